/* Stiction: static friction above Coulomb friction; at rest, friction balances the external force.

   Morin: Memoires de mathematique et de physique, 1833, for the higher force at rest; the equations are (4) and the
   preceding ones of Olsson, Astrom, Canudas de Wit, Gaefvert, Lischinsky: European Journal of Control 4(3), 1998.

       v != 0:  F = load Fc sign(v) + Fv v
       v  = 0:  F = F_ext, |F| <= load Fs
       load = max(Fn, 0) / Fn0

   F_ext is the sum of all other forces on the mass, as the velocity alone does not determine the force at rest. If
   F_ext is not connected, F is 0 at v = 0. Fs < Fc is allowed.

   Use it for break-away: whether and when a load starts to move.

   Limits: the force drops from Fs to Fc instantaneously, without Stribeck effect; no presliding. F jumps at v = 0, so a
   mass stopped by it in discrete steps oscillates about v = 0 with the amplitude F h / m; KarnoppMass and SwitchMass
   contain the mass and stop it exactly. */

#define MODEL    Stiction
#define SUMMARY  "Stiction, Coulomb and viscous friction"
#define SOURCE   "Morin 1833; Olsson and others, European Journal of Control 4(3), 1998, eq. (4)"
#define CITES    "Olsson1998"
#define STATUS   "equation (4) of Olsson et al. 1998 and the preceding ones"
#define FEATURES "rate dependent, needs force"

/* clang-format off */
#define VARIABLES                                                                                                                       \
    INPUT    (v,     VELOCITY, 0.0,               "relative sliding velocity")                                                          \
    INPUT    (F_ext, FORCE,    0.0,               "sum of the other " FORCE_NOUN "s on the " MASS_NOUN "; determines friction at rest") \
    OPTIONAL (Fn,    "N",      1.0,               "normal force")                                                                       \
    OUTPUT   (F,     FORCE,                       "friction " FORCE_NOUN ", opposes v")                                                 \
    FLAG     (stuck,                              "at rest and held by friction")                                                       \
    PARAMETER(Fc,    FORCE,    1.0, 0.0,   INF,   "Coulomb friction at Fn0")                                                            \
    PARAMETER(Fs,    FORCE,    1.5, 0.0,   INF,   "static friction at Fn0 (usually above Fc)")                                          \
    PARAMETER(Fv,    DAMPING,  0.4, 0.0,   INF,   "viscous coefficient")                                                                \
    PARAMETER(Fn0,   "N",      1.0, 1e-12, INF,   "normal force for which the parameters are valid")

#define CONTACT \
    COULOMB(Fc) \
    STATIC (Fs) \
    VISCOUS(Fv)
/* clang-format on */

#include "resting.h"

#include "block.h"
#include "rest.h"
#include "symmetric_rest.h"

static void equations(Model *m)
{
    GIVEN(m)
    const double direction = direction_of(m);

    if (direction == 0.0)
        at_rest(m); /* (4) */
    else
        sliding(m, direction * load_of(Fn, Fn0) * Fc + Fv * v);
}
