/* Motion at a speed that changes linearly with time. */

#ifndef RAMP_H
#define RAMP_H

#include <math.h>

/* Return the path after t seconds, from the speed v with the acceleration a. */
static inline double path_after(double v, double a, double t) { return t * (v + 0.5 * a * t); }

/* Return the path after t seconds with the initial speed v, initial acceleration a and constant jerk. */
static inline double path_with_jerk(double v, double a, double jerk, double t)
{
    return t * (v + t * (a / 2.0 + t * jerk / 6.0));
}

/* Return the square of the speed after a path; it is negative if the motion reverses before. */
static inline double squared_speed_after(double path, double v, double a) { return v * v + 2.0 * a * path; }

/* Return the duration of a path between two speeds: the path over their mean. */
static inline double time_between(double path, double v, double v_end) { return 2.0 * path / (v + v_end); }

#endif
