/* What `systems.py` compares `newton` with: a mass that a spring pulls over LuGre friction, as an engineer would write
   it by hand in C, with the numerical methods of `newton` and of the blocks. The velocity and the friction force are
   lines during a step, with the means of the generalised-alpha method (harness/engine/span.h); the force at the end of
   the step is found by the secant method. Exact steps and quadrature are those of fmu_src/numerics. There are no checks
   of steps, no brackets, no contacts at rest and no other systems; only the position is recorded. */

#include <math.h>
#include <stdbool.h>
#include <time.h>

static double square(double a) { return a * a; }
static double sign(double a) { return (double)((a > 0.0) - (a < 0.0)); }
static double clip(double a, double low, double high) { return a < low ? low : a > high ? high : a; }

typedef struct {
    struct {
        double tolerance;
    } run;
} Model; /* as attraction.h expects it */

#define LINEAR_STATES 3

#include "attraction.h"
#include "oscillator.h"

#define TOLERANCE 3e-8 /* of the secant method, over the largest force */

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now); /* others may use the machine */
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* A value during a step: at its start, at its end, and its mean. */
typedef struct {
    double u0, q0, u1, q1, mean;
} Value;

static void end_at(Value *a, double u1)
{
    const double rho = 0.5, m = 0.5 * (3.0 - rho) / (1.0 + rho), f = 1.0 / (1.0 + rho), g = 0.5 + m - f;
    a->u1 = u1;
    const double q0 = a->u0 + (a->q0 - a->u0); /* rounded as in span.h */
    a->q1 = ((1.0 - f) * a->u0 + f * u1 - (1.0 - m) * q0) / m;
    a->mean = (1.0 - g) * q0 + g * a->q1;
}

static void next(Value *a)
{
    a->u0 = a->u1;
    a->q0 = a->q1;
}

typedef struct {
    double Fc, Fs, vs, delta, sigma0, sigma1, sigma2;
} LuGre;

/* Return z after h seconds on a ramp of v that does not pass zero. */
static double slip(const LuGre *p, double z, double v, double slope, double h)
{
    const Model usual = {{0.0}};
    const Attraction a = {p->sigma0, true, p->Fc, p->Fs, p->vs, p->delta, quadrature_tolerance(&usual)};
    const double direction = sign(h * (v + 0.5 * slope * h)), growth = direction * slope, y = direction * p->sigma0 * z;
    const double end = fmax(fabs(v) + growth * h, 0.0);
    const double sensitivity =
        1.0 + fmax(p->sigma1 * fabs(v) / level_of(&a, fabs(v)), p->sigma1 * end / level_of(&a, end));
    double kept, gained;
    if (direction == 0.0)
        return z;
    if (slope == 0.0)
        return relax(z, direction * level_of(&a, fabs(v)) / p->sigma0, p->sigma0 * fabs(v) / level_of(&a, fabs(v)) * h);
    if (!attract(&a, fabs(v), growth, h, fabs(y), sensitivity, &kept, &gained))
        return NAN;
    return direction * (kept * y + gained) / p->sigma0;
}

/* Return the time until a value passes zero, at most h; the blocks divide their steps there. */
static double until_zero(double begin, double slope, double h)
{
    return begin * slope < 0.0 && -begin / slope < h * (1.0 - 4.0 * DBL_EPSILON) ? -begin / slope : h;
}

/* Move the bristles along the line of the velocity; return the force at its end. */
static double friction(const LuGre *p, double *z, const Value *v, double h)
{
    const double begin = 2.0 * v->mean - v->u1, slope = 2.0 * (v->u1 - v->mean) / h;
    const double until = until_zero(begin, slope, h);
    *z = slip(p, *z, begin, slope, until);
    if (until < h)
        *z = slip(p, *z, 0.0, slope, h - until);
    const double rate = p->sigma0 * fabs(v->u1) / stribeck(v->u1, p->Fc, p->Fs, p->vs, p->delta);
    return p->sigma0 * *z + p->sigma1 * (v->u1 - rate * *z) + p->sigma2 * v->u1;
}

/* Move x, v and the position of the support, x[0] to x[2], along the line of the friction force. */
static void pull(Oscillator *last, double *x, const Value *F, double m, double k, double v_support, double h)
{
    const double slope = 2.0 * (F->u1 - F->mean) / h, c[] = {0.0, -slope / m, 0.0};
    double force = 2.0 * F->mean - F->u1;
    for (double rest = h; rest > 0.0; force = 0.0) {
        const double piece = until_zero(force, slope, rest);
        const bool renews = differs(last, m, k, 0.0, piece);
        const double w = last->w, b[] = {0.0, -force / m, w * v_support};
        const double A[] = {0.0, w, 0.0, -k / (m * w), 0.0, k / (m * w), 0.0, 0.0, 0.0};
        double y[] = {w * x[0], x[1], w * x[2]};
        if (renews)
            exponential(A, piece, &last->of);
        linear_step(&last->of, b, c, y);
        x[0] = y[0] / w;
        x[1] = y[1];
        x[2] = y[2] / w;
        rest = piece < rest ? rest - piece : 0.0;
    }
}

/* Seconds of n steps; rows gets n + 1 positions. */
double run_pulled_mass(const LuGre *p, double m, double k, double v_support, long n, double h, double *rows)
{
    double x[3] = {0.0}, z = 0.0, inverse = -1.0, trend = 0.0, last = 0.0, largest = 0.0;
    Value v = {0.0}, F = {0.0};
    Oscillator oscillator = {0.0};
    const double begin = seconds();
    rows[0] = 0.0;
    for (long tick = 0; tick < n; tick++) {
        double y[3], z1 = z, force = last + trend * h, force0 = 0.0, r0 = 0.0;
        for (int tries = 0; tries < 50; tries++) {
            end_at(&F, force);
            for (int i = 0; i < 3; i++)
                y[i] = x[i];
            pull(&oscillator, y, &F, m, k, v_support, h);
            end_at(&v, y[1]);
            z1 = z;
            const double r = friction(p, &z1, &v, h) - force;
            const double step = force - force0, by = inverse * (r - r0);
            if (tries > 0 && step * (r - r0) < 0.0)
                inverse += (step - by) * (step * inverse / (step * by)); /* step / (r - r0), as Broyden rounds it */
            if (fabs(r) <= TOLERANCE * fmax(largest, fmin(fabs(force), fabs(force + r))))
                break;
            force0 = force;
            r0 = r;
            force -= inverse * r;
        }
        for (int i = 0; i < 3; i++)
            x[i] = y[i];
        z = z1;
        next(&v);
        next(&F);
        trend = (force - last) / h;
        last = force;
        largest = fmax(largest, fabs(force));
        rows[tick + 1] = x[0];
    }
    return seconds() - begin;
}
