/* Exact steps of linear equations with constant coefficients. */

#ifndef LINEAR_STEP_H
#define LINEAR_STEP_H

#include <math.h>

/* Return z(h) of z' = rate (target - z), with `decay` = rate h >= 0; also exact if decay is tiny or infinite. */
static inline double relax(double z, double target, double decay) { return z - (target - z) * expm1(-decay); }

/* Replace x by the exact x(h) of x' = a x + b + c s, using the exponential of the matrix [a c b; 0 0 1; 0 0 0] h by
   scaling and squaring of its Taylor series. Van Loan, IEEE TAC 23(3), 1978. At most 6 states, balanced by the
   caller. */
static inline void linear_step(int n, const double *a, const double *b, const double *c, double *x, double h)
{
    enum { LARGEST = 8, TERMS = 16 };
    const int size = n + 2;
    double matrix[LARGEST * LARGEST] = {0.0}, result[LARGEST * LARGEST] = {0.0}, term[LARGEST * LARGEST],
                            next[LARGEST * LARGEST];

    double norm = 0.0;
    for (int i = 0; i < n; i++) {
        double row = 0.0;
        for (int j = 0; j < n; j++)
            row += fabs(a[i * n + j]) * h;
        norm = fmax(norm, row);
    }
    int halvings = 0;
    while (ldexp(norm, -halvings) > 0.5 && halvings < 1000)
        halvings++;
    const double part = ldexp(h, -halvings);

    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++)
            matrix[i * size + j] = a[i * n + j] * part;
        matrix[i * size + n] = c[i] * part;
        matrix[i * size + n + 1] = b[i] * part;
    }
    matrix[n * size + n + 1] = part;

    for (int i = 0; i < size; i++)
        result[i * size + i] = 1.0;
    for (int i = 0; i < size * size; i++)
        term[i] = result[i];
    for (int k = 1; k <= TERMS; k++) {
        for (int i = 0; i < size; i++)
            for (int j = 0; j < size; j++) {
                double sum = 0.0;
                for (int l = 0; l < size; l++)
                    sum += matrix[i * size + l] * term[l * size + j];
                next[i * size + j] = sum / k;
            }
        for (int i = 0; i < size * size; i++) {
            term[i] = next[i];
            result[i] += next[i];
        }
    }
    for (; halvings > 0; halvings--) {
        for (int i = 0; i < size; i++)
            for (int j = 0; j < size; j++) {
                double sum = 0.0;
                for (int l = 0; l < size; l++)
                    sum += result[i * size + l] * result[l * size + j];
                next[i * size + j] = sum;
            }
        for (int i = 0; i < size * size; i++)
            result[i] = next[i];
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
