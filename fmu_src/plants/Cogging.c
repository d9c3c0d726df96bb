/* Cogging: a conservative force that depends only on position and is periodic with the magnet pitch.

   It is a sum of harmonics, as usual for the detent force of permanent-magnet motors; for linear motors and their
   compensation in motion control, see Otten, de Vries, van Amerongen, Rankers, Gaal: Linear motor motion control using
   a learning feedforward controller, IEEE/ASME Transactions on Mechatronics 2(3), 1997.

       F = sum_k A_k sin(k w x + phi_k),   w = 2 pi / pitch,   k = 1 ... 6
       energy = sum_k A_k / (k w) cos(k w x + phi_k),   F = -d(energy)/dx

   A_k = amplitude[k], phi_k = phase[k]. F acts on the mass in the positive direction, unlike a friction force; connect
   it to the input F_load of a plant. With phi = 0, the mass has a stable equilibrium at half a pitch, where F decreases
   through zero, with the stiffness w A_1 if this is the only harmonic.

   Use it for the position-dependent part of a disturbance, together with a velocity-dependent friction model. A
   position table, a repetitive controller or a learning controller can compensate it; a friction compensator cannot.

   Limits: no current-dependent force (reluctance ripple) and no end effects of the magnet track. If x is large compared
   with the pitch, F contains the rounding error of x, 1e-16 x. */

#define MODEL   Cogging
#define SUMMARY "Position-dependent conservative {force}: harmonics of the magnet pitch"
#define SOURCE  "Otten et al., IEEE/ASME Transactions on Mechatronics 2(3), 1997"
#define CITES   "Otten1997"

/* clang-format off */
#define VARIABLES                                                                                                                           \
    INPUT     (x,         LENGTH,  0.0,                                               "position")                                           \
    OUTPUT    (F,         FORCE,                                                      FORCE_NOUN " on the " MASS_NOUN ", positive forward") \
    OUTPUT    (energy,    "J",                                                        "potential energy of the " FORCE_NOUN)                \
    PARAMETER (pitch,     LENGTH,  0.024,                          1e-9, INF, "magnet pitch, the period of F")                              \
    PARAMETERS(amplitude, 6, FORCE, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0), -INF, INF, "amplitude of each harmonic; 0: none")                       \
    PARAMETERS(phase,     6, ANGLE, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), -INF, INF, "phase of each harmonic at x = 0")
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
