/* Set-valued friction in loops. At v = 0, Coulomb friction takes any value up to static friction. A solution with v = 0
   exactly is therefore tried wherever a velocity is or passes 0: the unknown force is then the one for which the mass
   stops, and the contact gets the velocity 0. It holds if its output at v = 0 is one of the forces that it reads, which
   is the sum of the other forces on the mass, or if the force lies within the jump of its output at v = 0. Otherwise it
   breaks away, at the time at which the force exceeds the limit. Whether the output jumps is found by two steps to
   velocities beside 0; smooth models are left alone. */

#ifndef CONTACTS_H
#define CONTACTS_H

#include "contact.h"

#define SOONEST   1e-6   /* of a step: break-away before it is at its beginning */
#define STOPS     0.9999 /* of a step: a contact that stops after more of it stops at its end */
#define STOPS_NOT 0.5    /* of a step that forces cannot stop within twice its length */
#define UNEVEN    0.02   /* distance to a stop over the path: how much it may vary with the friction on the way */
#define PARTIAL   0.01   /* of its force: by how much a contact at rest differs from a load that is not the whole one */
#define UNLIKE    1e-5   /* of its jump: the same, if more than half of the force is missing in the load; */
#define AHEAD     1e-3   /* otherwise, as the mean of a load that begins within the span is behind or ahead of it */
#define FEW       0.05   /* of the way to a stop: that at velocities below the first of two points */
#define GAUSS     0.28867513459481287 /* distance of the points from the middle: root of 1/12 */
enum { MOST_CORRECTIONS = 12 };

/* Let a contact be at rest. Its force varies over the span if it was before; in a span in which it stops, it does not.
 */
static void hold(const Engine *e, Newton *newton, const Group *g, const Contact *c, const Span *s)
{
    Moving *const m = velocity_of(newton, c);
    m->leader = -1;
    m->still = 0;
    m->low = m->high = 0.0;
    const bool begins = m->u0 == 0.0 && !m->rests && c->load_count > 0;
    const bool alone = m->rests == AT_REST || (begins && held_at_start(e, newton, c, s));
    const bool held = is_shared(e, newton, g, c) ? m->rests != FREE : alone;
    assume(newton, g, c, AT_REST, held ? HOLDING : m->rests == IN_JUMP ? FREE : CHANGING);
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
            int status = outcome(e, newton->order[i], SET, hand_over(p, e->signals), t);
            if (status == SOLVED)
                status = outcome(e, newton->order[i], GET, fetch_outputs(p, e->signals), t);
            if (status != SOLVED)
                return status;
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
    for (int64_t i = g->line; i < g->line + g->lines; i++)
        if (newton->moving[newton->lines[i]].carries && newton->moving[newton->lines[i]].role >= HOLDING)
            return refresh(e, newton, g, s->t, s->to);
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
    newton_step(step, inverse, newton->r + g->unknown, n);
    for (int64_t i = 0; i < n; i++) {
        w[i] += step[i];
        const double size = fmax(scale[i], scale[i] > 0.0 ? fabs(w[i]) : 0.0);
        most = worse(most, size > 0.0 ? fabs(step[i]) / size : 0.0);
    }
    return most;
}

/* Return the inverse Jacobian of the equations of contacts at rest. */
static double *inverse_at_rest(const Newton *newton)
{
    return newton->work + 6 * newton->most_unknowns + newton->most_unknowns * newton->most_unknowns;
}

