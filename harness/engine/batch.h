/* Copies of a system that one engine steps in turn: the state of each is copied to the parts and the engine, and back
   after its steps. A copy whose steps fail keeps its state. */

#ifndef BATCH_H
#define BATCH_H

#include "part.h"

enum { NOT_A_NUMBER = 105 }; /* status: an input of a copy is not finite; its number is in the place of the part */

typedef struct {
    void *place;
    int64_t size;
} Piece;

typedef struct {
    const Piece *pieces; /* all that a step may change */
    int64_t piece_count;
    char *states; /* of each copy, `size` bytes */
    int64_t size;
    int64_t *ticks; /* of each copy: the next one */
    int64_t steps;
    const double *inputs;   /* a row for each copy */
    const int64_t *targets; /* signals of its columns */
    int64_t input_count;
    double *outputs; /* a row for each copy */
    const int64_t *columns;
    int64_t output_count;
} Batch;

static inline void load_copy(const Batch *b, int64_t number)
{
    const char *from = b->states + number * b->size;
    for (const Piece *p = b->pieces; p < b->pieces + b->piece_count; from += p->size, p++)
        memcpy(p->place, from, (size_t)p->size);
}

static inline void store_copy(const Engine *e, const Batch *b, int64_t number)
{
    char *to = b->states + number * b->size;
    for (const Piece *p = b->pieces; p < b->pieces + b->piece_count; to += p->size, p++)
        memcpy(to, p->place, (size_t)p->size);
    for (int64_t i = 0; i < b->output_count; i++)
        b->outputs[number * b->output_count + i] = e->signals[b->columns[i]];
}

/* Give the copy its inputs, which hold during its steps. */
static inline bool take_inputs(Engine *e, const Batch *b, int64_t number)
{
    const double *const values = b->inputs + number * b->input_count;
    for (int64_t i = 0; i < b->input_count; i++) {
        if (!isfinite(values[i]))
            return failed(e, i, SET, NOT_A_NUMBER, time_of(e, b->ticks[number]));
        e->signals[b->targets[i]] = values[i];
    }
    return true;
}

/* A part that does nothing: its outputs are the inputs of the copies. */

static int set_nothing(void *component, const Ports *ports, const double *values)
{
    (void)component, (void)ports, (void)values;
    return 0;
}

static int step_nothing(void *component, double t, double h)
{
    (void)component, (void)t, (void)h;
    return 0;
}

static int get_nothing(void *component, const Ports *ports, double *signals)
{
    (void)component, (void)ports, (void)signals;
    return 0;
}

static bool turn_nothing(void *component, const Ports *ports, double *signals, double t, double h)
{
    (void)component, (void)ports, (void)signals, (void)t, (void)h;
    return true;
}

static int verify_nothing(void *component, const Ports *ports, const double *signals, double t, double h, bool done)
{
    (void)component, (void)ports, (void)signals, (void)t, (void)h, (void)done;
    return 0;
}

EXPORT const Direct *engine_inert(void);

EXPORT const Direct *engine_inert(void)
{
    static const Direct inert = {
        .version = DIRECT_VERSION,
        .set = set_nothing,
        .step = step_nothing,
        .get = get_nothing,
        .turn = turn_nothing,
        .verify = verify_nothing,
    };
    return &inert;
}

#endif
