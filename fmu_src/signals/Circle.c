/* Circle of two axes at constant feed, with smooth start and stop: the usual contouring test. At each end of a
   quadrant, one axis reverses, and friction causes a glitch.

   The test follows ISO 230-4 (circular tests for numerically controlled machine tools). The speed starts with a
   polynomial of fifth order, whose first two derivatives are zero at its ends, as in Biagiotti, Melchiorri: Trajectory
   Planning for Automatic Machines and Robots, Springer 2008.

       angle = start_angle + direction p / radius, direction 1, or -1 if clockwise
       x = x_centre + radius cos(angle),   y = y_centre + radius sin(angle)
       dp/dt = V b(s / T),   b(u) = 10 u^3 - 15 u^4 + 6 u^5
       T = t_ramp, s = time since t_start

   p is the path length. The acceleration phase takes the time T and the path V T / 2; the deceleration phase is its
   mirror image. In between, the speed is V = feed, such that the total path has the length of `turns` circles, L = 2 pi
   radius turns; if L is shorter than feed T, the peak speed is V = L / T. The motion takes L / V + T and ends at p = L.
   With turns = 0, it never stops.

   x, y and their first two derivatives are continuous, so that position, speed and force of the axes do not jump if the
   axes begin at rest at the initial x, y (set these initial positions in the plants). The centripetal acceleration is
   feed^2 / radius.

   Use it for quadrant glitches: each axis passes zero velocity twice per turn, with the acceleration feed^2 / radius,
   while the other axis moves at the feed. `reversals` counts these events; for polar plots over `angle`, t_start and
   turns select whole turns.

   Limits: with t_ramp = 0, the speed jumps at the ends, where the derivatives have the values after the jump. If a
   parameter changes during a motion, the whole motion is replanned, and x and y may jump. At late times, the angle
   contains a rounding error of 1e-16 feed t / radius. */

#define MODEL   Circle
#define SUMMARY "Circle of two axes at constant feed with smooth start and stop"
#define SOURCE  "ISO 230-4; Biagiotti, Melchiorri: Trajectory Planning for Automatic Machines and Robots, 2008"
#define CITES   "ISO2304, BiagiottiMelchiorri2008"

/* clang-format off */
#define VARIABLES                                                                                            \
    OUTPUT   (x,           LENGTH,              "position of the first axis")                                \
    OUTPUT   (xd,          VELOCITY,            "velocity of the first axis")                                \
    OUTPUT   (xdd,         ACCELERATION,        "acceleration of the first axis")                            \
    OUTPUT   (y,           LENGTH,              "position of the second axis")                               \
    OUTPUT   (yd,          VELOCITY,            "velocity of the second axis")                               \
    OUTPUT   (ydd,         ACCELERATION,        "acceleration of the second axis")                           \
    OUTPUT   (angle,       ANGLE,               "angle on the circle, continuous over all turns")            \
    TALLY    (reversals,                        "ends of quadrants passed since the start")                  \
    PARAMETER(radius,      LENGTH,   0.01,      1e-12, INF, "radius of the circle")                          \
    PARAMETER(feed,        VELOCITY, 0.01,      1e-12, INF, "speed along the path")                          \
    PARAMETER(turns,       NO_UNIT,  0.0,       0.0,   INF, "number of turns; 0: unlimited")                 \
    PARAMETER(start_angle, ANGLE,    0.0,       -INF,  INF, "angle at which the motion begins")              \
    SWITCH   (clockwise,   0,                               "clockwise rotation, from y to x")               \
    PARAMETER(t_start,     TIME,     0.0,       -INF,  INF, "time at which the motion begins")               \
    PARAMETER(t_ramp,      TIME,     0.2,       0.0,   INF, "duration of the acceleration and deceleration phases") \
    PARAMETER(x_centre,    LENGTH,   0.0,       -INF,  INF, "centre of the circle, first axis")              \
    PARAMETER(y_centre,    LENGTH,   0.0,       -INF,  INF, "centre of the circle, second axis")
/* clang-format on */

#define EVENTS     1
#define DECIDES_BY transition
#define MEMORY     struct passed
#define VALID_BY   is_passed
#define KEEPS_BY   keep_decisions

#include <stdbool.h>

struct passed {
    double reversals; /* in model exchange */
};

#include "block.h"
#include "constants.h"

typedef struct {
    double p, v, a; /* path and its derivatives */
} Motion;

/* Return the motion s seconds after the start of the acceleration to V within T. */
static Motion ramp(double V, double T, double s)
{
    const double u = s / T;
    return (Motion){
        V * T * u * u * u * u * (2.5 - u * (3.0 - u)),
        V * u * u * u * (10.0 - u * (15.0 - 6.0 * u)),
        V / T * 30.0 * square(u * (1.0 - u)),
    };
}

/* Return the motion along the path s seconds after the start. */
static Motion along(double V, double T, double L, double s)
{
    const double end = L / V + T;
    if (s < 0.0)
        return (Motion){0.0, 0.0, 0.0};
    if (s >= end)
        return (Motion){L, 0.0, 0.0};
    if (s < T)
        return ramp(V, T, s);
    if (s <= end - T)
        return (Motion){V * (s - 0.5 * T), V, 0.0};
    const Motion left = ramp(V, T, end - s);
    return (Motion){L - left.p, left.v, -left.a};
}

/* Return the quadrant of an angle, 0 for the first one. */
static double quadrant(double a) { return floor(a / HALF_PI); }

static void equations(Model *m)
{
    GIVEN(m)
    const double L = turns > 0.0 ? TWO_PI * radius * turns : INF;
    const double V = t_ramp > 0.0 ? fmin(feed, L / t_ramp) : feed;
    const Motion now = along(V, t_ramp, L, m->time - t_start);
    const double direction = clockwise ? -1.0 : 1.0;
    const double turned = direction * now.p / radius, rate = direction * now.v / radius,
                 rate_dot = direction * now.a / radius;

    m->angle = start_angle + turned;
    const double c = cos(m->angle), s = sin(m->angle);
    m->x = x_centre + radius * c;
    m->y = y_centre + radius * s;
    m->xd = -radius * s * rate;
    m->yd = radius * c * rate;
    m->xdd = -radius * (s * rate_dot + c * rate * rate);
    m->ydd = radius * (c * rate_dot - s * rate * rate);
    const double passed = quadrant(direction * m->angle) - quadrant(direction * start_angle);
    m->reversals = m->run.frozen ? m->memory.reversals : fmin(passed, COUNTS);
}

static bool is_passed(const Model *m) { return is_count(m->memory.reversals, COUNTS); }

/* Return the quadrants passed at the angle of the last evaluation. */
static double place(const Model *m)
{
    const double direction = m->clockwise != 0.0 ? -1.0 : 1.0;
    return direction * m->angle / HALF_PI - quadrant(direction * m->start_angle);
}

static void indicators(const Model *m, double *left) { left[0] = m->memory.reversals + 1.0 - place(m); }

static void transition(Model *m)
{
    equations(m);
    m->memory.reversals = fmin(floor(place(m)), COUNTS);
}
