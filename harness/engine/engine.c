/* Run a system from one tick to another: perform the operations of each communication step, record values, and measure
   the coupling error of held values. */

#include "engine.h"
#include "batch.h"
#include "defect.h"
#include "drive.h"
#include "floats.h"
#include "fmi3_adapter.h"
#include "integrator.h"
#include "masters.h" /* generated: it includes the header of each master */
#include "tick.h"

#include <stdlib.h>

/* Status: a part has changed the floating-point control. */
enum { FLOATS_CHANGED = 102 };

MIRRORED(Batch)
MIRRORED(Clock3)
MIRRORED(Defect)
MIRRORED(Direct)
MIRRORED(Engine)
MIRRORED(EnginePart)
MIRRORED(Fmi3)
MIRRORED(Line)
MIRRORED(Manipulator)
MIRRORED(Pair)
MIRRORED(Piece)
MIRRORED(Ports)
MIRRORED(State3)
MIRRORED(Variable3)

#include "mirrors.h" /* generated: fields and offsets of the structs marked by MIRRORED */

EXPORT int64_t fixed_point_work(int64_t n);

EXPORT int64_t fixed_point_work(int64_t n) { return FIXED_POINT_WORK(n); }

static void record(Engine *e)
{
    double *const row = e->rows + e->filled * e->width;
    for (int64_t i = 0; i < e->width; i++)
        row[i] = e->signals[e->columns[i]];
    e->filled++;
}

/* Return whether the program handles one part after the other (Gauss-Seidel), and all of them have direct calls. */
static bool takes_turns(const Engine *e)
{
    bool all = e->program_length > 0 && e->program_length % 3 == 0 && e->gains == NULL && e->lines == NULL;
    for (int64_t i = 0; all && i < e->program_length / 3; i++) {
        const int64_t *const operations = e->program + 6 * i, part = operations[1];
        all = operations[0] == SET && operations[2] == STEP && operations[4] == GET && operations[3] == part &&
              operations[5] == part && e->parts[part].direct && e->parts[part].every == 1;
    }
    return all;
}

/* Let all parts take their turns, and check the results then, in the same order: a check waits for values that have
   just been written. */
static bool take_turns(Engine *e, double t)
{
    int64_t taken = 0;
    bool done = true;
    for (; done && 3 * taken < e->program_length; taken++) {
        const EnginePart *const p = &e->parts[e->program[6 * taken + 1]];
        done = p->direct->turn(p->component, &p->ports, e->signals, t, e->step);
    }
    for (int64_t i = 0; i < taken; i++) {
        const int64_t part = e->program[6 * i + 1];
        EnginePart *const p = &e->parts[part];
        int operation = STEP,
            status = p->direct->verify(p->component, &p->ports, e->signals, t, e->step, done || i + 1 < taken);
        if (status == NOT_DIRECT) {
            operation = SET;
            status = hand_over(p, e->signals);
        }
        if (status > 1)
            return failed(e, part, operation, status, t);
    }
    return true;
}

/* Run the ticks from, ..., to - 1. Return the first tick that was not completed, or `to` if all were. */
static int64_t run_ticks(Engine *e, int64_t from, int64_t to)
{
    const bool turns = takes_turns(e);
    for (int64_t tick = from; tick < to; tick++) {
        span_tick(e, tick);
        if (!(turns ? take_turns(e, e->time) : advance(e, tick)))
            return tick;
        measure_defects(e);
        if (e->width > 0 && (e->decimate == 1 || (tick + 1) % e->decimate == 0))
            record(e);
    }
    return to;
}

/* Step each part once more and return the one that changes the floating-point control, or -1. The run is over, so this
   changes no result. */
static int64_t culprit(Engine *e, uint32_t control, double t)
{
    for (int64_t i = 0; i < e->part_count; i++) {
        EnginePart *const p = &e->parts[i];
        if (p->call)
            continue;
        (void)hand_over(p, e->signals);
        (void)step_part(p, t, (double)p->every * e->step);
        (void)fetch_outputs(p, e->signals);
        if (float_control() != control) {
            set_float_control(control);
            return i;
        }
    }
    return -1;
}

EXPORT int64_t engine_run(Engine *e, int64_t from, int64_t to);

/* Run the ticks from, ..., to - 1. Return the first tick that was not completed, or `to` if all were. The
   floating-point control is checked after the first tick and then every 64 ticks, at no measurable cost. If a part has
   changed it, the rows recorded since the last check are discarded. */
EXPORT int64_t engine_run(Engine *e, int64_t from, int64_t to)
{
    enum { TICKS = 64 };
    const uint32_t control = float_control();
    for (int64_t tick = from, length = 1; tick < to; length = TICKS) {
        const int64_t end = to - tick < length ? to : tick + length, filled = e->filled;
        const int64_t done = run_ticks(e, tick, end);
        const uint32_t changed = float_control() ^ control;
        if (changed != 0) {
            set_float_control(control);
            e->filled = filled;
            e->float_change = (int64_t)changed;
            (void)failed(e, culprit(e, control, time_of(e, end)), STEP, FLOATS_CHANGED, time_of(e, tick));
            return tick;
        }
        if (done < end)
            return done;
        tick = end;
    }
    return to;
}

EXPORT int64_t engine_batch(Engine *e, const Batch *b, int64_t from, int64_t to);

/* Step the copies from, ..., to - 1. Return the first one that fails, or `to`. */
EXPORT int64_t engine_batch(Engine *e, const Batch *b, int64_t from, int64_t to)
{
    for (int64_t number = from; number < to; number++) {
        const int64_t first = b->ticks[number], last = first + b->steps;
        load_copy(b, number);
        if (!take_inputs(e, b, number) || run_ticks(e, first, last) < last)
            return number;
        store_copy(e, b, number);
        b->ticks[number] = last;
    }
    return to;
}

EXPORT uint32_t engine_float_control(void);

/* Return the floating-point control of this thread, see floats.h. */
EXPORT uint32_t engine_float_control(void) { return float_control(); }

EXPORT void engine_set_float_control(uint32_t control);

EXPORT void engine_set_float_control(uint32_t control) { set_float_control(control); }

static void (*last_call)(void);

static void end(void)
{
    if (last_call)
        last_call();
}

EXPORT int engine_at_exit(void (*call)(void));

/* Register a function to be called when any code ends the program with exit(). NULL removes it. */
EXPORT int engine_at_exit(void (*call)(void))
{
    const bool first = call != NULL && last_call == NULL;
    last_call = call;
    return first ? atexit(end) : 0;
}