/* Solve for the forces with which the contacts at rest stay at v = 0. */
static int solve_at_rest(Engine *e, Newton *newton, const Group *g, const Span *s, bool again)
{
    const int64_t n = g->unknowns;
    double *const r = newton->r + g->unknown, *const r0 = newton->work + 2 * newton->most_unknowns;
    double *const inverse = inverse_at_rest(newton), norm = 0.0;
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

/* Return an input of a contact at the end of the span; its signal is that at the end of the step if it comes from
   outside the loop. */
static double load_at_end(const Engine *e, const Newton *newton, const Contact *c, int64_t input)
{
    for (int64_t k = e->lines_from[c->part]; k < e->lines_from[c->part + 1]; k++)
        if (e->lines[k].input == input && !newton->moving[k].inner)
            return e->lines[k].end;
    return e->signals[input];
}

/* Return the input of a contact that is closest to this force: friction at rest tells which one is the load, as a
   normal force is a force, too. INFINITY if it has none. */
static double load_near(const Engine *e, const Newton *newton, const Contact *c, double force)
{
    double load = INFINITY;
    for (int64_t k = c->first_load; k < c->first_load + c->load_count; k++) {
        const double value = load_at_end(e, newton, c, newton->loads[k]);
        if (fabs(value - force) < fabs(load - force))
            load = value;
    }
    return load;
}

/* What is known of a contact that is held in a solution. */
typedef struct {
    bool holds;
    double limit, share;     /* the force at which it breaks away; the part of the span after which it stops */
    double load;             /* at the end of the span; INFINITY if it is not an input */
    double rest, up, down;   /* friction at v = 0 and beside it */
    double slow, fast, mean; /* friction at the points of Gauss on the way to a stop */
} Trial;

/* Set the part of the span after which mean friction and the load stop a contact in motion. If they cannot, or if two
   points are too few for the distance on the way, as on a steep Stribeck curve, a shorter span is solved first. */
static void locate_stop(const Engine *e, const Newton *newton, const Group *g, const Contact *c, const Span *s,
                        Trial *trial)
{
    const Moving *const m = velocity_of(newton, c);
    const double force = newton->w[c->unknown];
    double load = isfinite(trial->load) ? trial->load : trial->rest; /* its mean */
    for (int64_t k = e->lines_from[c->part]; k < e->lines_from[c->part + 1]; k++)
        if (e->lines[k].end == trial->load)
            load = e->lines[k].mean;
    if (leads(m)) /* it is unknown, but equal to the friction with which the mass would not slow down */
        load = force + m->u0 * inverse_at_rest(newton)[(c->unknown - g->unknown) * (g->unknowns + 1)];
    const double net = trial->mean - load, at = (force - load) / net;
    trial->holds = trial->holds || (leads(m) && fabs(at - 1.0) <= 1.0 - STOPS);
    const double last = m->u0 > 0.0 ? trial->up : trial->down, way = 0.5 * fabs(m->u0) * at * s->h;
    const double varies = fmax(fabs(trial->slow - trial->fast), FEW * fabs(last - trial->slow));
    const bool uneven = way * varies > UNEVEN * (m->path + way) * fabs(net);
    if (trial->holds && (at < -SOONEST || at > 1.0 / STOPS_NOT))
        trial->share = STOPS_NOT;
    else if (trial->holds && at > SOONEST && uneven)
        trial->share = 0.5 * fmin(at, 1.0);
    else if (at > SOONEST && at < STOPS)
        trial->share = at;
}

/* Return whether the force that keeps a contact at rest differs from a load. */
static bool differs(const Newton *newton, const Contact *c, double load)
{
    const double force = newton->w[c->unknown];
    return fabs(force - load) > PARTIAL * fmax(fabs(force), newton->scale[c->unknown]);
}

/* Find out whether a contact at rest holds and, if it stops within the span, when. */
static int test(Engine *e, Newton *newton, const Group *g, const Contact *c, const Span *s, Trial *trial)
{
    Moving *const m = velocity_of(newton, c);
    const double force = newton->w[c->unknown], rest = e->signals[newton->unknowns[c->unknown]];
    const bool stopping = !m->rests && m->u0 != 0.0;
    *trial =
        (Trial){.rest = rest, .limit = rest, .share = 1.0, .load = load_near(e, newton, c, stopping ? rest : force)};
    if (leads(m) && is_still(m)) {
        const double slack = EQUAL * (m->high - m->low);
        m->role = IN_JUMP;
        trial->holds = force >= m->low - slack && force <= m->high + slack;
        trial->limit = force > m->high ? m->high : m->low;
        return SOLVED;
    }
    const double load = trial->load;
    const bool equal = isfinite(load) && fabs(rest - load) <= EQUAL * fmax(fabs(rest), fabs(load));
    const bool by_load = equal && !leads(m) && (m->u0 != 0.0 || held_at_start(e, newton, c, s));
    m->role = by_load ? AT_REST : IN_JUMP;
    const bool stays = by_load ? m->force == HOLDING : m->rests == IN_JUMP && !stopping && !leads(m);
    if (m->rigid > 0 && by_load && !stopping && !(stays && differs(newton, c, load))) {
        trial->holds = true;
        return SOLVED;
    }
    int status = SOLVED;
    trial->up = face(e, newton, c, s, BESIDE, &status);
    trial->down = face(e, newton, c, s, -BESIDE, &status);
    trial->slow = stopping ? face(e, newton, c, s, (0.5 - GAUSS) * m->u0, &status) : 0.0;
    trial->fast = stopping ? face(e, newton, c, s, (0.5 + GAUSS) * m->u0, &status) : 0.0;
    face(e, newton, c, s, 0.0, &status); /* which remains the output */
    if (status != SOLVED)
        return status;
    const double least = fmin(trial->up, trial->down), most = fmax(trial->up, trial->down);
    const double low = fmin(least, rest), high = fmax(most, rest);
    classify(m, low, high);
    /* a contact in motion stops only if no more than its friction, at v = 0 or on the way there, is needed for that */
    const double slack = (1.0 - STOPS) * fmax(fabs(low), fabs(high));
    trial->mean = 0.5 * (trial->slow + trial->fast);
    const bool enough =
        m->u0 > 0.0 ? force <= fmax(trial->up, trial->mean) + slack : force >= fmin(trial->down, trial->mean) - slack;
    trial->holds = m->rigid > 0 && (!stopping || enough) && (by_load || (force >= least && force <= most));
    const double slight = (fabs(load) < 0.5 * fabs(force) ? UNLIKE : AHEAD) * (high - low);
    if (trial->holds && stays && differs(newton, c, load) && fabs(force - load) > slight)
        m->partial = 1;
    /* in a divided step, a contact that goes on in the other direction is located, too */
    const bool passes = m->rigid > 0 && (s->to - s->from < 1.0 || leads(m));
    if (stopping && (trial->holds || passes))
        locate_stop(e, newton, g, c, s, trial);
    if (!by_load && m->rests == IN_JUMP)
        trial->limit = force > 0.0 ? high : low;
    return SOLVED;
}

/* Result of an attempt to hold contacts. */
typedef struct {
    bool changed;       /* another contact is held, or one less: the forces must be solved for again */
    bool held, changes; /* a contact holds; one stops, or is held within its jump */
    double share;       /* of the span, until the first of them stops or breaks away */
} Attempt;

/* Keep a contact at rest if it holds, else let it go. */
static int keep_or_release(Engine *e, Newton *newton, const Group *g, const Contact *c, const Span *s, Attempt *attempt)
{
    Moving *const m = velocity_of(newton, c);
    const double start = newton->w_last[c->unknown], end = newton->w[c->unknown];
    const int64_t partial = m->partial;
    Trial trial;
    const int status = test(e, newton, g, c, s, &trial);
    attempt->share = fmin(attempt->share, trial.share);
    attempt->held = attempt->held || trial.holds;
    attempt->changes = attempt->changes || !m->rests || m->role == IN_JUMP;
    lead(newton, g, c);
    attempt->changed = attempt->changed || m->partial > partial;
    if (status != SOLVED || trial.holds)
        return status;
    attempt->changed = true;
    if (m->rests) {
        const double at = (trial.limit - start) / (end - start);
        attempt->share = fmin(attempt->share, at > 0.0 && at < 1.0 ? at : 0.5);
        if (at <= SOONEST && at > -SOONEST)
            attempt->share = 0.0;
    }
    const bool turns = !m->rests && trial.share * (s->to - s->from) <= SOONEST; /* and moves the other way, */
    if (turns && leads(m) && !m->still) {                                       /* unless static friction holds it */
        hold_still(e, newton, g, c);
        attempt->held = true;
        return SOLVED;
    }
    let_go(e, newton, g, c, turns);
    newton->turns = newton->turns || turns;
    return SOLVED;
}

/* Solve a step with contacts at rest. *rests: a contact is held; else the step must be solved without any. */
static int solve_held(Engine *e, Newton *newton, const Group *g, const Span *s, bool again, bool *rests)
{
    const Contact *const first = contacts_of(newton, g), *const last = first + g->contacts;
    *rests = false;
    for (int64_t tries = 0; tries <= 2 * g->contacts; tries++, again = true) {
        int status = solve_at_rest(e, newton, g, s, again);
        newton->turns = false;
        Attempt attempt = {.share = 1.0};
        if (status == NOT_CONVERGED) { /* it may be another contact that stops */
            for (const Contact *c = first; c < last && tries == 0; c++)
                if (!is_rest(velocity_of(newton, c)) && velocity_of(newton, c)->rigid >= 0) {
                    hold(e, newton, g, c, s);
                    attempt.changed = true;
                }
            if (attempt.changed)
                continue;
            break;
        }
        for (const Contact *c = first; c < last && status == SOLVED; c++) {
            const Moving *const m = velocity_of(newton, c);
            const bool passes = m->rigid >= 0 && m->u0 * m->u1 < 0.0;
            if (is_rest(m) && m->leader < 0)
                status = keep_or_release(e, newton, g, c, s, &attempt);
            else if (!is_rest(m) && passes && tries < g->contacts) {
                hold(e, newton, g, c, s);
                attempt.changed = true;
            }
        }
        if (status != SOLVED)
            return status;
        const bool within = attempt.share < 1.0 && attempt.share * (s->to - s->from) > SOONEST;
        if (newton->splits && within) {
            newton->share = attempt.share;
            return BREAKS_AWAY;
        }
        if (!attempt.changed) {
            *rests = attempt.held;
            newton->jumped = attempt.changes;
            set_at_rest(e, newton, g);
            return SOLVED;
        }
        if (!attempt.held)
            break;
    }
    for (const Contact *c = first; c < last; c++)
        if (is_rest(velocity_of(newton, c)))
            let_go(e, newton, g, c, false);
    return SOLVED;
}

/* Hold contacts that pass v = 0, or, if `any`, may: all, or the one with the number `only`. Return whether one is. */
static bool hold_some(const Engine *e, Newton *newton, const Group *g, const Span *s, int64_t only, bool any)
{
    bool held = false;
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++) {
        const Moving *const m = velocity_of(newton, c);
        const bool slows = m->u0 * m->u1 <= (1.0 - STOPS) * m->u0 * m->u0;
        const bool may = m->rigid >= 0 && !m->leaves && (slows || any);
        if (may && (only < 0 || is_beside(e, c, contacts_of(newton, g) + only))) {
            hold(e, newton, g, c, s);
            held = true;
        } else if (only >= 0)
            let_go(e, newton, g, c, false);
    }
    return held;
}

