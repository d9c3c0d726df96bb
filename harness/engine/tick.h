/* One tick: the operations of an explicit master, or the function of another one. */

#ifndef TICK_H
#define TICK_H

#include "manipulate.h"

/* Perform one operation of an explicit master. */
static bool operate(Engine *e, int operation, int64_t index, int64_t tick)
{
    EnginePart *const p = &e->parts[index];
    if (!is_due(e, p, tick))
        return true;
    int status = 0;
    if (operation == SET) {
        fetch_inputs(e, p);
        status = hand_over(p, e->signals);
    } else if (operation == STEP) {
        double t = 0.0, h = 0.0;
        interval_of(e, p, tick, &t, &h);
        status = step_part(p, t, h);
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
