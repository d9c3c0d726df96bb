/* Cogging: a force that depends on position only and repeats with the pitch of the magnets. It takes no energy.

   Sum of harmonics, as is usual for the detent force of permanent-magnet motors; for linear ones and their compensation
   in motion control: Otten, de Vries, van Amerongen, Rankers, Gaal: Linear motor motion control using a learning
   feedforward controller, IEEE/ASME Transactions on Mechatronics 2(3), 1997.

       F = sum_k A_k sin(k w x + phi_k),   w = 2 pi / pitch,   k = 1 ... 6
       energy = sum_k A_k / (k w) cos(k w x + phi_k),   F = -d(energy)/dx

   A_k = amplitude[k], phi_k = phase[k]. F is a force on the mass, for the input F_load of a plant, and positive to the
   front, other than a friction force. With phi = 0 the mass rests stably at half a pitch, where F falls through zero,
   with the stiffness w A_1 if that is the only harmonic.

   Use it for the position-dependent part of a disturbance, beside a friction model that depends on velocity: what a
   table over position, a repetitive controller or learning can take away, and a friction compensator cannot.

   Limits: no force that depends on the current (reluctance ripple), and none at the ends of the magnet track. x that is
   large against the pitch carries its rounding, 1e-16 x. */

#define MODEL    Cogging
#define SUMMARY  "Force by position: harmonics of the magnet pitch, conservative"
#define SOURCE   "Otten et al., IEEE/ASME Transactions on Mechatronics 2(3), 1997"
#define PORTRAIT "ripple"
#define QUOTES   "cogging"

/* clang-format off */
#define VARIABLES                                                                                                    \
    INPUT     (x,         LENGTH,  0.0,                                               "position")                    \
    OUTPUT    (F,         FORCE,                                                      "force on the mass, to the front") \
    OUTPUT    (energy,    "J",                                                        "potential energy of the force") \
    PARAMETER (pitch,     LENGTH,  0.024,                          1e-9, INF, "length of a period")                  \
    PARAMETERS(amplitude, 6, FORCE, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0), -INF, INF, "amplitude of each harmonic; 0: none") \
    PARAMETERS(phase,     6, ANGLE, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), -INF, INF, "phase of each harmonic at x = 0")

#define IN_LOOP COGGING(pitch, amplitude, phase)
/* clang-format on */

#include "block.h"
#include "constants.h"

enum { HARMONICS = sizeof starts_of_amplitude / sizeof starts_of_amplitude[0] };

static void equations(Model *m)
{
    GIVEN(m)
    const double periods = x / pitch, place = periods - floor(periods);

    m->F = m->energy = 0.0;
    for (int k = 1; k <= HARMONICS; k++) {
        const double A = amplitude[k - 1], angle = TWO_PI * k * place + phase[k - 1];
        m->F += A * sin(angle);
        m->energy += A * pitch / (TWO_PI * k) * cos(angle);
    }
}
