/* Iterative learning control: the force for a repeated motion, learned from trial to trial.

   Arimoto, Kawamura, Miyazaki, Journal of Robotic Systems 1(2), 1984; survey, with a zero-phase low-pass: Bristow,
   Tharayil, Alleyne, IEEE Control Systems Magazine 26(3), 2006.

       trial j:   F_hat[k] = w_j[k],   k = 0 ... N-1 samples from its start
                  e[k] = r - x is recorded
       between:   w_(j+1) = Q (w_j + rate L e_j), within u_min and u_max
       (L e)[k] = m (e[k+1] - 2 e[k] + e[k-1])/Ts^2
                  + Kd (e[k+1] - e[k-1])/(2 Ts) + Kp e[k]
                  + Ki Ts (e[0] + ... + e[k-1])
       u        = clip(gain F_hat, u_min, u_max)

   Outside the trial, e has its first or last value. Q is a Butterworth low-pass filter of order 2 with the corner
   frequency fq, applied forwards and backwards; fq = 0: Q = 1.

   L is the inverse process sensitivity of a mass m under PID control with these gains: the force that would have made e
   vanish. trial_end marks the first sample of a trial: when it becomes true, the recorded trial is learned from, and k
   = 0 in the same sample. While learn is false, trials are repeated without learning.

   Use it for a motion that is repeated from the same state, including friction: each trial must begin at rest and at
   the same place as the first one. Connect u to the input f of the PID with the given gains. The learned force contains
   friction and all other forces of the motion; it is valid for this motion only.

   For a linear loop with the process P and the controller C, the 2-norm of the error converges monotonically if

       |Q (1 - rate L P/(1 + P C))| < 1 at all frequencies

   The first trials reduce e by a factor of about 1 - rate.

   reset discards what was learned, in the same sample. While enable is false, u, F_hat and u_sat are 0; the learned
   force is kept. After both, u is 0 and nothing is recorded until the next trial begins, as the motion of this one has
   advanced without being counted; the first trial of a run begins with its first sample.

   While an input is NaN or infinite, the outputs are held and the trial continues, but nothing is learned from it.

   Limits: N is at most 4096; after N samples F_hat is 0 and nothing is recorded. Nothing is learned above fq, so the
   sharpest part of the error at reversals remains. Choose fq below the frequency up to which m, Kp, Kd and Ki describe
   the loop. u_min must not exceed u_max. */

#define MODEL   IterativeLearning
#define SUMMARY "Iterative learning of the {force} for a repeated motion"
#define SOURCE  "Arimoto, Kawamura, Miyazaki, Journal of Robotic Systems 1(2), 1984"
#define CITES   "Arimoto1984, Bristow2006"

/* clang-format off */
#define VARIABLES                                                                                                                \
    INPUT    (r,         LENGTH, 0.0,                   "reference position")                                                    \
    INPUT    (x,         LENGTH, 0.0,                   "measured position")                                                     \
    COMMAND  (trial_end, 0,                             "becomes true in the first sample of the next trial")                    \
    COMMAND  (learn,     1,                             "false: trials are repeated without learning")                           \
    COMMAND  (enable,    1,                             "false: u = 0, F_hat = 0 and k = 0; the learned " FORCE_NOUN " is kept") \
    COMMAND  (reset,     0,                             "true: what was learned is discarded")                                   \
    OUTPUT   (u,         FORCE,                         FORCE_NOUN " gain F_hat, within u_min and u_max")                        \
    OUTPUT   (F_hat,     FORCE,                         "learned " FORCE_NOUN)                                                   \
    OUTPUT   (u_sat,     NO_UNIT,                       "active limit: -1 lower, +1 upper, 0 none")                              \
    OUTPUT_FLAG(fault,                          "true: an input is NaN or infinite; while enabled, outputs and states are held") \
    LOCAL    (rms,       LENGTH,                        "root mean square error of the last trial")                              \
    TALLY    (trial,                                    "number of completed trials")                                            \
    FIXED    (Ts,        TIME,      1e-3,   1e-9, INF,  "sample time")                                                           \
    COUNT    (N,         1000,              1, LONGEST, "number of samples in a trial")                                          \
    PARAMETER(gain,      NO_UNIT,   1.0,    0.0,  1.0,  "fraction of the learned " FORCE_NOUN " that is applied")                \
    PARAMETER(rate,      NO_UNIT,   0.5,    0.0,  2.0,  "learning rate")                                                         \
    PARAMETER(fq,        FREQUENCY, 50.0,   0.0,  INF,  "corner frequency of Q; 0: none")                                        \
    PARAMETER(m,         MASS,      1.0,    0.0,  INF,  MASS_NOUN " of the loop")                                                \
    PARAMETER(Kp,        STIFFNESS, 12e3,   0.0,  INF,  "proportional gain of the controller")                                   \
    PARAMETER(Kd,        DAMPING,   190.0,  0.0,  INF,  "derivative gain of the controller")                                     \
    PARAMETER(Ki, FORCE "/(" LENGTH ".s)", 250e3, 0.0, INF, "integral gain of the controller")                                   \
    PARAMETER(u_min,     FORCE,    -100.0, -INF,  INF,  "lower limit of u and of the learned " FORCE_NOUN)                       \
    PARAMETER(u_max,     FORCE,     100.0, -INF,  INF,  "upper limit of u and of the learned " FORCE_NOUN)

