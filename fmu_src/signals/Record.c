/* Recorded motion: position, velocity and acceleration from a table with linear interpolation.

   The table is `series` in "series.h", with one row { t [s], r, rd, rdd } per sample, t strictly increasing, and at
   least two rows; uniform sampling makes the look-up fastest but is not required. The file shipped with this block
   contains a short triangular motion; packaging the FMU with a measured motion replaces it.

       y(t) = (1 - w) y_i + w y_(i+1),   t_i <= t <= t_(i+1),   y in {r, rd, rdd}
       w    = (t - t_i) / (t_(i+1) - t_i)

   At a sample, also if t misses it by rounding, the outputs equal the numbers in the table. Before the first and after
   the last row, r keeps the position of this row at rest: rd = rdd = 0.

   Limits: each column is interpolated separately, so that between two rows rd is not exactly the derivative of r. If a
   record begins or ends in motion, the velocity jumps there. */

#define MODEL   Record
#define SUMMARY "Recorded motion, interpolated linearly"
#define SOURCE  "table in series.h"
#define CITES   "FrictionFmus2026"

/* clang-format off */
#define VARIABLES                                      \
    OUTPUT(r,   LENGTH,       "recorded position")     \
    OUTPUT(rd,  VELOCITY,     "recorded velocity")     \
    OUTPUT(rdd, ACCELERATION, "recorded acceleration")
/* clang-format on */

#include "block.h"
#include "search.h"

/* static const double series[][4] = { { t, r, rd, rdd }, ... } */
#include "series.h"

enum { SAMPLES = sizeof series / sizeof series[0], LAST = SAMPLES - 1 };
typedef char series_has_two_rows[SAMPLES >= 2 ? 1 : -1];

static double time_of(const void *table, int64_t i)
{
    (void)table;
    return series[i][0];
}

/* Return the i with t_i <= t < t_(i+1) and i < LAST. */
static size_t interval_of(double t)
{
    size_t low = 0, high = LAST;

    /* the interval under uniform sampling, or the one next to it */
    const double place = (t - series[0][0]) / (series[LAST][0] - series[0][0]) * (double)LAST;
    const size_t guess = (size_t)fmin(fmax(place, 1.0), LAST) - 1;
    for (size_t i = guess; i < guess + 4 && i < LAST; i++) {
        if (t < series[i][0]) {
            high = i;
            break;
        }
        low = i;
    }
    return (size_t)last_not_above(time_of, NULL, (int64_t)low, (int64_t)high, t);
}

/* Return the weight of row b at time t between the rows a and b; a row that is missed by rounding is matched
   exactly. */
static double share(const double *a, const double *b, double t, double rounding)
{
    if (fabs(t - a[0]) <= rounding)
        return 0.0;
    if (fabs(t - b[0]) <= rounding)
        return 1.0;
    return clip((t - a[0]) / (b[0] - a[0]), 0.0, 1.0);
}

static void equations(Model *m)
{
    const double t = m->time, first = series[0][0], last = series[LAST][0];
    const double rounding = 4.0 * DBL_EPSILON * fmax(fabs(first), fabs(last)); /* [s] */
    const bool outside = t < first - rounding || t > last + rounding;

    const size_t i = interval_of(t);
    const double *const a = series[i], *const b = series[i + 1];
    const double w = share(a, b, t, rounding);

    m->r = (1.0 - w) * a[1] + w * b[1];
    m->rd = outside ? 0.0 : (1.0 - w) * a[2] + w * b[2];
    m->rdd = outside ? 0.0 : (1.0 - w) * a[3] + w * b[3];
}
