/* Inputs that move during a step, as straight lines: what an implicit master and extrapolation hand over. */

#ifndef LINE_H
#define LINE_H

#include "part.h"

/* A Real input whose source is a continuous part; over the step it has this mean value and this value at the end. */
struct line {
    int64_t input;
    double mean, end;
};

/* Hands the lines of a part over and steps it. A part that does not interpolate gets the means, and for its direct
   outputs then the values at the end. */
static int step_on_lines(Engine *e, int64_t index, double t, double h)
{
    EnginePart *const p = &e->parts[index];
    const Line *const first = e->lines + e->lines_from[index], *const last = e->lines + e->lines_from[index + 1];
    const int64_t reals = p->inputs[REAL];
    const bool interpolates = p->set_slopes != NULL && first < last;

    if (interpolates)
        memset(p->slopes, 0, (size_t)count_of(p->inputs, REAL) * sizeof(double));
    for (const Line *l = first; l < last; l++) {
        e->signals[l->input] = interpolates ? 2.0 * l->mean - l->end : l->mean;
        if (interpolates)
            p->slopes[l->input - reals] = 2.0 * (l->end - l->mean) / h;
    }
    int status = hand_over(p, e->signals);
    if (status <= 1 && interpolates)
        status =
            p->set_slopes(p->component, p->input_references, (size_t)count_of(p->inputs, REAL), p->orders, p->slopes);
    if (status <= 1)
        status = step_part(p, t, h);
    for (const Line *l = first; l < last; l++)
        e->signals[l->input] = l->end;
    if (status <= 1 && first < last && !interpolates)
        status = hand_over(p, e->signals);
    return status;
}

#endif
