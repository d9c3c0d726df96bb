/* The modified Leuven model as described in ModifiedLeuven.c, for all blocks with its parameters, an input or state v,
   and the results F, Fh, z, der_z, Fi, der_Fi and slipping. Included after block.h. */

#ifndef MODIFIED_LEUVEN_H
#define MODIFIED_LEUVEN_H

#include "presliding.h"
#include "maxwell.h"
#include "transition.h"

/* What a block has decided about an element at the last event. */
#ifndef SLIPS
#define SLIPS(m, i) false
#endif

static double hysteresis_force(const Model *m)
{
    GIVEN(m)
    double sum = 0.0;
    for (int i = 0; i < N; i++)
        sum += limited(Fi[i], W[i]);
    return sum;
}

static void contact(Model *m, double S)
{
    GIVEN(m)
    const double force = hysteresis_force(m);
    const double rate = v * (1.0 - signed_power(sign(v) * force / S, n));
    for (int i = 0; i < 10; i++) {
        const bool slips = i < N && (m->run.frozen ? SLIPS(m, i) : rate != 0.0 && !(sign(rate) * Fi[i] < W[i]));
        m->slipping[i] = slips ? 1.0 : 0.0;
        m->der_Fi[i] = i < N && !slips ? k[i] * rate : 0.0;
    }
    m->der_z = rate;
    m->Fh = force;
    m->F = load_of(Fn, Fn0) * (force + sigma1 * rate) + sigma2 * v;
}

static void equations(Model *m)
{
    GIVEN(m)
    contact(m, stribeck(v, Fc, Fs, vs, delta));
}

#include "modified_leuven_ramp.h"

#endif
