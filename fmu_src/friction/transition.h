/* The transition 1 - sgn(r) |r|^n from sticking to sliding in both Leuven models, and their step at constant or linear
   velocity without a change of sign. Included after block.h; the block uses `step` and defines `follow_motion`. */

#ifndef TRANSITION_H
#define TRANSITION_H

#include "constants.h"
#include "stribeck.h"

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

/* Return sign(r) |r|^n, limited to finite values. */
static inline double signed_power(double r, double n)
{
    const double size = fabs(r), power = n == 1.0 ? size : n == 2.0 ? size * size : pow(size, n);
    return copysign(fmin(power, 1e15), r);
}

/* Return the fraction of the motion that deflects the contact. If r has left the part of the step, `backwards` (r < 0)
   or not, r is taken as 0. */
static inline double deflecting(double r, double n, bool backwards)
{
    return 1.0 - signed_power(backwards ? fmin(r, 0.0) : fmax(r, 0.0), n);
}

/* Return the Stribeck level at the time s of a motion, which is S at constant velocity. */
static inline double level_along(const Model *m, const Motion *motion, double S, double s)
{
    GIVEN(m)
    return motion->slope == 0.0 ? S : stribeck(velocity(motion, s), Fc, Fs, vs, delta);
}

/* For large n, 1 - sgn(r) |r|^n is first flat and then steep. Return the r up to which it is 1 within rounding; beyond,
   relevant changes of r have this magnitude. Parts of a step on both sides of this r end slightly beyond it. */
static inline double flat_until(double n) { return n < 8.0 ? 0.0 : exp(-36.0 / n); }
static inline double sharpness(double n) { return 0.25 * fmin(1.0, 3.0 / n); }
static const double behind_flat = 1e-6;

/* Return the r to which a larger r, after a drop of the level, decreases within a path of less than 1e-13 / (n - 1) of
   the elastic deflection, that is, instantaneously. */
static inline double falls_to(double n) { return n > 1.0 ? exp(log(1e13) / n) : INF; }

#endif
