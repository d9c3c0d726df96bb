/* LuGre friction: the mean deflection z of elastic bristles that slip at a rate set by the Stribeck curve g(v).

   Canudas de Wit, Olsson, Astrom, Lischinsky: A new model for control of systems with friction, IEEE TAC 40(3), 1995,
   equations (2), (3), (5); start values from its Table I. The bristle damping that decreases with speed is equation
   (30) of Olsson, Astrom, Canudas de Wit, Gaefvert, Lischinsky: Friction models and friction compensation, European
   Journal of Control 4, 1998.

       g(v)  = Fc + (Fs - Fc) exp(-|v/vs|^delta)
       dz/dt = v - sigma0 |v| z / g(v)
       F     = (sigma0 z + sigma1(v) dz/dt) Fn/Fn0 + sigma2 v
       sigma1(v) = sigma1 exp(-(v/v_d)^2) if v_d > 0, else sigma1

   For constant v, the step is the exact solution; for v that changes linearly, it is an integral computed by quadrature
   with error control (attraction.h). With asymmetric, v < 0 has its own set of parameters.

   Use it as a first model of a servo axis with presliding, for simulation and for friction observers: a single state
   describes stiffness at rest, rate-dependent break-away, the Stribeck effect with lag, and stick-slip. It needs v
   only. Fc, Fs, vs and sigma2 follow from steady velocities, sigma0 and sigma1 from small motions around rest.

   Limits: if v jumps, F jumps by sigma1 times as much. With the published values, F can even have the direction of the
   motion; choose v_d < 4 sqrt(2 e) Fc / sigma1 to prevent that. z drifts under a constant force with vibration, and the
   model does not remember reversal points. */

#define MODEL    LuGre
#define SUMMARY  "LuGre bristle friction with Stribeck effect"
#define SOURCE   "Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995"
#define CITES    "CanudasDeWit1995"
#define STATUS   "equations (2), (3) and (5) of the paper; (30) of Olsson et al. 1998 for sigma1(v)"
#define FEATURES "presliding, Stribeck, lag, rate dependent"

/* clang-format off */
#define VARIABLES                                                                                                              \
    INPUT    (v,          VELOCITY,  0.0,                    "relative sliding velocity")                                      \
    OPTIONAL (Fn,         "N",       1.0,                    "normal force")                                                   \
    OUTPUT   (F,          FORCE,                             "friction " FORCE_NOUN ", opposes v")                             \
    STATE    (z,          LENGTH,    0.0,  1e-5,             "mean bristle deflection")                                        \
    PARAMETER(sigma0,     STIFFNESS, 1e5,  1e-9, INF,        "bristle stiffness")                                              \
    PARAMETER(sigma1,     DAMPING,   316.22776601683796, 0.0, INF, "bristle damping")                                          \
    PARAMETER(sigma2,     DAMPING,   0.4,  0.0,  INF,        "viscous coefficient")                                            \
    PARAMETER(Fc,         FORCE,     1.0,  1e-9, INF,        "Coulomb friction")                                               \
    PARAMETER(Fs,         FORCE,     1.5,  1e-9, INF,        "static friction (usually above Fc)")                             \
    PARAMETER(vs,         VELOCITY,  1e-3, 1e-12, INF,       "Stribeck velocity")                                              \
    PARAMETER(delta,      NO_UNIT,   2.0,  1e-3, 100.0,      "Stribeck exponent")                                              \
    PARAMETER(v_d,        VELOCITY,  0.0,  0.0,  INF,        "speed at which the bristle damping decays; 0: constant damping") \
    SWITCH   (asymmetric, 0,                                 "v < 0 uses the parameters with the suffix _neg")                 \
    PARAMETER(sigma2_neg, DAMPING,   0.4,  0.0,  INF,        "viscous coefficient for v < 0")                                  \
    PARAMETER(Fc_neg,     FORCE,     1.0,  1e-9, INF,        "Coulomb friction for v < 0")                                     \
    PARAMETER(Fs_neg,     FORCE,     1.5,  1e-9, INF,        "static friction for v < 0")                                      \
    PARAMETER(vs_neg,     VELOCITY,  1e-3, 1e-12, INF,       "Stribeck velocity for v < 0")                                    \
    PARAMETER(delta_neg,  NO_UNIT,   2.0,  1e-3, 100.0,      "Stribeck exponent for v < 0")                                    \
    PARAMETER(Fn0,        "N",       1.0,  1e-12, INF,       "normal force for which the parameters are valid")

