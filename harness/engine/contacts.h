/* Set-valued friction in loops. At v = 0, Coulomb friction takes any value up to static friction. A solution with v = 0
   exactly is therefore tried wherever a velocity is or passes 0: the unknown force is then the one for which the mass
   stops, and the contact gets the velocity 0. It holds if its output at v = 0 is one of the forces that it reads, which
   is the sum of the other forces on the mass, or if the force lies within the jump of its output at v = 0. Otherwise it
   breaks away, at the time at which the force exceeds the limit. Whether the output jumps is found by two steps to
   velocities beside 0; smooth models are left alone. */

#ifndef CONTACTS_H
#define CONTACTS_H

#include "quasi_newton.h"

#define BESIDE    1e-300 /* [m/s] or [rad/s] */
#define NO_JUMP   1e-150 /* [N] or [N.m]: a smooth output beside v = 0 differs by less from that at v = 0 */
#define EQUAL     1e-9   /* relative difference of equal forces */
#define STARTED   1e-6   /* the same at the start of a step */
#define SOONEST   1e-6   /* of a step: break-away before it is at its beginning */
#define STOPS     0.9999 /* of a step: a contact that stops after more of it stops at its end */
#define STOPS_NOT 0.5    /* of a step that forces cannot stop within twice its length */
#define UNEVEN    0.02   /* distance to a stop over the path: how much it may vary with the friction on the way */
#define FEW       0.05   /* of the way to a stop: that at velocities below the first of two points */
#define FAINT     1e-3   /* of the jump of a contact: a load that it holds */
#define HUGE_LOAD 1e12   /* of the same: a load that it does not hold */
#define MORE      1.001  /* of the friction at such a load: one that it does not hold either */
#define GAUSS     0.28867513459481287 /* distance of the points from the middle: root of 1/12 */
enum { MOST_CORRECTIONS = 12, MOST_CARRIED = 62 /* contacts that `carries` can tell; as in newton.py */ };

/* Return whether a contact at rest determines the forces of others on the same mass. */
static bool leads(const Moving *m) { return m->high > m->low && m->leader < 0; }

static bool is_still(const Moving *m) { return m->u0 == 0.0 || m->still; }

static Moving *velocity_of(const Newton *newton, const Contact *c) { return &newton->moving[c->line]; }

static bool carries(const Newton *newton, const Group *g, const Moving *m, const Contact *c)
{
    const int64_t number = c - contacts_of(newton, g);
    return m->unknown == c->unknown || (number < MOST_CARRIED && (m->carries >> number & 1));
}

/* Set the role of a contact: of its velocity, and of the lines that carry its force; one of several forces has the
   highest. */
static void assume(const Engine *e, Newton *newton, const Group *g, const Contact *c, int64_t velocity, int64_t force)
{
    const Contact *const first = contacts_of(newton, g), *const last = first + g->contacts;
    velocity_of(newton, c)->role = velocity;
    velocity_of(newton, c)->force = force;
    for (int64_t i = g->first; i < g->first + g->count; i++)
        for (int64_t k = e->lines_from[newton->order[i]]; k < e->lines_from[newton->order[i] + 1]; k++) {
            Moving *const m = &newton->moving[k];
            if (!carries(newton, g, m, c))
                continue;
            m->role = force;
            for (const Contact *d = first; d < last; d++)
                if (velocity_of(newton, d)->force > m->role && carries(newton, g, m, d))
                    m->role = velocity_of(newton, d)->force;
        }
}

/* Return whether the load of a contact at rest was its force at the start of the span, too: a mass that returns to
   v = 0 within the span has moved. */
static bool held_at_start(const Engine *e, const Newton *newton, const Contact *c)
{
    const double force = newton->w_last[c->unknown];
    bool lines = false;
    for (int64_t k = e->lines_from[c->part]; k < e->lines_from[c->part + 1]; k++)
        for (int64_t i = c->first_load; i < c->first_load + c->load_count; i++)
            if (e->lines[k].input == newton->loads[i]) {
                const double load = newton->moving[k].u0;
                if (fabs(load - force) <= STARTED * fmax(fabs(load), newton->scale[c->unknown]))
                    return true;
                lines = true;
            }
    return !lines;
}

