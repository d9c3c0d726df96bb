/* Exact steps of a mass on a spring and a damper. */

#ifndef OSCILLATOR_H
#define OSCILLATOR_H

#include <math.h>

#include "linear_step.h"

/* Advance q and v = dq/dt of m dv/dt = f + f_rate s - k q - d v by h; k and d may be 0. */
static inline void oscillate(double *q, double *v, double m, double k, double d, double f, double f_rate, double h)
{
    /* y = (w q, v) with w = sqrt(k/m) gives all rates the same magnitude. */
    const double w = k > 0.0 ? sqrt(k / m) : 1.0 / h;
    const double A[] = {0.0, w, -k / (m * w), -d / m};
    const double b[] = {0.0, f / m};
    const double c[] = {0.0, f_rate / m};
    double y[] = {w * *q, *v};
    linear_step(2, A, b, c, y, h);
    *q = y[0] / w;
    *v = y[1];
}

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
