/* Load of a contact in a screw, worm or gear with known efficiencies: driving and back-driving differ, and it can be
   self-locking.

       against the load:  Fn = base + |F_load| (1 / eta_drive - 1)
       with the load:     Fn = base + |F_load| (1 - eta_back)

   F_load is what the load would exert on the mass without friction: W lead / (2 pi) for a screw with an axial force W.
   Below v_rest, the direction is that of F_ext, the sum of the other forces on the mass: solvers leave a velocity of
   the size of rounding at rest, whose sign says nothing.

   A screw with lead angle lambda and angle of friction phi has eta_drive = tan(lambda) / tan(lambda + phi) and eta_back
   = tan(lambda - phi) / tan(lambda). With eta_back at most 0, the load cannot move it: it is self-locking.

   Connect Fn to a contact that has a friction of 1 N at Fn0 = 1 N, such as Stribeck with Fc = Fs = 1 N. In the
   rotational variant, Fn is the friction torque over 1 m. Fn is never negative, so that the contact remains passive.

   Use it with the efficiencies of a data sheet, for axes that lift a load and lower it.

   Limits: Fn jumps where the direction changes. The efficiencies do not depend on the speed; the contact may. */

#define MODEL   EfficiencyLoad
#define SUMMARY "Load of a contact from the efficiencies of driving and back-driving: screws and worms, self-locking"
#define SOURCE  "Budynas, Nisbett: Shigley's Mechanical Engineering Design, 10th ed., 2015, section 8-2"
#define CITES   "Shigley2015"
#define NO_EXCHANGE "its direction changes with the velocity, without an event"

/* clang-format off */
#define VARIABLES                                                                                                     \
    INPUT    (v,         VELOCITY, 0.0,             "velocity of the contact")                                        \
    INPUT    (F_load,    FORCE,    0.0,             FORCE_NOUN " of the load, positive if it drives forward")         \
    INPUT    (F_ext,     FORCE,    0.0,             "sum of the other " FORCE_NOUN "s on the " MASS_NOUN ", at rest") \
    OUTPUT   (Fn,        "N",                       "normal force of a contact that has 1 N of friction at 1 N")      \
    PARAMETER(base,      FORCE,    0.0, 0.0,   INF, "friction without load")                                          \
    PARAMETER(eta_drive, NO_UNIT,  0.5, 1e-6,  1.0, "efficiency of motion against the load")                          \
    PARAMETER(eta_back,  NO_UNIT,  0.2, -1e6,  1.0, "efficiency of motion with the load; at most 0: self-locking")    \
    PARAMETER(v_rest,    VELOCITY, 1e-9, 0.0,  INF, "speed below which the direction is that of F_ext")
/* clang-format on */

#include "block.h"

static void equations(Model *m)
{
    GIVEN(m)
    const double direction = sign(fabs(v) > v_rest ? v : F_ext), against = 1.0 / eta_drive - 1.0, with = 1.0 - eta_back;
    const double share = direction == 0.0 ? fmax(against, with) : direction * F_load < 0.0 ? against : with;
    m->Fn = base + fabs(F_load) * share;
}
