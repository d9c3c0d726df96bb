/* Velocity from a sampled position, as estimated from an encoder in servo drives: average over the last n samples,
   difference of two averages, first-order low-pass filter.

   Janot, Gautier, Brunot: Data set and reference models of EMPS, Workshop on Nonlinear System Identification
   Benchmarks, 2019, for n = 2; low-pass filter: any text on sampled control.

       x_mean[k] = (x[k] + ... + x[k-n+1]) / n,   n = window
       d[k]      = (x_mean[k] - x_mean[k-1]) / Ts = (x[k] - x[k-n]) / (n Ts)
       v[k]      = v[k-1] + (1 - exp(-Ts/tau)) (d[k] - v[k-1])
       v[k]      = d[k] if tau = 0

   The low-pass filter is the exact step of tau dv/dt = d - v, with d constant from sample k-1 to k, the interval that
   d[k] describes. Before the first sample, x is assumed to have moved at v0, so that v starts at v0.

   Limits: v lags by n Ts/2 + tau (the slope of a ramp is exact after n samples, or once the low-pass filter has
   settled), x_mean by (n - 1) Ts/2. With a quantised x, v has steps of quantum / (n Ts). */

#define MODEL   Differentiator
#define SUMMARY "Sampled velocity estimate: moving average, difference, low-pass filter"
#define SOURCE  "Janot, Gautier, Brunot: Data set and reference models of EMPS, 2019"
#define CITES   "Janot2019"

/* clang-format off */
#define VARIABLES                                                                                       \
    INPUT    (x,      LENGTH, 0.0,              "measured position")                                    \
    OUTPUT   (v,      VELOCITY,                 "estimated velocity")                                   \
    OUTPUT   (x_mean, LENGTH,                   "moving average of the position")                       \
    FIXED    (Ts,     TIME,   1e-3, 1e-9, INF,  "sample time")                                          \
    COUNT    (window, 2,      1,    LONGEST,    "number of samples in the average")                     \
    FIXED    (v0,     VELOCITY, 0.0, -INF, INF, "velocity before the first sample")                     \
    PARAMETER(tau,    TIME,   0.0,  0.0,  INF,  "time constant of the low-pass filter; 0: none")
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

    /* x is assumed to have moved at v0 before the first sample */
    if (m->run.tick == 0) {
        for (size_t i = 1; i <= n; i++)
            ring[n - i] = x - (double)i * v0 * Ts;
        m->memory.v = v0;
    }
    /* x[k] replaces x[k-n] */
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
