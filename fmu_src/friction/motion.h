/* A step at constant or linear velocity without a change of sign, for models that integrate a differential equation
   over it. Included after block.h; the block uses `step` and defines `follow_motion`. */

#ifndef MOTION_H
#define MOTION_H

#include "constants.h"

/* The velocity v + slope s from s = start to end. */
typedef struct {
    double v, slope, start, end;
} Motion;

static bool follow_motion(Model *m, Motion motion);

/* Before a stop, time counts backwards from it: floating-point numbers are densest around 0, where the Stribeck curve
   may be steep. */
static bool step(Model *m, double h)
{
    const double v = m->v, slope = SLOPE(v);
    const bool stops = v * slope < 0.0 && fabs(v + slope * h) <= 4.0 * DBL_EPSILON * fabs(v);
    if (!stops)
        return follow_motion(m, (Motion){v, slope, 0.0, h});
    return follow_motion(m, (Motion){v, slope, 0.0, 0.5 * h}) && follow_motion(m, (Motion){0.0, slope, -0.5 * h, 0.0});
}

static inline double velocity(const Motion *motion, double s) { return motion->v + motion->slope * s; }

#endif
