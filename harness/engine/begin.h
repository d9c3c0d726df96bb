/* The values of the implicit master before its first step. */

#ifndef BEGIN_H
#define BEGIN_H

#include "newton_data.h"

/* Begin a run at the values of the signals; the guards, the kept copies and the work space are zero. */
EXPORT void newton_begin(const Engine *e, Newton *newton);

EXPORT void newton_begin(const Engine *e, Newton *newton)
{
    const int64_t most = newton->most_unknowns;
    const Group none = {0}, *const last = newton->group_count > 0 ? &newton->groups[newton->group_count - 1] : &none;
    for (int64_t k = 0; k < e->lines_from[e->part_count]; k++) {
        Moving *const m = &newton->moving[k];
        const int64_t input = e->lines[k].input;
        const double value = arriving(e, input);
        m->from_rest = value == 0.0;
        m->u0 = m->q0 = m->u1 = m->q1 = value;
        m->scale = m->size = m->at_begin = m->outside = fabs(value);
        m->lasting = 0.0;
        m->noise = m->accumulated_error = m->path = m->distance_error = m->x0 = m->strayed = 0.0;
        m->role = m->rests = m->force = m->rigid = m->partial = m->leaves = 0;
        m->gain = e->gains ? e->gains[input] : 1.0;
        m->offset = e->gains ? e->offsets[input] : 0.0;
    }
    for (const Contact *c = newton->contacts; c < newton->contacts + last->contact + last->contacts; c++)
        if (c->position >= 0)
            newton->moving[c->line].x0 = e->signals[c->position];
    for (int64_t j = 0; j < last->unknown + last->unknowns; j++) {
        newton->w[j] = newton->w_last[j] = e->signals[newton->unknowns[j]];
        newton->scale[j] = newton->at_begin[j] = fabs(newton->w[j]);
        newton->lasting[j] = 0.0;
        newton->trend[j] = newton->prediction_error[j] = newton->growth[j] = 0.0;
    }
    for (int64_t k = 0; k < last->held + last->held_count; k++) {
        newton->held_values[k] = arriving(e, newton->held[k]);
        newton->held_sizes[k] = fabs(newton->held_values[k]);
    }
    for (int64_t i = 0; i < last->state + last->states; i++)
        newton->state_sizes[i] = fabs(e->signals[newton->states[i].output]);
    for (int64_t g = 0; g < newton->group_count; g++) {
        for (int64_t i = 0; i < most * most; i++)
            newton->inverse[g * most * most + i] = i % (most + 1) == 0 ? -1.0 : 0.0;
        newton->proposed[g] = newton->before[g] = 0.0;
    }
}

#endif
