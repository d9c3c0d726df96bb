/* An actuator between controller and plant: a pure delay, a limit of the force, and a first-order lag, in this order.

   The usual model of a current loop with its computing delay and current limit; e.g. Ellis: Control System Design
   Guide, 4th ed., Elsevier 2012.

       w(t) = clip(u(t - delay), F_min, F_max)
       tau dF_lag/dt = w - F_lag
       F = F_lag,   F = w if tau = 0

   The start values delay = 0 and tau = 0 leave these parts out, and the limits can be put out of reach. Before the run
   u was F_lag, of which the start value can be set: the delay is filled with it.

   The step is exact for a u that is held or linear in time: every change of u comes out of the delay at its own
   time, also within a step, and w reaches its limits at the time where it does. A change that comes out at a
   communication point shows in F after it: as masters hand over what F is at the end of a step, a delay of n steps
   is then n steps more than none. What is on its way is kept in a ring of 1024 changes of u, a part of the FMU
   state; a u that goes on as it was (held, or at the same rate) is no change. `command` is w, what an observer of
   disturbances should be given in place of u.

   Use it to see what a loop of friction compensation loses to a real drive: lag and delay rob the feedforward of its
   timing, and the limit winds up integrals.

   Limits: no limit on the rate of the force, no resonance of the current loop, the same lag up and down. F depends on u
   at once if tau = 0 and delay = 0. If more than 1024 changes are on their way the oldest are lost, and the delay is
   shorter than asked for; a warning says so. A change comes out to within 1e-12 of the time and the delay. */

#define MODEL    Actuator
#define SUMMARY  "Delay, force limit and first-order lag of a drive"
#define SOURCE   "Ellis: Control System Design Guide, 4th ed., 2012"
#define PORTRAIT "saturation"
#define QUOTES   "loop_poles, break_away"

/* clang-format off */
#define VARIABLES                                                                                       \
    INPUT    (u,         FORCE, 0.0,              "force that is asked for")                            \
    OUTPUT   (F,         FORCE,                   "force of the actuator")                              \
    OUTPUT   (command,   FORCE,                   "what the lag follows: u after delay and limits")     \
    STATE    (F_lag,     FORCE, 0.0,    1.0,      "force of the lag; at the start also what u was before") \
    FLAG     (limited,                            "u after the delay is beyond a limit")                \
    PARAMETER(F_min,     FORCE, -100.0, -INF,INF, "lower limit, not above F_max")                       \
    PARAMETER(F_max,     FORCE, 100.0,  -INF,INF, "upper limit")                                        \
    PARAMETER(tau,       TIME,  0.0,    0.0, INF, "time constant of the lag; 0: none")                  \
    FIXED    (delay,     TIME,  0.0,    0.0, INF, "time that u takes to have an effect; 0: none")

#define IN_LOOP         \
    DRIVE(F_min, F_max) \
    LAG  (tau)          \
    DELAY(delay)
/* clang-format on */

#define STEPS_BY step
#define WARNING  "more than 1024 changes of u are on their way, so that the delay is shorter than asked for"
#define MEMORY   struct history
#define VALID_BY is_history

#include <stdbool.h>
#include <stdint.h>

/* A value of u that is linear in time, from `begin` on. */
struct piece {
    double begin, u, rate;
};

enum { LONGEST = 1024 };

/* What u was: piece i is at i modulo LONGEST, and `before` is what it was before the first of them. */
struct history {
    int64_t oldest, end; /* pieces oldest ... end - 1 are kept */
    double before;
    struct piece pieces[LONGEST];
};

#include "block.h"
#include "search.h"

static bool is_history(const Model *m)
{
    const struct history *const past = &m->memory;
    const int64_t most = INT64_C(1) << 53;
    if (past->oldest < 0 || past->oldest > most || past->end < 0 || past->end > most || !isfinite(past->before))
        return false;
    const int64_t kept = past->end - past->oldest; /* cannot overflow, now that both are known */
    if (kept > LONGEST || kept < (past->end > 0))
        return false;
    for (int64_t i = past->oldest; i < past->end; i++)
        if (!all_finite(&past->pieces[i % LONGEST].begin, 1))
            return false;
    return true;
}

/* w from now on, for `length` at most. */
typedef struct {
    double u, rate, length;
} Line;

/* How far apart two times may be that are meant to be the same [s]. */
static double rounding(const Model *m, double t) { return 1e-12 * (fabs(t) + m->delay); }

static const struct piece *piece_of(const Model *m, int64_t i) { return &m->memory.pieces[i % LONGEST]; }

static double begin_of(const void *m, int64_t i) { return piece_of((const Model *)m, i)->begin; }

/* u at a time t in the past: right before it (side = -1) or from it on (side = 1), also if rounding misses a change. */
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

/* Pieces that nothing will ask for again: the next one has come out, too. */
static void forget(Model *m, double t)
{
    struct history *const past = &m->memory;
    while (past->end - past->oldest > 1 && piece_of(m, past->oldest + 1)->begin < t)
        past->oldest++;
}

static void equations(Model *m)
{
    GIVEN(m)
    /* a change that comes out at this very time belongs to the step that follows, as a new u does without delay */
    const double wanted = delay > 0.0 ? past(m, m->time - delay, -1.0).u : u;
    m->command = clip(wanted, F_min, F_max);
    m->limited = wanted < F_min || wanted > F_max ? 1.0 : 0.0;
    m->der_F_lag = tau > 0.0 ? (m->command - F_lag) / tau : 0.0;
    m->F = tau > 0.0 ? F_lag : m->command;
}

/* The lag over a time in which w = u + rate s. */
static double follow(double F, double tau, double u, double rate, double h)
{
    return u + rate * h + relax(F - u, -rate * tau, h / tau);
}

/* The lag over a line, cut where that passes the limits. */
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
        /* a piece may be shorter than the rounding of s */
        s = last ? h : fmax(s + w.length, nextafter(s, h));
    }
    m->F_lag = F;
    if (m->delay > 0.0)
        forget(m, m->time + h - m->delay - 2.0 * rounding(m, m->time + h));
    return true;
}
