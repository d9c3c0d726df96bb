/* The Stribeck curve that many friction laws share: friction at steady sliding, without the viscous part.

   Bo, Pavelescu: Wear 82, 1982; delta = 1 is Tustin's, delta = 2 Armstrong's.

       g(v) = Fc + (Fs - Fc) exp(-|v/vs|^delta)                                                               */

#ifndef STRIBECK_H
#define STRIBECK_H

static inline double stribeck(double v, double Fc, double Fs, double vs, double delta)
{
    const double ratio = fabs(v) / vs;
    const double power = delta == 2.0 ? ratio * ratio : delta == 1.0 ? ratio : pow(ratio, delta);
    return Fc + (Fs - Fc) * exp(-power);
}

/* The Lorentzian curve. Hess, Soom: Journal of Tribology 112, 1990.

       g(v) = Fc + (Fs - Fc) / (1 + |v/vs|^delta)                                                             */
static inline double stribeck_lorentzian(double v, double Fc, double Fs, double vs, double delta)
{
    const double ratio = fabs(v) / vs;
    const double power = delta == 2.0 ? ratio * ratio : delta == 1.0 ? ratio : pow(ratio, delta);
    return Fc + (Fs - Fc) / (1.0 + power);
}

#endif
