/* Dead-zone torque: at rest friction balances the external torque as far as a dead zone of torque reaches.

   Our interpretation of a description, not a published equation: a comparison of friction models mentions a model
   with an approach similar to Karnopp's, but based on torque, in which a dead-zone torque describes friction below
   the stiction torque; its source could not be identified.

       |v| < DV and |F_ext| <= load T_dz:  F = F_ext
       otherwise:                          F = load Fc d + Fv v
       d = sign(v), at v = 0 the sign of F_ext
       load = max(Fn, 0) / Fn0

   Where Karnopp decides by velocity alone and limits the force inside the band to Fs, here velocity and force decide
   together, and a force beyond the dead zone meets Coulomb friction at once. With DV = 0 and T_dz = Fc this is
   Coulomb and viscous friction.

   Use it for drives whose torque is known, where T_dz is the torque that first moves the axis. F_ext is the sum of all
   other forces on the mass and has to be connected; in the rotational twin it is a torque.

   Limits: an interpretation. F jumps where the dead zone is left if T_dz is not Fc, and at v = 0. A mass that reads F
   keeps a velocity below DV for ever while it is held. No Stribeck effect, no presliding. */

/* @misc{DeadZoneTorque,
     title = {Dead-zone torque model of friction},
     note  = {Interpretation; the source of the description could not be identified}} */

#define MODEL    DeadZoneTorque
#define SUMMARY  "Coulomb and viscous friction with a dead zone of torque at rest (interpretation)"
#define SOURCE   "Interpretation of a description without an identified source"
#define STATUS   "equations of our own, from a description"
#define FEATURES "rate dependent, needs force"

/* clang-format off */
#define VARIABLES                                                                                           \
    INPUT    (v,     VELOCITY, 0.0,               "relative sliding velocity")                              \
    INPUT    (F_ext, FORCE,    0.0,               "sum of the other forces on the mass; determines friction at rest") \
    OPTIONAL (Fn,    "N",      1.0,               "normal force")                                           \
    OUTPUT   (F,     FORCE,                       "friction force")                                         \
    FLAG     (stuck,                              "inside the dead zone")                                   \
    PARAMETER(Fc,    FORCE,    1.0,  0.0,   INF,  "Coulomb friction at Fn0")                                \
    PARAMETER(T_dz,  FORCE,    1.5,  0.0,   INF,  "force, in the rotational twin torque, up to which the dead zone holds, at Fn0") \
    PARAMETER(Fv,    DAMPING,  0.4,  0.0,   INF,  "viscous coefficient")                                    \
    PARAMETER(DV,    VELOCITY, 1e-3, 0.0,   INF,  "velocity below which the dead zone may hold")            \
    PARAMETER(Fn0,   "N",      1.0,  1e-12, INF,  "normal force for which the parameters are valid")

#define CONTACT   \
    COULOMB(Fc)   \
    STATIC (T_dz) \
    VISCOUS(Fv)
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
