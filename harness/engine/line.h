/* Inputs that vary linearly during a step, as used by the implicit masters and by extrapolation. */

#ifndef LINE_H
#define LINE_H

#include "part.h"

/* A Real input driven by a continuous part, with its mean value and its end value in the current step. */
struct line {
    int64_t input;
    double mean, end;
};

/* Pass the lines to a part and step it. A part without input interpolation is stepped with the mean values. Inputs that
   do not end at the end values, or not exactly, as where a block divides its step at v = 0, are then set to them for
   the direct outputs. */
static int step_on_lines(Engine *e, int64_t index, double t, double h)
{
    EnginePart *const p = &e->parts[index];
    const Line *const first = e->lines + e->lines_from[index], *const last = e->lines + e->lines_from[index + 1];
    const int64_t reals = p->inputs[REAL];
    const bool interpolates = p->set_slopes != NULL && first < last;
    bool ends = interpolates || first == last; /* at the end values */

    if (interpolates)
        memset(p->slopes, 0, (size_t)count_of(p->inputs, REAL) * sizeof(double));
    for (const Line *l = first; l < last; l++) {
        const double begin = e->signals[l->input] = interpolates ? 2.0 * l->mean - l->end : l->mean;
        if (interpolates) {
            const double slope = p->slopes[l->input - reals] = 2.0 * (l->end - l->mean) / h;
            ends = ends && begin + slope * h == l->end && (begin < 0.0) == (l->end < 0.0);
        }
    }
    int status = interpolates ? move_on_slopes(p, e->signals, t, h) : hand_over(p, e->signals);
    if (status <= 1 && !interpolates)
        status = step_part(p, t, h);
    for (const Line *l = first; l < last; l++)
        e->signals[l->input] = l->end;
    if (status <= 1 && !ends)
        status = hand_over(p, e->signals);
    return status;
}

#endif
