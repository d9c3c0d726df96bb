/* Start values of algebraic loops: solve G(w) = w by Newton's method with a Jacobian from differences. */

#ifndef FIXED_POINT_H
#define FIXED_POINT_H

#include "quasi_newton.h"

/* Compute r = G(w) - w; return whether all parts accepted the values. */
typedef bool Residual(void *context, const double *w, double *r);

enum { MOST_NEWTON_STEPS = 50 };
#define SETTLED 1e-13 /* a residual that is rounding, relative to the values */

static double norm_of(const double *w, const double *r, int64_t n)
{
    double worst = 0.0;
    for (int64_t i = 0; i < n; i++) {
        const double size = r[i] == 0.0 ? 0.0 : fabs(r[i]) / fmax(fmax(fabs(w[i]), fabs(w[i] + r[i])), 1e-300);
        worst = worse(worst, size);
    }
    return worst;
}

#define FIXED_POINT_WORK(n) (5 * (n) + 2 * (n) * (n)) /* doubles of work space for find_fixed_point */

EXPORT bool find_fixed_point(Residual *residual, void *context, double *w, int64_t n, double *work, double *norm);

/* Find w from a first estimate; *norm becomes the largest remaining residual relative to the values. Return false if a
   part rejects a value. A step that does not reduce the residual is halved, and the search ends at the best w. */
EXPORT bool find_fixed_point(Residual *residual, void *context, double *w, int64_t n, double *work, double *norm)
{
    double *const r = work, *const r1 = r + n, *const step = r1 + n, *const w1 = step + n, *const best = w1 + n;
    double *const jacobian = best + n, *const inverse = jacobian + n * n;
    if (!residual(context, w, r))
        return false;
    *norm = norm_of(w, r, n);
    for (int tries = 0; tries < MOST_NEWTON_STEPS && *norm > SETTLED; tries++) {
        for (int64_t j = 0; j < n; j++) {
            memcpy(w1, w, (size_t)n * sizeof(double));
            w1[j] += 1e-6 * fmax(fmax(fabs(w[j]), fabs(w[j] + r[j])), 1e-6);
            if (!residual(context, w1, r1))
                return false;
            for (int64_t i = 0; i < n; i++)
                jacobian[i * n + j] = (r1[i] - r[i]) / (w1[j] - w[j]);
        }
        invert(jacobian, inverse, n);
        newton_step(step, inverse, r, n);
        const double before = *norm;
        memcpy(best, w, (size_t)n * sizeof(double));
        for (double part = 1.0; part > 1e-3; part *= 0.5) {
            for (int64_t j = 0; j < n; j++)
                w1[j] = best[j] + part * step[j];
            if (!residual(context, w1, r1))
                return false;
            const double reached = norm_of(w1, r1, n);
            if (reached < *norm) {
                *norm = reached;
                memcpy(w, w1, (size_t)n * sizeof(double));
                memcpy(r, r1, (size_t)n * sizeof(double));
                break;
            }
        }
        if (!(*norm < before))
            break;
    }
    return true;
}

#endif
