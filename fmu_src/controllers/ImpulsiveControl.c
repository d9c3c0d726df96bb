/* Impulsive control: force pulses for an axis that is stuck away from its target, each sized to slide it by its error.

   Armstrong-Helouvry, Dupont, Canudas de Wit: A survey of models, analysis tools and compensation methods for the
   control of machines with friction, Automatica 30(7), 1994 (survey); the size of the pulse follows from Newton's law.

       stuck:  |v| < v_stuck for n_stuck samples in a row, and |r - x| > tol
       then:   a pulse Fp sgn(r - x) of n_pulse samples, tp = n_pulse Ts
       Fp      = (Fc + sqrt(Fc^2 + 8 m Fc d/tp^2))/2,   at least Fs
       d       = gain |r - x|
       u       = clip(f + pulse, u_min, u_max);   with alone: without f

   A mass m with Coulomb friction Fc that starts from rest under the constant force Fp for tp slides by

       d = Fp (Fp - Fc) tp^2/(2 m Fc)

   until it stops again; Fp above is the inverse. After a pulse, the count of samples at rest restarts, so n_stuck is
   also the dwell between two pulses. The error after a pulse is e - d; the pulses converge if 0 < d/e < 2.

   Use it to remove the last micrometres of error inside the stiction band if the time is not critical. It supplements a
   position controller without integral action, whose force is connected to f, or replaces it. With sized = false, Fp =
   F_pulse.

   While enable is false, u and u_sat are 0 and the counters are 0. reset ends a pulse in the same sample.

   While an input is NaN or infinite, the outputs are held, even during a pulse; these samples count towards the pulse,
   and the dwell restarts.

   Limits: d is exact for Fs = Fc, a stiff actuator and f = 0. Static friction above Fc makes every slide longer. If Fp
   = Fs, the slide is longer than a small error; choose tp short enough for

       Fs (Fs - Fc) tp^2/(2 m Fc) < 2 tol

   or the pulses do not settle. A pulse within the presliding range springs back. u_min must not exceed u_max. */

#define MODEL   ImpulsiveControl
#define SUMMARY "{Force} pulses for an axis that is stuck away from its target"
#define SOURCE  "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994"
#define CITES   "ArmstrongHelouvry1994"

/* clang-format off */
#define VARIABLES                                                                                                               \
    INPUT    (r,       LENGTH,   0.0,                 "reference position")                                                     \
    INPUT    (x,       LENGTH,   0.0,                 "measured position")                                                      \
    INPUT    (v,       VELOCITY, 0.0,                 "measured velocity")                                                      \
    OPTIONAL (f,       FORCE,    0.0,                 FORCE_NOUN " of the position controller")                                 \
    COMMAND  (enable,  1,                             "false: u = 0 and the counters are 0")                                    \
    COMMAND  (reset,   0,                             "true: no pulse, and the counters are 0")                                 \
    OUTPUT   (u,       FORCE,                         "f plus the pulse, within u_min and u_max")                               \
    OUTPUT   (u_sat,   NO_UNIT,                       "active limit: -1 lower, +1 upper, 0 none")                               \
    OUTPUT_FLAG(fault,                         "true: an input is NaN or infinite; while enabled, outputs and states are held") \
    LOCAL    (pulse,   FORCE,                         FORCE_NOUN " of the pulse, 0 between pulses")                             \
    TALLY    (pulses,                                 "number of pulses started")                                               \
    FIXED    (Ts,      TIME,     1e-3,   1e-9,  INF,  "sample time")                                                            \
    PARAMETER(gain,    NO_UNIT,  1.0,    0.0,   1.0,  "fraction of the error that a pulse removes")                             \
    PARAMETER(m,       MASS,     1.0,    1e-12, INF,  MOVING_MASS)                                                              \
    PARAMETER(Fc,      FORCE,    1.0,    1e-12, INF,  "Coulomb friction")                                                       \
    PARAMETER(Fs,      FORCE,    1.5,    0.0,   INF,  "static friction")                                                        \
    SWITCH   (sized,   1,                             "true: the pulse is sized by the error; false: F_pulse")                  \
    PARAMETER(F_pulse, FORCE,    3.0,    0.0,   INF,  FORCE_NOUN " of a pulse if sized is false")                               \
    SWITCH   (alone,   1,                             "true: f is omitted during a pulse")                                      \
    PARAMETER(tol,     LENGTH,   1e-4,   0.0,   INF,  "tolerated error")                                                        \
    PARAMETER(v_stuck, VELOCITY, 1e-3,   0.0,   INF,  "speed below which the axis is considered stuck")                         \
    COUNT    (n_stuck, 10,       1,      COUNTS,      "samples at rest before a pulse")                                         \
    COUNT    (n_pulse, 5,        1,      COUNTS,      "samples of a pulse")                                                     \
    PARAMETER(u_min,   FORCE,   -100.0, -INF,   INF,  "lower limit of u")                                                       \
    PARAMETER(u_max,   FORCE,    100.0, -INF,   INF,  "upper limit of u")

#define USE                                                                    \
    KIND (dither)                                                              \
    NEVER("It acts on an axis that is stuck away from its target, not on a moving axis.")
/* clang-format on */

#define SAMPLED
#define GUARDED
#define REQUIRES limits_in_order
#define SKIPS_BY skip
#define MEMORY   struct train
#define VALID_BY is_train

struct train {
    int at_rest;   /* consecutive samples, up to n_stuck */
    int left;      /* remaining samples of the pulse */
    double force;  /* force of the pulse, signed */
    double pulses; /* number started so far */
};

#include "block.h"
#include "limits.h"

/* Return the force that slides the mass by a distance, during tp and the subsequent stop. */
static double force_for(double distance, double tp, double m, double Fc, double Fs)
{
    const double force = 0.5 * (Fc + sqrt(Fc * Fc + 8.0 * m * Fc * distance / (tp * tp)));
    return force > Fs ? force : Fs;
}

static bool is_train(const Model *model)
{
    const struct train *const train = &model->memory;
    return is_count(train->at_rest, model->n_stuck) && is_count(train->left, model->n_pulse) &&
           isfinite(train->force) && is_count(train->pulses, DBL_MAX);
}

static void skip(Model *model)
{
    struct train *const train = &model->memory;
    if (train->left > 0)
        train->left--;
    train->at_rest = 0;
    if (model->enable == 0.0) {
        train->left = 0;
        model->u = model->u_sat = model->pulse = 0.0;
    }
}

static void sample(Model *model)
{
    GIVEN(model)
    struct train *const train = &model->memory;
    const double e = r - x;

    if (reset || !enable)
        *train = (struct train){.pulses = train->pulses};
    const bool rests = enable && fabs(v) < v_stuck && train->left == 0;
    train->at_rest = rests ? train->at_rest + (train->at_rest < n_stuck) : 0;

    if (enable && !reset && train->at_rest >= n_stuck && fabs(e) > tol) {
        train->left = n_pulse;
        train->force = sign(e) * (sized ? force_for(gain * fabs(e), n_pulse * Ts, m, Fc, Fs) : gain * F_pulse);
        train->pulses += 1.0;
        train->at_rest = 0;
    }
    const bool active = train->left > 0;
    if (active)
        train->left--;

    const double wanted = !enable ? 0.0 : !active ? f : alone ? train->force : f + train->force;
    model->u = enable ? clip(wanted, u_min, u_max) : 0.0;
    model->u_sat = sign(wanted - model->u);
    model->pulse = active ? train->force : 0.0;
    model->pulses = fmin(train->pulses, COUNTS);
}
