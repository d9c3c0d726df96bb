/* Roots of functions of one variable. */

#ifndef ROOTS_H
#define ROOTS_H

#include <math.h>
#include <stdbool.h>

/* A function at a place: its value, its slope and, for `first_zero`, an upper bound of its second derivative from there
   on. */
typedef struct {
    double value, slope, bend;
} Taylor;

typedef Taylor Function(const void *data, double x);

/* The first x in [0, end) with f(x) >= 0, INFINITY if there is none. Each step goes to where the parabola
   f + f' s + bend s^2/2, which lies above f, reaches zero: it never passes a zero, and converges quadratically. Each
   step takes one off `left`. */
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

/* x if it is inside the interval, else the middle. */
static inline double kept_inside(double x, double low, double high)
{
    return x > low && x < high ? x : 0.5 * (low + high);
}

/* The root between low, where f is not positive, and high: Newton's method from `x` on, bisection where that leaves the
   interval. The interval shrinks around the root, which is returned. */
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

/* Where the line through two points is zero, as a distance from the first. */
static inline double secant(double a, double f_a, double b, double f_b) { return a - f_a * (b - a) / (f_b - f_a); }

/* An interval in which f changes its sign, for false position with halved weights (Illinois; Dowell, Jarratt: BIT 11,
   1971): the value at an end that stays where it is counts half from the second time on. */
typedef struct {
    double low, high, f_low, f_high;
    int moved; /* the end that moved last: -1 low, 1 high, 0 none */
} Bracket;

/* Moves the high end to x if that is `beyond` the root, else the low one. */
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
