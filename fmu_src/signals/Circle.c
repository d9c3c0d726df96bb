/* A circle of two axes at constant feed, started and stopped smoothly: the usual test of contouring. At each end of a
   quadrant one axis reverses, and friction draws its glitch there.

   The test is that of ISO 230-4 (circular tests for numerically controlled machine tools); the start is the polynomial
   of fifth order, at rest up to its second derivative, as in Biagiotti, Melchiorri: Trajectory Planning for Automatic
   Machines and Robots, Springer 2008.

       angle = start_angle + way p / radius,   way = 1, or -1 if clockwise
       x = x_centre + radius cos(angle),   y = y_centre + radius sin(angle)
       dp/dt = V b(s / T),   b(u) = 10 u^3 - 15 u^4 + 6 u^5
       T = t_ramp, s = time since t_start

   p is the length of the path. Speeding up takes T and V T / 2 of the path, slowing down is the same backwards. Between
   them the speed is V = feed, for as long as the path of `turns` circles, L = 2 pi radius turns, asks; a path shorter
   than feed T is gone at the peak V = L / T. The motion takes L / V + T and ends on L. turns = 0 never stops.

   x, y and their first two derivatives are continuous, so that position, speed and force of the axes have no jump if
   they begin at rest at x, y of the start (give the plants these initial positions). Centripetal acceleration is
   feed^2 / radius.

   Use it for quadrant glitches: each axis passes zero velocity twice in a turn, at the acceleration feed^2 / radius,
   while the other one runs at the feed. reversals counts them; t_start and turns give whole turns for polar plots over
   `angle`.

   Limits: with t_ramp = 0 the speed jumps at the ends, and derivatives there are those that follow. A parameter changed
   during a motion replaces the whole plan, and x and y may jump. The angle of late times carries the rounding error of
   feed t / radius, 1e-16 of it. */

#define MODEL    Circle
#define SUMMARY  "Circle of two axes at constant feed with smooth start and stop"
#define SOURCE   "ISO 230-4; Biagiotti, Melchiorri: Trajectory Planning for Automatic Machines and Robots, 2008"
#define PORTRAIT "circle"

/* clang-format off */
#define VARIABLES                                                                                            \
    OUTPUT   (x,           LENGTH,              "position of the first axis")                                \
    OUTPUT   (xd,          VELOCITY,            "velocity of the first axis")                                \
    OUTPUT   (xdd,         ACCELERATION,        "acceleration of the first axis")                            \
    OUTPUT   (y,           LENGTH,              "position of the second axis")                               \
    OUTPUT   (yd,          VELOCITY,            "velocity of the second axis")                               \
    OUTPUT   (ydd,         ACCELERATION,        "acceleration of the second axis")                           \
    OUTPUT   (angle,       ANGLE,               "angle on the circle, grows from turn to turn")              \
    TALLY    (reversals,                        "ends of quadrants passed since the start")                  \
    PARAMETER(radius,      LENGTH,   0.01,      1e-12, INF, "radius of the circle")                          \
    PARAMETER(feed,        VELOCITY, 0.01,      1e-12, INF, "speed along the path")                          \
    PARAMETER(turns,       NO_UNIT,  0.0,       0.0,   INF, "number of turns, 0: no end")                    \
    PARAMETER(start_angle, ANGLE,    0.0,       -INF,  INF, "angle where the motion begins")                 \
    SWITCH   (clockwise,   0,                               "turn from y to x")                              \
    PARAMETER(t_start,     TIME,     0.0,       -INF,  INF, "time at which the motion begins")               \
    PARAMETER(t_ramp,      TIME,     0.2,       0.0,   INF, "time to reach the feed, and to stop from it")   \
    PARAMETER(x_centre,    LENGTH,   0.0,       -INF,  INF, "centre, first axis")                            \
    PARAMETER(y_centre,    LENGTH,   0.0,       -INF,  INF, "centre, second axis")
/* clang-format on */

#include "block.h"
#include "constants.h"

typedef struct {
    double p, v, a; /* path and its derivatives */
} Motion;

/* Speeding up to V in T, s seconds after the start. */
static Motion ramp(double V, double T, double s)
{
    const double u = s / T;
    return (Motion){
        V * T * u * u * u * u * (2.5 - u * (3.0 - u)),
        V * u * u * u * (10.0 - u * (15.0 - 6.0 * u)),
        V / T * 30.0 * square(u * (1.0 - u)),
    };
}

/* The way that is gone s seconds after the start. */
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

/* The quadrant in which an angle lies, 0 for the first one. */
static double quadrant(double a) { return floor(a / HALF_PI); }

static void equations(Model *m)
{
    GIVEN(m)
    const double L = turns > 0.0 ? TWO_PI * radius * turns : INF;
    const double V = t_ramp > 0.0 ? fmin(feed, L / t_ramp) : feed;
    const Motion now = along(V, t_ramp, L, m->time - t_start);
    const double way = clockwise ? -1.0 : 1.0;
    const double turned = way * now.p / radius, rate = way * now.v / radius, rate_dot = way * now.a / radius;

    m->angle = start_angle + turned;
    const double c = cos(m->angle), s = sin(m->angle);
    m->x = x_centre + radius * c;
    m->y = y_centre + radius * s;
    m->xd = -radius * s * rate;
    m->yd = radius * c * rate;
    m->xdd = -radius * (s * rate_dot + c * rate * rate);
    m->ydd = radius * (c * rate_dot - s * rate * rate);
    m->reversals = fmin(quadrant(way * m->angle) - quadrant(way * start_angle), COUNTS);
}
