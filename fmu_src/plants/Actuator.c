/* Actuator between controller and plant: a pure delay, a force limit and a first-order lag, in this order.

   This is the usual model of a current loop with its computing delay and current limit; see Ellis: Control System
   Design Guide, 4th ed., Elsevier 2012.

       w(t) = clip(u(t - delay), F_min, F_max)
       tau dF_lag/dt = w - F_lag
       F = F_lag,   F = w if tau = 0

   delay = 0 and tau = 0, the start values, disable these parts. Before the run, u is taken as F_lag, whose start value
   can be set.

   The step is exact for constant or linear u: every change of u takes effect after exactly the delay, also within a
   step, and w reaches its limits at the exact time. A change that takes effect at a communication point appears in F in
   the next step; since masters pass the value of F at the end of a step, a delay of n steps then adds exactly n steps.
   Delayed changes of u are stored in a ring buffer of 1024 entries, which is part of the FMU state; if u remains
   constant or keeps its rate, this is not a change. `command` is w; connect it to a disturbance observer instead of u.

   Use it to study how a real drive degrades friction compensation: lag and delay shift the feedforward in time, and the
   limit causes integrator windup.

   Limits: no limit on the rate of the force, no resonance of the current loop, the same lag for rising and falling
   force. With tau = 0 and delay = 0, F depends directly on u. If more than 1024 changes occur within the delay, the
   oldest are lost, the delay is shorter than specified, and a warning is logged. Changes take effect to within 1e-12 of
   the time and the delay. */

#define MODEL       Actuator
#define SUMMARY     "Delay, {force} limit and first-order lag of a drive"
#define SOURCE      "Ellis: Control System Design Guide, 4th ed., 2012"
#define CITES       "Ellis2012"
#define NO_EXCHANGE "every change of u would become a time event after the delay"

/* clang-format off */
#define VARIABLES                                                                                                           \
    INPUT    (u,         FORCE, 0.0,              "commanded " FORCE_NOUN)                                                  \
    OUTPUT   (F,         FORCE,                   FORCE_NOUN " of the actuator")                                            \
    OUTPUT   (command,   FORCE,                   "u after delay and limits, the input of the lag")                         \
    STATE    (F_lag,     FORCE, 0.0,    1.0,      FORCE_NOUN " of the lag; initially also the value of u before the start") \
    FLAG     (limited,                            "u after the delay exceeds a limit")                                      \
    PARAMETER(F_min,     FORCE, -100.0, -INF,INF, "lower limit, not above F_max")                                           \
    PARAMETER(F_max,     FORCE, 100.0,  -INF,INF, "upper limit")                                                            \
    PARAMETER(tau,       TIME,  0.0,    0.0, INF, "time constant of the lag; 0: none")                                      \
    FIXED    (delay,     TIME,  0.0,    0.0, INF, "time until u takes effect; 0: none")
/* clang-format on */

#define STEPS_BY step
#define REQUIRES limits_in_order
#define WARNING                                                                                                        \
    "more than 1024 changes of u within the delay; the oldest are lost, and the delay is shorter than specified"
#define MEMORY   struct history
#define VALID_BY is_history

#include <stdbool.h>
#include <stdint.h>

/* A segment of u that is linear in time, from `begin` on. */
struct piece {
    double begin, u, rate;
};

enum { LONGEST = 1024 };

/* The history of u: segment i is at i modulo LONGEST; `before` is the value before the first segment. */
struct history {
    int64_t oldest, end; /* segments oldest ... end - 1 are stored */
    double before;
    struct piece pieces[LONGEST];
};

#include "block.h"
#include "search.h"

static const char *limits_in_order(const Model *m) { return m->F_min <= m->F_max ? NULL : "F_min <= F_max"; }

static bool is_history(const Model *m)
{
    const struct history *const past = &m->memory;
    const int64_t most = INT64_C(1) << 53;
    if (past->oldest < 0 || past->oldest > most || past->end < 0 || past->end > most || !isfinite(past->before))
        return false;
    const int64_t kept = past->end - past->oldest; /* cannot overflow, as both have been checked */
    if (kept > LONGEST || kept < (past->end > 0))
        return false;
    for (int64_t i = past->oldest; i < past->end; i++)
        if (!all_finite(&past->pieces[i % LONGEST].begin, 1))
            return false;
    return true;
}

/* The delayed u from now on, valid for `length` at most. */
typedef struct {
    double u, rate, length;
} Line;

