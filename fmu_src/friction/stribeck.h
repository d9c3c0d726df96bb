/* The Stribeck curve that many friction laws share: friction at steady sliding, without the viscous part.

   Bo, Pavelescu: Wear 82, 1982; delta = 1 is Tustin's, delta = 2 Armstrong's.

       g(v) = Fc + (Fs - Fc) exp(-|v/vs|^delta)                                                               */

#ifndef STRIBECK_H
#define STRIBECK_H

static inline double stribeck(double v, double Fc, double Fs, double vs, double delta)
{
    const double ratio = fabs(v) / vs;
    const double power = delta == 2.0 ? ratio * ratio : delta == 1.0 ? ratio : pow(ratio, delta);
    /* sums of positive terms: exact also where one level is tiny beside the other; from 708 on exp underflows, which
       takes it three times as long */
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

/* The time from which, for a velocity that changes, the Stribeck curve g may be of another size than up to there: the
   powers of two of (v/vs)^delta, from where g leaves Fs to where it has reached Fc. Between them g is smooth enough for
   an error estimate to be trusted. */
static inline double stribeck_piece(double v, double slope, double Fc, double Fs, double vs, double delta)
{
    if (slope == 0.0)
        return INF;
    const double speed = fabs(v), rate = v == 0.0 ? fabs(slope) : sign(v) * slope;
    const double power = delta * log2(speed / vs), contrast = log2(Fs / Fc);
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
