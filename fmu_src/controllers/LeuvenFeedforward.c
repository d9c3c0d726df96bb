/* Feedforward of inertia and Leuven friction along the reference, sampled every Ts.

   Swevers, Al-Bender, Ganseman, Prajogo: An integrated friction model structure with improved presliding behavior for
   accurate friction compensation, IEEE TAC 45(4), 2000, for this use; Lampaert, Swevers, Al-Bender, American Control
   Conference, 2004, compare it with the Dahl, LuGre and GMS models.

       w     = (r - last) / Ts,   last: the reference in the previous sample
       z, stacks: as in the block Leuven over a step Ts
                  at the constant velocity w
       F     = (Fh + sigma1 dz/dt) max(Fn, 0) / Fn0 + sigma2 rd
       dz/dt: at the velocity rd
       F_hat = F
       u     = clip(mass rdd + gain F_hat, u_min, u_max)

   If rd = w, F_hat is the force of the block Leuven at the end of a step with the velocity w. This block reuses the
   code of Leuven, with the same equations, decisions and parameters. Connect Fn if the normal force is known.

   Use it for references with nested reversals, where the memory of the reversal points matters; GMSFeedforward and
   ModifiedLeuvenFeedforward have this memory without stacks.

   The first sample and a sample with reset start at r, with dr = 0 and without history. While enable is false, u,
   F_hat, u_sat and the states are 0; when enable becomes true again, dr is 0, however far r has moved. Connect u to the
   input f of a position controller, whose parameter m must then be 0. Feedforward does not change the stability of the
   loop.

   While an input is NaN or infinite, outputs and states are held; the next sample uses the displacement and the time
   since the last valid one.

   A >= 2 max(Fs, Fc) is required: with a smaller A, the curve that begins at a reversal ends below the Stribeck level,
   r stays below 1, and z grows without bound in any steady motion.

   Limits: as for Leuven, and F_hat jumps when an inner loop closes and, by sigma1 times the jump, when rd jumps. A
   reversal between two samples is missed. When the stacks are full, the innermost loop is discarded with a warning.
   u_min must not exceed u_max. */

#define MODEL   LeuvenFeedforward
#define SUMMARY "Feedforward of inertia and Leuven friction with stacks, computed from the reference"
#define STATUS  "not checked against the papers"
#define SOURCE  "Swevers, Al-Bender, Ganseman, Prajogo, IEEE TAC 45(4), 2000"
#define CITES   "Swevers2000, Lampaert2004"

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
    LOCAL     (Fb,       FORCE,                      "hysteresis " FORCE_NOUN " at the last stored reversal")              \
    TALLY     (depth,                                "reversal points on both stacks")                                     \
    FLAG      (sliding,                              "the transition to sliding is complete")                              \
    FLAG      (stack_overflow,                       "an inner loop has been discarded")                                   \
    STATE     (z,        LENGTH,   0.0,   1e-5,      "deflection since the last stored reversal")                          \
    STATE     (v,        VELOCITY, 0.0,   1e-3,      "reference velocity used by the law")                                 \
    STATE     (last,     LENGTH,   0.0,   1.0,       "reference in the previous sample")                                   \
    STATE     (started,  NO_UNIT,  0.0,   1.0,       "1 if there is a previous sample")                                    \
    STATE     (missed,   NO_UNIT,  0.0,   1.0,       "number of samples missed before this one, as an input was invalid")  \
    FIXED     (Ts,       TIME,     1e-3,  1e-9, INF, "sample time")                                                        \
    PARAMETER (gain,     NO_UNIT,  1.0,   0.0,  1.0, "fraction of the friction that is compensated")                       \
    PARAMETER (mass,     MASS,     1.0,   0.0,  INF, MASS_NOUN " of the inertia feedforward; 0: none")                     \
    PARAMETER (A,        FORCE,    4.0,   1e-9,  INF, "limit of the hysteresis curve, at least 2 max(Fs, Fc)")             \
    PARAMETER (zc,       LENGTH,   4e-5,  1e-15, INF, "deflection scale of the hysteresis curve")                          \
    PARAMETER (n,        NO_UNIT,  2.0,   0.1,   1e4, "sharpness of the transition to sliding")                            \
    PARAMETER (sigma1,   DAMPING,  316.22776601683796, 0.0, INF, "bristle damping")                                        \
    PARAMETER (sigma2,   DAMPING,  0.4,   0.0,   INF, "viscous coefficient")                                               \
    PARAMETER (Fc,       FORCE,    1.0,   1e-9,  INF, "Coulomb friction")                                                  \
    PARAMETER (Fs,       FORCE,    1.5,   1e-9,  INF, "static friction (usually above Fc)")                                \
    PARAMETER (vs,       VELOCITY, 1e-3,  1e-12, INF, "Stribeck velocity")                                                 \
    PARAMETER (delta,    NO_UNIT,  2.0,   1e-3,  100.0, "Stribeck exponent")                                               \
    PARAMETER (dead_band, LENGTH,  0.0,   0.0,   INF, "deflection below which a reversal is discarded")                    \
    PARAMETER (Fn0,      "N",      1.0,   1e-12, INF, "normal force for which the parameters are valid")                   \
    PARAMETER (u_min,    FORCE,    -1000.0, -INF, INF, "lower limit of u")                                                 \
    PARAMETER (u_max,    FORCE,    1000.0, -INF, INF, "upper limit of u")

#define CONTACT         \
    COULOMB (Fc)        \
    STATIC  (Fs)        \
    STRIBECK(vs, delta) \
    VISCOUS (sigma2)

#define USE             \
    KIND  (feedforward) \
    MODELS(Leuven)      \
    TUNED (mass, 0)     \
    TUNED (A, max(A, 2 * max(Fs, Fc)))
/* clang-format on */

#include "reversals.h"

#define SAMPLED
#define GUARDED
#define SKIPS_BY skip
#define REQUIRES relations
#define WARNING  "there are more reversal points than the stacks can store; inner loops are discarded"
#define MEMORY   struct reversals
#define VALID_BY are_reversals

#include "block.h"
#include "limits.h"
#include "held_reference.h"
#include "leuven.h"

static const char *relations(const Model *m)
{
    return m->A >= 2.0 * fmax(m->Fs, m->Fc) ? limits_in_order(m) : "A >= 2 max(Fs, Fc)";
}

static void forget(Model *m)
{
    m->z = 0.0;
    m->memory = (struct reversals){.direction = 0.0};
}

static void sample(Model *m)
{
    GIVEN(m)
    follow_reference(m, forget, !isnan(z + A + zc + n + Fc + Fs + vs + delta + dead_band));
    feed_forward(m);
}

static void skip(Model *m) { miss_reference(m, forget); }
