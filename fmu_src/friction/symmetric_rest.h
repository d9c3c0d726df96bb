/* Friction at rest of the models with Fs and Fc that is equal in both directions. Included after rest.h. */

#ifndef SYMMETRIC_REST_H
#define SYMMETRIC_REST_H

static void range(const Model *m, double *low, double *high)
{
    *high = load_of(m->Fn, m->Fn0) * held_by(m, m->Fs, m->Fc);
    *low = -*high;
}

#endif
