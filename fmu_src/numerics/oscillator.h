/* The exact step of a mass on a spring and a damper. Included after block.h. */

#ifndef OSCILLATOR_H
#define OSCILLATOR_H

/* q and v = dq/dt after h of m dv/dt = f + f_rate s - k q - d v; k and d may be 0. */
static inline void oscillate(double *q, double *v, double m, double k, double d, double f, double f_rate, double h)
{
    /* y = (w q, v) with w = sqrt(k/m) makes all rates of one size. */
    const double w = k > 0.0 ? sqrt(k / m) : 1.0 / h;
    const double A[] = {0.0, w, -k / (m * w), -d / m};
    const double b[] = {0.0, f / m};
    const double c[] = {0.0, f_rate / m};
    double y[] = {w * *q, *v};
    linear_step(2, A, b, c, y, h);
    *q = y[0] / w;
    *v = y[1];
}

#endif
