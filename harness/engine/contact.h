/* A contact, and those side by side that hold one mass, such as the brake and the bearing of a shaft. They stop and
   break away together. At rest, the equations determine only the sum of their forces, and any division is as good. Here
   the one that holds most leads: its force is solved for, and the others follow in the ratio of what each holds at
   most. */

#ifndef CONTACT_H
#define CONTACT_H

#include "quasi_newton.h"

#define BESIDE    1e-300 /* [m/s] or [rad/s] */
#define NO_JUMP   1e-150 /* [N] or [N.m]: a smooth output beside v = 0 differs by less from that at v = 0 */
#define EQUAL     1e-9   /* relative difference of equal forces */
#define STARTED   1e-6   /* the same at the start of a step */
#define FAINT     1e-3   /* of the jump of a contact: a load that it holds */
#define HUGE_LOAD 1e12   /* of the same: a load that it does not hold */
#define MORE      1.001  /* of the friction at such a load: one that it does not hold either */

static Moving *velocity_of(const Newton *newton, const Contact *c) { return &newton->moving[c->line]; }

static bool carries(const Moving *m, const Contact *c) { return m->unknown == c->unknown || (m->carries & c->bit); }

/* Set the role of a contact: of its velocity, and of the lines that carry its force; one of several forces has the
   highest. */
static void assume(Newton *newton, const Group *g, const Contact *c, int64_t velocity, int64_t force)
{
    const Contact *const first = contacts_of(newton, g), *const last = first + g->contacts;
    velocity_of(newton, c)->role = velocity;
    velocity_of(newton, c)->force = force;
    for (int64_t i = g->line; i < g->line + g->lines; i++) {
        Moving *const m = &newton->moving[newton->lines[i]];
        if (!carries(m, c))
            continue;
        m->role = force;
        for (const Contact *d = first; d < last; d++)
            if (velocity_of(newton, d)->force > m->role && carries(m, d))
                m->role = velocity_of(newton, d)->force;
    }
}

/* Return whether the load of a contact at rest was its force at the start of the span, too: a mass that returns to
   v = 0 within the span has moved. */
static bool held_at_start(const Engine *e, const Newton *newton, const Contact *c, const Span *s)
{
    const double force = newton->w_last[c->unknown];
    bool lines = false;
    for (int64_t k = e->lines_from[c->part]; k < e->lines_from[c->part + 1]; k++)
        for (int64_t i = c->first_load; i < c->first_load + c->load_count; i++)
            if (e->lines[k].input == newton->loads[i]) {
                const Moving *const m = &newton->moving[k];
                const double load = m->inner ? m->u0 : value_at(m, arriving(e, e->lines[k].input), s->from);
                if (fabs(load - force) <= STARTED * fmax(fabs(load), newton->scale[c->unknown]))
                    return true;
                lines = true;
            }
    return !lines;
}

/* Step a contact once more, to this velocity. Return its force; 0 after a failure. */
static double face(Engine *e, const Newton *newton, const Contact *c, const Span *s, double v, int *status)
{
    if (*status == SOLVED)
        *status = outcome(e, c->part, RESTORE, restore_part(&e->parts[c->part]), s->t);
    if (*status != SOLVED)
        return 0.0;
    e->lines[c->line].end = v;
    *status = follow_lines(e, c->part, s, true);
    return e->signals[newton->unknowns[c->unknown]];
}

/* Tell from the lowest and the highest friction at and beside v = 0 whether it jumps there; 0 would not tell. */
static void classify(Moving *m, double low, double high)
{
    const double size = fmax(fabs(low), fabs(high));
    if (high - low > fmax(NO_JUMP, EQUAL * size))
        m->rigid = 1;
    else if (size > NO_JUMP)
        m->rigid = -1;
}

/* Return whether a contact at rest determines the forces of others on the same mass. */
static bool leads(const Moving *m) { return m->high > m->low && m->leader < 0; }

static bool is_still(const Moving *m) { return m->u0 == 0.0 || m->still; }

/* Return whether two contacts read one velocity. */
static bool is_beside(const Engine *e, const Contact *c, const Contact *d)
{
    const int64_t a = e->lines[c->line].input, b = e->lines[d->line].input;
    return c == d || (e->sources[a] == e->sources[b] && (!e->gains || (e->offsets[a] == 0.0 && e->offsets[b] == 0.0)));
}

/* Return whether another contact holds the same mass, or a force acts on it that this one does not read. */
static bool is_shared(const Engine *e, const Newton *newton, const Group *g, const Contact *c)
{
    if (velocity_of(newton, c)->partial)
        return true;
    for (const Contact *d = contacts_of(newton, g); d < contacts_of(newton, g) + g->contacts; d++)
        if (d != c && velocity_of(newton, d)->rigid >= 0 && is_beside(e, c, d))
            return true;
    return false;
}

/* Let a contact move, and those beside it. */
static void let_go(const Engine *e, Newton *newton, const Group *g, const Contact *c, bool changes)
{
    for (const Contact *d = contacts_of(newton, g); d < contacts_of(newton, g) + g->contacts; d++)
        if (is_beside(e, c, d))
            assume(newton, g, d, FREE, changes || velocity_of(newton, d)->rests ? CHANGING : FREE);
}

/* Let static friction of a contact and of those beside it hold a mass that stops at the start of the span. */
static void hold_still(const Engine *e, Newton *newton, const Group *g, const Contact *c)
{
    for (const Contact *d = contacts_of(newton, g); d < contacts_of(newton, g) + g->contacts; d++)
        if (is_beside(e, c, d))
            velocity_of(newton, d)->still = 1;
}

