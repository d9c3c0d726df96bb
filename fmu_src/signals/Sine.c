/* Sum of four sines about an offset, with exact derivatives. A single sine is the usual test of tracking and frictional
   lag; several sines form a multisine, which excites only selected frequencies.

   Pintelon, Schoukens: System Identification, 2nd ed., Wiley 2012 (multisine excitation).

       r(t) = offset + sum_k a_k sin(w_k t + phi_k),   w_k = 2 pi f_k
       a = amplitude, f = frequency, phi = phase

   Limits: t is the simulation time, not the time since the start of the simulation. With a phase of pi/2, the motion
   starts at rest, but displaced by the amplitude. At late times, the phase has a rounding error of about 1e-16 f t
   periods. */

#define MODEL   Sine
#define SUMMARY "Sum of up to four sines with exact derivatives"
#define SOURCE  "Pintelon, Schoukens: System Identification, 2nd ed., 2012"
#define CITES   "PintelonSchoukens2012"

/* clang-format off */
#define VARIABLES                                                                                               \
    OUTPUT    (r,         LENGTH,                                    "position")                                \
    OUTPUT    (rd,        VELOCITY,                                  "velocity")                                \
    OUTPUT    (rdd,       ACCELERATION,                              "acceleration")                            \
    PARAMETER (offset,    LENGTH,       0.0,                   -INF, INF, "mean position")                      \
    PARAMETERS(amplitude, 4, LENGTH,    (0.01, 0.0, 0.0, 0.0), -INF, INF, "amplitude of each sine; 0: none")    \
    PARAMETERS(frequency, 4, FREQUENCY, (1.0, 2.0, 3.0, 4.0),  0.0,  INF, "frequency of each sine")             \
    PARAMETERS(phase,     4, ANGLE,     (0.0, 0.0, 0.0, 0.0),  -INF, INF, "phase of each sine at t = 0")
/* clang-format on */

#include "block.h"
#include "constants.h"

enum { SINES = sizeof starts_of_amplitude / sizeof starts_of_amplitude[0] };

static void equations(Model *m)
{
    GIVEN(m)
    m->r = offset;
    m->rd = m->rdd = 0.0;
    for (int k = 0; k < SINES; k++) {
        const double w = TWO_PI * frequency[k], angle = w * m->time + phase[k];
        m->r += amplitude[k] * sin(angle);
        m->rd += amplitude[k] * w * cos(angle);
        m->rdd -= amplitude[k] * w * w * sin(angle);
    }
}