/* Return whether two contacts read one velocity: they stop and break away together. */
static bool is_beside(const Engine *e, const Contact *c, const Contact *d)
{
    const int64_t a = e->lines[c->line].input, b = e->lines[d->line].input;
    return c == d || (e->sources[a] == e->sources[b] && (!e->gains || (e->offsets[a] == 0.0 && e->offsets[b] == 0.0)));
}

/* Return whether another contact holds the same mass. */
static bool is_shared(const Engine *e, const Newton *newton, const Group *g, const Contact *c)
{
    for (const Contact *d = contacts_of(newton, g); d < contacts_of(newton, g) + g->contacts; d++)
        if (d != c && velocity_of(newton, d)->rigid >= 0 && is_beside(e, c, d))
            return true;
    return false;
}

static void hold(const Engine *e, Newton *newton, const Group *g, const Contact *c)
{
    Moving *const m = velocity_of(newton, c);
    m->leader = -1;
    m->still = 0;
    m->low = m->high = 0.0;
    const bool held =
        is_shared(e, newton, g, c)
            ? m->rests != FREE
            : m->rests == AT_REST || (m->u0 == 0.0 && !m->rests && c->load_count > 0 && held_at_start(e, newton, c));
    assume(e, newton, g, c, AT_REST, held ? HOLDING : m->rests == IN_JUMP ? FREE : CHANGING);
}

/* Let a contact move, and those beside it. */
static void let_go(const Engine *e, Newton *newton, const Group *g, const Contact *c, bool changes)
{
    for (const Contact *d = contacts_of(newton, g); d < contacts_of(newton, g) + g->contacts; d++)
        if (is_beside(e, c, d))
            assume(e, newton, g, d, FREE, changes || velocity_of(newton, d)->rests ? CHANGING : FREE);
}

/* Give the source of the velocity of a contact at rest the value 0. */
static void stop_source(const Engine *e, const Line *l)
{
    if (!e->gains || e->offsets[l->input] == 0.0)
        e->signals[e->sources[l->input]] = 0.0;
}

/* Give the signals the values of the solution: velocities of contacts at rest, and holding forces within a jump. */
static void set_at_rest(const Engine *e, Newton *newton, const Group *g)
{
    bool rests = false;
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++) {
        const Moving *const m = velocity_of(newton, c);
        if (!is_rest(m))
            continue;
        rests = true;
        stop_source(e, &e->lines[c->line]);
        if (m->role == IN_JUMP)
            e->signals[newton->unknowns[c->unknown]] = newton->w[c->unknown];
    }
    for (int64_t j = g->unknown; newton->jumped && !rests && j < g->unknown + g->unknowns; j++)
        e->signals[newton->unknowns[j]] = newton->w[j];
}

/* Compute the outputs of a loop or a part for the present inputs, those from outside at this part of the step; again
   while an unknown changes, as a part may be stepped before one that its outputs depend on. */
static int refresh(Engine *e, Newton *newton, const Group *g, double t, double at)
{
    bool changed = true;
    for (int64_t sweep = 0; changed && sweep < g->count; sweep++) {
        for (int64_t j = g->unknown; j < g->unknown + g->unknowns; j++)
            newton->r[j] = e->signals[newton->unknowns[j]];
        for (int64_t i = g->first; i < g->first + g->count; i++) {
            EnginePart *const p = &e->parts[newton->order[i]];
            fetch_inputs(e, p);
            for (int64_t k = e->lines_from[newton->order[i]]; at < 1.0 && k < e->lines_from[newton->order[i] + 1]; k++)
                if (!newton->moving[k].inner)
                    e->signals[e->lines[k].input] = value_at(&newton->moving[k], arriving(e, e->lines[k].input), at);
            int operation = SET, status = hand_over(p, e->signals);
            if (status <= 1) {
                operation = GET;
                status = fetch_outputs(p, e->signals);
            }
            if (status > 1) {
                failed(e, newton->order[i], operation, status, t);
                return status;
            }
            set_at_rest(e, newton, g); /* before a contact at rest reads its velocity */
        }
        changed = false;
        for (int64_t j = g->unknown; j < g->unknown + g->unknowns; j++)
            changed = changed || e->signals[newton->unknowns[j]] != newton->r[j];
    }
    return SOLVED;
}

