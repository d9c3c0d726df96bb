/* Coupling error of an explicit master: inputs are held while their sources change, which generates energy. A jump,
   such as Coulomb friction at a reversal, causes an error in one step only. An error that persists over two steps or
   alternates in sign shows that the loop is too fast for the communication step. */

#ifndef DEFECT_H
#define DEFECT_H

#include "part.h"

/* An undamped oscillation, for example of a mass on a sticking contact, must not grow. It grows if the energy that the
   coupling supplies is not small compared with the energy that friction dissipates. An incomplete period at the end of
   the window contributes less than FED times the transferred energy. */
enum { WINDOW = 2000 };
#define FED 1e-3

static void end_window(Pair *p)
{
    p->unstable += fabs(p->fed) > FED * p->flow && fabs(p->fed) > 0.5 * fabs(p->net);
    p->windows++;
    p->passed += p->flow;
    p->fed = p->net = p->flow = 0.0;
    p->ticks = 0;
}

static void measure_defects(Engine *e)
{
    for (Defect *d = e->defects; d < e->defects + e->defect_count; d++) {
        const double end = arriving(e, d->input), defect = end - e->signals[d->input];
        const double lasting = fmin(fabs(defect), fabs(d->before));
        if (defect * d->before < 0.0)
            d->flips += lasting;
        d->squares += lasting * lasting;
        d->before = defect;
        d->mean = 0.5 * (d->value + end);
        d->value = end;
        d->values += fabs(end);
        d->value_squares += end * end;
    }
    for (Pair *p = e->pairs; p < e->pairs + e->pair_count; p++) {
        const Defect *const force = &e->defects[p->force], *const velocity = &e->defects[p->velocity];
        const double F = force->mean, v = velocity->mean, passed = F * v * e->step;
        const double made = (e->signals[force->input] * v - e->signals[velocity->input] * F) * e->step;
        p->made += fabs(made);
        p->fed += made;
        p->net += passed;
        p->flow += fabs(passed);
        if (++p->ticks == WINDOW)
            end_window(p);
    }
}

#endif
