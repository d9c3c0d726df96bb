/* Tustin friction: static friction that decreases exponentially with speed to Coulomb friction, and viscous friction.

   Tustin: Journal of the Institution of Electrical Engineers 94(2A), 1947. The force at rest is equation (4) of Olsson,
   Astrom, Canudas de Wit, Gaefvert, Lischinsky: European Journal of Control 4(3), 1998.

       v != 0:  F = load g(v) sign(v) + Fv v
       v  = 0:  F = F_ext, |F| <= load Fs
       g(v) = Fc + (Fs - Fc) exp(-|v| / vs)
       load = max(Fn, 0) / Fn0

   It equals Stribeck with the exponent delta = 1. The term with Fs - Fc has the sign of v; without the sign, as printed
   in some texts, it would act in the same direction for both signs of v. F_ext is the sum of all other forces on the
   mass.

   Use it for stick-slip of servo drives at low speed: at v = 0+, the force decreases with the finite slope -(Fs - Fc) /
   vs, which determines stability there; the Gaussian curve (delta = 2) has slope zero.

   Limits: no presliding. F jumps at v = 0, so a mass stopped by it in discrete steps oscillates about v = 0 with the
   amplitude F h / m. */

#define MODEL    Tustin
#define SUMMARY  "Exponential decay from static to Coulomb friction, and viscous friction"
#define SOURCE   "Tustin, Journal of the IEE 94(2A), 1947"
#define CITES    "Tustin1947"
#define STATUS   "equation (4) of Olsson et al. 1998 for the force at rest; not checked against the paper"
#define FEATURES "Stribeck, rate dependent, needs force"

/* clang-format off */
#define VARIABLES                                                                                                                       \
    INPUT    (v,     VELOCITY, 0.0,               "relative sliding velocity")                                                          \
    INPUT    (F_ext, FORCE,    0.0,               "sum of the other " FORCE_NOUN "s on the " MASS_NOUN "; determines friction at rest") \
    OPTIONAL (Fn,    "N",      1.0,               "normal force")                                                                       \
    OUTPUT   (F,     FORCE,                       "friction " FORCE_NOUN ", opposes v")                                                 \
    FLAG     (stuck,                              "at rest and held by friction")                                                       \
    PARAMETER(Fc,    FORCE,    1.0,  0.0,   INF,  "Coulomb friction at Fn0")                                                            \
    PARAMETER(Fs,    FORCE,    1.5,  0.0,   INF,  "static friction at Fn0 (usually above Fc)")                                          \
    PARAMETER(Fv,    DAMPING,  0.4,  0.0,   INF,  "viscous coefficient")                                                                \
    PARAMETER(vs,    VELOCITY, 1e-3, 1e-12, INF,  "velocity scale of the decay of static friction")                                     \
    PARAMETER(Fn0,   "N",      1.0,  1e-12, INF,  "normal force for which the parameters are valid")

#define CONTACT     \
    COULOMB (Fc)    \
    STATIC  (Fs)    \
    STRIBECK(vs, 1) \
    VISCOUS (Fv)
/* clang-format on */

#include "resting.h"

#include "block.h"
#include "rest.h"
#include "symmetric_rest.h"
#include "stribeck.h"

static void equations(Model *m)
{
    GIVEN(m)
    const double direction = direction_of(m);

    if (direction == 0.0)
        at_rest(m); /* (4) */
    else
        sliding(m, direction * load_of(Fn, Fn0) * stribeck(v, Fc, Fs, vs, 1.0) + Fv * v);
}
