/* Viscous friction: the force of a lubricating film, proportional to the velocity or to a power of it.

   Reynolds: Philosophical Transactions of the Royal Society 177, 1886, for delta_v = 1. The power law, which fits data
   better, is equation (3) of Olsson, Astrom, Canudas de Wit, Gaefvert, Lischinsky: European Journal of Control 4(3),
   1998.

       F = Fv |v|^delta_v sign(v)

   With delta_v = 1, the start value, Fv is in N.s/m; in general in N (s/m)^delta_v. F does not depend on a normal
   force: in this catalogue, contact forces scale with the normal force, film forces do not.

   Use it alone for fully lubricated bearings and air drag, or together with a contact model; most other models of this
   catalogue have their own linear viscous friction.

   Limits: no force at rest, so nothing sticks. For delta_v < 1 the slope at v = 0 is infinite; delta_v = 0 is Coulomb
   friction with F = 0 at rest. */

#define MODEL    Viscous
#define SUMMARY  "Viscous friction, linear or a power of the velocity"
#define SOURCE   "Reynolds 1886; Olsson and others, European Journal of Control 4(3), 1998"
#define CITES    "Olsson1998"
#define STATUS   "equation (3) of Olsson et al. 1998 for the power"
#define FEATURES "rate dependent"

/* clang-format off */
#define VARIABLES                                                                       \
    INPUT    (v,       VELOCITY, 0.0,             "relative sliding velocity")          \
    OUTPUT   (F,       FORCE,                     "friction " FORCE_NOUN ", opposes v") \
    PARAMETER(Fv,      DAMPING,  0.4, 0.0, INF,   "viscous coefficient")                \
    PARAMETER(delta_v, NO_UNIT,  1.0, 0.0, 100.0, "exponent of the velocity")

#define CONTACT VISCOUS(Fv)

#define IDENTIFIED HELD(delta_v, 1, fast)
/* clang-format on */

#include "block.h"

static void equations(Model *m)
{
    GIVEN(m)
    const double speed = fabs(v);
    const double power = delta_v == 1.0 ? speed : delta_v == 2.0 ? speed * speed : pow(speed, delta_v);
    m->F = sign(v) * Fv * power; /* (3) */
}
