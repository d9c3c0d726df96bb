/* The transition 1 - sgn(r) |r|^n from sticking to sliding in both Leuven models. Included after block.h. */

#ifndef TRANSITION_H
#define TRANSITION_H

#include "motion.h"
#include "stribeck.h"

/* sign(r) |r|^n, limited so that it is finite. */
static inline double signed_power(double r, double n)
{
    const double size = fabs(r), power = n == 1.0 ? size : n == 2.0 ? size * size : pow(size, n);
    return copysign(fmin(power, 1e15), r);
}

/* The share of the motion that deflects the contact. Where r has left the piece of the step, `backwards` (r < 0) or
   not, it counts as 0. */
static inline double deflecting(double r, double n, bool backwards)
{
    return 1.0 - signed_power(backwards ? fmin(r, 0.0) : fmax(r, 0.0), n);
}

/* The Stribeck level at the time s of a motion, which is S while the velocity is held. */
static inline double level_along(const Model *m, const Motion *motion, double S, double s)
{
    GIVEN(m)
    return motion->slope == 0.0 ? S : stribeck(velocity(motion, s), Fc, Fs, vs, delta);
}

/* The law 1 - sgn(r) |r|^n is flat at first and then sharp, for large n: up to this r it is 1 to rounding, and from
   there on changes of r that count are of this size. Pieces on either side of that r end a little behind it. */
static inline double flat_until(double n) { return n < 8.0 ? 0.0 : exp(-36.0 / n); }
static inline double sharpness(double n) { return 0.25 * fmin(1.0, 3.0 / n); }
static const double behind_flat = 1e-6;

/* Above this r, which a contact has when its level has jumped down, it takes a path of less than 1e-13 / (n - 1) of
   the elastic deflection to come down to it: no time. */
static inline double falls_to(double n) { return n > 1.0 ? exp(log(1e13) / n) : INF; }

#endif
