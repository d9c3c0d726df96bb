/* Friction force by local function estimation: a polynomial through the mean forces of the last sampling intervals.

   Savitzky, Golay, Analytical Chemistry 36(8), 1964 (least squares over the last samples as a weighted sum). The
   weights for means over intervals, evaluated at the end of the last interval, follow in the same way.

       F_m[j] = u_prev - m (v[k-j] - v[k-j-1])/Ts,   j = 0 ... n-1
       F_hat = w[0] F_m[0] + ... + w[n-1] F_m[n-1]
       t     = (n - 1)/2 - j
       w[j]  = 1/n                                                    p = 0
               + 6 t/(n^2 - 1)                                        p = 1, 2
               + 30 n (t^2 - (n^2 - 1)/12)/((n^2 - 1)(n^2 - 4))       p = 2
       u     = clip(gain F_hat, u_min, u_max)

   F_m are the mean friction forces in the last n sampling intervals, n = window. F_hat is the value at sample k of the
   polynomial of degree p whose means over these intervals fit F_m best (least squares).

   Use it for an estimate with finite memory: only the last n samples count, and a force that is a polynomial of degree
   p is estimated without error. For a force that grows at a constant rate, the estimate lags by n Ts/2 for p = 0 and
   has no lag for p = 1 and 2. Connect u to the input f of a position controller; u_prev is the force since the last
   sample after all limits, so that nothing winds up if the actuator saturates. In a system file, the connection to
   u_prev needs a delay.

   While an input is NaN or infinite, the outputs and the memory are held; the mean force of an interval that begins or
   ends at such a sample is omitted.

   Before the first sample, the velocity is v0 and the mean forces are 0. reset clears the memory, so that F_hat is 0 in
   the same sample. While enable is false, u, F_hat and u_sat are 0 and the memory is empty.

   Limits: extrapolation amplifies noise. The variance of noise that is independent in each interval is multiplied by
   1/n for p = 0, 1/n + 3 n/(n^2 - 1) for p = 1 and, for p = 2, by another 5 n^3/((n^2 - 1)(n^2 - 4)) in addition: about
   1/n, 4/n, 9/n. If n is at most p, the degree is n - 1. With a wrong mass, F_hat contains the difference of the
   inertia forces. u_min must not exceed u_max. */

#define MODEL   LocalFunctionEstimator
#define SUMMARY "Compensation of friction estimated by a polynomial fit to the last mean {force}s"
#define SOURCE  "Savitzky, Golay, Analytical Chemistry 36(8), 1964"
#define CITES   "SavitzkyGolay1964"

/* clang-format off */
#define VARIABLES                                                                                                                   \
    INPUT    (v,      VELOCITY, 0.0,                "measured velocity")                                                            \
    INPUT    (u_prev, FORCE,    0.0,                FORCE_NOUN " applied since the last sample, after all limits")                  \
    COMMAND  (enable, 1,                            "false: u = 0, F_hat = 0 and the memory is empty")                              \
    COMMAND  (reset,  0,                            "true: the memory is cleared")                                                  \
    OUTPUT   (u,      FORCE,                        "compensation " FORCE_NOUN " gain F_hat, within u_min and u_max")               \
    OUTPUT   (F_hat,  FORCE,                        "estimated friction " FORCE_NOUN ", positive for a positive velocity")          \
    OUTPUT   (u_sat,  NO_UNIT,                      "active limit: -1 lower, +1 upper, 0 none")                                     \
    OUTPUT_FLAG(fault,                             "true: an input is NaN or infinite; while enabled, outputs and states are held") \
    FIXED    (Ts,     TIME,     1e-3,   1e-9, INF,  "sample time")                                                                  \
    COUNT    (window, 10,       1,      LONGEST,    "number of intervals in the estimate")                                          \
    FIXED    (v0,     VELOCITY, 0.0,   -INF,  INF,  "velocity before the first sample")                                             \
    COUNT    (degree, 1,        0,      2,          "degree of the polynomial")                                                     \
    PARAMETER(gain,   NO_UNIT,  1.0,    0.0,  1.0,  "fraction of the friction that is compensated")                                 \
    PARAMETER(m,      MASS,     1.0,    0.0,  INF,  MOVING_MASS)                                                                    \
    PARAMETER(u_min,  FORCE,   -100.0, -INF,  INF,  "lower limit of u")                                                             \
    PARAMETER(u_max,  FORCE,    100.0, -INF,  INF,  "upper limit of u")

#define USE                                              \
    KIND (estimator)                                     \
    TUNED(m, m)                                          \
    TUNED(window, max(3, round(1 / (pi * corner * Ts)))) \
    LINEAR(local_function)
/* clang-format on */

#include <stdbool.h>
#include <stddef.h>

enum { LONGEST = 64 };

#define SAMPLED
#define GUARDED
#define REQUIRES limits_in_order
#define SKIPS_BY skip
#define MEMORY   struct past
#define VALID_BY is_past

struct past {
    double force[LONGEST]; /* mean forces, in a ring of n */
    size_t latest;         /* index of the latest */
    double v;              /* velocity in the previous sample */
    bool unknown;          /* that sample was invalid: v is an older one */
};

#include "block.h"
#include "limits.h"
#include "compensation.h"

/* Return the weight of the interval j before the last one. */
static double weight(double n, double j, int degree)
{
    const double t = (n - 1.0) / 2.0 - j;
    const double n2 = n * n;
    double w = 1.0 / n;
    if (degree >= 1 && n >= 2.0)
        w += 6.0 * t / (n2 - 1.0);
    if (degree >= 2 && n >= 3.0)
        w += 30.0 * n * (t * t - (n2 - 1.0) / 12.0) / ((n2 - 1.0) * (n2 - 4.0));
    return w;
}

static bool is_past(const Model *model)
{
    const struct past *const past = &model->memory;
    return past->latest < (size_t)model->window && isfinite(past->v) && is_flag(&past->unknown);
}

static void skip(Model *model)
{
    if (model->enable == 0.0) {
        model->memory = (struct past){.v = 0.0};
        compensate(model, 0.0);
    }
    model->memory.unknown = true;
}

static void sample(Model *model)
{
    GIVEN(model)
    struct past *const past = &model->memory;
    const size_t n = (size_t)clip(window, 1.0, LONGEST);

    if (model->run.tick == 0)
        past->v = v0;
    const double force = u_prev - m * (v - past->v) / Ts;
    if (reset || !enable) {
        *past = (struct past){.v = 0.0};
    } else if (!past->unknown) {
        past->latest = (past->latest + 1) % n;
        past->force[past->latest] = force;
    }
    past->v = v;
    past->unknown = false;

    double estimate = 0.0;
    for (size_t j = 0; j < n; j++)
        estimate += weight((double)n, (double)j, degree) * past->force[(past->latest + n - j) % n];
    compensate(model, estimate);
}
