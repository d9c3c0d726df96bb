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

/* Whether the program is set, step and read of one part after the other, as that of Gauss-Seidel, and all parts are
   FMUs with Reals only that are stepped at every tick. */
static bool is_plain(const Engine *e)
{
    for (int64_t i = 0; i < e->program_length; i++)
        if (e->program[2 * i] != i % 3 || e->program[2 * i + 1] != e->program[2 * (i - i % 3) + 1])
            return false;
    for (const EnginePart *p = e->parts; p < e->parts + e->part_count; p++)
        if (p->call || p->every > 1 || p->inputs[INTEGER] < p->inputs[TYPES] || p->outputs[INTEGER] < p->outputs[TYPES])
            return false;
    return e->program_length % 3 == 0;
}

/* The three operations on such a part. To choose and to check each of them takes 7 ns more. */
static inline bool take_turn(Engine *e, int64_t index, double t)
{
    EnginePart *const p = &e->parts[index];
    const int64_t inputs = count_of(p->inputs, REAL), outputs = count_of(p->outputs, REAL);
    fetch_inputs(e, p);
    int operation = SET, status = 0;
    if (inputs > 0)
        status = p->set[REAL](p->component, p->input_references, (size_t)inputs, e->signals + p->inputs[REAL]);
    if (status <= 1) {
        operation = STEP;
        status = p->do_step(p->component, t, e->step, 1);
    }
    if (status <= 1 && outputs > 0) {
        operation = GET;
        status = p->get[REAL](p->component, p->output_references, (size_t)outputs, e->signals + p->outputs[REAL]);
    }
    return status <= 1 || failed(e, index, operation, status, t);
}

static void record(Engine *e)
{
    double *const row = e->rows + e->filled * e->width;
    for (int64_t i = 0; i < e->width; i++)
        row[i] = e->signals[e->columns[i]];
    e->filled++;
}

/* What the master does from one tick to the next. */
static bool advance(Engine *e, int64_t tick, bool plain)
{
    if (e->manipulator_count > 0)
        manipulate(e, tick);
    if (e->newton)
        return newton_tick(e, e->newton, tick);
    if (e->extrapolation && !extrapolated_tick(e, e->extrapolation, tick))
        return false;
    for (int64_t i = 0; plain && i < e->program_length; i += 3)
        if (!take_turn(e, e->program[2 * i + 1], time_of(e, tick)))
            return false;
    for (int64_t i = 0; !plain && i < e->program_length; i++)
        if (!operate(e, (int)e->program[2 * i], e->program[2 * i + 1], tick))
            return false;
    measure_defects(e);
    return true;
}

EXPORT int64_t engine_run(Engine *e, int64_t from, int64_t to);

/* Runs the ticks from, ..., to - 1; returns the first one that was not completed, `to` if all were. */
EXPORT int64_t engine_run(Engine *e, int64_t from, int64_t to)
{
    const bool plain = is_plain(e);
    for (int64_t tick = from; tick < to; tick++) {
        if (!advance(e, tick, plain))
            return tick;
        if (e->width > 0 && (tick + 1) % e->decimate == 0)
            record(e);
    }
    return to;
}
