/* Systems of linear equations. */

#ifndef ELIMINATION_H
#define ELIMINATION_H

#include <math.h>
#include <stdbool.h>

/* Solve the n by n system a x = b in place by Gaussian elimination with row exchanges; return false if a is
   singular. */
static inline bool solve_linear(int n, double *a, double *b)
{
    for (int k = 0; k < n; k++) {
        int pivot = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(a[i * n + k]) > fabs(a[pivot * n + k]))
                pivot = i;
        if (a[pivot * n + k] == 0.0 || !isfinite(a[pivot * n + k]))
            return false;
        for (int j = 0; j < n; j++) {
            const double swap = a[k * n + j];
            a[k * n + j] = a[pivot * n + j];
            a[pivot * n + j] = swap;
        }
        const double swap = b[k];
        b[k] = b[pivot];
        b[pivot] = swap;
        for (int i = 0; i < n; i++) {
            if (i == k)
                continue;
            const double factor = a[i * n + k] / a[k * n + k];
            for (int j = k; j < n; j++)
                a[i * n + j] -= factor * a[k * n + j];
            b[i] -= factor * b[k];
        }
    }
    for (int i = 0; i < n; i++)
        b[i] /= a[i * n + i];
    return true;
}

#endif
