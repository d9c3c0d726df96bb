/* Roots of functions of one variable. */

#ifndef ROOTS_H
#define ROOTS_H

#include <math.h>
#include <stdbool.h>

/* A function at a point: its value, its slope and, for `first_zero`, an upper bound of its second derivative from this
   point on. */
typedef struct {
    double value, slope, bend;
} Taylor;

typedef Taylor Function(const void *data, double x);

/* Return the first x in [0, end) with f(x) >= 0, or INFINITY if there is none. Each step goes to the zero of the
   parabola f + f' s + bend s^2/2, which lies above f; therefore it never skips a zero of f, and convergence is
   quadratic. Each step decreases `left` by one. */
static inline double first_zero(Function *f, const void *data, double end, double *left)
{
    double x = 0.0;
    for (int i = 0; i < 1000; i++) {
        const Taylor at = f(data, x);
        *left -= 1.0;
        if (at.value >= 0.0)
            return x;
        const double root = sqrt(at.slope * at.slope - 2.0 * at.bend * at.value);
        const double s = at.slope > 0.0 ? -2.0 * at.value / (at.slope + root) : (root - at.slope) / at.bend;
        if (!(x + s < end))
            return INFINITY;
        if (s <= 1e-15 * x)
            return x;
        x += s;
    }
    return x;
}

/* Return x if it is inside the interval, else the midpoint. */
static inline double kept_inside(double x, double low, double high)
{
    return x > low && x < high ? x : 0.5 * (low + high);
}

/* Return the root between low, where f is not positive, and high, by Newton's method from `x` with bisection if a step
   leaves the interval. The interval shrinks around the root. */
static inline double newton_between(Function *f, const void *data, double x, double *low, double *high)
{
    for (int i = 0; i < 200 && *low < *high; i++) {
        const Taylor at = f(data, x);
        if (at.value > 0.0)
            *high = x;
        else
            *low = x;
        const double next = kept_inside(x - at.value / at.slope, *low, *high);
        if (next == x || next <= *low || next >= *high)
            break;
        x = next;
    }
    return x;
}

/* Return the zero of the line through two points, as a distance from the first point. */
static inline double secant(double a, double f_a, double b, double f_b) { return a - f_a * (b - a) / (f_b - f_a); }

/* An interval in which f changes its sign, for false position with halved weights (Illinois algorithm; Dowell, Jarratt:
   BIT 11, 1971): if an end is retained twice in succession, its value is halved. */
typedef struct {
    double low, high, f_low, f_high;
    int moved; /* the end that moved last; -1: low, 1: high, 0: none */
} Bracket;

/* Move the high end to x if x is `beyond` the root, else the low end. */
static inline void narrow(Bracket *b, double x, double f, bool beyond)
{
    if (beyond) {
        b->f_low *= b->moved > 0 ? 0.5 : 1.0;
        b->moved = 1;
        b->high = x;
        b->f_high = f;
    } else {
        b->f_high *= b->moved < 0 ? 0.5 : 1.0;
        b->moved = -1;
        b->low = x;
        b->f_low = f;
    }
}

#endif
