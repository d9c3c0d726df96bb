/* A sampled position encoder: rounds to whole counts at sample times, and gives the velocity as a difference.

   Quantisation: Widrow, Kollar: Quantization Noise, Cambridge University Press 2008. Velocity by difference and its
   error: Brown, Schneider, Mulligan: Analysis of algorithms for velocity estimation from discrete position versus time
   data, IEEE Transactions on Industrial Electronics 39(1), 1992.

       x_measured[k] = q round(x(t_k + delta_k) / q),   t_k = start + k Ts
       v_measured[k] = (x_measured[k] - x_measured[k-1]) / Ts,   v_measured[0] = v0
       delta_k uniform in [-jitter, jitter],   x(t_k + delta_k) = x + v delta_k

   q = 0 does not round; halves go away from zero. jitter = 0, the default, draws no numbers and needs no v. With jitter
   the samples are taken early or late, but time-stamped as if they were not, which is what makes an error of the
   velocity at high speed; the numbers are the same for the same seed. What is not sampled is held.

   Use it between a plant and its controller for the measurement that a drive has; Differentiator has averages and a
   low-pass for the velocity, from an x_measured that is sampled at the same times.

   Limits: v_measured is that of half a sample ago, and has steps of q / Ts: 1 mm/s for q = 1 um at 1 kHz. No
   hysteresis: a position that rests half way between two counts flickers with its last bit. Within the jitter the
   velocity is taken as constant, an error of a jitter^2 / 2; it has to be short against Ts. */

#define MODEL    Encoder
#define SUMMARY  "Sampled, quantised position with velocity by difference, optionally with jitter"
#define SOURCE   "Widrow, Kollar, 2008; Brown, Schneider, Mulligan, IEEE TIE 39(1), 1992"
#define PORTRAIT "staircase"
#define QUOTES   "encoder_count, loop_poles"

/* clang-format off */
#define VARIABLES                                                                                      \
    INPUT    (x,          LENGTH,   0.0,               "position")                                     \
    OPTIONAL (v,          VELOCITY, 0.0,               "velocity, moves x within the jitter")          \
    OUTPUT   (x_measured, LENGTH,                      "measured position")                            \
    OUTPUT   (v_measured, VELOCITY,                    "difference of the last two, over Ts")          \
    FIXED    (Ts,         TIME,     1e-3, 1e-9, INF,   "sample time")                                  \
    PARAMETER(q,          LENGTH,   1e-6, 0.0,  INF,   "step of the position; 0: none")                \
    PARAMETER(jitter,     TIME,     0.0,  0.0,  INF,   "largest error of a sample time; 0: none")      \
    COUNT    (seed,       1,        0,    COUNTS,      "of the jitter")                                \
    FIXED    (v0,         VELOCITY, 0.0,  -INF, INF,   "v_measured of the first sample")

#define IN_LOOP          \
    SENSOR  ()           \
    QUANTUM (q)          \
    VELOCITY(v_measured)
/* clang-format on */

#define SAMPLED
#define MEMORY   struct encoder
#define VALID_BY is_encoder

struct encoder {
    double x; /* last measured position */
};

#include "block.h"
#include "random.h"

static bool is_encoder(const Model *m) { return isfinite(m->memory.x); }

static void sample(Model *m)
{
    GIVEN(m)
    double at = x;
    if (jitter > 0.0) {
        /* by the number of the sample, so that no other sample has a say in it */
        Random random;
        seed_random(&random, (uint64_t)seed << 32 | (uint64_t)(m->run.tick & UINT32_MAX));
        at += v * jitter * (2.0 * uniform(&random) - 1.0);
    }
    const double measured = q == 0.0 ? at : q * round(at / q);

    m->v_measured = m->run.tick == 0 ? v0 : (measured - m->memory.x) / Ts;
    m->x_measured = m->memory.x = measured;
}
