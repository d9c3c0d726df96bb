/* Static friction: Coulomb, viscous and Stribeck, with an offset. At rest the external force decides.

   Tustin: IEE Journal 94(2A), 1947 (delta = 1); Bo, Pavelescu: Wear 82, 1982 (any delta); Armstrong-Helouvry,
   Dupont, Canudas de Wit: Automatica 30(7), 1994 (delta = 2). The force at rest is equation (4) of Olsson, Astrom,
   Canudas de Wit, Gaefvert, Lischinsky: European Journal of Control 4, 1998.

       v != 0:  F = sign(v) g(v) + Fv v + offset,   g(v) = Fc + (Fs - Fc) exp(-|v/vs|^delta)
       v  = 0:  F = F_ext, at most Fs away from the offset

   Fs = Fc is Coulomb and viscous friction; Fs < Fc, friction that grows with speed, is allowed. With asymmetric,
   v < 0 has its own set of parameters.

   Limits: F jumps at v = 0, so a mass that is stopped by it in discrete steps swings about v = 0 by F h / m. F_ext
   is the sum of all other forces on the mass, needed only to hold it at v = 0. */

/* @article{ArmstrongHelouvry1994,
     author  = {Armstrong-H{\'e}louvry, B. and Dupont, P. and Canudas de Wit, C.},
     title   = {A survey of models, analysis tools and compensation methods for the control of machines with friction},
     journal = {Automatica},
     volume  = {30}, number = {7}, pages = {1083--1138}, year = {1994}} */

#define MODEL    Stribeck
#define SUMMARY  "Coulomb, viscous and Stribeck friction"
#define SOURCE   "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994"
#define FEATURES "Stribeck, needs force"

/* clang-format off */
#define VARIABLES                                                                                           \
    INPUT    (v,          VELOCITY, 0.0,                 "relative sliding velocity")                       \
    INPUT    (F_ext,      FORCE,    0.0,                 "all other forces on the mass, decides the force at rest") \
    OUTPUT   (F,          FORCE,                         "friction force, opposes v")                       \
    FLAG     (stuck,                                     "at rest and held by friction")                    \
    PARAMETER(Fc,         FORCE,    1.0,  0.0,   INF,    "Coulomb friction")                                \
    PARAMETER(Fs,         FORCE,    1.5,  0.0,   INF,    "static friction, may be below Fc")                \
    PARAMETER(Fv,         DAMPING,  0.4,  0.0,   INF,    "viscous coefficient")                             \
    PARAMETER(vs,         VELOCITY, 1e-3, 1e-12, INF,    "Stribeck velocity")                               \
    PARAMETER(delta,      NO_UNIT,  2.0,  1e-3,  100.0,  "Stribeck exponent")                               \
    PARAMETER(offset,     FORCE,    0.0,  -INF,  INF,    "constant force, for example of an amplifier offset") \
    SWITCH   (asymmetric, 0,                             "v < 0 has its own parameters, the ones named _neg") \
    PARAMETER(Fc_neg,     FORCE,    1.0,  0.0,   INF,    "Coulomb friction for v < 0")                      \
    PARAMETER(Fs_neg,     FORCE,    1.5,  0.0,   INF,    "static friction for v < 0")                       \
    PARAMETER(Fv_neg,     DAMPING,  0.4,  0.0,   INF,    "viscous coefficient for v < 0")                   \
    PARAMETER(vs_neg,     VELOCITY, 1e-3, 1e-12, INF,    "Stribeck velocity for v < 0")                     \
    PARAMETER(delta_neg,  NO_UNIT,  2.0,  1e-3,  100.0,  "Stribeck exponent for v < 0")
/* clang-format on */

#include "block.h"
#include "stribeck.h"

static void equations(Model *m)
{
    GIVEN(m)
    const double holding = asymmetric ? Fs_neg : Fs; /* against a push to negative v */

    m->stuck = v == 0.0 && F_ext >= offset - holding && F_ext <= offset + Fs ? 1.0 : 0.0;
    if (v == 0.0)
        m->F = clip(F_ext, offset - holding, offset + Fs);
    else if (asymmetric && v < 0.0)
        m->F = -stribeck(v, Fc_neg, Fs_neg, vs_neg, delta_neg) + Fv_neg * v + offset;
    else
        m->F = sign(v) * stribeck(v, Fc, Fs, vs, delta) + Fv * v + offset;
}
