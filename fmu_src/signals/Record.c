/* Plays a recorded motion: position, velocity and acceleration from a table, linear between its rows.

   The table is `series` in "series.h", one row { t [s], r, rd, rdd } a sample, t strictly increasing, at least two
   rows; uniform sampling makes the look-up fastest but is not needed. The file that comes with this block holds a
   short triangle motion; a measured motion takes its place when the FMU is packaged.

       y(t) = (1 - w) y_i + w y_(i+1),   t_i <= t <= t_(i+1),   y in {r, rd, rdd}
       w    = (t - t_i) / (t_(i+1) - t_i)

   At a sample, also where t misses it by rounding, the outputs are the numbers of the table. Before the first row
   and after the last one r keeps their position, at rest: rd = rdd = 0.

   Limits: each column is interpolated by itself, so rd is not exactly the derivative of r between two rows. The
   velocity of a record that begins or ends in motion jumps there. */

#define MODEL   Record
#define SUMMARY "Recorded motion, interpolated linearly"
#define SOURCE  "the table in series.h"

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

/* The i with t_i <= t < t_(i+1), and i < LAST. */
static size_t interval_of(double t)
{
    size_t low = 0, high = LAST;

    /* where uniform sampling would have it, or next to it */
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

/* The share of row b at time t between the rows a and b; a row that is missed by rounding counts as met. */
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
