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
#include "turns.h"

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

/* How a tick is performed: by the master; or, if the program handles one part after the other (Gauss-Seidel) with plain
   connections at every tick, by turns of the parts: of FMUs that exchange Reals only, or by direct calls. Selecting and
   checking each operation separately takes 7 ns more per part. */
typedef enum { BY_MASTER, BY_TURNS, BY_DIRECT_TURNS } Way;

static Way way_of(const Engine *e)
{
    bool reals = true, direct = true;
    if (e->program_length == 0 || e->program_length % 3 != 0 || e->gains != NULL || e->lines != NULL)
        return BY_MASTER;
    for (int64_t i = 0; i < e->program_length / 3; i++) {
        const int64_t *const operations = e->program + 6 * i, part = operations[1];
        const EnginePart *const p = &e->parts[part];
        if (operations[0] != SET || operations[2] != STEP || operations[4] != GET || operations[3] != part ||
            operations[5] != part || p->call || p->every > 1)
            return BY_MASTER;
        reals = reals && p->inputs[INTEGER] == p->inputs[TYPES] && p->outputs[INTEGER] == p->outputs[TYPES];
        direct = direct && p->direct;
    }
    return direct ? BY_DIRECT_TURNS : reals ? BY_TURNS : BY_MASTER;
}

static inline bool take_turn(Engine *e, int64_t part, double t)
{
    EnginePart *const p = &e->parts[part];
    int operation = SET, status = 0;
    const size_t in = (size_t)count_of(p->inputs, REAL), out = (size_t)count_of(p->outputs, REAL);
    fetch_inputs(e, p);
    if (in > 0)
        status = set_reals(p, p->input_references, in, e->signals + p->inputs[REAL]);
    if (status <= 1) {
        operation = STEP;
        status = step_fmu(p, t, e->step);
    }
    if (status <= 1 && out > 0) {
        operation = GET;
        status = get_reals(p, p->output_references, out, e->signals + p->outputs[REAL]);
    }
    return status <= 1 || failed(e, part, operation, status, t);
}

static bool take_turns(Engine *e, double t)
{
    for (int64_t i = 0; 3 * i < e->program_length; i++)
        if (!take_turn(e, e->program[6 * i + 1], t))
            return false;
    return true;
}

/* Let all parts take their turns, and check the results then, in the same order: a check waits for values that have
   just been written. */
static bool take_direct_turns(Engine *e, double t)
{
    int64_t taken = 0;
    bool done = true;
    for (; done && 3 * taken < e->program_length; taken++) {
        const EnginePart *const p = &e->parts[e->program[6 * taken + 1]];
        done = p->direct->turn(p->component, &p->ports, e->signals, t, e->step);
    }
    return settle_turns(e, taken, done, t);
}

EXPORT bool engine_takes_turns(const Engine *e);

/* Return whether a loop can be compiled for this system, see compiled_system.h. */
EXPORT bool engine_takes_turns(const Engine *e) { return way_of(e) == BY_DIRECT_TURNS; }

/* Run the ticks from, ..., to - 1. Return the first tick that was not completed, or `to` if all were. */
static int64_t run_ticks(Engine *e, int64_t from, int64_t to)
{
    const Way way = way_of(e);
    if (e->compiled && way == BY_DIRECT_TURNS)
        return e->compiled(e, from, to);
    for (int64_t tick = from; tick < to; tick++) {
        span_tick(e, tick);
        if (!(way == BY_DIRECT_TURNS ? take_direct_turns(e, e->time)
              : way == BY_TURNS      ? take_turns(e, e->time)
                                     : advance(e, tick)))
            return tick;
        measure_defects(e);
        record_tick(e, tick);
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
