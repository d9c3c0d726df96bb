/* Repetitive control: the force against an error with a known period, learned from period to period during operation.

   Hara, Yamamoto, Omata, Nakano, IEEE Transactions on Automatic Control 33(7), 1988; with an inverse model: Tomizuka,
   Tsao, Chew, Journal of Dynamic Systems, Measurement, and Control 111(3), 1989.

       F_hat[k] = sum over i = -M ... M of q[i] y[k-N+i],   within u_min and u_max
       y[k]     = F_hat[k] + rate (L e)[k],   e = r - x
       (L e)[k] = m (e[k+1] - 2 e[k] + e[k-1])/Ts^2
                  + Kd (e[k+1] - e[k-1])/(2 Ts) + Kp e[k]
                  + Ki Ts (sum of all e before k, except those that push
                    F_hat further into an active limit)
       q[i]     = sin(2 pi fq Ts i)/(pi i) cos^2(pi i/(2 (M + 1))), with the sum 1
       u        = clip(gain F_hat, u_min, u_max)

   L is the inverse process sensitivity of a mass m under PID control with these gains, and q are the coefficients of
   the low-pass filter Q. Both are non-causal, which is possible because a period has passed. fq = 0, fq above 1/(2 Ts)
   or M = 0: Q = 1.

   Use it for a rotation or a motion that is repeated without pause, with the period N Ts. Connect u to the input f of
   the PID with the given gains. For separate trials, use IterativeLearning.

   With the process P, the controller C and S_p = P/(1 + P C), the loop is stable if

       |Q (1 - rate L S_p)| < 1 at all frequencies

   Harmonics k/(N Ts) below fq are then suppressed except for the part 1 - Q. Errors between the harmonics are
   amplified, with an exact L by a factor of up to 2/(2 - rate).

   reset discards what was learned, in the same sample. While enable is false, u, F_hat and u_sat are 0 and the memory
   is empty.

   While an input is NaN or infinite, the outputs are held and the period continues, but nothing is learned from this
   sample, the one before it and the one after it.

   Limits: N is at most 4096, or the larger N with which the FMU was built, at most 16384. M is at most N - 2. If the
   period differs from N Ts, the highest harmonics are affected first. Q is not 1 at harmonics near fq, so they are
   suppressed only partly. u_min must not exceed u_max. */

#define MODEL   RepetitiveController
#define SUMMARY "Repetitive learning of the {force} against a periodic error during operation"
#define SOURCE  "Hara, Yamamoto, Omata, Nakano, IEEE Trans. Automatic Control 33(7), 1988"
#define CITES   "Hara1988, Tomizuka1989"

/* clang-format off */
#define VARIABLES                                                                                                                \
    INPUT    (r,      LENGTH, 0.0,                  "reference position")                                                        \
    INPUT    (x,      LENGTH, 0.0,                  "measured position")                                                         \
    COMMAND  (enable, 1,                            "false: u = 0, F_hat = 0 and the memory is empty")                           \
    COMMAND  (reset,  0,                            "true: what was learned is discarded")                                       \
    OUTPUT   (u,      FORCE,                        "periodic " FORCE_NOUN " gain F_hat, within u_min and u_max")                \
    OUTPUT   (F_hat,  FORCE,                        "learned " FORCE_NOUN)                                                       \
    OUTPUT   (u_sat,  NO_UNIT,                      "active limit: -1 lower, +1 upper, 0 none")                                  \
    OUTPUT_FLAG(fault,                          "true: an input is NaN or infinite; while enabled, outputs and states are held") \
    FIXED    (Ts,     TIME,      1e-3,   1e-9, INF, "sample time")                                                               \
    COUNT    (N,      1000,              2, LONGEST, "number of samples in the period")                                          \
    COUNT    (M,      16,                0, TAPS,   "number of samples that Q uses before and after")                            \
    FIXED    (fq,     FREQUENCY, 50.0,   0.0,  INF, "corner frequency of Q; 0: none")                                            \
    PARAMETER(gain,   NO_UNIT,   1.0,    0.0,  1.0, "fraction of the learned " FORCE_NOUN " that is applied")                    \
    PARAMETER(rate,   NO_UNIT,   0.5,    0.0,  2.0, "learning rate")                                                             \
    PARAMETER(m,      MASS,      1.0,    0.0,  INF, MASS_NOUN " of the loop")                                                    \
    PARAMETER(Kp,     STIFFNESS, 12e3,   0.0,  INF, "proportional gain of the controller")                                       \
    PARAMETER(Kd,     DAMPING,   190.0,  0.0,  INF, "derivative gain of the controller")                                         \
    PARAMETER(Ki, FORCE "/(" LENGTH ".s)", 250e3, 0.0, INF, "integral gain of the controller")                                   \
    PARAMETER(u_min,  FORCE,    -100.0, -INF,  INF, "lower limit of u and of the learned " FORCE_NOUN)                           \
    PARAMETER(u_max,  FORCE,     100.0, -INF,  INF, "upper limit of u and of the learned " FORCE_NOUN)

