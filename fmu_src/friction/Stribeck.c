/* Static friction model: Coulomb, viscous and Stribeck friction with an offset. At rest, friction balances the external
   force.

   Tustin: IEE Journal 94(2A), 1947 (delta = 1); Bo, Pavelescu: Wear 82, 1982 (any delta); Armstrong-Helouvry,
   Dupont, Canudas de Wit: Automatica 30(7), 1994 (delta = 2). The force at rest is equation (4) of Olsson, Astrom,
   Canudas de Wit, Gaefvert, Lischinsky: European Journal of Control 4, 1998.

       v != 0:  F = load g(v) sign(v) + Fv v + offset
       v  = 0:  F = F_ext, |F - offset| <= load Fs
       shape 0: g(v) = Fc + (Fs - Fc) exp(-|v/vs|^delta)
       shape 1: g(v) = Fc + (Fs - Fc) / (1 + |v/vs|^delta)
       load = max(Fn, 0) / Fn0

   Fs = Fc is Coulomb and viscous friction; Fs < Fc (friction that grows with speed) is allowed. With asymmetric, v < 0
   has its own set of parameters. Shape 1, the Lorentzian curve, is from Hess, Soom: Journal of Tribology 112(1), 1990,
   who found delta = 2 for lubricated line contacts; its tail is longer.

   Use it for motion without presliding: identification from steady velocities, feedforward, and the curve of bristle
   models at constant velocity.

   Limits: F jumps at v = 0, so a mass stopped by it in discrete steps oscillates about v = 0 with the amplitude F h /
   m. F_ext is the sum of all other forces on the mass; it is only needed to hold the mass at v = 0. */

#define MODEL    Stribeck
#define SUMMARY  "Coulomb, viscous and Stribeck friction"
#define SOURCE   "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994"
#define CITES    "ArmstrongHelouvry1994, HessSoom1990"
#define STATUS   "equation (4) of Olsson et al. 1998 for the force at rest"
#define FEATURES "Stribeck, rate dependent, needs force"

/* clang-format off */
#define VARIABLES                                                                                                                              \
    INPUT    (v,          VELOCITY, 0.0,                 "relative sliding velocity")                                                          \
    INPUT    (F_ext,      FORCE,    0.0,                 "sum of the other " FORCE_NOUN "s on the " MASS_NOUN "; determines friction at rest") \
    OPTIONAL (Fn,         "N",      1.0,                 "normal force")                                                                       \
    OUTPUT   (F,          FORCE,                         "friction " FORCE_NOUN ", opposes v")                                                 \
    FLAG     (stuck,                                     "at rest and held by friction")                                                       \
    PARAMETER(Fc,         FORCE,    1.0,  0.0,   INF,    "Coulomb friction")                                                                   \
    PARAMETER(Fs,         FORCE,    1.5,  0.0,   INF,    "static friction (usually above Fc)")                                                 \
    PARAMETER(Fv,         DAMPING,  0.4,  0.0,   INF,    "viscous coefficient")                                                                \
    PARAMETER(vs,         VELOCITY, 1e-3, 1e-12, INF,    "Stribeck velocity")                                                                  \
    PARAMETER(delta,      NO_UNIT,  2.0,  1e-3,  100.0,  "Stribeck exponent")                                                                  \
    COUNT    (shape,      0,        0,     1,            "shape of the Stribeck curve; 0: exponential, 1: Lorentzian")                         \
    PARAMETER(Fn0,        "N",      1.0,  1e-12, INF,    "normal force for which the parameters are valid")                                    \
    PARAMETER(offset,     FORCE,    0.0,  -INF,  INF,    "constant " FORCE_NOUN ", for example of an amplifier offset")                        \
    SWITCH   (asymmetric, 0,                             "v < 0 uses the parameters with the suffix _neg")                                     \
    PARAMETER(Fc_neg,     FORCE,    1.0,  0.0,   INF,    "Coulomb friction for v < 0")                                                         \
    PARAMETER(Fs_neg,     FORCE,    1.5,  0.0,   INF,    "static friction for v < 0")                                                          \
    PARAMETER(Fv_neg,     DAMPING,  0.4,  0.0,   INF,    "viscous coefficient for v < 0")                                                      \
    PARAMETER(vs_neg,     VELOCITY, 1e-3, 1e-12, INF,    "Stribeck velocity for v < 0")                                                        \
    PARAMETER(delta_neg,  NO_UNIT,  2.0,  1e-3,  100.0,  "Stribeck exponent for v < 0")

#define CONTACT                     \
    COULOMB (Fc)                    \
    STATIC  (Fs)                    \
    STRIBECK(vs, delta, shape == 0) \
    VISCOUS (Fv)

#define IDENTIFIED HELD(offset, 0, directions)
/* clang-format on */

#include "resting.h"

#include "block.h"
#include "rest.h"
#include "stribeck.h"

/* Friction at rest. */
static void range(const Model *m, double *low, double *high)
{
    GIVEN(m)
    const double load = load_of(Fn, Fn0);
    *low = offset - load * (asymmetric ? held_by(m, Fs_neg, Fc_neg) : held_by(m, Fs, Fc));
    *high = offset + load * held_by(m, Fs, Fc);
}

/* Return the friction in steady sliding, from the parameters for the direction of motion. */
static double level(const Model *m, bool negative)
{
    GIVEN(m)
    double (*const curve)(double, double, double, double, double) = shape == 1 ? stribeck_lorentzian : stribeck;
    return negative ? curve(v, Fc_neg, Fs_neg, vs_neg, delta_neg) : curve(v, Fc, Fs, vs, delta);
}

static void equations(Model *m)
{
    GIVEN(m)
    const double direction = direction_of(m);

    if (direction == 0.0)
        at_rest(m); /* (4) */
    else {
        const bool negative = asymmetric && direction < 0.0;
        const double viscous = negative ? Fv_neg : Fv;
        sliding(m, direction * load_of(Fn, Fn0) * level(m, negative) + viscous * v + offset);
    }
}
