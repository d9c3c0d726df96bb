/* A single contact: its roles, its friction at and beside v = 0, and the load under which it is at rest. */

#ifndef CONTACT_H
#define CONTACT_H

#include "quasi_newton.h"

#define BESIDE  1e-300 /* [m/s] or [rad/s] */
#define NO_JUMP 1e-150 /* [N] or [N.m]: a smooth output beside v = 0 differs by less from that at v = 0 */
#define EQUAL   1e-9   /* relative difference of equal forces */
#define STARTED 1e-6   /* the same at the start of a step */

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

/* Find the friction on both sides of v = 0, and at last that at v = 0, which remains the output. */
static int probe(Engine *e, const Newton *newton, const Contact *c, const Span *s, double *up, double *down,
                 double *rest)
{
    int status = face(e, newton, c, s, BESIDE, up);
    if (status == SOLVED)
        status = face(e, newton, c, s, -BESIDE, down);
    if (status == SOLVED)
        status = face(e, newton, c, s, 0.0, rest);
    return status;
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

#endif
