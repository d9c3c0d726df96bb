/* Velocity from a sampled position, as servo drives estimate it from an encoder: average over the last n samples,
   then the difference of two averages, then a first-order low-pass.

   Janot, Gautier, Brunot: Data set and reference models of EMPS, Workshop on Nonlinear System Identification
   Benchmarks, 2019, for n = 2; low-pass: any text on sampled control.

       x_mean[k] = (x[k] + ... + x[k-n+1]) / n,   n = window
       d[k]      = (x_mean[k] - x_mean[k-1]) / Ts = (x[k] - x[k-n]) / (n Ts)
       v[k]      = v[k-1] + (1 - exp(-Ts/tau)) (d[k] - v[k-1])
       v[k]      = d[k] if tau = 0

   The low-pass is the exact step of tau dv/dt = d - v for a d that is held from sample k-1 to k, the time that d[k]
   is about. Before the first sample x is taken to have moved at v0, so v starts with v0.

   Limits: v lags by n Ts/2 + tau (a ramp is followed exactly after n samples, or once the low-pass has settled),
   x_mean by (n - 1) Ts/2; with a quantised x, v has steps of quantum / (n Ts). */

#define MODEL    Differentiator
#define SUMMARY  "Sampled velocity estimate: moving average, difference, low-pass"
#define SOURCE   "Janot, Gautier, Brunot: Data set and reference models of EMPS, 2019"
#define PORTRAIT "differentiation"

/* clang-format off */
#define VARIABLES                                                                                       \
    INPUT    (x,      LENGTH, 0.0,              "measured position")                                    \
    OUTPUT   (v,      VELOCITY,                 "estimated velocity")                                   \
    OUTPUT   (x_mean, LENGTH,                   "moving average of the position")                       \
    FIXED    (Ts,     TIME,   1e-3, 1e-9, INF,  "sample time")                                          \
    COUNT    (window, 2,      1,    LONGEST,    "samples that are averaged")                            \
    FIXED    (v0,     VELOCITY, 0.0, -INF, INF, "velocity before the first sample")                     \
    PARAMETER(tau,    TIME,   0.0,  0.0,  INF,  "time constant of the low-pass; 0: none")

#define IN_LOOP              \
    SENSOR  ()               \
    VELOCITY(v, window, tau)
/* clang-format on */

enum { LONGEST = 64 };

#define SAMPLED
#define MEMORY   struct estimator
#define VALID_BY is_estimator

struct estimator {
    double x[LONGEST]; /* the last n samples, sample k at k modulo n */
    double v;          /* the last estimate */
};

#include "block.h"

static bool is_estimator(const Model *m) { return isfinite(m->memory.v) && all_finite(m->memory.x, LONGEST); }

static void sample(Model *m)
{
    GIVEN(m)
    double *const ring = m->memory.x;
    const size_t n = (size_t)clip(window, 1.0, LONGEST);

    /* as if x had moved at v0 before the first sample */
    if (m->run.tick == 0) {
        for (size_t i = 1; i <= n; i++)
            ring[n - i] = x - (double)i * v0 * Ts;
        m->memory.v = v0;
    }
    /* x[k] takes the place of x[k-n] */
    double *const place = &ring[(size_t)m->run.tick % n];
    const double d = (x - *place) / ((double)n * Ts);
    *place = x;

    double sum = 0.0;
    for (size_t i = 0; i < n; i++)
        sum += ring[i];

    m->x_mean = sum / (double)n;
    m->memory.v = tau > 0.0 ? relax(m->memory.v, d, Ts / tau) : d;
    m->v = m->memory.v;
}