/* Let sums of forces follow contacts at rest, whose forces at the end of a span are those that their outputs tell. */
static int follow_rest(Engine *e, Newton *newton, const Group *g, const Span *s)
{
    for (int64_t i = g->first; i < g->first + g->count; i++)
        for (int64_t k = e->lines_from[newton->order[i]]; k < e->lines_from[newton->order[i] + 1]; k++)
            if (newton->moving[k].carries && newton->moving[k].role >= HOLDING)
                return refresh(e, newton, g, s->t, s->to);
    return SOLVED;
}

/* Step a contact once more, to this velocity, and read its force. */
static int face(Engine *e, const Newton *newton, const Contact *c, const Span *s, double v, double *force)
{
    Line *const l = &e->lines[c->line];
    int operation = RESTORE, status = restore_part(&e->parts[c->part]);
    if (status <= 1) {
        operation = STEP;
        l->end = v;
        status = step_on_lines(e, c->part, s->t, s->h);
    }
    if (status <= 1)
        status = hand_over(&e->parts[c->part], e->signals);
    if (status <= 1)
        status = fetch_outputs(&e->parts[c->part], e->signals);
    *force = e->signals[newton->unknowns[c->unknown]];
    if (status <= 1)
        return SOLVED;
    failed(e, c->part, operation, status, s->t);
    return status;
}

/* Return whether the force of a contact at v = 0 is this one if it is given as the load; *force: what it is. */
static bool answers(Engine *e, const Newton *newton, const Contact *c, const Span *s, int64_t load, double value,
                    double *force, int *status)
{
    e->signals[load] = value;
    for (int64_t k = e->lines_from[c->part]; k < e->lines_from[c->part + 1]; k++)
        if (e->lines[k].input == load)
            e->lines[k].mean = e->lines[k].end = value;
    *status = *status == SOLVED ? face(e, newton, c, s, 0.0, force) : *status;
    return *status == SOLVED && fabs(*force - value) <= EQUAL * fabs(value);
}

/* Find the forces between which a contact holds: those within its jump, and, unless it stops in this span, static
   friction, which equals the load. */
static int find_range(Engine *e, Newton *newton, const Group *g, const Contact *c, const Span *s)
{
    Moving *const m = velocity_of(newton, c);
    double ends[2] = {0.0, 0.0}, rest = 0.0;
    int status = face(e, newton, c, s, BESIDE, &ends[0]);
    if (status == SOLVED)
        status = face(e, newton, c, s, -BESIDE, &ends[1]);
    if (status == SOLVED)
        status = face(e, newton, c, s, 0.0, &rest);
    const double size = fmax(fmax(fabs(ends[0]), fabs(ends[1])), fabs(rest));
    if (fmax(fmax(ends[0], ends[1]), rest) - fmin(fmin(ends[0], ends[1]), rest) > fmax(NO_JUMP, EQUAL * size))
        m->rigid = 1;
    else if (size > NO_JUMP)
        m->rigid = -1;
    for (int64_t k = c->first_load; k < c->first_load + c->load_count && is_still(m) && m->rigid > 0; k++) {
        const int64_t load = newton->loads[k]; /* or a normal force */
        if (!answers(e, newton, c, s, load, FAINT * size, &rest, &status) ||
            !answers(e, newton, c, s, load, -FAINT * size, &rest, &status))
            continue;
        for (int i = 0; i < 2; i++) {
            double good = (i ? -FAINT : FAINT) * size, bad = good / FAINT * HUGE_LOAD;
            const bool all = answers(e, newton, c, s, load, bad, &rest, &status);
            if (all || answers(e, newton, c, s, load, rest, &rest, &status))
                good = fabs(rest) > fabs(good) ? rest : good;
            bool more = !all && answers(e, newton, c, s, load, good * MORE, &rest, &status);
            for (int tries = 0; more && tries < MOST_BISECTIONS && fabs(bad) > (1.0 + 1e-14) * fabs(good); tries++) {
                const double middle = copysign(sqrt(good * bad), good);
                *(answers(e, newton, c, s, load, middle, &rest, &status) ? &good : &bad) = middle;
            }
            ends[i] = i ? fmin(ends[i], good) : fmax(ends[i], good);
        }
    }
    m->low = fmin(ends[0], ends[1]);
    m->high = fmax(ends[0], ends[1]);
    for (int64_t i = g->first; i < g->first + g->count; i++) /* a force that was 0 so far has no magnitude */
        for (int64_t k = e->lines_from[newton->order[i]]; k < e->lines_from[newton->order[i] + 1]; k++)
            if (newton->moving[k].unknown >= 0 && carries(newton, g, &newton->moving[k], c))
                newton->scale[newton->moving[k].unknown] = fmax(newton->scale[newton->moving[k].unknown], size);
    return status;
}

