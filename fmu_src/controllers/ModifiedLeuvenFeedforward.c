/* Feedforward of inertia and modified Leuven friction along the reference, sampled every Ts.

   Lampaert, Swevers, Al-Bender: Modification of the Leuven integrated friction model structure, IEEE TAC 47(4), 2002,
   for the model.

       w     = (r - last) / Ts,   last: the reference in the previous sample
       z, Fi: as in the block ModifiedLeuven over a step Ts
              at the constant velocity w
       F     = (F1 + ... + FN + sigma1 dz/dt) max(Fn, 0) / Fn0 + sigma2 rd
       dz/dt: at the velocity rd
       F_hat = F
       u     = clip(mass rdd + gain F_hat, u_min, u_max)

   If rd = w, F_hat is the force of the block ModifiedLeuven at the end of a step with the velocity w. This block reuses
   the code of ModifiedLeuven, with the same equations and parameters. Connect Fn if the normal force is known.

   Use it for references with nested reversals if sliding friction must follow the Stribeck curve without the lag due to
   the attraction C of GMSFeedforward.

   The first sample and a sample with reset start at r, with dr = 0 and without history. While enable is false, u,
   F_hat, u_sat and the states are 0; when enable becomes true again, dr is 0, however far r has moved. Connect u to the
   input f of a position controller, whose parameter m must then be 0. Feedforward does not change the stability of the
   loop.

   While an input is NaN or infinite, outputs and states are held; the next sample uses the displacement and the time
   since the last valid one.

   Limits: as for ModifiedLeuven: W1 + ... + WN must be at least Fs and Fc, otherwise a warning is logged; for small n,
   loops do not close. A jump of rd causes a jump of F_hat by sigma1 times the jump of rd. A reversal between two
   samples is missed. u_min must not exceed u_max. */

#define MODEL   ModifiedLeuvenFeedforward
#define SUMMARY "Feedforward of inertia and modified Leuven friction computed from the reference"
#define STATUS  "not checked against the paper"
#define SOURCE  "Lampaert, Swevers, Al-Bender, IEEE TAC 47(4), 2002"
#define CITES   "Lampaert2002"

