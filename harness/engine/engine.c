/* Runs a system from one tick to another: the operations of every step, what is recorded, and how well the values
   that were handed over held. */

#include "engine.h"
#include "defect.h"
#include "extrapolate.h"
#include "manipulate.h"
#include "newton.h"
#include "part.h"

/* One operation of an explicit master. */
static bool operate(Engine *e, int operation, int64_t index, int64_t tick)
{
    EnginePart *const p = &e->parts[index];
    if (!is_due(p, tick))
        return true;
    int status = 0;
    if (operation == SET) {
        fetch_inputs(e, p);
        status = hand_over(p, e->signals);
    } else if (operation == STEP)
        status = step_part(p, time_of(e, tick - p->phase), (double)p->every * e->step);
    else
        status = fetch_outputs(p, e->signals);
    return status <= 1 || failed(e, index, operation, status, time_of(e, tick));
}

static void record(Engine *e)
{
    double *const row = e->rows + e->filled * e->width;
    for (int64_t i = 0; i < e->width; i++)
        row[i] = e->signals[e->columns[i]];
    e->filled++;
}

EXPORT int64_t engine_run(Engine *e, int64_t from, int64_t to);

/* Runs the ticks from, ..., to - 1; returns the first one that was not completed, `to` if all were. */
EXPORT int64_t engine_run(Engine *e, int64_t from, int64_t to)
{
    for (int64_t tick = from; tick < to; tick++) {
        if (e->manipulator_count > 0)
            manipulate(e, tick);
        if (e->newton) {
            if (!newton_tick(e, e->newton, tick))
                return tick;
        } else {
            if (e->extrapolation && !extrapolated_tick(e, e->extrapolation, tick))
                return tick;
            for (int64_t i = 0; i < e->program_length; i++)
                if (!operate(e, (int)e->program[2 * i], e->program[2 * i + 1], tick))
                    return tick;
            measure_defects(e);
        }
        if (e->width > 0 && (tick + 1) % e->decimate == 0)
            record(e);
    }
    return to;
}