static double width(const Newton *newton, const Contact *c)
{
    return velocity_of(newton, c)->high - velocity_of(newton, c)->low;
}

/* Divide the force that holds a mass between contacts beside one another, in the ratio of what each holds at most: at
   rest, any other division is as good. */
static int divide(Engine *e, Newton *newton, const Group *g, const Span *s, bool *divided)
{
    const Contact *const first = contacts_of(newton, g), *const last = first + g->contacts;
    for (const Contact *c = first; c < last; c++) {
        Moving *const m = velocity_of(newton, c);
        if (!is_rest(m) || !is_shared(e, newton, g, c))
            continue;
        const int status = find_range(e, newton, g, c, s);
        if (status != SOLVED)
            return status;
        *divided = true;
        if (m->rigid <= 0)
            assume(e, newton, g, c, FREE, m->rests ? CHANGING : FREE);
    }
    for (const Contact *c = first; c < last && *divided; c++) {
        Moving *const m = velocity_of(newton, c);
        const Contact *leader = NULL; /* the one that holds most */
        int64_t count = 0;
        m->leader = -1;
        for (const Contact *d = first; d < last; d++)
            if (is_rest(m) && is_rest(velocity_of(newton, d)) && is_beside(e, c, d)) {
                leader = !leader || width(newton, d) > width(newton, leader) ? d : leader;
                count++;
            }
        if (!leader || count == 1 || width(newton, leader) == 0.0)
            m->low = m->high = 0.0;
        else if (leader != c) {
            const Moving *const one = velocity_of(newton, leader);
            const int64_t a = e->lines[c->line].input, b = e->lines[leader->line].input;
            const bool opposite = e->gains && e->gains[a] * e->gains[b] < 0.0;
            m->leader = leader->unknown;
            m->slope = (opposite ? -1.0 : 1.0) * width(newton, c) / width(newton, leader);
            m->base = (opposite ? m->high : m->low) - m->slope * one->low;
        }
    }
    return SOLVED;
}

/* Return the largest magnitude of the force of a contact. */
static double strength_of(const Newton *newton, const Group *g)
{
    double most = 0.0;
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++)
        most = fmax(most, fmax(newton->scale[c->unknown], fabs(newton->w[c->unknown])));
    return most;
}

/* Correct w by Newton's method. Return the largest correction over the magnitudes; a value that was always 0 has none.
 */
static double correct(Newton *newton, const Group *g, const double *inverse)
{
    const int64_t n = g->unknowns;
    const double strength = strength_of(newton, g);
    double *const step = newton->work, *const scale = step + n, *const w = newton->w + g->unknown, most = 0.0;
    memcpy(scale, newton->scale + g->unknown, (size_t)n * sizeof(double));
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++)
        scale[c->unknown - g->unknown] = strength;
    for (int64_t i = 0; i < n; i++) {
        step[i] = 0.0;
        for (int64_t j = 0; j < n; j++)
            step[i] -= inverse[i * n + j] * newton->r[g->unknown + j];
    }
    for (int64_t i = 0; i < n; i++) {
        w[i] += step[i];
        const double size = fmax(scale[i], scale[i] > 0.0 ? fabs(w[i]) : 0.0);
        const double moved = size > 0.0 ? fabs(step[i]) / size : 0.0;
        most = moved <= most ? most : isnan(moved) ? INFINITY : moved;
    }
    return most;
}

