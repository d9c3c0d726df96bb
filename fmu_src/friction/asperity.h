/* Parts of GenericAsperity.c that do not depend on the block: motion of the slider, slip on a sinusoidal profile. */

#ifndef ASPERITY_H
#define ASPERITY_H

#include <math.h>
#include <stdbool.h>

#include "constants.h"
#include "ramp.h"
#include "roots.h"

/* Motion of the slider from now on: b += v t + a t^2/2, to one side (1, -1) or none (0). */
typedef struct {
    double v, a, rest;
    int side;
} Interval;

static inline double distance_in(const Interval *c, double t) { return path_after(c->v, c->a, t); }

/* Return the time in which the slider moves by `distance` (to its side), or INFINITY if it takes longer. */
static inline double time_for(const Interval *c, double distance)
{
    if (distance * c->side <= 0.0)
        return 0.0;
    const double squared = squared_speed_after(distance, c->v, c->a);
    const double t = squared < 0.0 ? INFINITY : time_between(distance, c->v, c->side * sqrt(squared));
    return t < c->rest ? t : INFINITY;
}

static inline void pass(Interval *c, double t)
{
    c->v += c->a * t;
    c->rest -= t;
}

/* An asperity of height h on the profile w(p) = A cos(k p). */
typedef struct {
    double h, A, k, k_n, k_t, mu0;
} Surface;

static inline double reach(const Surface *f, double p) { return f->h + f->A * cos(f->k * p); }
static inline double incline(const Surface *f, double p) { return -f->A * f->k * sin(f->k * p); }

/* Return g(p) = p + N (w' + s mu0)/k_t, the position of the base in slip, with its slope and a bound of |g''|. */
static inline Taylor balance(const Surface *f, int s, double p)
{
    const double A = f->A, k = f->k, ratio = f->k_n / f->k_t, w = A * cos(k * p), up = -A * k * sin(k * p);
    return (Taylor){p + ratio * (f->h + w) * (up + s * f->mu0),
                    1.0 + ratio * (up * (up + s * f->mu0) - (f->h + w) * k * k * w),
                    ratio * A * k * k * (1.5 * A * k + f->mu0 + (f->h + A) * k)};
}

/* Slip from `from` by x to the side s. */
typedef struct {
    const Surface *surface;
    double from, base;
    int s;
} Slip;

/* Return the distance by which the tip is ahead of balance with its base. */
static inline Taylor ahead(const void *data, double x)
{
    const Slip *const slip = (const Slip *)data;
    Taylor g = balance(slip->surface, slip->s, slip->from + slip->s * x);
    g.value = slip->s * (g.value - slip->base);
    return g;
}

/* Return -g', which is zero where slip becomes unstable, and a bound of |g'''|. */
static inline Taylor instability(const void *data, double x)
{
    const Slip *const slip = (const Slip *)data;
    const Surface *const f = slip->surface;
    const double A = f->A, k = f->k, ratio = f->k_n / f->k_t, p = slip->from + slip->s * x;
    const double w = A * cos(k * p), up = -A * k * sin(k * p), w2 = -k * k * w, w3 = -k * k * up;
    const double third = 3.0 * up * w2 + slip->s * f->mu0 * w2 + (f->h + w) * w3;
    return (Taylor){-balance(f, slip->s, p).slope, -slip->s * ratio * third,
                    ratio * A * k * k * k * (4.0 * A * k + f->mu0 + (f->h + A) * k)};
}

/* Return the angle in [0, 2 pi) from one to the other. */
static inline double turn(double from, double to)
{
    const double angle = fmod(to - from, TWO_PI);
    return angle < 0.0 ? angle + TWO_PI : angle;
}

/* Return the phase at which a tip reaches or loses the profile; not NaN where it never does, as a compiler may compute
   that in advance. */
static inline double edge(const Surface *f) { return acos(-f->h / fmax(f->A, fabs(f->h))); }

/* Return the distance to the side s after which a tip at p reaches or loses the profile: at cos(k p) = -h/A. */
static inline double to_next_contact(const Surface *f, int s, double p) { return turn(s * f->k * p, -edge(f)) / f->k; }

static inline double to_last_contact(const Surface *f, int s, double p)
{
    if (f->h >= f->A)
        return INFINITY;
    if (reach(f, p) <= 1e-12 * (f->h + f->A) && s * incline(f, p) <= 0.0)
        return 0.0;
    return turn(s * f->k * p, edge(f)) / f->k;
}

/* Return the deflection in balance. */
static inline double balanced(const Surface *f, int s, double p)
{
    return f->k_n / f->k_t * reach(f, p) * (incline(f, p) + s * f->mu0);
}

typedef struct {
    double p, base; /* positions of the tip and its base */
    bool lost;      /* contact is lost there */
} SlipEnd;

/* Slip to the side s up to the first position of balance with a base at `base`, or until contact is lost. A tip driven
   by the slider also loses contact where slip becomes unstable; a tip that springs forward continues to the next
   balance. */
static inline SlipEnd slip_to(const Surface *f, int s, double p, double base, bool driven, double *left)
{
    if (f->A == 0.0)
        return (SlipEnd){base - balanced(f, s, 0.0), base, false};
    const double ratio = f->k_n / f->k_t, wavelength = TWO_PI / f->k;
    const double gone = to_last_contact(f, s, p), far = fmin(gone, wavelength);
    driven = driven && ratio * f->A * f->k * (f->A * f->k + f->mu0 + (f->h + f->A) * f->k) >= 1.0;
    Slip slip = {f, p, base, s};
    for (;;) {
        const double there = first_zero(ahead, &slip, far, left), within = fmin(there, far);
        const double unstable = driven ? first_zero(instability, &slip, within, left) : INFINITY;
        if (unstable < within) {
            p = slip.from + s * unstable;
            return (SlipEnd){p, balance(f, s, p).value, true};
        }
        if (there < far)
            return (SlipEnd){slip.from + s * there, base, false};
        if (gone < wavelength) {
            p = slip.from + s * gone;
            return (SlipEnd){p, p, true};
        }
        /* no event in a whole wavelength means none in the next ones */
        const double whole = floor(s * (base - balance(f, s, slip.from).value) / wavelength);
        const double before = slip.from;
        slip.from += s * wavelength * fmax(whole, 1.0);
        if (slip.from == before || !(fabs(slip.from) < INFINITY)) /* so far away that rounding hides the profile */
            return (SlipEnd){slip.from, base, false};
    }
}

#endif
