/* A second-order low-pass filter with zero phase. */

#ifndef ZERO_PHASE_H
#define ZERO_PHASE_H

#include <math.h>
#include <stddef.h>

#include "constants.h"

/* Butterworth filter of order 2 by the bilinear transform, forwards over y[0], y[step], ..., initially at rest at the
   first value. */
static void low_pass(double *y, ptrdiff_t n, ptrdiff_t step, double K)
{
    const double scale = 1.0 / (1.0 + sqrt(2.0) * K + K * K);
    const double b = K * K * scale;
    const double a1 = 2.0 * (K * K - 1.0) * scale;
    const double a2 = (1.0 - sqrt(2.0) * K + K * K) * scale;
    double s1 = (1.0 - b) * *y;
    double s2 = (b - a2) * *y;

    for (; n > 0; n--, y += step) {
        const double in = *y;
        const double out = b * in + s1;
        s1 = 2.0 * b * in - a1 * out + s2;
        s2 = b * in - a2 * out;
        *y = out;
    }
}

/* Filter forwards and backwards: zero phase and the squared gain, 1/(1 + (f/fq)^4) for f far below 1/(2 Ts). */
static void zero_phase(double *y, ptrdiff_t n, double fq, double Ts)
{
    if (fq <= 0.0 || fq * Ts >= 0.5 || n < 1)
        return;
    const double K = tan(PI * fq * Ts);
    low_pass(y, n, 1, K);
    low_pass(y + n - 1, n, -1, K);
}

#endif