#define USE            \
    KIND  (learning)   \
    PERIOD(N)          \
    TUNED (N, period)  \
    TUNED (m, m)       \
    TUNED (Kp, Kp)     \
    TUNED (Kd, Kd)     \
    TUNED (Ki, Ki)     \
    TUNED (fq, corner) \
    RULE  (contraction)
/* clang-format on */

#include <stdbool.h>
#include <stdint.h>

#define LONGEST 4096
#define SIZES   SIZE(N, LONGEST, 16384)

enum { TAPS = 64, RING = LONGEST + TAPS + 1 };

#define SAMPLED
#define GUARDED
#define REQUIRES limits_in_order
#define SKIPS_BY skip
#define MEMORY   struct period
#define VALID_BY is_period

struct period {
    double y[RING];     /* last N + M samples, sample k at index k modulo N + M + 1 */
    double q[TAPS + 1]; /* half of Q */
    double e[2];        /* the last two errors */
    double integral;    /* of the errors before the last one */
    bool known;         /* there is a previous sample */
    int missing;        /* number of unknown errors among the last two */
    double limited;     /* active limit of the last force: -1 lower, +1 upper */
};

#include "block.h"
#include "limits.h"
#include "compensation.h"
#include "constants.h"

static bool is_period(const Model *model)
{
    const struct period *const past = &model->memory;
    return is_flag(&past->known) && is_count(past->missing, 2.0) && is_direction(past->limited);
}

/* Compute the coefficients of Q for i = 0 ... M. */
static void design(double *q, int M, double corner)
{
    const bool none = corner <= 0.0 || corner >= 0.5;
    double sum = 0.0;

    for (int i = 0; i <= M; i++) {
        const double window = square(cos(PI * i / (2.0 * (M + 1))));
        q[i] = i == 0 ? (none ? 1.0 : 2.0 * corner) : none ? 0.0 : sin(2.0 * PI * corner * i) / (PI * i) * window;
        sum += i == 0 ? q[i] : 2.0 * q[i];
    }
    for (int i = 0; i <= M; i++)
        q[i] /= sum;
}

/* Return the number of samples that Q uses before and after. */
static int half_of(const Model *model)
{
    GIVEN(model)
    return M < N - 2 ? M : N - 2;
}

/* For an unknown sample, use the force from the previous period. */
static void skip(Model *model)
{
    GIVEN(model)
    struct period *const past = &model->memory;
    const int64_t ring = N + half_of(model) + 1, k = model->run.tick + ring;

    if (!enable) {
        *past = (struct period){.known = false};
        compensate(model, 0.0);
        return;
    }
    past->y[k % ring] = past->y[(k - N) % ring];
    past->missing = 2;
}

static void sample(Model *model)
{
    GIVEN(model)
    struct period *const past = &model->memory;
    const int half = half_of(model);
    const int64_t ring = N + half + 1;
    const int64_t k = model->run.tick + ring; /* k - N - M is not negative */
    const double e = r - x, heard = past->e[0] * past->limited > 0.0 ? 0.0 : past->e[0];

    if (reset || !enable)
        *past = (struct period){.known = false};
    if (!past->known) {
        design(past->q, half, fq * Ts);
        past->e[0] = past->e[1] = e;
        past->missing = 0;
    } else if (past->missing == 2) {
        past->integral += Ts * heard;
        past->e[0] = past->e[1] = e;
    } else {
        const double second = (e - 2.0 * past->e[0] + past->e[1]) / (Ts * Ts);
        const double first = (e - past->e[1]) / (2.0 * Ts);
        if (past->missing == 0)
            past->y[(k - 1) % ring] += rate * (m * second + Kd * first + Kp * past->e[0] + Ki * past->integral);
        past->integral += Ts * heard;
        past->e[1] = past->e[0];
        past->e[0] = e;
    }
    past->known = enable;
    past->missing -= past->missing > 0;

    double force = past->q[0] * past->y[(k - N) % ring];
    for (int i = 1; i <= half; i++)
        force += past->q[i] * (past->y[(k - N - i) % ring] + past->y[(k - N + i) % ring]);
    const double learned = clip(force, u_min, u_max);
    past->limited = sign(force - learned);
    past->y[k % ring] = learned;
    compensate(model, learned);
    model->u_sat = enable ? past->limited : 0.0;
}