/* Solve for the forces with which the contacts at rest stay at v = 0. */
static int solve_at_rest(Engine *e, Newton *newton, const Group *g, const Span *s, bool again)
{
    const int64_t n = g->unknowns, most = newton->most_unknowns;
    double *const r = newton->r + g->unknown, *const r0 = newton->work + 2 * most;
    double *const inverse = newton->work + 6 * most + most * most, norm = 0.0;
    for (int64_t j = g->unknown; j < g->unknown + n; j++)
        newton->w[j] = newton->w_last[j] + newton->trend[j] * s->h;
    bool divided = false;
    int status = evaluate(e, newton, g, s, again, &norm);
    if (status == SOLVED)
        status = divide(e, newton, g, s, &divided);
    bool rests = !divided;
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++)
        rests = rests || is_rest(velocity_of(newton, c));
    if (status == SOLVED && !rests)
        return SOLVED;
    if (status == SOLVED && divided)
        status = evaluate(e, newton, g, s, true, &norm);
    for (int tries = 0; status == SOLVED && tries < MOST_CORRECTIONS; tries++) {
        if (tries % 3 == 0) {
            memcpy(r0, r, (size_t)n * sizeof(double));
            status = differentiate(e, newton, g, s, r0, inverse);
            if (status != SOLVED)
                return status;
            memcpy(r, r0, (size_t)n * sizeof(double));
        }
        const double moved = correct(newton, g, inverse);
        status = isfinite(moved) ? evaluate(e, newton, g, s, true, &norm) : NOT_CONVERGED;
        if (status == SOLVED && (moved <= 1e-12 || (tries > 1 && moved <= newton->tolerance)))
            return SOLVED;
    }
    return status == SOLVED ? NOT_CONVERGED : status;
}

/* Find out whether a contact at rest holds. If not, *limit is the force at which it breaks away. If it stops within a
   span that may be divided, *share is the part of the span until then: mean friction, at the points of Gauss, and the
   load decelerate it. It does not stop if these cannot; a span without this solution is then shorter. */
static int test(Engine *e, Newton *newton, const Group *g, const Contact *c, const Span *s, bool *holds, double *limit,
                double *share)
{
    Moving *const m = velocity_of(newton, c);
    const double force = newton->w[c->unknown], rest = e->signals[newton->unknowns[c->unknown]];
    /* a normal force is a force, too: friction at rest tells which is the load, or, if it is to stay at rest, the force
     */
    const double sought = m->rests || m->u0 == 0.0 ? force : rest;
    double load = INFINITY, up = 0.0, down = 0.0, again = 0.0;
    for (int64_t k = c->first_load; k < c->first_load + c->load_count; k++) {
        const double value = e->signals[newton->loads[k]];
        if (fabs(value - sought) < fabs(load - sought))
            load = value;
    }
    const bool by_load = !leads(m) && isfinite(load) && (m->u0 != 0.0 || held_at_start(e, newton, c)) &&
                         fabs(rest - load) <= EQUAL * fmax(fabs(rest), fabs(load));
    *limit = rest;
    if (leads(m) && is_still(m)) {
        const double slack = EQUAL * (m->high - m->low);
        m->role = IN_JUMP;
        *holds = force >= m->low - slack && force <= m->high + slack;
        *limit = force > m->high ? m->high : m->low;
        return SOLVED;
    }
    if (m->rigid > 0 && by_load && (m->rests || m->u0 == 0.0)) {
        m->role = AT_REST;
        *holds = true;
        return SOLVED;
    }
    int status = face(e, newton, c, s, BESIDE, &up);
    if (status == SOLVED)
        status = face(e, newton, c, s, -BESIDE, &down);
    double friction[] = {0.0, 0.0};
    const bool stopping = !m->rests && m->u0 != 0.0;
    for (int i = 0; i < 2 && stopping && status == SOLVED; i++)
        status = face(e, newton, c, s, (i ? 0.5 + GAUSS : 0.5 - GAUSS) * m->u0, &friction[i]);
    if (status == SOLVED)
        status = face(e, newton, c, s, 0.0, &again);
    const double low = fmin(fmin(up, down), rest), high = fmax(fmax(up, down), rest),
                 size = fmax(fabs(low), fabs(high));
    if (high - low > fmax(NO_JUMP, EQUAL * size))
        m->rigid = 1;
    else if (size > NO_JUMP)
        m->rigid = -1;
    const bool in_jump = force >= fmin(up, down) && force <= fmax(up, down);
    /* a contact in motion stops only if no more than its friction, at v = 0 or on the way there, is needed for that */
    const double slack = (1.0 - STOPS) * size, mean = 0.5 * (friction[0] + friction[1]);
    const bool stops =
        m->rests || m->u0 == 0.0 || (m->u0 > 0.0 ? force <= fmax(up, mean) + slack : force >= fmin(down, mean) - slack);
    m->role = by_load ? AT_REST : IN_JUMP;
    *holds = m->rigid > 0 && stops && (by_load || in_jump);
    /* in a divided step, a contact that goes on in the other direction is located, too */
    if (stopping && (*holds || (m->rigid > 0 && (s->to - s->from < 1.0 || leads(m))))) {
        double other = isfinite(load) ? load : rest;
        for (int64_t k = e->lines_from[c->part]; k < e->lines_from[c->part + 1]; k++)
            if (e->lines[k].end == load)
                other = e->lines[k].mean;
        /* the load of one of several contacts is not known: it is the friction with which the mass would not slow down
         */
        const double *const inverse =
            newton->work + 6 * newton->most_unknowns + newton->most_unknowns * newton->most_unknowns;
        if (leads(m))
            other = force + m->u0 * inverse[(c->unknown - g->unknown) * (g->unknowns + 1)];
        const double at = (force - other) / (mean - other);
        *holds = *holds || (leads(m) && fabs(at - 1.0) <= 1.0 - STOPS);
        /* two points tell the distance to the stop if friction varies little on the way */
        const double spread =
            fmax(fabs(friction[0] - friction[1]), FEW * fabs((m->u0 > 0.0 ? up : down) - friction[0]));
        const double way = 0.5 * fabs(m->u0) * at * s->h;
        if (*holds && (at < -SOONEST || at > 1.0 / STOPS_NOT))
            *share = fmin(*share, STOPS_NOT);
        else if (*holds && at > SOONEST && way * spread > UNEVEN * (m->path + way) * fabs(mean - other))
            *share = fmin(*share, 0.5 * fmin(at, 1.0));
        else if (at > SOONEST && at < STOPS)
            *share = fmin(*share, at);
    }
    if (!by_load && m->rests == IN_JUMP)
        *limit = force > 0.0 ? high : low;
    return status;
}

