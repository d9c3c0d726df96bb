/* Rest in the models that jump at v = 0, for model exchange: rest begins where v reaches 0, as exactly as the solver
   locates it, and ends where v has changed by a speed that no drive resolves, or at once beyond static friction. If
   F_ext is beyond static friction when v reaches 0, motion is reversed in one event.
   Friction at rest balances F_ext from `low` to `high`, which the block defines. Included after block.h. */

#ifndef REST_H
#define REST_H

#include "load.h"
#include "until_change.h"

/* [m/s] or [rad/s] */
#define HELD    1e-10 /* change of the velocity that ends rest while friction balances F_ext */
#define FREE    1e-18 /* the same beyond static friction */
#define ARRIVAL 1e-8  /* largest velocity at which rest begins */

static void range(const Model *m, double *low, double *high);

/* A mass whose sliding friction exceeds static friction is also held by it: there is no motion in between. */
static inline double held_by(const Model *m, double Fs, double Fc) { return m->run.frozen ? fmax(Fs, Fc) : Fs; }

static bool is_rest(const Model *m)
{
    return is_direction(m->memory.direction) && is_count(m->memory.stuck, 1.0) && fabs(m->memory.at) <= 2.0 * ARRIVAL;
}

/* Return the direction of motion, 0 at rest. */
static inline double direction_of(const Model *m) { return m->run.frozen ? m->memory.direction : sign(m->v); }

static double margin(const Model *m)
{
    double low, high;
    range(m, &low, &high);
    return fmin(m->F_ext - low, high - m->F_ext);
}

/* Compute the results at rest. */
static void at_rest(Model *m)
{
    double low, high;
    range(m, &low, &high);
    m->F = clip(m->F_ext, low, high);
    m->stuck = m->run.frozen ? m->memory.stuck : m->F == m->F_ext ? 1.0 : 0.0;
}

/* Compute the results in motion. */
static inline void sliding(Model *m, double friction)
{
    m->F = friction;
    m->stuck = 0.0;
}

static double until_moving(const Model *m)
{
    return (m->memory.stuck != 0.0 ? HELD : FREE) - fabs(m->v - m->memory.at);
}

static void indicators(const Model *m, double *left)
{
    const double direction = m->memory.direction;
    left[0] = direction != 0.0 ? direction * m->v : until_moving(m);
    left[1] = direction != 0.0 ? 1.0 : until_change(m->memory.stuck, margin(m), load_of(m->Fn, m->Fn0));
}

static void transition(Model *m)
{
    struct rest *const now = &m->memory;
    const double v = m->v;
    if (now->direction == 0.0) {
        if (until_moving(m) <= 0.0 && v != 0.0)
            now->direction = fabs(v) > ARRIVAL ? sign(v) : sign(v - now->at);
    } else if (now->direction * v <= 0.0)
        now->direction = fabs(v) > ARRIVAL || margin(m) < 0.0 ? sign(v) : 0.0;
    now->stuck = now->direction == 0.0 && margin(m) >= 0.0 ? 1.0 : 0.0;
    if (now->direction == 0.0 && (v == 0.0 || until_moving(m) <= 0.0))
        now->at = v;
}

#endif
