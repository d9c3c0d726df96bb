/* Third-order point-to-point motion: from rest at r_start to rest at r_end in the shortest time within limits on
   velocity, acceleration and jerk.

   Lambrechts, Boerlage, Steinbuch: Trajectory planning and feedforward design for electromechanical motion systems,
   Control Engineering Practice 13(2), 2005; the third-order planner. With symmetric limits, the fastest motion is
   symmetric about its middle, with the jerk +j, 0, -j, 0 (constant velocity), -j, 0, +j during

       t_j, t_a, t_j, t_v, t_j, t_a, t_j,    j = j_max

   It reaches the acceleration A and the velocity V, with the acceleration phase ending after the distance P:

       A = j t_j,   V = A (t_j + t_a),   P = V (2 t_j + t_a) / 2

   A move over the distance L uses the longest t_j within the limits, then the longest t_a, and then the remaining t_v:
       t_j = min( (L / 2 j)^(1/3), (v_max / j)^(1/2), a_max / j )
       t_a = min( v_max / A,  sqrt(L / A + t_j^2 / 4) - t_j / 2 ) - t_j
       t_v = L / V - (2 t_j + t_a)

   so that t_v = 0 where v_max is not reached and t_a = 0 where a_max is not. The second half is the first half rotated
   about the middle, r(T - t) = L - r(t); therefore, r ends exactly at r_end.

   With `cyclic`, the move is followed by a pause `dwell`, the move back and another such pause, and this repeats.

   Limits: the jerk jumps between segments (to the value of the next segment), which excites a flexible load. The limits
   are the same for both directions and for acceleration and deceleration. If a parameter changes during a motion, the
   whole motion is replanned, and r may jump. */

#define MODEL   Profile
#define SUMMARY "Point-to-point motion with limited velocity, acceleration and jerk"
#define SOURCE  "Lambrechts, Boerlage, Steinbuch, Control Engineering Practice 13(2), 2005"
#define CITES   "Lambrechts2005"

/* clang-format off */
#define VARIABLES                                                                                       \
    OUTPUT   (r,       LENGTH,             "position")                                                  \
    OUTPUT   (rd,      VELOCITY,           "velocity")                                                  \
    OUTPUT   (rdd,     ACCELERATION,       "acceleration")                                              \
    OUTPUT   (rddd,    JERK,               "jerk")                                                      \
    PARAMETER(r_start, LENGTH,       0.0,  -INF, INF, "position before the motion")                     \
    PARAMETER(r_end,   LENGTH,       0.1,  -INF, INF, "position to move to")                            \
    PARAMETER(t_start, TIME,         0.0,  -INF, INF, "time at which the motion begins")                \
    PARAMETER(v_max,   VELOCITY,     0.25, 1e-9, INF, "largest velocity")                               \
    PARAMETER(a_max,   ACCELERATION, 2.5,  1e-9, INF, "largest acceleration")                           \
    PARAMETER(j_max,   JERK,         50.0, 1e-9, INF, "jerk of the segments with nonzero jerk")         \
    SWITCH   (cyclic,  0,                             "repeat the move back and forth")                 \
    PARAMETER(dwell,   TIME,         0.2,  0.0,  INF, "pause at each end of a cyclic motion")
/* clang-format on */

typedef struct {
    double t_j, t_a, t_v; /* [s] constant jerk, acceleration, velocity */
    double T;             /* [s] whole motion */
} Plan;

/* The last plan with what it was made of: its roots would take a third of the time of a step. */
typedef struct {
    double L, v_max, a_max, j_max;
    Plan plan;
} Planned;

#define CACHE Planned

#include "block.h"

typedef struct {
    double p, v, a, j; /* distance and its derivatives */
} Motion;

static Plan plan(double L, double v_max, double a_max, double j)
{
    const double t_j = fmin(cbrt(L / (2.0 * j)), fmin(sqrt(v_max / j), a_max / j));
    if (t_j == 0.0)
        return (Plan){0.0, 0.0, 0.0, 0.0};
    const double A = j * t_j;
    const double t_a = fmax(fmin(v_max / A, sqrt(L / A + square(0.5 * t_j)) - 0.5 * t_j) - t_j, 0.0);
    const double t_v = fmax(L / (A * (t_j + t_a)) - (2.0 * t_j + t_a), 0.0);
    return (Plan){t_j, t_a, t_v, 4.0 * t_j + 2.0 * t_a + t_v};
}

/* Return the motion after s seconds, 0 <= s <= T / 2. */
static Motion first_half(Plan by, double L, double j, double s)
{
    const double t_j = by.t_j, t_a = by.t_a;
    const double A = j * t_j, V = A * (t_j + t_a), P = V * (t_j + 0.5 * t_a);

    /* increasing acceleration */
    if (s < t_j)
        return (Motion){j * s * s * s / 6.0, j * s * s / 2.0, j * s, j};

    /* constant acceleration; u is the time since its beginning */
    if (s < t_j + t_a) {
        const double u = s - t_j, v = A * t_j / 2.0;
        return (Motion){A * t_j * t_j / 6.0 + v * u + A * u * u / 2.0, v + A * u, A, 0.0};
    }
    /* decreasing acceleration; u is the time until it is zero */
    if (s < 2.0 * t_j + t_a) {
        const double u = 2.0 * t_j + t_a - s;
        return (Motion){P - V * u + j * u * u * u / 6.0, V - j * u * u / 2.0, j * u, -j};
    }
    /* constant velocity */
    return (Motion){L / 2.0 - V * (by.T / 2.0 - s), V, 0.0, 0.0};
}

/* Return the plan of these parameters. */
static Plan planned(Model *m, double L)
{
    GIVEN(m)
    Planned *const last = &m->cache;
    if (last->L != L || last->v_max != v_max || last->a_max != a_max || last->j_max != j_max)
        *last = (Planned){L, v_max, a_max, j_max, plan(L, v_max, a_max, j_max)};
    return last->plan;
}

static void equations(Model *m)
{
    GIVEN(m)
    double from = r_start, to = r_end, s = m->time - t_start;
    const double L = fabs(to - from);
    const Plan by = planned(m, L);

    /* the position in the cycle */
    const double leg = by.T + dwell;
    if (cyclic && s > 0.0 && leg > 0.0) {
        s = fmod(s, 2.0 * leg);
        if (s >= leg) {
            s -= leg;
            from = r_end;
            to = r_start;
        }
    }
    /* at rest */
    m->r = s < 0.0 ? from : to;
    m->rd = m->rdd = m->rddd = 0.0;
    if (s < 0.0 || s >= by.T)
        return;

    /* in motion: the second half is the first half backwards */
    const double direction = sign(to - from);
    const bool late = s > 0.5 * by.T;
    const Motion now = first_half(by, L, j_max, late ? by.T - s : s);
    m->r = late ? to - direction * now.p : from + direction * now.p;
    m->rd = direction * now.v;
    m->rdd = late ? -direction * now.a : direction * now.a;
    m->rddd = direction * now.j;
}
