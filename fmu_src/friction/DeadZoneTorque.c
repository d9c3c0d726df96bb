/* Dead-zone torque: at rest, friction balances the external torque within a dead zone.

   This is an interpretation of a description, not a published equation. A comparison of friction models mentions a
   model similar to Karnopp's, but based on torque, in which a dead-zone torque describes friction below the stiction
   torque. Its source could not be identified.

       |v| < DV and |F_ext| <= load T_dz:  F = F_ext
       otherwise:                          F = load Fc d + Fv v
       d = sign(v), or sign(F_ext) at v = 0
       load = max(Fn, 0) / Fn0

   Karnopp's model uses the velocity only and limits the force inside the band to Fs. This model uses velocity and
   force, and a force beyond the dead zone meets Coulomb friction immediately. With DV = 0 and T_dz = Fc, it is Coulomb
   and viscous friction.

   Use it for drives with a known torque; T_dz is the torque that first moves the axis. F_ext is the sum of all other
   forces on the mass and must be connected; in the rotational twin it is a torque.

   Limits: the model is an interpretation. F jumps at v = 0 and, unless T_dz = Fc, at the edge of the dead zone. A mass
   connected to F keeps a velocity below DV while it is held. No Stribeck effect, no presliding. */

#define MODEL       DeadZoneTorque
#define SUMMARY     "Coulomb and viscous friction with a torque dead zone at rest (interpretation)"
#define SOURCE      "Interpretation of a description without an identified source"
#define CITES       "DeadZoneTorque"
#define STATUS      "equations specific to this library, from a description"
#define FEATURES    "rate dependent, needs force"
#define NO_EXCHANGE "the model has no solution at rest for forces between T_dz and Fc"

/* clang-format off */
#define VARIABLES                                                                                                                       \
    INPUT    (v,     VELOCITY, 0.0,               "relative sliding velocity")                                                          \
    INPUT    (F_ext, FORCE,    0.0,               "sum of the other " FORCE_NOUN "s on the " MASS_NOUN "; determines friction at rest") \
    OPTIONAL (Fn,    "N",      1.0,               "normal force")                                                                       \
    OUTPUT   (F,     FORCE,                       "friction " FORCE_NOUN)                                                               \
    FLAG     (stuck,                              "inside the dead zone")                                                               \
    PARAMETER(Fc,    FORCE,    1.0,  0.0,   INF,  "Coulomb friction at Fn0")                                                            \
    PARAMETER(T_dz,  FORCE,    1.5,  0.0,   INF,  "limit of the dead zone at Fn0: force, or torque in the rotational twin")             \
    PARAMETER(Fv,    DAMPING,  0.4,  0.0,   INF,  "viscous coefficient")                                                                \
    PARAMETER(DV,    VELOCITY, 1e-3, 0.0,   INF,  "velocity below which the dead zone applies")                                         \
    PARAMETER(Fn0,   "N",      1.0,  1e-12, INF,  "normal force for which the parameters are valid")

#define CONTACT   \
    COULOMB(Fc)   \
    STATIC (T_dz) \
    VISCOUS(Fv)

#define IDENTIFIED HELD(DV, 1e-3, slow)
/* clang-format on */

#include "block.h"
#include "load.h"

static void equations(Model *m)
{
    GIVEN(m)
    const double load = load_of(Fn, Fn0);
    const bool held = (fabs(v) < DV || v == 0.0) && fabs(F_ext) <= load * T_dz;

    m->stuck = held ? 1.0 : 0.0;
    m->F = held ? F_ext : load * Fc * sign(v == 0.0 ? F_ext : v) + Fv * v;
}