/* Solve a step with contacts at rest. *rests: a contact is held; else the step must be solved without any. */
static int solve_held(Engine *e, Newton *newton, const Group *g, const Span *s, bool again, bool *rests)
{
    const Contact *const first = contacts_of(newton, g), *const last = first + g->contacts;
    for (int64_t tries = 0; tries <= 2 * g->contacts; tries++, again = true) {
        int status = solve_at_rest(e, newton, g, s, again);
        bool changed = false, held = false, changes = false;
        *rests = false;
        newton->turns = false;
        if (status == NOT_CONVERGED) { /* it may be another contact that stops */
            for (const Contact *c = first; c < last && tries == 0; c++)
                if (!is_rest(velocity_of(newton, c)) && velocity_of(newton, c)->rigid >= 0) {
                    hold(e, newton, g, c);
                    changed = true;
                }
            if (changed)
                continue;
            break;
        }
        double share = 1.0;
        for (const Contact *c = first; c < last && status == SOLVED; c++) {
            Moving *const m = velocity_of(newton, c);
            const double start = newton->w_last[c->unknown], end = newton->w[c->unknown];
            double limit = 0.0;
            bool holds = false;
            if (!is_rest(m)) {
                const double v = m->u1;
                if (m->rigid >= 0 && m->u0 * v < 0.0 && tries < g->contacts) {
                    hold(e, newton, g, c);
                    changed = true;
                }
                continue;
            }
            if (m->leader >= 0)
                continue;
            double stop = 1.0;
            status = test(e, newton, g, c, s, &holds, &limit, &stop);
            share = fmin(share, stop);
            held = held || holds;
            changes = changes || !m->rests || m->role == IN_JUMP;
            for (const Contact *d = first; d < last; d++)
                if (velocity_of(newton, d)->leader == c->unknown && is_rest(velocity_of(newton, d)))
                    velocity_of(newton, d)->role = m->role;
            if (status != SOLVED || holds)
                continue;
            if (m->rests) {
                const double at = (limit - start) / (end - start);
                share = fmin(share, at > 0.0 && at < 1.0 ? at : 0.5);
                if (at <= SOONEST && at > -SOONEST)
                    share = 0.0;
            }
            const bool turns = !m->rests && stop * (s->to - s->from) <= SOONEST; /* and moves the other way */
            if (turns && leads(m) && !m->still) {                                /* unless static friction holds it */
                for (const Contact *d = first; d < last; d++)
                    if (is_beside(e, c, d))
                        velocity_of(newton, d)->still = 1;
                changed = held = true;
                continue;
            }
            let_go(e, newton, g, c, turns);
            newton->turns = newton->turns || turns;
            changed = true;
        }
        if (status != SOLVED)
            return status;
        if (newton->splits && share < 1.0 &&
            share * (s->to - s->from) > SOONEST) { /* at a stop, or where one breaks away */
            newton->share = share;
            return BREAKS_AWAY;
        }
        if (!changed) {
            *rests = held;
            newton->jumped = changes;
            set_at_rest(e, newton, g);
            return SOLVED;
        }
        if (!held)
            break;
    }
    for (const Contact *c = first; c < last; c++)
        if (is_rest(velocity_of(newton, c)))
            let_go(e, newton, g, c, false);
    return SOLVED;
}

