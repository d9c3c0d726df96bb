/* Steps of many coupled masses, x'' = a(s, x, x'), by extrapolation: high order, O(N) per evaluation of the forces.

   The error of Gragg's modified midpoint rule with n = 2, 4, 6, ... substeps contains only even powers of the substep,
   which the Aitken-Neville scheme removes column by column until the last correction is below the tolerance. Gragg:
   SIAM J. Numer. Anal. 2, 1965; Bulirsch, Stoer: Numer. Math. 8, 1966; Hairer, Norsett, Wanner: Solving Ordinary
   Differential Equations I, section II.9. This file needs no model and can be included before block.h. */

#ifndef EXTRAPOLATION_H
#define EXTRAPOLATION_H

#include <math.h>
#include <stdbool.h>

enum { MASSES = 1000, COLUMNS = 8 };

#define CHAIN_TOLERANCE 1e-12 /* of a step, for positions; times `rate` for velocities */

/* Write the n accelerations of `system` at s seconds after the start of the communication step; y contains n positions,
   then n velocities. */
typedef void Accelerations(const void *system, double s, const double *y, double *a);

typedef struct {
    Accelerations *accelerations;
    const void *system;
    int n;
    double rate;      /* [1/s] fastest rate of the system; scales velocities like positions */
    double tolerance; /* of a step */
    double *left;     /* remaining work of the communication step, as counted by effort.h */
} Dynamics;

/* Apply the modified midpoint rule over H in n substeps from (s, y), where the accelerations are a. */
static inline void midpoint(const Dynamics *d, double s, const double *y, const double *a, double H, int n, double *end)
{
    const int N = d->n;
    const double h = H / n;
    if (N < 1) /* so that the compiler knows that the loops below write everything that is read */
        return;
    double first[2 * MASSES], second[2 * MASSES], now[MASSES], *before = first, *here = second;

    for (int i = 0; i < N; i++) {
        before[i] = y[i];
        before[N + i] = y[N + i];
        here[i] = y[i] + h * y[N + i];
        here[N + i] = y[N + i] + h * a[i];
    }
    for (int step = 1; step < n; step++) {
        d->accelerations(d->system, s + step * h, here, now);
        for (int i = 0; i < N; i++) {
            before[i] += 2.0 * h * here[N + i];
            before[N + i] += 2.0 * h * now[i];
        }
        double *const swap = before;
        before = here;
        here = swap;
    }
    d->accelerations(d->system, s + H, here, now);
    for (int i = 0; i < N; i++) {
        end[i] = 0.5 * (before[i] + here[i] + h * here[N + i]);
        end[N + i] = 0.5 * (before[N + i] + here[N + i] + h * now[i]);
    }
}

/* Perform one step from (s, y) over H to y_end; return the number of columns, or 0 if it does not converge. */
static inline int extrapolate(const Dynamics *d, double s, const double *y, double H, double *y_end)
{
    const int N = d->n;
    double table[COLUMNS][2 * MASSES], a[MASSES], divisor[COLUMNS];

    d->accelerations(d->system, s, y, a);
    for (int k = 0; k < COLUMNS; k++) {
        midpoint(d, s, y, a, H, 2 * (k + 1), y_end);
        *d->left -= 2.0 * (k + 1) * N;
        int j = 1;
        for (double rest = k; rest > 0.0; rest -= 1.0) { /* a loop over integers may also be computed for rest = 0 */
            const double ratio = (k + 1) / rest;
            divisor[j++] = ratio * ratio - 1.0;
        }
        double worst = 0.0;
        for (int i = 0; i < 2 * N; i++) {
            double correction = INFINITY;
            for (j = 1; j <= k; j++) {
                const double previous = table[j - 1][i];
                table[j - 1][i] = y_end[i];
                correction = (y_end[i] - previous) / divisor[j];
                y_end[i] += correction;
            }
            table[k][i] = y_end[i];
            const double scale = (i < N ? 1.0 : d->rate) + 1e-4 * fabs(y_end[i]);
            worst = fabs(correction) < worst * scale ? worst : fabs(correction) / scale;
        }
        if (worst <= d->tolerance)
            return k + 1;
        if (!isfinite(worst) && k > 0)
            return 0;
    }
    return 0;
}

/* Return the size of the next step after one of size H that needed `columns` columns. */
static inline double next_step(double H, int columns)
{
    return columns == 0 ? 0.4 * H : columns < 5 ? 2.0 * H : columns < 7 ? 1.3 * H : columns < 8 ? H : 0.8 * H;
}

/* Return whether steps of size H can continue: work is left, and H is not so far below the fastest time constant that
   no step can meet the tolerance. */
static inline bool goes_on(const Dynamics *d, double H) { return *d->left >= 0.0 && H * d->rate > 1e-12; }

/* Move y by h; *inner stores the step size. Returns false if this takes more work than is left or if no step
   converges. */
static inline bool move_masses(const Dynamics *d, double *y, double h, double *inner)
{
    double y_end[2 * MASSES], H = *inner > 0.0 ? *inner : 0.5 / d->rate;
    double s = 0.0;
    while (s < h) {
        const bool last = s + 1.01 * H >= h;
        const double taken = last ? h - s : H;
        const int columns = extrapolate(d, s, y, taken, y_end);
        if (columns > 0) {
            for (int i = 0; i < 2 * d->n; i++)
                y[i] = y_end[i];
            s = last ? h : s + taken;
        }
        const double next = next_step(taken, columns);
        H = last && columns > 0 ? fmax(H, next) : next;
        if (!goes_on(d, H))
            return false;
    }
    *inner = H;
    return true;
}

#endif