#define USE                                                                                         \
    KIND (learning)                                                                                 \
    NEVER("It learns from trial to trial, but the study runs the reference once.")
/* clang-format on */

#include "zero_phase.h"

#include <stdbool.h>

enum { LONGEST = 4096 }; /* largest number of samples in a trial */

#define SAMPLED
#define GUARDED
#define REQUIRES limits_in_order
#define SKIPS_BY skip
#define MEMORY   struct trials
#define VALID_BY are_trials

struct trials {
    double w[LONGEST]; /* learned force */
    double e[LONGEST]; /* error of this trial */
    int k;             /* number of samples in this trial so far */
    bool spoilt;       /* one of them had an invalid input */
    bool ended;        /* trial_end in the previous sample */
    bool waits;        /* for the next trial, after a reset or while disabled in this one */
    double rms, trial; /* of the last trial; number of trials */
};

#include "block.h"
#include "limits.h"
#include "compensation.h"

static bool are_trials(const Model *model)
{
    const struct trials *const past = &model->memory;
    return is_count(past->k, model->N) && is_flag(&past->spoilt) && is_flag(&past->ended) && is_flag(&past->waits) &&
           past->rms >= 0.0 && is_count(past->trial, DBL_MAX);
}

/* Perform the learning step between two trials. */
static void learn_from(Model *model)
{
    GIVEN(model)
    struct trials *const past = &model->memory;
    const double *const error = past->e;
    const int n = past->k;
    double integral = 0.0;

    for (int k = 0; k < n; k++) {
        const double before = error[k > 0 ? k - 1 : 0];
        const double after = error[k + 1 < n ? k + 1 : k];
        const double force = m * (after - 2.0 * error[k] + before) / (Ts * Ts) + Kd * (after - before) / (2.0 * Ts) +
                             Kp * error[k] + Ki * integral;
        integral += Ts * error[k];
        past->w[k] += rate * force;
    }
    zero_phase(past->w, n, fq, Ts);
    for (int k = 0; k < n; k++)
        past->w[k] = clip(past->w[k], u_min, u_max);
}

/* Start and end trials; return whether this sample belongs to a trial. */
static bool in_trial(Model *model)
{
    GIVEN(model)
    struct trials *const past = &model->memory;

    if (reset)
        *past = (struct trials){.ended = past->ended, .waits = true};
    const bool begins = trial_end && !past->ended;
    if (begins && past->k > 0) {
        double sum = 0.0;
        for (int k = 0; k < past->k; k++)
            sum += square(past->e[k]);
        past->rms = sqrt(sum / past->k);
        past->trial += 1.0;
        if (learn && !past->spoilt)
            learn_from(model);
        past->k = 0;
    }
    past->ended = trial_end;
    past->waits = !enable || (past->waits && !begins);
    if (past->waits)
        past->k = 0;
    past->spoilt = past->spoilt && past->k > 0;
    return !past->waits && past->k < N;
}

static void skip(Model *model)
{
    struct trials *const past = &model->memory;
    if (in_trial(model)) {
        past->e[past->k] = past->k > 0 ? past->e[past->k - 1] : 0.0;
        past->k++;
        past->spoilt = true;
    }
    if (model->enable == 0.0)
        compensate(model, 0.0);
}

static void sample(Model *model)
{
    GIVEN(model)
    struct trials *const past = &model->memory;

    double force = 0.0;
    if (in_trial(model)) {
        past->e[past->k] = r - x;
        force = past->w[past->k++];
    }
    compensate(model, force);
    model->rms = past->rms;
    model->trial = fmin(past->trial, COUNTS);
}
