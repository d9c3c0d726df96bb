/* Jumps between two steps of an implicit master. A held input, such as the force of a sampled law, jumps when its
   source is sampled; outputs that depend on it directly jump with it, and so do the inputs that they drive. The lines
   begin the next step with the values after the jump. */

#ifndef RESTART_H
#define RESTART_H

#include "contacts.h"

#include <float.h>

#define ROUNDED 10.0 /* smallest jump over the tolerance of a solution */

/* The onset of a manipulator is a jump: the inputs begin this step with the manipulated value. */
static void restart_manipulated(Engine *e, Newton *newton)
{
    for (int64_t k = 0; k < e->lines_from[e->part_count]; k++) {
        Moving *const m = &newton->moving[k];
        const int64_t input = e->lines[k].input;
        const double gain = e->gains[input], offset = e->offsets[input];
        if (gain == m->gain && offset == m->offset)
            continue;
        m->gain = gain;
        m->offset = offset;
        m->u0 = m->q0 = arriving(e, input);
    }
}

/* Raise the largest magnitude of an input. Return how far it has jumped, as a part of that. */
static double jump_of(double before, double value, double *size)
{
    *size = fmax(*size, fmax(fabs(before), fabs(value)));
    const double jump = value == before ? 0.0 : fmax(fabs(value - before) / *size, DBL_MIN);
    return isnan(jump) ? INFINITY : jump;
}

/* Remember the held inputs. Return how far one of them has jumped since the last step, or a line from a part that was
   restarted since its end, over the magnitude. */
static double largest_jump(const Engine *e, Newton *newton, const Group *g)
{
    double most = 0.0;
    for (int64_t k = g->held; k < g->held + g->held_count; k++) {
        const double value = arriving(e, newton->held[k]);
        most = fmax(most, jump_of(newton->held_values[k], value, &newton->held_sizes[k]));
        newton->held_values[k] = value;
    }
    for (int64_t i = g->line; i < g->line + g->lines; i++) {
        const int64_t k = newton->lines[i];
        Moving *const m = &newton->moving[k];
        if (!m->inner)
            most = fmax(most, jump_of(m->u0, arriving(e, e->lines[k].input), &m->outside));
    }
    return most;
}

/* Begin the lines to a loop or a part with the values that arrive; `which`: only lines that read an unknown, or only
   the others, or only those within the loop. A difference within the tolerance of the solution is no jump. The mean of
   a line follows from its slope in the last step, which a jump does not change. */
typedef enum { ALL_LINES, KNOWN_LINES, UNKNOWN_LINES, INNER_LINES } Which;

static void begin_lines(const Engine *e, Newton *newton, const Group *g, Which which)
{
    for (int64_t i = g->line; i < g->line + g->lines; i++) {
        const int64_t k = newton->lines[i];
        Moving *const m = &newton->moving[k];
        const double value = arriving(e, e->lines[k].input), jump = value - m->u0;
        const bool begins =
            which == INNER_LINES ? m->inner : which == ALL_LINES || (which == UNKNOWN_LINES) == (m->unknown >= 0);
        if (begins && fabs(jump) > ROUNDED * newton->tolerance * fmax(m->scale, fabs(value))) {
            m->u0 = value;
            m->q0 += jump;
        }
    }
}

/* Solve for the holding forces at this part of the step: in a step that is too short for any motion. */
static int hold_again(Engine *e, Newton *newton, int64_t number, double t, double at)
{
    const Group *const g = &newton->groups[number];
    const double h = ldexp(e->length, -MOST_HALVINGS);
    const Span instant = {t, h, at, at + h / e->length, 1.0, true};
    int status = save_loop(e, newton, g, t);
    if (status == SOLVED)
        status = solve(e, newton, g, number, &instant, false);
    for (int64_t i = g->first; i < g->first + g->count && status == SOLVED; i++)
        status = outcome(e, newton->order[i], RESTORE, restore_part(&e->parts[newton->order[i]]), t);
    for (int64_t j = g->unknown; j < g->unknown + g->unknowns; j++)
        e->signals[newton->unknowns[j]] = newton->w[j];
    return status;
}

/* Before a span, find the forces of contacts beside one another at rest, which their outputs do not tell, or that they
   are about to move. */
static int share_again(Engine *e, Newton *newton, int64_t number, double t, double at)
{
    const Group *const g = &newton->groups[number];
    const Contact *const first = contacts_of(newton, g), *const last = first + g->contacts;
    const int64_t jumped = newton->jumped;
    bool shared = false, holds = true;
    for (const Contact *c = first; c < last; c++)
        shared = shared || (velocity_of(newton, c)->rests && is_shared(e, newton, g, c));
    if (!shared)
        return SOLVED;
    int status = hold_again(e, newton, number, t, at);
    for (const Contact *c = first; c < last; c++) {
        Moving *const m = velocity_of(newton, c);
        m->leaves = m->rests && !is_rest(m);
        holds = holds && !m->leaves;
    }
    if (status == SOLVED)
        status = refresh(e, newton, g, t, at);
    if (holds && status == SOLVED) {
        begin_lines(e, newton, g, INNER_LINES);
        memcpy(newton->w_last + g->unknown, newton->w + g->unknown, (size_t)g->unknowns * sizeof(double));
    }
    newton->jumped = jumped;
    return status;
}

/* Restart a loop or a part after a jump. While a contact sticks, its output is not the holding force, which is the
   unknown. */
static int restart(Engine *e, Newton *newton, int64_t number, double t)
{
    const Group *const g = &newton->groups[number];
    const bool sticks = newton->guards[number].jumped;
    newton->jumped = sticks; /* it may be that of another loop, or of another copy in a batch */
    int status = refresh(e, newton, g, t, 1.0);
    if (status != SOLVED)
        return status;
    begin_lines(e, newton, g, sticks ? KNOWN_LINES : ALL_LINES);
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++)
        if (!sticks && velocity_of(newton, c)->rests)
            newton->w_last[c->unknown] = e->signals[newton->unknowns[c->unknown]];
    if (!sticks)
        return SOLVED;
    status = hold_again(e, newton, number, t, 0.0);
    for (int64_t j = g->unknown; j < g->unknown + g->unknowns; j++) {
        newton->w_last[j] = newton->w[j];
        newton->trend[j] = 0.0;
    }
    if (status == SOLVED)
        begin_lines(e, newton, g, UNKNOWN_LINES);
    return status;
}

#endif
