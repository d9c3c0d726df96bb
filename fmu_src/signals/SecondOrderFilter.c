/* Sampled filter of second order, as in servo drives: low-pass, band-pass, high-pass or notch.

   Bilinear transform with prewarping at f; Franklin, Powell, Emami-Naeini: Feedback Control of Dynamic Systems, 8th
   ed., 2019.

       y/u = (high p^2 + 2 zeta band p + low)/(p^2 + 2 zeta p + 1)
       p   = (z - 1)/(z + 1)/tan(pi f Ts)

   The start values give a low-pass filter. low = high = 1 is a notch filter, of which band is the gain at f. Before the
   first sample, u is assumed to have been constant, so that a constant u passes without a transient.

   Use it behind Differentiator for a velocity filter of order 2, or behind a controller as notch filter of the command.

   Limits: f must be below 1/(2 Ts); from there on, and with f = 0, y = u. Input and output have no unit, so that a tool
   cannot check the units of the signals. */

#define MODEL   SecondOrderFilter
#define SUMMARY "Sampled filter of second order: low-pass, band-pass, high-pass or notch"
#define SOURCE  "Franklin, Powell, Emami-Naeini: Feedback Control of Dynamic Systems, 8th ed., 2019"
#define CITES   "Franklin2019"

/* clang-format off */
#define VARIABLES                                                                                  \
    INPUT    (u,    NO_UNIT,   0.0,               "signal")                                        \
    OUTPUT   (y,    NO_UNIT,                      "filtered signal")                               \
    FIXED    (Ts,   TIME,      1e-3,  1e-9, INF,  "sample time")                                   \
    FIXED    (f,    FREQUENCY, 100.0, 0.0,  INF,  "corner frequency, or centre of the notch; 0: no filter") \
    FIXED    (zeta, NO_UNIT,   0.70710678118654752, 1e-6, INF, "damping ratio of the poles")       \
    FIXED    (low,  NO_UNIT,   1.0,   -INF, INF,  "gain at frequency 0")                           \
    FIXED    (band, NO_UNIT,   0.0,   -INF, INF,  "gain at f, apart from low and high")            \
    FIXED    (high, NO_UNIT,   0.0,   -INF, INF,  "gain at high frequencies")
/* clang-format on */

#define SAMPLED
#define MEMORY   struct filter
#define VALID_BY is_filter

struct filter {
    double s1, s2; /* direct form II transposed */
};

#include "block.h"
#include "constants.h"

static bool is_filter(const Model *m) { return isfinite(m->memory.s1) && isfinite(m->memory.s2); }

static void sample(Model *m)
{
    GIVEN(m)
    struct filter *const old = &m->memory;
    m->y = u;
    if (!(f > 0.0 && f * Ts < 0.5))
        return;
    const double q = 1.0 / tan(PI * f * Ts), d = 2.0 * zeta * q, a0 = q * q + d + 1.0;
    const double b0 = (high * q * q + band * d + low) / a0, a1 = 2.0 * (1.0 - q * q) / a0;
    const double b1 = 2.0 * (low - high * q * q) / a0, a2 = (q * q - d + 1.0) / a0;
    const double b2 = (high * q * q - band * d + low) / a0;

    if (m->run.tick == 0) {
        old->s2 = (b2 - a2 * low) * u;
        old->s1 = (b1 - a1 * low) * u + old->s2;
    }
    m->y = b0 * u + old->s1;
    old->s1 = b1 * u - a1 * m->y + old->s2;
    old->s2 = b2 * u - a2 * m->y;
}
