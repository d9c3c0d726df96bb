/* Load of a contact in a gear, screw or guide: its friction grows with the forces that it transmits. All terms of the
   models M1 to M6 of the source but the viscous one, which the contact has itself.

       Fn = base + |a_external F_external - a_drive F_drive|
          + s(v) (at_rest + |b_external F_external - b_drive F_drive| + quadratic)
       s(v) = exp(-|v/vs|^delta)

       quadratic = c_external F_external^2   if |F_external| < |F_drive|
       quadratic = c_drive F_drive^2         if |F_external| > |F_drive|
       quadratic = 0                         if they are equal or of the same sign

   Connect Fn to a contact that has a friction of 1 N at Fn0 = 1 N. The friction of Stribeck with Fc = Fs = 1 N is then
   Fn sign(v) + Fv v, and at most Fn at rest: M1 has base and Fv; M2 also at_rest; M3 base, Fv and a_external = a_drive;
   M4 also at_rest and b_external = b_drive; M5 all but the quadratic term; M6 all. LuGre, GMS, Dahl and the other
   models with Fn become load-dependent in the same way. In the rotational variant, Fn is the friction torque over 1 m.

   The coefficients are those of the side that the force comes from, so that driving and back-driving differ. As none of
   them is negative, Fn is not either, and the contact remains passive.

   Use it for robot joints, strain-wave gears, screws and guides under load. F_external is what acts on the output side,
   such as gravity, and F_drive the force of the motor; in a position that the motor holds without friction, they are
   opposite.

   Limits: the forces are those before friction and inertia, as in the source, not the force in the teeth. Fn jumps
   where |F_external| = |F_drive| if the quadratic coefficients differ. */

#define MODEL   TransmissionLoad
#define SUMMARY "Load of a contact from the transmitted {force}s: friction of gears, models M1 to M6"
#define SOURCE  "Duclusaud, Passault, Padois, Ly, IEEE International Conference on Robotics and Automation, 2025"
#define CITES   "Duclusaud2025"

/* clang-format off */
#define VARIABLES                                                                                                                        \
    INPUT    (v,          VELOCITY,  0.0,               "velocity of the contact")                                                       \
    INPUT    (F_drive,    FORCE,     0.0,               FORCE_NOUN " of the drive")                                                      \
    INPUT    (F_external, FORCE,     0.0,               FORCE_NOUN " on the output side, such as gravity")                               \
    OUTPUT   (Fn,         "N",                          "normal force of a contact that has 1 N of friction at 1 N")                     \
    PARAMETER(base,       FORCE,     1.0,  0.0,   INF,  "friction without load")                                                         \
    PARAMETER(at_rest,    FORCE,     0.0,  0.0,   INF,  "additional friction at rest")                                                   \
    PARAMETER(a_drive,    NO_UNIT,   0.1,  0.0,   INF,  "friction over " FORCE_NOUN " of the drive")                                     \
    PARAMETER(a_external, NO_UNIT,   0.1,  0.0,   INF,  "friction over external " FORCE_NOUN)                                            \
    PARAMETER(b_drive,    NO_UNIT,   0.0,  0.0,   INF,  "additional friction at rest over " FORCE_NOUN " of the drive")                  \
    PARAMETER(b_external, NO_UNIT,   0.0,  0.0,   INF,  "additional friction at rest over external " FORCE_NOUN)                         \
    PARAMETER(c_drive,    PER_FORCE, 0.0,  0.0,   INF,  "additional friction at rest over the square of the " FORCE_NOUN " of the drive, if it is the smaller one") \
    PARAMETER(c_external, PER_FORCE, 0.0,  0.0,   INF,  "additional friction at rest over the square of the external " FORCE_NOUN ", if it is the smaller one")     \
    PARAMETER(vs,         VELOCITY,  1e-3, 1e-12, INF,  "Stribeck velocity")                                                             \
    PARAMETER(delta,      NO_UNIT,   2.0,  1e-3,  100.0, "Stribeck exponent")
/* clang-format on */

#include "block.h"
#include "stribeck.h"

static void equations(Model *m)
{
    GIVEN(m)
    const double drive = fabs(F_drive), external = fabs(F_external);
    double resting = at_rest + fabs(b_external * F_external - b_drive * F_drive);
    if ((F_drive < 0.0) != (F_external < 0.0) && drive != external)
        resting += drive < external ? c_drive * drive * drive : c_external * external * external;
    const double moving = base + fabs(a_external * F_external - a_drive * F_drive);
    m->Fn = stribeck(v, moving, moving + resting, vs, delta);
}