/* clang-format off */
#define VARIABLES                                                                                                          \
    INPUT     (r,        LENGTH,   0.0,              "reference position")                                                 \
    INPUT     (rd,       VELOCITY, 0.0,              "reference velocity")                                                 \
    INPUT     (rdd,      ACCELERATION, 0.0,          "reference acceleration")                                             \
    OPTIONAL  (Fn,       "N",      1.0,              "normal force")                                                       \
    COMMAND   (enable,   1,                          "false: u = 0, F_hat = 0 and the states are at their start values")   \
    COMMAND   (reset,    0,                          "true: the states are reset to their start values")                   \
    OUTPUT    (u,        FORCE,                      "feedforward " FORCE_NOUN ", within u_min and u_max")                 \
    OUTPUT    (F_hat,    FORCE,                      "estimated friction " FORCE_NOUN "; u contains gain F_hat")           \
    OUTPUT    (z_hat,    LENGTH,                     "deflection in this sample")                                          \
    OUTPUT    (u_sat,    NO_UNIT,                    "active limit: -1 lower, +1 upper, 0 none")                           \
    OUTPUT_FLAG(fault,                    "true: an input is NaN or infinite; while enabled, outputs and states are held") \
    LOCAL     (F,        FORCE,                      "friction " FORCE_NOUN " along the reference")                        \
    LOCAL     (Fh,       FORCE,                      "hysteresis " FORCE_NOUN " at the normal force Fn0")                  \
    LOCAL     (der_z,    VELOCITY,                   "time derivative of z")                                               \
    LOCALS    (der_Fi,   10, FORCE "/s",             "time derivative of Fi")                                              \
    FLAGS     (slipping, 10,                         "the element slips")                                                  \
    STATE     (z,        LENGTH,   0.0,   1e-5,      "mean deflection")                                                    \
    STATES    (Fi,       10, FORCE, (0.0), 0.1,      FORCE_NOUN " of the element at the normal force Fn0")                 \
    STATE     (v,        VELOCITY, 0.0,   1e-3,      "reference velocity used by the law")                                 \
    STATE     (last,     LENGTH,   0.0,   1.0,       "reference in the previous sample")                                   \
    STATE     (started,  NO_UNIT,  0.0,   1.0,       "1 if there is a previous sample")                                    \
    STATE     (missed,   NO_UNIT,  0.0,   1.0,       "number of samples missed before this one, as an input was invalid")  \
    FIXED     (Ts,       TIME,     1e-3,  1e-9, INF, "sample time")                                                        \
    PARAMETER (gain,     NO_UNIT,  1.0,   0.0,  1.0, "fraction of the friction that is compensated")                       \
    PARAMETER (mass,     MASS,     1.0,   0.0,  INF, MASS_NOUN " of the inertia feedforward; 0: none")                     \
    COUNT     (N,        10,       1,     10,        "number of elements")                                                 \
    PARAMETERS(k,        10, STIFFNESS, (28e3, 15e3, 10e3, 8e3, 6.5e3, 5.3e3, 4.3e3, 3.5e3, 2.8e3, 2.1e3),                 \
                                   0.0, INF,         "stiffness of the element")                                           \
    PARAMETERS(W,        10, FORCE, (0.15, 0.15, 0.15, 0.15, 0.15, 0.15, 0.15, 0.15, 0.15, 0.15),                          \
                                   0.0, INF,         FORCE_NOUN " at which the element slips")                             \
    PARAMETER (n,        NO_UNIT,  2.0,   0.1,   1e4, "sharpness of the transition to sliding")                            \
    PARAMETER (sigma1,   DAMPING,  316.22776601683796, 0.0, INF, "bristle damping")                                        \
    PARAMETER (sigma2,   DAMPING,  0.4,   0.0,   INF, "viscous coefficient")                                               \
    PARAMETER (Fc,       FORCE,    1.0,   1e-9,  INF, "Coulomb friction")                                                  \
    PARAMETER (Fs,       FORCE,    1.5,   1e-9,  INF, "static friction (usually above Fc)")                                \
    PARAMETER (vs,       VELOCITY, 1e-3,  1e-12, INF, "Stribeck velocity")                                                 \
    PARAMETER (delta,    NO_UNIT,  2.0,   1e-3,  100.0, "Stribeck exponent")                                               \
    PARAMETER (Fn0,      "N",      1.0,   1e-12, INF, "normal force for which the parameters are valid")                   \
    PARAMETER (u_min,    FORCE,    -1000.0, -INF, INF, "lower limit of u")                                                 \
    PARAMETER (u_max,    FORCE,    1000.0, -INF, INF, "upper limit of u")

#define CONTACT         \
    COULOMB (Fc)        \
    STATIC  (Fs)        \
    STRIBECK(vs, delta) \
    VISCOUS (sigma2)

/* As with GMS, whose elements slip one after the other: no other rounding of the transition, no bristle damping. The
   sum of W is slightly above the level; below it, the deflection would grow without bound. */
#define USE                                                                     \
    KIND  (feedforward)                                                         \
    MODELS(GMS)                                                                 \
    TUNED (mass, 0)                                                             \
    TUNED (n, 100)                                                              \
    TUNED (sigma1, 0)                                                           \
    TUNED (W[i], (1 + 1e-9) * max(Fs, Fc) * alpha[i] / max(sum(alpha), 1e-300))
/* clang-format on */

#define SAMPLED
#define GUARDED
#define SKIPS_BY skip
#define REQUIRES limits_in_order
#define WARNING  "the sum of W is below Fs or Fc, so the force cannot reach the Stribeck curve; increase W"

#include "block.h"
#include "limits.h"
#include "held_reference.h"
#include "modified_leuven.h"

static void forget(Model *m)
{
    m->z = 0.0;
    for (int i = 0; i < 10; i++)
        m->Fi[i] = 0.0;
}

static void sample(Model *m)
{
    GIVEN(m)
    double sum = n + Fc + Fs + vs + delta;
    for (int i = 0; i < 10; i++)
        sum += k[i] + W[i] + Fi[i];
    follow_reference(m, forget, !isnan(sum));
    feed_forward(m);
}

static void skip(Model *m) { miss_reference(m, forget); }