/* Hold contacts that pass v = 0, or, if `any`, may: all, or the one with the number `only`. Return whether one is. */
static bool hold_some(const Engine *e, Newton *newton, const Group *g, int64_t only, bool any)
{
    bool held = false;
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++) {
        const Moving *const m = velocity_of(newton, c);
        const bool slows = m->u0 * m->u1 <= (1.0 - STOPS) * m->u0 * m->u0;
        if (m->rigid >= 0 && (slows || any) && (only < 0 || is_beside(e, c, contacts_of(newton, g) + only))) {
            hold(e, newton, g, c);
            held = true;
        } else if (only >= 0)
            let_go(e, newton, g, c, false);
    }
    return held;
}

/* Solve a step: with the contacts at rest that may be, else in motion; and again with those at rest that pass v = 0. If
   they do not stop together, one alone may: forces that stop both in a step can be far from those that stop one. */
static int solve(Engine *e, Newton *newton, const Group *g, int64_t number, const Span *s, bool again)
{
    const Contact *const first = contacts_of(newton, g), *const last = first + g->contacts;
    bool tried = false, rests = false, smooth = true;
    for (const Contact *c = first; c < last; c++)
        smooth = smooth && velocity_of(newton, c)->rigid < 0;
    if (smooth)
        return iterate(e, newton, g, number, s, again);
    newton->jumped = false;
    for (const Contact *c = first; c < last; c++) {
        const Moving *const m = velocity_of(newton, c);
        if (m->rigid >= 0 && m->u0 == 0.0) {
            hold(e, newton, g, c);
            tried = true;
        } else
            assume(e, newton, g, c, FREE, FREE);
    }
    int status = tried ? solve_held(e, newton, g, s, again, &rests) : SOLVED;
    if (status != SOLVED || rests)
        return status;
    status = iterate(e, newton, g, number, s, again || tried);
    if (status != NOT_CONVERGED && (tried || status != SOLVED))
        return status;
    const bool jumped = newton->jumped, any = jumped || status == NOT_CONVERGED;
    if (!tried && !hold_some(e, newton, g, -1, any))
        return status;
    const int solved = status;
    double *const w = newton->work + 6 * newton->most_unknowns + 2 * newton->most_unknowns * newton->most_unknowns;
    memcpy(w, newton->w + g->unknown, (size_t)g->unknowns * sizeof(double));
    status = tried ? SOLVED : solve_held(e, newton, g, s, true, &rests);
    for (int64_t i = 0; any && g->contacts > 1 && status == SOLVED && !rests && i < g->contacts; i++)
        if (hold_some(e, newton, g, i, any))
            status = solve_held(e, newton, g, s, true, &rests);
    if (status != SOLVED || rests)
        return status;
    if (newton->turns && iterate(e, newton, g, number, s, true) == SOLVED)
        return SOLVED;
    for (const Contact *c = first; c < last; c++)
        let_go(e, newton, g, c, false);
    if (solved != SOLVED)
        return solved;
    double norm = 0.0;
    memcpy(newton->w + g->unknown, w, (size_t)g->unknowns * sizeof(double));
    status = evaluate(e, newton, g, s, true, &norm);
    newton->jumped = jumped;
    set_at_rest(e, newton, g);
    return status;
}

#endif
