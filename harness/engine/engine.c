/* Run a system from one tick to another: perform the operations of each communication step, record values, and measure
   the coupling error of held values. */

#include "engine.h"
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

MIRRORED(Clock3)
MIRRORED(Defect)
MIRRORED(Engine)
MIRRORED(EnginePart)
MIRRORED(Fmi3)
MIRRORED(Line)
MIRRORED(Manipulator)
MIRRORED(Pair)
MIRRORED(State3)
MIRRORED(Variable3)

#include "mirrors.h" /* generated: fields and offsets of the structs marked by MIRRORED */

EXPORT int64_t fixed_point_work(int64_t n);

EXPORT int64_t fixed_point_work(int64_t n) { return FIXED_POINT_WORK(n); }

/* Data to set, step and read one part in a single pass, stored contiguously. Only for FMUs that exchange Reals only and
   are stepped at every tick. */
typedef struct {
    EnginePart *part;
    const uint32_t *input_references, *output_references;
    double *inputs, *outputs;
    const int64_t *sources;
    int64_t input_count, output_count, number;
} Turn;

enum { MOST_TURNS = 16 };

/* Fill in the turns of a tick and return their number, if the program handles one part after the other (Gauss-Seidel)
   and all parts are such FMUs; else return 0. Selecting and checking each operation separately takes 7 ns more per
   part. */
static int64_t turns_of(const Engine *e, Turn *turns)
{
    const int64_t count = e->program_length / 3;
    if (e->program_length % 3 != 0 || count > MOST_TURNS || e->gains != NULL || e->lines != NULL)
        return 0;
    for (int64_t i = 0; i < count; i++) {
        const int64_t *const operations = e->program + 6 * i, part = operations[1];
        EnginePart *const p = &e->parts[part];
        if (operations[0] != SET || operations[2] != STEP || operations[4] != GET || operations[3] != part ||
            operations[5] != part || p->call || p->every > 1 || p->inputs[INTEGER] < p->inputs[TYPES] ||
            p->outputs[INTEGER] < p->outputs[TYPES])
            return 0;
        turns[i] = (Turn){p,
                          p->input_references,
                          p->output_references,
                          e->signals + p->inputs[REAL],
                          e->signals + p->outputs[REAL],
                          e->sources + p->inputs[REAL],
                          count_of(p->inputs, REAL),
                          count_of(p->outputs, REAL),
                          part};
    }
    return count;
}

static inline bool take_turn(Engine *e, const Turn *p, double t)
{
    for (int64_t i = 0; i < p->input_count; i++)
        p->inputs[i] = e->signals[p->sources[i]];
    int operation = SET, status = 0;
    if (p->input_count > 0)
        status = set_reals(p->part, p->input_references, (size_t)p->input_count, p->inputs);
    if (status <= 1) {
        operation = STEP;
        status = step_fmu(p->part, t, e->step);
    }
    if (status <= 1 && p->output_count > 0) {
        operation = GET;
        status = get_reals(p->part, p->output_references, (size_t)p->output_count, p->outputs);
    }
    return status <= 1 || failed(e, p->number, operation, status, t);
}

static void record(Engine *e)
{
    double *const row = e->rows + e->filled * e->width;
    for (int64_t i = 0; i < e->width; i++)
        row[i] = e->signals[e->columns[i]];
    e->filled++;
}

/* Run the ticks from, ..., to - 1. Return the first tick that was not completed, or `to` if all were. */
static int64_t run_ticks(Engine *e, const Turn *turns, int64_t turn_count, int64_t from, int64_t to)
{
    for (int64_t tick = from; tick < to; tick++) {
        for (int64_t i = 0; i < turn_count; i++)
            if (!take_turn(e, &turns[i], time_of(e, tick)))
                return tick;
        span_tick(e, tick);
        if (turn_count == 0 && !advance(e, tick))
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
    Turn turns[MOST_TURNS];
    const int64_t turn_count = turns_of(e, turns);
    const uint32_t control = float_control();
    for (int64_t tick = from, length = 1; tick < to; length = TICKS) {
        const int64_t end = to - tick < length ? to : tick + length, filled = e->filled;
        const int64_t done = run_ticks(e, turns, turn_count, tick, end);
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
