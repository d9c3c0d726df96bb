/* Coulomb friction: a constant force against the motion; at rest, friction balances the external force.

   Coulomb: Theorie des machines simples, 1785. The force at rest as in Olsson, Astrom, Canudas de Wit, Gaefvert,
   Lischinsky: European Journal of Control 4(3), 1998, section on static models.

       v != 0:  F = load Fc sign(v)
       v  = 0:  F = F_ext, |F| <= load Fc
       load = max(Fn, 0) / Fn0

   F_ext is the sum of all other forces on the mass. If it is not connected, F is 0 at v = 0. The coefficient of
   friction is Fc / Fn0.

   Use it if friction at low speed and the approach to rest do not matter, for estimates by hand, and as a reference for
   other models.

   Limits: no stiction, no Stribeck effect, no presliding. F jumps at v = 0, so a mass stopped by it in discrete steps
   oscillates about v = 0 with the amplitude F h / m; KarnoppMass and SwitchMass contain the mass and stop it
   exactly. */

#define MODEL    Coulomb
#define SUMMARY  "Coulomb friction, balances the external {force} at rest"
#define SOURCE   "Coulomb 1785; Olsson and others, European Journal of Control 4(3), 1998"
#define CITES    "Olsson1998"
#define STATUS   "equations of Olsson et al. 1998, section on static models"
#define FEATURES "needs force"

/* clang-format off */
#define VARIABLES                                                                                                                       \
    INPUT    (v,     VELOCITY, 0.0,               "relative sliding velocity")                                                          \
    INPUT    (F_ext, FORCE,    0.0,               "sum of the other " FORCE_NOUN "s on the " MASS_NOUN "; determines friction at rest") \
    OPTIONAL (Fn,    "N",      1.0,               "normal force")                                                                       \
    OUTPUT   (F,     FORCE,                       "friction " FORCE_NOUN ", opposes v")                                                 \
    FLAG     (stuck,                              "at rest and held by friction")                                                       \
    PARAMETER(Fc,    FORCE,    1.0, 0.0,   INF,   "Coulomb friction at Fn0")                                                            \
    PARAMETER(Fn0,   "N",      1.0, 1e-12, INF,   "normal force for which the parameters are valid")

#define CONTACT COULOMB(Fc)
/* clang-format on */

#include "resting.h"

#include "block.h"
#include "rest.h"

static void range(const Model *m, double *low, double *high)
{
    *high = load_of(m->Fn, m->Fn0) * m->Fc;
    *low = -*high;
}

static void equations(Model *m)
{
    GIVEN(m)
    const double direction = direction_of(m);

    if (direction == 0.0)
        at_rest(m);
    else
        sliding(m, direction * (load_of(Fn, Fn0) * Fc));
}
