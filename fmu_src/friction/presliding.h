/* Shared code of the presliding models. Included after block.h. */

#ifndef PRESLIDING_H
#define PRESLIDING_H

#include "load.h"
#include "ramp.h"

/* Return the bristle damping, which decreases with speed if v_d > 0. Equation (30) of Olsson and others, European
   Journal of Control 4, 1998. */
static inline double fading(double sigma1, double v, double v_d)
{
    return v_d > 0.0 ? sigma1 * exp(-square(v / v_d)) : sigma1;
}

/* Return the signed sliding distance in the next s seconds at constant or linear velocity. */
static inline double slide(const Model *m, double s) { return path_after(m->v, SLOPE(v), s); }

/* Return the time to slide a distance from a speed with the rate of change `growth`; also the time back from the end of
   a slide. */
static inline double time_to_slide(double path, double speed, double growth)
{
    return time_between(path, speed, sqrt(fmax(squared_speed_after(path, speed, growth), 0.0)));
}
static inline double time_back(double path, double speed, double growth) { return time_to_slide(path, speed, -growth); }

/* Return the force of an elastic, perfectly plastic element, limited to W in both directions. */
static inline double limited(double force, double W) { return fabs(force) < W ? force : copysign(W, force); }

#endif
