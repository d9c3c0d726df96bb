/* One tick: the operations of an explicit master, or the function of another one. */

#ifndef TICK_H
#define TICK_H

#include "line.h"
#include "manipulate.h"

/* Return whether inputs of a part follow lines in an explicit master. */
static bool is_on_lines(const Engine *e, int64_t index)
{
    return e->lines_from && e->lines_from[index] < e->lines_from[index + 1] && e->parts[index].set_slopes;
}

/* Let the lines of a part continue from the values at the end of the last step. */
static void continue_lines(Engine *e, int64_t index)
{
    for (int64_t k = e->lines_from[index]; k < e->lines_from[index + 1]; k++) {
        Line *const l = &e->lines[k];
        l->end = arriving(e, l->input);
        l->mean = 0.5 * (e->signals[l->input] + l->end);
    }
}

/* Perform one operation of an explicit master. */
static bool operate(Engine *e, int operation, int64_t index, int64_t tick)
{
    EnginePart *const p = &e->parts[index];
    if (!is_due(e, p, tick))
        return true;
    int status = 0;
    const bool on_lines = is_on_lines(e, index);
    if (operation == SET) {
        if (on_lines)
            continue_lines(e, index);
        fetch_inputs(e, p);
        status = on_lines ? 0 : hand_over(p, e->signals);
    } else if (operation == RENEW) {
        for (Defect *d = e->defects; d < e->defects + e->defect_count; d++)
            if (d->input >= p->inputs[0] && d->input < p->inputs[TYPES]) {
                d->renewed = 1;
                d->held = e->signals[d->input];
            }
        fetch_inputs(e, p);
        operation = SET;
        status = hand_over(p, e->signals);
    } else if (operation == STEP) {
        double t = 0.0, h = 0.0;
        interval_of(e, p, tick, &t, &h);
        status = on_lines ? step_on_lines(e, index, t, h) : step_part(p, t, h);
    } else
        status = fetch_outputs(p, e->signals);
    return status <= 1 || failed(e, index, operation, status, time_of(e, tick));
}

/* Perform the operations of the master over a tick, or over the part of it that the engine's span is. */
static bool advance(Engine *e, int64_t tick)
{
    if (e->manipulator_count > 0 && e->begins)
        manipulate(e, tick);
    if (e->advance)
        return e->advance(e, tick);
    for (int64_t i = 0; i < e->program_length; i++)
        if (!operate(e, (int)e->program[2 * i], e->program[2 * i + 1], tick))
            return false;
    return true;
}

#endif
