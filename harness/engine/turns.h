/* A tick of a program that handles one part after the other (Gauss-Seidel) with plain connections: parts take turns. */

#ifndef TURNS_H
#define TURNS_H

#include "part.h"

static inline void record(Engine *e)
{
    double *const row = e->rows + e->filled * e->width;
    for (int64_t i = 0; i < e->width; i++)
        row[i] = e->signals[e->columns[i]];
    e->filled++;
}

/* Record the values at the end of this tick if they are due. */
static inline void record_tick(Engine *e, int64_t tick)
{
    if (e->width > 0 && (e->decimate == 1 || (tick + 1) % e->decimate == 0))
        record(e);
}

/* Take what `verify` of a part says of its turn, if that is not 0; false: failed. */
static bool settle_turn(Engine *e, int64_t part, int status, double t)
{
    int operation = STEP;
    if (status == NOT_DIRECT) {
        operation = SET;
        status = hand_over(&e->parts[part], e->signals);
    }
    return status <= 1 || failed(e, part, operation, status, t);
}

/* Check the turns that have been taken, of which all but the last are known to be done. */
static bool settle_turns(Engine *e, int64_t taken, bool done, double t)
{
    for (int64_t i = 0; i < taken; i++) {
        const int64_t part = e->program[6 * i + 1];
        const EnginePart *const p = &e->parts[part];
        const int status = p->direct->verify(p->component, &p->ports, e->signals, t, e->step, done || i + 1 < taken);
        if (status != 0 && !settle_turn(e, part, status, t))
            return false;
    }
    return true;
}

#endif