/* Return the largest difference [s] between times that are considered equal. */
static double rounding(const Model *m, double t) { return 1e-12 * (fabs(t) + m->delay); }

static const struct piece *piece_of(const Model *m, int64_t i) { return &m->memory.pieces[i % LONGEST]; }

static double begin_of(const void *m, int64_t i) { return piece_of((const Model *)m, i)->begin; }

/* Return u at a time t in the past: just before it (side = -1) or from it on (side = 1), also if a change misses t by
   rounding. */
static Line past(const Model *m, double t, double side)
{
    const struct history *const past = &m->memory;
    const double at = t + side * rounding(m, t);
    const int64_t begun = last_not_above(begin_of, m, past->oldest - 1, past->end, at), next = begun + 1;
    const double length = next < past->end ? piece_of(m, next)->begin - t : INF;
    if (begun < past->oldest)
        return (Line){past->end > 0 ? past->before : m->F_lag, 0.0, length};
    const struct piece *const now = piece_of(m, begun);
    return (Line){now->u + now->rate * (t - now->begin), now->rate, length};
}

static void remember(Model *m)
{
    struct history *const past = &m->memory;
    const double u = m->u, rate = SLOPE(u), t = m->time;
    if (past->end == 0)
        past->before = m->F_lag;
    else {
        const struct piece *const last = piece_of(m, past->end - 1);
        if (rate == last->rate && u == last->u + rate * (t - last->begin))
            return;
    }
    if (past->end - past->oldest == LONGEST) {
        past->before = piece_of(m, past->oldest)->u;
        past->oldest++;
        m->run.warning = true;
    }
    past->pieces[past->end++ % LONGEST] = (struct piece){t, u, rate};
}

/* Discard the segments that are no longer needed because the next segment has also taken effect. */
static void forget(Model *m, double t)
{
    struct history *const past = &m->memory;
    while (past->end - past->oldest > 1 && piece_of(m, past->oldest + 1)->begin < t)
        past->oldest++;
}

static void equations(Model *m)
{
    GIVEN(m)
    /* a change that takes effect at this time belongs to the next step, like a new u without delay */
    const double wanted = delay > 0.0 ? past(m, m->time - delay, -1.0).u : u;
    m->command = clip(wanted, F_min, F_max);
    m->limited = wanted < F_min || wanted > F_max ? 1.0 : 0.0;
    m->der_F_lag = tau > 0.0 ? (m->command - F_lag) / tau : 0.0;
    m->F = tau > 0.0 ? F_lag : m->command;
}

/* Return the force of the lag after h, during which w = u + rate s. */
static double follow(double F, double tau, double u, double rate, double h)
{
    return u + rate * h + relax(F - u, -rate * tau, tau > 0.0 ? h / tau : INF);
}

/* Return the force of the lag after a line, which is divided where it crosses the limits. */
static double follow_clipped(const Model *m, double F, Line w)
{
    double cuts[] = {0.0, 0.0, 0.0, w.length};
    if (w.rate != 0.0) {
        const double to_min = (m->F_min - w.u) / w.rate, to_max = (m->F_max - w.u) / w.rate;
        cuts[1] = clip(fmin(to_min, to_max), 0.0, w.length);
        cuts[2] = clip(fmax(to_min, to_max), 0.0, w.length);
    }
    for (int i = 0; i < 3; i++) {
        const double begin = cuts[i], h = cuts[i + 1] - begin;
        if (!(h > 0.0))
            continue;
        const double middle = w.u + w.rate * (begin + 0.5 * h);
        if (middle < m->F_min || middle > m->F_max)
            F = follow(F, m->tau, middle < m->F_min ? m->F_min : m->F_max, 0.0, h);
        else
            F = follow(F, m->tau, w.u + w.rate * begin, w.rate, h);
    }
    return F;
}

static bool step(Model *m, double h)
{
    if (m->delay > 0.0)
        remember(m);
    double F = m->F_lag;
    for (double s = 0.0; s < h;) {
        const double t = m->time + s - m->delay;
        Line w = m->delay > 0.0 ? past(m, t, 1.0) : (Line){m->u + SLOPE(u) * s, SLOPE(u), INF};
        const bool last = !(s + w.length < h);
        w.length = last ? h - s : w.length;
        F = follow_clipped(m, F, w);
        /* a segment may be shorter than the rounding of s */
        s = last ? h : fmax(s + w.length, nextafter(s, h));
    }
    m->F_lag = F;
    if (m->delay > 0.0)
        forget(m, m->time + h - m->delay - 2.0 * rounding(m, m->time + h));
    return true;
}
