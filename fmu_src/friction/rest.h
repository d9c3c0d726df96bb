/* Rest in the models that jump at v = 0, for model exchange: rest begins where v reaches 0, as exactly as the solver
   locates it, and ends where v has changed by a speed that no drive resolves. Friction at rest balances F_ext from
   `low` to `high`, which the block defines. Included after block.h. */

#ifndef REST_H
#define REST_H

#include "load.h"
#include "until_change.h"

#define REST    1e-10 /* change of the velocity that ends rest [m/s] or [rad/s] */
#define ARRIVAL 1e-8  /* largest velocity at which rest begins */

static void range(const Model *m, double *low, double *high);

static bool is_rest(const Model *m)
{
    return is_direction(m->memory.direction) && is_count(m->memory.stuck, 1.0) && isfinite(m->memory.at);
}

/* Return the direction of motion, 0 at rest. */
static inline double direction_of(const Model *m) { return m->run.frozen ? m->memory.direction : sign(m->v); }

static double reserve(const Model *m)
{
    double low, high;
    range(m, &low, &high);
    return fmin(m->F_ext - low, high - m->F_ext);
}

static inline double stuck_at(const Model *m, double direction)
{
    return m->run.frozen ? m->memory.stuck : direction == 0.0 && reserve(m) >= 0.0 ? 1.0 : 0.0;
}

static void indicators(const Model *m, double *left)
{
    const double direction = m->memory.direction;
    left[0] = direction != 0.0 ? direction * m->v : REST - fabs(m->v - m->memory.at);
    left[1] = direction != 0.0 ? 1.0 : until_change(m->memory.stuck, reserve(m), load_of(m->Fn, m->Fn0));
}

static void transition(Model *m)
{
    struct rest *const now = &m->memory;
    const bool arrives = now->direction != 0.0 && now->direction * m->v <= 0.0 && fabs(m->v) <= ARRIVAL;
    const bool starts = now->direction == 0.0 && fabs(m->v - now->at) >= REST && m->v != 0.0;
    if (arrives || (now->direction == 0.0 && m->v == 0.0)) {
        now->direction = 0.0;
        now->at = m->v;
    } else if (starts || now->direction * m->v <= -ARRIVAL)
        now->direction = sign(m->v);
    now->stuck = now->direction == 0.0 && reserve(m) >= 0.0 ? 1.0 : 0.0;
}

#endif
