/* The loop over communication steps, compiled for one system in which parts take turns. The generated file defines
     TURNS(X)      X(part, place) for each block, in the order of the program, in which it has this place
     DEFECTS(X)    X(number, input, output) for each measured connection
     PAIRS(X)      X(number, force, velocity, has_position, late) for each power bond
   The engine calls it in place of its own loop, with the same results. */

#pragma GCC diagnostic ignored "-Wunused-function" /* operations of parts that take no turns */
#include "defect.h"
#include "turns.h"

#define DECLARE(part, place)                                                                                           \
    bool turn_##part(void *component, double *signals, double t, double h);                                            \
    int verify_##part(void *component, const double *signals, double t, double h, bool done);                          \
    int64_t size_##part(int64_t *fixed, char *guid);

TURNS(DECLARE)

/* As take_direct_turns of engine.c. */
static inline bool take_compiled_turns(Engine *e, double t)
{
    int64_t taken = 0;
#define TAKE(part, place) &&(taken = place + 1, turn_##part(e->parts[part].component, e->signals, t, e->step))
    if (!(true TURNS(TAKE)))
        return settle_turns(e, taken, false, t);
    int status;
#define VERIFY(part)        verify_##part(e->parts[part].component, e->signals, t, e->step, true)
#define SETTLE(part, place) &&((status = VERIFY(part)) == 0 || settle_turn(e, part, status, t))
    return true TURNS(SETTLE);
}

static inline void measure_compiled_defects(Engine *e)
{
    Defect *const d = e->defects;
#define MEASURE(number, input, output) measure_defect(e, d + number, input, e->signals[output], false);
    DEFECTS(MEASURE)
#define MEASURE_PAIR(number, force, velocity, has_position, late)                                                      \
    measure_pair(e, e->pairs + number, d + force, d + velocity, has_position, late);
    PAIRS(MEASURE_PAIR)
    (void)d;
}

EXPORT Loop run_compiled;

EXPORT int64_t run_compiled(Engine *e, int64_t from, int64_t to)
{
    for (int64_t tick = from; tick < to; tick++) {
        span_tick(e, tick);
        if (!take_compiled_turns(e, e->time))
            return tick;
        measure_compiled_defects(e);
        record_tick(e, tick);
    }
    return to;
}

EXPORT int64_t compiled_size(int64_t part, int64_t *fixed, char *guid);

/* Return the size of the state of a part, whose first `fixed` bytes are parameters, and the GUID of its sources. */
EXPORT int64_t compiled_size(int64_t part, int64_t *fixed, char *guid)
{
#define SIZE(number, place)                                                                                            \
    if (part == number)                                                                                                \
        return size_##number(fixed, guid);
    TURNS(SIZE)
    return 0;
}
