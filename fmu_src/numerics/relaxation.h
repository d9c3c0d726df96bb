/* Relaxation of a hysteresis force towards the Stribeck level, for models without closed form: a scalar differential
   equation dy/ds = f(s, y), integrated until a goal is reached.

   The method is the extrapolated linearly implicit Euler method: Deuflhard, SIAM Review 27(4), 1985; Hairer, Wanner:
   Solving Ordinary Differential Equations II, 2nd ed. 1996, section IV.9 (SEULEX). It has high order where y is smooth
   and takes long steps where y follows its equilibrium, also if the equation is stiff. With j = 1, 2, 3, ... substeps
   of length h = H/j and p(s), the moving equilibrium of y if it is near (else 0),

       y_{i+1} - y_i = p_{i+1} - p_i + (h f(s_{i+1}, y_i + p_{i+1} - p_i) - p_{i+1} + p_i) / (1 - h J)
       J = df/dy at the start, at most 0
       T[j][k+1] = T[j][k] + (T[j][k] - T[j-1][k]) (j - k - 1) / (k + 1) */

#ifndef RELAXATION_H
#define RELAXATION_H

#include "constants.h"

typedef double Curve(double s, double y, const void *law);
typedef struct {
    Curve *rate, *goal, *place; /* f, the goal, and p (a function of s only); the last two may be NULL */
    const void *data;
    bool steady; /* f depends on y only */
    int *budget; /* remaining inner steps of the communication step */
} Law;

/* These inner steps take about 0.1 s, and no contact needs nearly as many. */
enum { BUDGET = 50000 };

/* Return the tolerance relative to the size of y: a default for constant or changing inputs, or the tolerance of the
   experiment, limited to values above rounding. A tolerance coarser than 1e-6 would save no steps and could miss sharp
   changes of f. */
static inline double relaxation_tolerance(const Model *m)
{
    const double finest = 1e-13, coarsest = 1e-6;
    return m->run.tolerance > 0.0 ? clip(m->run.tolerance, finest, coarsest) : inputs_held(m) ? 1e-12 : 1e-11;
}

/* Perform one accepted step from (s, y) towards `end`, of about the length `step`, which is replaced by a proposal for
   the next step. `tolerance` is absolute; f is approximately linear over changes of y by `detail`. Returns false if no
   step is short enough. */
static bool extrapolated_step(const Law *law, double *s, double *y, double *step, double end, double tolerance,
                              double detail)
{
    enum { ROWS_OF_TABLE = 7 };
    Curve *const f = law->rate;
    const void *const data = law->data;
    const double start = *y, p_start = law->place ? law->place(*s, start, data) : 0.0,
                 allowed = fmax(tolerance, 4.0 * DBL_EPSILON * fabs(start));
    const double delta = 1e-4 * detail + 1e-8 * fabs(start), rate = f(*s, start, data);
    const double J = fmin((f(*s, start + delta, data) - rate) / delta, 0.0);
    if (rate != 0.0)
        *step = fmin(*step, (4.0 * detail + 2.0 * fabs(start)) / fabs(rate));
    for (int tries = 0; tries < 400 && --*law->budget > 0; tries++) {
        const bool last = *s + 1.1 * *step >= end;
        const double H = last ? end - *s : *step;
        double table[ROWS_OF_TABLE], error = INF, previous = INF;
        double gone = 0.0; /* change of p */
        bool converged = false;
        int row = 0;
        for (; row < ROWS_OF_TABLE; row++) {
            const double h = H / (row + 1), damping = 1.0 / (1.0 - h * J);
            double moved = 0.0; /* relative to p */
            gone = 0.0;
            for (int i = 1; i <= row + 1; i++) {
                const double s_i = i == row + 1 ? *s + H : *s + i * h, before = gone;
                gone = law->place ? law->place(s_i, start, data) - p_start : 0.0;
                const double f_i = i == 1 && law->steady ? rate : f(s_i, start + moved + gone, data);
                moved += (h * f_i - gone + before) * damping;
            }
            for (int k = 0; k < row; k++) {
                const double better = moved + (moved - table[k]) * (row - k) / (k + 1);
                table[k] = moved;
                moved = better;
            }
            table[row] = moved;
            previous = error;
            error = row > 0 ? fabs(moved - table[row - 1]) : INF;
            converged = error <= allowed && previous <= 1e3 * allowed; /* one small difference may be a coincidence */
            if (converged || (row >= 2 && !(error <= 2.0 * previous)))
                break;
        }
        if (converged && -H * J < 1.0 && H * fabs(rate) > detail) {
            /* convergence is a coincidence if the mean rate is far from the rates at both ends */
            const double s_end = last ? end : *s + H, rate_end = f(s_end, start + (table[row] + gone), data);
            const double middle = 0.5 * (rate + rate_end), width = 1.5 * fabs(rate_end - rate);
            converged = fabs(table[row] + gone - H * middle) <= H * width + 10.0 * allowed;
        }
        if (converged) {
            *s = last ? end : *s + H;
            *y = start + (table[row] + gone);
            *step = H * (row <= 3 ? 4.0 : row == 4 ? 2.0 : row == 5 ? 1.3 : 0.8);
            return true;
        }
        *step = H * (isfinite(error) ? 0.35 : 0.1);
        if (!(*s + *step > *s))
            return false;
    }
    return false;
}

enum { FAILED = -1, ENDED, REACHED };

/* Return the result of a step whose relaxation has FAILED. */
static inline bool failed(Model *m, int budget) { return budget <= 0 ? too_much(m) : false; }

/* Integrate from (s, y) to `end`, or to the first point where the goal is no longer negative (NULL: no goal). The
   tolerance is relative to `size`. In the first step, y changes by at most `detail`, so that the error estimate covers
   all of f. */
static int follow(const Model *m, const Law *law, double *s, double *y, double end, double size, double detail)
{
    Curve *const f = law->rate, *const goal = law->goal;
    const double tolerance = relaxation_tolerance(m) * size;
    const double rate = fabs(f(*s, *y, law->data)), last = law->steady ? rate : fabs(f(end, *y, law->data));
    const double fastest = fmax(rate, last);
    double step = fastest > 0.0 ? fmin(end - *s, detail / fastest) : end - *s;
    while (*s < end) {
        double s_before = *s, y_before = *y;
        if (!extrapolated_step(law, s, y, &step, end, tolerance, detail))
            return FAILED;
        if (!goal || goal(*s, *y, law->data) < 0.0)
            continue;
        /* search between the last point before the goal and the first point after it by the secant method, or by
           bisection where that is slow */
        double low = goal(s_before, y_before, law->data), high = goal(*s, *y, law->data);
        for (int tries = 0; tries < 100 && *s - s_before > 2.0 * DBL_EPSILON * fabs(*s) && high > 0.0; tries++) {
            const double part = tries % 3 == 2 ? 0.5 : clip(-low / (high - low), 1e-3, 1.0 - 1e-3);
            double s_middle = s_before, y_middle = y_before, inner = part * (*s - s_before);
            const double middle = s_before + inner;
            while (s_middle < middle)
                if (!extrapolated_step(law, &s_middle, &y_middle, &inner, middle, tolerance, detail))
                    return FAILED;
            const double found = goal(s_middle, y_middle, law->data);
            if (found < 0.0) {
                s_before = s_middle;
                y_before = y_middle;
                low = found;
            } else {
                *s = s_middle;
                *y = y_middle;
                high = found;
            }
            if (fabs(*y - y_before) <= tolerance && *s - s_before <= 1e-9 * fabs(*s))
                break;
        }
        return REACHED;
    }
    return ENDED;
}

#endif
