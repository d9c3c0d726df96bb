/* Sampled position encoder: position rounded to whole counts at the sample times, and velocity as a difference.

   Quantisation: Widrow, Kollar: Quantization Noise, Cambridge University Press 2008. Velocity by difference and its
   error: Brown, Schneider, Mulligan: Analysis of algorithms for velocity estimation from discrete position versus time
   data, IEEE Transactions on Industrial Electronics 39(1), 1992.

       x_measured[k] = q round(x(t_k + delta_k) / q),   t_k = start + k Ts
       v_measured[k] = (x_measured[k] - x_measured[k-1]) / Ts,   v_measured[0] = v0
       delta_k uniform in [-jitter, jitter],   x(t_k + delta_k) = x + v delta_k

   q = 0 disables rounding; halves are rounded away from zero. With jitter = 0, the default, no random numbers are drawn
   and v is not needed. With jitter, samples are taken early or late but have nominal time stamps, which causes velocity
   errors at high speed; the random numbers are the same for the same seed. Outputs are held between samples.

   Use it between a plant and its controller to model the measurement of a drive. For averages and a low-pass filter of
   the velocity, connect x_measured to Differentiator with the same Ts.

   Limits: v_measured lags by half a sample and has steps of q / Ts: 1 mm/s for q = 1 um at 1 kHz. No hysteresis: a
   position at rest halfway between two counts flickers with its last bit. The velocity is taken as constant within the
   jitter, with an error of a jitter^2 / 2; the jitter must be short compared with Ts. */

#define MODEL   Encoder
#define SUMMARY "Sampled, quantised position with velocity by difference, optionally with jitter"
#define SOURCE  "Widrow, Kollar, 2008; Brown, Schneider, Mulligan, IEEE TIE 39(1), 1992"
#define CITES   "WidrowKollar2008, Brown1992"

/* clang-format off */
#define VARIABLES                                                                                      \
    INPUT    (x,          LENGTH,   0.0,               "position")                                     \
    OPTIONAL (v,          VELOCITY, 0.0,               "velocity, used with jitter only")              \
    OUTPUT   (x_measured, LENGTH,                      "measured position")                            \
    OUTPUT   (v_measured, VELOCITY,                    "difference of the last two measured positions over Ts") \
    FIXED    (Ts,         TIME,     1e-3, 1e-9, INF,   "sample time")                                  \
    PARAMETER(q,          LENGTH,   1e-6, 0.0,  INF,   "quantisation step of the position; 0: none")   \
    PARAMETER(jitter,     TIME,     0.0,  0.0,  INF,   "largest error of a sample time; 0: none")      \
    COUNT    (seed,       1,        0,    COUNTS,      "seed of the jitter")                           \
    FIXED    (v0,         VELOCITY, 0.0,  -INF, INF,   "v_measured at the first sample")
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
        /* seeded by the sample number, so that samples are independent of each other */
        Random random;
        seed_random(&random, (uint64_t)seed << 32 | (uint64_t)(m->run.tick & UINT32_MAX));
        at += v * jitter * (2.0 * uniform(&random) - 1.0);
    }
    const double measured = q == 0.0 ? at : q * round(at / q);

    m->v_measured = m->run.tick == 0 ? v0 : (measured - m->memory.x) / Ts;
    m->x_measured = m->memory.x = measured;
}
