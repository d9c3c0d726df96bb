/* What an explicit master does wrong in a step: values that were handed over and have moved on, and the energy that
   this makes. A jump, as of Coulomb friction at a reversal, is wrong for one step only; what lasts for two steps or
   alternates in sign is a loop that is too fast for the step. */

#ifndef DEFECT_H
#define DEFECT_H

#include "part.h"

static void measure_defects(Engine *e)
{
    for (int64_t i = 0; i < e->pair_count; i++) {
        Pair *const p = &e->pairs[i];
        const Defect *const force = &e->defects[p->force], *const velocity = &e->defects[p->velocity];
        const double F = 0.5 * (force->value + arriving(e, force->input));
        const double v = 0.5 * (velocity->value + arriving(e, velocity->input));
        p->made += fabs(e->signals[force->input] * v - e->signals[velocity->input] * F) * e->step;
        p->passed += fabs(F * v) * e->step;
    }
    for (int64_t i = 0; i < e->defect_count; i++) {
        Defect *const d = &e->defects[i];
        const double end = arriving(e, d->input), defect = end - e->signals[d->input];
        const double lasting = fmin(fabs(defect), fabs(d->before));
        if (defect * d->before < 0.0)
            d->flips += lasting;
        d->squares += lasting * lasting;
        d->before = defect;
        d->value = end;
        d->values += fabs(end);
        d->value_squares += end * end;
    }
}

#endif
