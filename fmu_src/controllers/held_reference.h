/* Shared code of feedforward blocks that step a friction law along a sampled reference. Included after block.h and
   before the header of the law: its v is the velocity of the reference, constant between two samples. */

#ifndef HELD_REFERENCE_H
#define HELD_REFERENCE_H

#include "constants.h"

#undef SLOPE
#define SLOPE(name) 0.0
static inline bool inputs_held(const Model *m)
{
    (void)m;
    return true;
}

static bool step(Model *m, double h);
static void equations(Model *m);

/* Step the law over the displacement of the reference since the previous sample, then compute its force at the velocity
   rd. `forget` resets its states and memory. A law whose values are not `known` is not stepped, as it would take long
   to find that it has no solution. */
static void follow_reference(Model *m, void (*forget)(Model *), bool known)
{
    GIVEN(m)
    bool solved = true;
    if (reset || !enable || started == 0.0) {
        forget(m);
    } else {
        const double span = (missed + 1.0) * Ts;
        m->v = (r - last) / span;
        solved = known && isfinite(m->v) && step(m, span);
    }
    m->v = enable ? rd : 0.0;
    equations(m);
    if (!solved)
        m->F = NAN; /* the FMU rejects the step */
    m->last = enable ? r : 0.0;
    m->started = enable ? 1.0 : 0.0;
    m->missed = 0.0;
}

/* Compute the outputs from the friction force F. */
static void feed_forward(Model *m)
{
    GIVEN(m)
    const double wanted = mass * rdd + gain * m->F;
    m->F_hat = enable ? m->F : 0.0;
    m->u = enable ? clip(wanted, u_min, u_max) : 0.0;
    m->u_sat = !enable ? 0.0 : wanted < u_min ? -1.0 : wanted > u_max ? 1.0 : 0.0;
    m->z_hat = m->z;
}

/* In place of a sample with an invalid input: count it; a disabled block is at rest. */
static void miss_reference(Model *m, void (*forget)(Model *))
{
    const double load = m->Fn;

    m->missed += 1.0;
    if (m->enable != 0.0)
        return;
    m->Fn = m->Fn0; /* Fn may be the invalid input */
    follow_reference(m, forget, true);
    feed_forward(m);
    m->Fn = load;
}

#endif
