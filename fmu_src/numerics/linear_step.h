/* Exact steps of linear equations with constant coefficients. */

#ifndef LINEAR_STEP_H
#define LINEAR_STEP_H

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

/* Return z(h) of z' = rate (target - z), with `decay` = rate h >= 0; also exact if decay is tiny or infinite. */
static inline double relax(double z, double target, double decay) { return z - (target - z) * expm1(-decay); }

/* Number of states. A block with more of them defines it. */
#ifndef LINEAR_STATES
#define LINEAR_STATES 2
#endif
enum { ORDER = LINEAR_STATES };

/* What a step over h of x' = a x + b + c s needs of a and h: the exponential of `scaled` = a h / 2^halvings, both
   column by column. */
typedef struct {
    int halvings;
    double part; /* h / 2^halvings */
    double scaled[ORDER * ORDER], power[ORDER * ORDER];
    bool coupled[ORDER]; /* the row of a is not zero */
} Exponential;

static inline void multiply(const double *matrix, const double *x, double *product)
{
    for (int i = 0; i < ORDER; i++) {
        product[i] = matrix[i] * x[0];
        for (int l = 1; l < ORDER; l++)
            product[i] += matrix[l * ORDER + i] * x[l];
    }
}

/* Add the terms of a Taylor series from the k-th to the sum of the earlier ones. Each is `scaled` times the one before
   over its number. End when all further terms are too small to change the sum: their largest magnitude decreases to
   less than a sixth from one to the next, and a row of zeros stays one. */
static inline void add_terms(const Exponential *of, int k, double *term, double *sum)
{
    enum { TERMS = 16 };
    double next[ORDER];
    for (bool adds = true; k <= TERMS && adds; k++) {
        double most = 0.0;
        adds = false;
        multiply(of->scaled, term, next);
        for (int i = 0; i < ORDER; i++) {
            const double before = sum[i];
            term[i] = next[i] / k;
            sum[i] += term[i];
            adds |= sum[i] != before;
            most = fmax(most, fabs(term[i]));
        }
        for (int i = 0; i < ORDER && !adds; i++)
            adds = of->coupled[i] && most > 0.5 * DBL_EPSILON * fabs(sum[i]);
    }
}

/* Compute the exponential for `a`, which is given row by row and balanced by the caller. */
static inline void exponential(const double *a, double h, Exponential *of)
{
    double norm = 0.0, term[ORDER];
    for (int i = 0; i < ORDER; i++) {
        double row = 0.0;
        for (int j = 0; j < ORDER; j++)
            row += fabs(a[i * ORDER + j]) * h;
        norm = fmax(norm, row);
        of->coupled[i] = row != 0.0;
    }
    of->halvings = 0;
    for (double left = norm; left > 0.5 && of->halvings < 1000; left *= 0.5)
        of->halvings++;
    of->part = of->halvings > 0 ? ldexp(h, -of->halvings) : h;
    for (int j = 0; j < ORDER; j++)
        for (int i = 0; i < ORDER; i++) {
            of->scaled[j * ORDER + i] = a[i * ORDER + j] * of->part;
            of->power[j * ORDER + i] = (i == j ? 1.0 : 0.0) + of->scaled[j * ORDER + i];
        }
    for (int j = 0; j < ORDER; j++) {
        memcpy(term, of->scaled + j * ORDER, sizeof term);
        add_terms(of, 2, term, of->power + j * ORDER);
    }
}

/* Replace x by the exact x(h) of x' = a x + b + c s: the exponential of the matrix [a c b; 0 0 1; 0 0 0] h times
   [x; 0; 1], by scaling and squaring. Van Loan, IEEE TAC 23(3), 1978. */
static inline void linear_step(const Exponential *of, const double *b, const double *c, double *x)
{
    double part = of->part, power[ORDER * ORDER], square[ORDER * ORDER], moved[ORDER], term[ORDER];
    double by_c[ORDER], by_b[ORDER]; /* further columns of the exponential */
    for (int i = 0; i < ORDER; i++) {
        term[i] = c[i] * part;
        by_c[i] = 0.0 + term[i]; /* no negative zero */
    }
    if (of->halvings > 0)
        add_terms(of, 2, term, by_c);
    for (int i = 0; i < ORDER; i++) {
        term[i] = b[i] * part;
        by_b[i] = 0.0 + term[i];
    }
    multiply(of->scaled, term, moved);
    for (int i = 0; i < ORDER; i++) {
        term[i] = (moved[i] + c[i] * part * part) / 2.0;
        by_b[i] += term[i];
    }
    add_terms(of, 3, term, by_b);
    memcpy(power, of->power, sizeof power);
    for (int left = of->halvings; left > 0; left--, part *= 2.0) {
        multiply(power, by_b, moved);
        multiply(power, by_c, term);
        for (int i = 0; i < ORDER; i++) {
            by_b[i] += moved[i] + by_c[i] * part;
            by_c[i] += term[i];
            multiply(power, power + i * ORDER, square + i * ORDER);
        }
        memcpy(power, square, sizeof power);
    }
    for (int i = 0; i < ORDER; i++) {
        moved[i] = by_b[i];
        for (int j = 0; j < ORDER; j++)
            moved[i] += power[j * ORDER + i] * x[j];
    }
    memcpy(x, moved, sizeof moved);
}

#endif