#define CONTACT               \
    COULOMB  (Fc)             \
    STATIC   (Fs)             \
    STRIBECK (vs, delta)      \
    VISCOUS  (sigma2)         \
    STIFFNESS(sigma0)         \
    DAMPING  (sigma1, sigma2)

#define IDENTIFIED              \
    HELD   (v_d, 0, small_fast) \
    SLIDING(z, Fc / sigma0)
/* clang-format on */

#define STEPS_BY step

#include "block.h"
#include "presliding.h"
#include "stribeck.h"
#include "attraction.h"

/* Return g for a speed in the direction of motion, backward or forward. */
static double level(const Model *m, double speed, bool backward)
{
    GIVEN(m)
    return asymmetric && backward ? stribeck(speed, Fc_neg, Fs_neg, vs_neg, delta_neg)
                                  : stribeck(speed, Fc, Fs, vs, delta);
}

/* Compute dz/dt and F from the rate sigma0 |v| / g at which the bristles slip. */
static void contact(Model *m, double rate)
{
    GIVEN(m)
    const double damping = fading(sigma1, v, v_d);
    const double viscous = asymmetric && v < 0.0 ? sigma2_neg : sigma2;

    m->der_z = v - rate * z;                                                   /* (2), (3) */
    m->F = load_of(Fn, Fn0) * (sigma0 * z + damping * m->der_z) + viscous * v; /* (5) */
}

static void equations(Model *m) { contact(m, m->sigma0 * fabs(m->v) / level(m, m->v, m->v < 0.0)); }

/* On a ramp of v, y = sigma0 z is attracted to g: dy/dt = sigma0 |v| (1 - y/g). `sensitivity` is the effect of an error
   of y on F. */
static bool ramp(Model *m, double h)
{
    GIVEN(m)
    const double direction = sign(slide(m, h)), growth = direction * SLOPE(v), y = direction * sigma0 * z;
    const double v_end = fmax(fabs(v) + growth * h, 0.0), tolerance = quadrature_tolerance(m);
    const bool backward = direction < 0.0;
    const Attraction slip = asymmetric && backward
                                ? (Attraction){sigma0, true, Fc_neg, Fs_neg, vs_neg, delta_neg, tolerance}
                                : (Attraction){sigma0, true, Fc, Fs, vs, delta, tolerance};
    const double sensitivity = 1.0 + fmax(fading(sigma1, v, v_d) * fabs(v) / level(m, fabs(v), backward),
                                          fading(sigma1, v_end, v_d) * v_end / level(m, v_end, backward));
    double kept, gained;
    if (!attract(&slip, fabs(v), growth, h, fabs(y), sensitivity, &kept, &gained))
        return false;
    m->z = direction * (kept * y + gained) / sigma0;
    return true;
}

static bool step(Model *m, double h)
{
    GIVEN(m)
    if (SLOPE(v) != 0.0)
        return slide(m, h) == 0.0 || ramp(m, h);
    /* at constant velocity, z relaxes to sign(v) g/sigma0 at the rate sigma0 |v| / g */
    const double g = level(m, v, v < 0.0), rate = sigma0 * fabs(v) / g;
    m->z = relax(z, sign(v) * g / sigma0, rate * h);
    contact(m, rate);
    m->run.outputs_done = true;
    return true;
}
