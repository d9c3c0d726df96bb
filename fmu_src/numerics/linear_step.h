/* Exact steps of linear equations with constant coefficients. */

#ifndef LINEAR_STEP_H
#define LINEAR_STEP_H

#include <float.h>
#include <math.h>
#include <stdbool.h>

/* Return z(h) of z' = rate (target - z), with `decay` = rate h >= 0; also exact if decay is tiny or infinite. */
static inline double relax(double z, double target, double decay) { return z - (target - z) * expm1(-decay); }

/* Return whether all further terms of the series are too small to change the result. Their largest magnitude in a
   column decreases to less than a sixth from one to the next, and a row of zeros stays one. */
static inline bool all_negligible(int n, const double *term, const double *result, const bool *coupled)
{
    const int size = n + 2;
    for (int j = 0; j < size; j++) {
        double most = 0.0;
        for (int i = 0; i < n; i++)
            most = fmax(most, fabs(term[i * size + j]));
        for (int i = 0; i < n; i++)
            if (coupled[i] && most > 0.5 * DBL_EPSILON * fabs(result[i * size + j]))
                return false;
    }
    return true;
}

/* Replace x by the exact x(h) of x' = a x + b + c s, using the exponential of the matrix [a c b; 0 0 1; 0 0 0] h by
   scaling and squaring of its Taylor series. Van Loan, IEEE TAC 23(3), 1978. At most 6 states, balanced by the
   caller. The last two rows of every power are known, and so are the terms in a row of zeros. */
static inline void linear_step(int n, const double *a, const double *b, const double *c, double *x, double h)
{
    enum { LARGEST = 8, TERMS = 16 };
    const int size = n + 2;
    double matrix[LARGEST * LARGEST], result[LARGEST * LARGEST], term[LARGEST * LARGEST], next[LARGEST * LARGEST];
    bool coupled[LARGEST]; /* the row of `a` is not zero */

    double norm = 0.0;
    for (int i = 0; i < n; i++) {
        double row = 0.0;
        for (int j = 0; j < n; j++)
            row += fabs(a[i * n + j]) * h;
        norm = fmax(norm, row);
        coupled[i] = row != 0.0;
    }
    int halvings = 0;
    for (double left = norm; left > 0.5 && halvings < 1000; left *= 0.5)
        halvings++;
    double part = halvings > 0 ? ldexp(h, -halvings) : h;

    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++)
            matrix[i * size + j] = a[i * n + j] * part;
        matrix[i * size + n] = c[i] * part;
        matrix[i * size + n + 1] = b[i] * part;
        for (int j = 0; j < size; j++) {
            term[i * size + j] = matrix[i * size + j];
            result[i * size + j] = (i == j ? 1.0 : 0.0) + term[i * size + j];
        }
    }
    bool adds = true;
    for (int k = 2; k <= TERMS && adds; k++) {
        for (int i = 0; i < n; i++)
            for (int j = 0; j < size; j++) {
                double sum = 0.0;
                for (int l = 0; l < n; l++)
                    sum += matrix[i * size + l] * term[l * size + j];
                if (k == 2 && j == n + 1)
                    sum += matrix[i * size + n] * part;
                next[i * size + j] = sum / k;
            }
        bool changed = k == 2;
        for (int i = 0; i < n * size; i++) {
            const double sum = result[i] + next[i];
            changed |= sum != result[i];
            term[i] = next[i];
            result[i] = sum;
        }
        adds = changed || !all_negligible(n, term, result, coupled);
    }
    for (; halvings > 0; halvings--) {
        for (int i = 0; i < n; i++)
            for (int j = 0; j < size; j++) {
                double sum = 0.0;
                for (int l = 0; l < n; l++)
                    sum += result[i * size + l] * result[l * size + j];
                sum += j >= n ? result[i * size + n] * (j == n ? 1.0 : part) : 0.0;
                next[i * size + j] = sum + (j == n + 1 ? result[i * size + j] : 0.0);
            }
        for (int i = 0; i < n * size; i++)
            result[i] = next[i];
        part *= 2.0;
    }

    double moved[LARGEST];
    for (int i = 0; i < n; i++) {
        moved[i] = result[i * size + n + 1];
        for (int j = 0; j < n; j++)
            moved[i] += result[i * size + j] * x[j];
    }
    for (int i = 0; i < n; i++)
        x[i] = moved[i];
}

#endif