/* Give those whose force this contact determines its role. */
static void lead(Newton *newton, const Group *g, const Contact *c)
{
    for (const Contact *d = contacts_of(newton, g); d < contacts_of(newton, g) + g->contacts; d++)
        if (velocity_of(newton, d)->leader == c->unknown && is_rest(velocity_of(newton, d)))
            velocity_of(newton, d)->role = velocity_of(newton, c)->role;
}

/* Return whether the force of a contact at v = 0 is this one if it is given as the load; *force: what it is. */
static bool answers(Engine *e, const Newton *newton, const Contact *c, const Span *s, int64_t load, double value,
                    double *force, int *status)
{
    e->signals[load] = value;
    for (int64_t k = e->lines_from[c->part]; k < e->lines_from[c->part + 1]; k++)
        if (e->lines[k].input == load)
            e->lines[k].mean = e->lines[k].end = value;
    *force = face(e, newton, c, s, 0.0, status);
    return *status == SOLVED && fabs(*force - value) <= EQUAL * fabs(value);
}

/* Return the largest load that friction at v = 0 equals, by bisection between a faint one that it does and a huge one.
 */
static double largest_held(Engine *e, const Newton *newton, const Contact *c, const Span *s, int64_t load, double faint,
                           int *status)
{
    double good = faint, bad = faint / FAINT * HUGE_LOAD, rest = 0.0;
    const bool all = answers(e, newton, c, s, load, bad, &rest, status); /* else, most models return their limit */
    if (all || answers(e, newton, c, s, load, rest, &rest, status))
        good = fabs(rest) > fabs(good) ? rest : good;
    bool more = !all && answers(e, newton, c, s, load, good * MORE, &rest, status);
    for (int tries = 0; more && tries < MOST_BISECTIONS && fabs(bad) > (1.0 + 1e-14) * fabs(good); tries++) {
        const double middle = copysign(sqrt(good * bad), good);
        *(answers(e, newton, c, s, load, middle, &rest, status) ? &good : &bad) = middle;
    }
    return good;
}

/* Find the forces between which a contact holds: those within its jump, and, unless it stops in this span, static
   friction, which equals the load. */
static int find_range(Engine *e, Newton *newton, const Group *g, const Contact *c, const Span *s)
{
    Moving *const m = velocity_of(newton, c);
    int status = SOLVED;
    const double up = face(e, newton, c, s, BESIDE, &status), down = face(e, newton, c, s, -BESIDE, &status);
    double rest = face(e, newton, c, s, 0.0, &status);
    const double lowest = fmin(fmin(up, down), rest), highest = fmax(fmax(up, down), rest);
    const double size = fmax(fabs(lowest), fabs(highest)), faint = FAINT * size;
    classify(m, lowest, highest);
    m->low = fmin(up, down);
    m->high = fmax(up, down);
    for (int64_t k = c->first_load; k < c->first_load + c->load_count && is_still(m) && m->rigid > 0; k++) {
        const int64_t load = newton->loads[k]; /* or a normal force, which friction does not equal */
        if (!answers(e, newton, c, s, load, faint, &rest, &status) ||
            !answers(e, newton, c, s, load, -faint, &rest, &status))
            continue;
        m->high = fmax(m->high, largest_held(e, newton, c, s, load, faint, &status));
        m->low = fmin(m->low, largest_held(e, newton, c, s, load, -faint, &status));
    }
    for (int64_t i = g->line; i < g->line + g->lines; i++) { /* a force that was 0 so far has no magnitude */
        const Moving *const line = &newton->moving[newton->lines[i]];
        if (line->unknown >= 0 && carries(line, c))
            newton->scale[line->unknown] = fmax(newton->scale[line->unknown], size);
    }
    return status;
}

static double width(const Moving *m) { return m->high - m->low; }

/* Return the contact that holds most of those at rest beside this one; NULL: it is alone, or none holds anything. */
static const Contact *leader_of(const Engine *e, const Newton *newton, const Group *g, const Contact *c)
{
    const Contact *leader = NULL;
    int64_t count = 0;
    for (const Contact *d = contacts_of(newton, g); d < contacts_of(newton, g) + g->contacts; d++)
        if (is_rest(velocity_of(newton, d)) && is_beside(e, c, d)) {
            leader = !leader || width(velocity_of(newton, d)) > width(velocity_of(newton, leader)) ? d : leader;
            count++;
        }
    const Moving *const m = velocity_of(newton, c);
    return is_rest(m) && (count > 1 || m->partial) && width(velocity_of(newton, leader)) != 0.0 ? leader : NULL;
}

/* Divide the force that holds a mass between contacts beside one another. */
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
            assume(newton, g, c, FREE, m->rests ? CHANGING : FREE);
    }
    for (const Contact *c = first; c < last && *divided; c++) {
        Moving *const m = velocity_of(newton, c);
        const Contact *const leader = leader_of(e, newton, g, c);
        m->leader = -1;
        if (!leader)
            m->low = m->high = 0.0;
        else if (leader != c) { /* whose force f gives the one of this contact, base + slope f */
            const Moving *const one = velocity_of(newton, leader);
            const int64_t a = e->lines[c->line].input, b = e->lines[leader->line].input;
            const bool opposite = e->gains && e->gains[a] * e->gains[b] < 0.0;
            m->leader = leader->unknown;
            m->slope = (opposite ? -1.0 : 1.0) * width(m) / width(one);
            m->base = (opposite ? m->high : m->low) - m->slope * one->low;
        }
    }
    return SOLVED;
}

#endif
