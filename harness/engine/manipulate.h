/* Manipulation of connections: each connection passes gain * output + offset, and manipulators change both numbers from
   tick to tick. For a lost or delayed value, the gain is 0 and the offset is the older value, so that a part that is
   rolled back and stepped again gets the same input. */

#ifndef MANIPULATE_H
#define MANIPULATE_H

#include "part.h"

enum { OVERRIDE, BIAS, NOISE, LOSS, DELAY };

struct manipulator {
    int64_t kind, input;
    int64_t first, last;   /* active at the ticks first, ..., last - 1 */
    double value;          /* constant, bias, standard deviation or probability of a loss */
    const double *samples; /* noise or losses, one for each of these ticks; NULL: all values are lost */
    double *past;          /* values of the output at the start of the last `length` ticks */
    int64_t length;
    int64_t fresh;        /* losses: the output is up to date when it is passed, as its part is stepped first */
    int64_t every, phase; /* of the receiving part */
    double gain, offset;  /* losses: at the last value that the part fetched */
    double held;          /* losses: the last value that arrived */
    int64_t lost;
};

static inline bool asks(const Manipulator *m, int64_t tick) { return m->every == 1 || tick % m->every == m->phase; }

static void lose(Manipulator *m, bool active, int64_t tick, double output, double *gain, double *offset)
{
    if (!m->lost && (tick == 0 || asks(m, tick - 1)))
        m->held = map_of(m->gain, m->offset, m->fresh ? output : m->past[0]);
    m->past[0] = output;
    if (asks(m, tick)) {
        m->lost = active && (m->samples == NULL || m->samples[tick - m->first] < m->value);
        m->gain = *gain;
        m->offset = *offset;
    }
    if (m->lost) {
        *gain = 0.0;
        *offset = m->held;
    }
}

/* Set gains and offsets for a tick. */
static void manipulate(Engine *e, int64_t tick)
{
    Manipulator *const end = e->manipulators + e->manipulator_count;
    for (const Manipulator *m = e->manipulators; m < end; m++) {
        e->gains[m->input] = e->wire_gains[m->input];
        e->offsets[m->input] = e->wire_offsets[m->input];
    }
    for (Manipulator *m = e->manipulators; m < end; m++) {
        const bool active = tick >= m->first && tick < m->last;
        const double output = e->signals[e->sources[m->input]];
        double *const gain = &e->gains[m->input], *const offset = &e->offsets[m->input];
        if (m->kind == LOSS)
            lose(m, active, tick, output, gain, offset);
        if (m->kind == DELAY)
            m->past[tick % m->length] = output;
        if (!active)
            continue;
        if (m->kind == BIAS)
            *offset += m->value;
        if (m->kind == NOISE)
            *offset += m->value * m->samples[tick - m->first];
        if (m->kind == DELAY)
            *offset = map_of(*gain, *offset, m->past[(tick + 1) % m->length]);
        if (m->kind == OVERRIDE)
            *offset = m->value;
        if (m->kind == DELAY || m->kind == OVERRIDE)
            *gain = 0.0;
    }
}

#endif
