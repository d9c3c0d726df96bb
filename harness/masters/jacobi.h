/* Jacobi with extrapolated inputs. All parts are stepped at once. Each input follows the polynomial through the last
   values of its source. As parts accept no higher derivatives, the polynomial is replaced by a line with the same mean
   (as in the Adams-Bashforth methods) and the same end value. */

#ifndef EXTRAPOLATE_H
#define EXTRAPOLATE_H

#include "line.h"

typedef struct {
    int64_t order;  /* 1 or 2 */
    int64_t known;  /* number of earlier values available */
    double *before; /* source of each line one tick ago and two ticks ago */
    double *earlier;
} Extrapolation;

static void extrapolate(Engine *e, Extrapolation *x)
{
    const int64_t order = x->known < x->order ? x->known : x->order;
    for (int64_t k = 0; k < e->lines_from[e->part_count]; k++) {
        Line *const l = &e->lines[k];
        const double y0 = e->signals[e->sources[l->input]], y1 = x->before[k], y2 = x->earlier[k];
        double mean = y0, end = y0;
        if (order == 1) {
            mean = 1.5 * y0 - 0.5 * y1;
            end = 2.0 * y0 - y1;
        } else if (order == 2) {
            mean = (23.0 * y0 - 16.0 * y1 + 5.0 * y2) / 12.0;
            end = 3.0 * (y0 - y1) + y2;
        }
        l->mean = carried(e, l->input, mean);
        l->end = carried(e, l->input, end);
        x->earlier[k] = y1;
        x->before[k] = y0;
    }
    x->known++;
}

EXPORT bool extrapolated_tick(Engine *e, int64_t tick);

EXPORT bool extrapolated_tick(Engine *e, int64_t tick)
{
    extrapolate(e, e->algorithm);
    for (int64_t index = 0; index < e->part_count; index++) {
        EnginePart *const p = &e->parts[index];
        if (!is_due(e, p, tick))
            continue;
        fetch_inputs(e, p);
        double t = 0.0, h = 0.0;
        interval_of(e, p, tick, &t, &h);
        const int status = step_on_lines(e, index, t, h);
        if (status > 1)
            return failed(e, index, STEP, status, t);
    }
    for (int64_t index = 0; index < e->part_count; index++) {
        EnginePart *const p = &e->parts[index];
        const int status = is_due(e, p, tick) ? fetch_outputs(p, e->signals) : 0;
        if (status > 1)
            return failed(e, index, GET, status, time_of(e, tick));
    }
    return true;
}

MIRRORED(Extrapolation)

#endif
