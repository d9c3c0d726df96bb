/* Outputs u, F_hat and u_sat of a compensator from an estimate of friction. */

#ifndef COMPENSATION_H
#define COMPENSATION_H

#include "block.h"

static void compensate(Model *m, double estimate)
{
    const bool on = m->enable != 0.0;
    const double wanted = on ? m->gain * estimate : 0.0;
    const double u = on ? clip(wanted, m->u_min, m->u_max) : 0.0;
    const double beyond = wanted - u;

    m->F_hat = on ? estimate : 0.0;
    m->u = u;
    m->u_sat = beyond > 0.0 ? 1.0 : beyond < 0.0 ? -1.0 : beyond; /* NaN stays NaN */
}

#endif
