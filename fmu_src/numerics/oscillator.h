/* Exact steps of a mass on a spring and a damper. */

#ifndef OSCILLATOR_H
#define OSCILLATOR_H

#include <math.h>

#include "linear_step.h"

/* What the last step of a mass on a spring and a damper computed from its parameters and its length h. */
typedef struct {
    double m, k, d, h;
    double w; /* y = (w q, v) with w = sqrt(k/m) gives all rates the same magnitude */
    Exponential of;
} Oscillator;

/* Return whether parameters or length have changed: then store them, and w; the caller renews `of`. */
static inline bool differs(Oscillator *last, double m, double k, double d, double h)
{
    if (last->m == m && last->k == k && last->d == d && last->h == h)
        return false;
    last->m = m;
    last->k = k;
    last->d = d;
    last->h = h;
    last->w = k > 0.0 ? sqrt(k / m) : 1.0 / h;
    return true;
}

#if LINEAR_STATES == 2
/* Advance q and v = dq/dt of m dv/dt = f + f_rate s - k q - d v by h; k and d may be 0. */
static inline void oscillate(Oscillator *last, double *q, double *v, double m, double k, double d, double f,
                             double f_rate, double h)
{
    const bool renews = differs(last, m, k, d, h);
    const double w = last->w, b[] = {0.0, f / m}, c[] = {0.0, f_rate / m};
    double y[] = {w * *q, *v};
    if (renews)
        exponential((const double[]){0.0, w, -k / (m * w), -d / m}, h, &last->of);
    linear_step(&last->of, b, c, y);
    *q = y[0] / w;
    *v = y[1];
}
#endif

/* Advance d and its rate by t for d'' + 2 zeta omega d' + omega^2 d = a. Because a is constant, there is a closed form,
   which is fast for populations of oscillators. */
static inline void ring(double *d, double *rate, double omega2, double zeta, double a, double t)
{
    const double omega = sqrt(omega2), e = *d - a / omega2, e_rate = *rate;
    double cosine, sine; /* both multiplied by exp(-zeta omega t); the sine divided by its frequency */
    if (zeta < 1.0) {
        const double damped = omega * sqrt((1.0 - zeta) * (1.0 + zeta)), decay = exp(-zeta * omega * t);
        cosine = decay * cos(damped * t);
        sine = decay * sin(damped * t) / damped;
    } else {
        const double split = omega * sqrt((zeta - 1.0) * (zeta + 1.0));
        const double slow = exp(-omega2 / (zeta * omega + split) * t), fast = slow * exp(-2.0 * split * t);
        cosine = 0.5 * (slow + fast);
        sine = split > 0.0 ? 0.5 * (slow - fast) / split : t * slow;
    }
    *d = e * cosine + (e_rate + zeta * omega * e) * sine + a / omega2;
    *rate = e_rate * cosine - (omega2 * e + zeta * omega * e_rate) * sine;
}

#endif
