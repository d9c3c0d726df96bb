/* Steps of SevenParameter.c: break-away as the root of a polynomial. Included at its end. */

#ifndef SEVEN_PARAMETER_RAMP_H
#define SEVEN_PARAMETER_RAMP_H

#include "ramp.h"
#include "roots.h"

/* c0 + c1 t + c2 t^2 + c3 t^3 */
static Taylor cubic(const void *data, double t)
{
    const double *const c = (const double *)data;
    return (Taylor){.value = c[0] + t * (c[1] + t * (c[2] + t * c[3])),
                    .slope = c[1] + t * (2.0 * c[2] + t * 3.0 * c[3])};
}

/* Return the first time within h at which the cubic, which is not positive at 0, becomes positive, or INF. */
static double first_rise(const double *c, double h)
{
    double ends[4] = {0.0, h, h, h};
    int n = 1;
    /* the cubic is monotone between the roots of 3 c3 t^2 + 2 c2 t + c1 */
    const double discriminant = c[2] * c[2] - 3.0 * c[3] * c[1];
    if (discriminant > 0.0) {
        const double q = -(c[2] + copysign(sqrt(discriminant), c[2]));
        const double one = c[3] != 0.0 ? q / (3.0 * c[3]) : INF, other = c[1] / q;
        const double early = fmin(one, other), late = fmax(one, other);
        if (early > 0.0 && early < h)
            ends[n++] = early;
        if (late > 0.0 && late < h)
            ends[n++] = late;
    }
    ends[n] = h;
    for (int i = 0; i < n; i++)
        if (cubic(c, ends[i + 1]).value > 0.0) {
            double low = ends[i], high = ends[i + 1];
            newton_between(cubic, c, 0.5 * (low + high), &low, &high);
            return high;
        }
    return INF;
}

/* Return the time until kt d in the direction s reaches Fc + Fs(t2), or INF if not within h: (kt s d - Fc - Fs_last)
   (t2 + gamma) - (Fs_inf - Fs_last) t2 = 0, where d is quadratic and t2 linear in time. */
static double time_to_break_away(const Model *m, const Contact *c, double s, double h)
{
    const double over = m->kt * s * c->d - m->Fc - c->Fs_last, rise = m->Fs_inf - c->Fs_last;
    const double pull = m->kt * fabs(m->v), half = 0.5 * m->kt * s * m->slope[INPUT_v], t = c->t2 + m->gamma;
    const double at_once[] = {fmin(over - rise, 0.0), pull, half, 0.0};
    const double in_time[] = {fmin(over * t - rise * c->t2, 0.0), over + pull * t - rise, pull + half * t, half};
    return first_rise(m->gamma > 0.0 ? in_time : at_once, h);
}

static bool step(Model *m, double h)
{
    GIVEN(m)
    const double rate = m->slope[INPUT_v], s = v != 0.0 ? sign(v) : sign(rate);

    Contact c = contact(m, sign(v));
    remember(m, h);
    if (c.stopped) {
        m->memory.slid = 1;
        m->memory.Fs_last = c.Fs_last;
    }
    if (c.slip == 0.0 && s != 0.0 && breaks_away(m, &c, s))
        c.slip = s;
    if (c.slip == 0.0) {
        const double wait = s != 0.0 ? time_to_break_away(m, &c, s, h) : INF, t = fmin(wait, h);
        c.d += path_after(v, rate, t);
        c.t2 += t;
        if (wait <= h)
            c.slip = s;
    }
    m->d = c.d;
    m->t2 = c.t2;
    m->memory.slip = c.slip;
    return true;
}

#endif
