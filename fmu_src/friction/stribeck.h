/* The Stribeck curve, shared by many friction models: friction in steady sliding without viscous friction.

   Bo, Pavelescu: Wear 82, 1982; delta = 1 is from Tustin, delta = 2 from Armstrong.

       g(v) = Fc + (Fs - Fc) exp(-|v/vs|^delta) */

#ifndef STRIBECK_H
#define STRIBECK_H

#include "constants.h"

static inline double stribeck(double v, double Fc, double Fs, double vs, double delta)
{
    const double ratio = fabs(v) / vs;
    const double power = delta == 2.0 ? ratio * ratio : delta == 1.0 ? ratio : pow(ratio, delta);
    /* sums of positive terms: accurate even if one level is much smaller than the other; from 708 on, exp underflows
       and takes three times as long */
    return Fs < Fc ? Fs - (Fc - Fs) * expm1(-power) : Fc + (Fs - Fc) * (power > 708.0 ? 0.0 : exp(-power));
}

/* The Lorentzian curve. Hess, Soom: Journal of Tribology 112, 1990.

       g(v) = Fc + (Fs - Fc) / (1 + |v/vs|^delta)                                                             */
static inline double stribeck_lorentzian(double v, double Fc, double Fs, double vs, double delta)
{
    const double ratio = fabs(v) / vs;
    const double power = delta == 2.0 ? ratio * ratio : delta == 1.0 ? ratio : pow(ratio, delta);
    return Fs < Fc && power < 1.0 ? Fs + (Fc - Fs) * (power / (1.0 + power)) : Fc + (Fs - Fc) / (1.0 + power);
}

/* log2, without a division by zero at 0 */
static inline double binary_log(double a) { return a > 0.0 ? log2(a) : -INF; }

/* Return the time up to which the Stribeck curve g keeps its order of magnitude for a changing velocity: the next power
   of two of (v/vs)^delta, from where g leaves Fs to where it has reached Fc. In between, g is smooth enough for a
   reliable error estimate. */
static inline double stribeck_piece(double v, double slope, double Fc, double Fs, double vs, double delta)
{
    if (slope == 0.0)
        return INF;
    const double speed = fabs(v), rate = v == 0.0 ? fabs(slope) : sign(v) * slope;
    const double power = delta * binary_log(speed / vs), contrast = binary_log(Fs / Fc);
    const double first = delta > 2.0 || contrast < -3.0 ? -16.0 + fmin(contrast, 0.0) : 0.0;
    const double last = contrast > 30.0 ? 8.0 : 6.0;
    if (rate > 0.0) {
        const double next = fmax(floor(power + 1e-6) + 1.0, first);
        return next > last ? INF : (vs * exp2(next / delta) - speed) / rate;
    }
    const double next = fmin(ceil(power - 1e-6) - 1.0, last);
    return next < first ? INF : (vs * exp2(next / delta) - speed) / rate;
}

#endif