/* Hold the contacts that begin the span with v = 0 and let the others move. Return whether one is held. */
static bool hold_resting(const Engine *e, Newton *newton, const Group *g, const Span *s)
{
    bool held = false;
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++) {
        const Moving *const m = velocity_of(newton, c);
        if (m->rigid >= 0 && m->u0 == 0.0 && !m->leaves) {
            hold(e, newton, g, c, s);
            held = true;
        } else
            assume(newton, g, c, FREE, FREE);
    }
    return held;
}

/* Solve a step: with the contacts at rest that may be, else in motion; and again with those at rest that pass v = 0. If
   they do not stop together, one alone may: forces that stop both in a step can be far from those that stop one. */
static int solve(Engine *e, Newton *newton, const Group *g, int64_t number, const Span *s, bool again)
{
    bool rests = false, smooth = true;
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++)
        smooth = smooth && velocity_of(newton, c)->rigid < 0;
    if (smooth)
        return iterate(e, newton, g, number, s, again);
    newton->jumped = false;
    const bool tried = hold_resting(e, newton, g, s);
    int status = tried ? solve_held(e, newton, g, s, again, &rests) : SOLVED;
    if (status != SOLVED || rests)
        return status;
    status = iterate(e, newton, g, number, s, again || tried);
    const int solved = status;
    if (status != NOT_CONVERGED && (tried || status != SOLVED))
        return status;
    const bool jumped = newton->jumped, any = jumped || status == NOT_CONVERGED;
    if (!tried && !hold_some(e, newton, g, s, -1, any))
        return status;
    double *const w = newton->work + 6 * newton->most_unknowns + 2 * newton->most_unknowns * newton->most_unknowns;
    memcpy(w, newton->w + g->unknown, (size_t)g->unknowns * sizeof(double));
    status = tried ? SOLVED : solve_held(e, newton, g, s, true, &rests);
    const bool alone = any && g->contacts > 1;
    for (int64_t i = 0; alone && i < g->contacts && status == SOLVED && !rests; i++)
        if (hold_some(e, newton, g, s, i, any))
            status = solve_held(e, newton, g, s, true, &rests);
    if (status != SOLVED || rests)
        return status;
    if (newton->turns && iterate(e, newton, g, number, s, true) == SOLVED)
        return SOLVED;
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++)
        let_go(e, newton, g, c, false);
    if (solved != SOLVED)
        return solved;
    double norm = 0.0; /* the solution without a contact at rest */
    memcpy(newton->w + g->unknown, w, (size_t)g->unknowns * sizeof(double));
    status = evaluate(e, newton, g, s, true, &norm);
    newton->jumped = jumped;
    set_at_rest(e, newton, g);
    return status;
}

#endif
