/* A chain of masses connected by springs on a periodic substrate, shared by Frenkel-Kontorova and
   Frenkel-Kontorova-Tomlinson. Unit mass, unit period of the substrate.

       x_j'' = k (x_j+1 - 2 x_j + x_j-1) - (K / 2 pi) sin(2 pi x_j) + kappa (X + j c - x_j) + F_drive - damping x_j'

   The states are the displacements u_j = x_j - j c - turns, whose differences are exact however far the chain has
   moved; the integer number `turns` of periods only affects rounding. c is the rest length of the springs; in a ring,
   x_j+N = x_j + N c, where N c is an integer. */

#ifndef CHAIN_H
#define CHAIN_H

#include "constants.h"
#include "extrapolation.h"
#include "ramp.h"

struct chain {
    bool ready;           /* initialised and stepped */
    double time;          /* [s] of y */
    double turns;         /* whole periods removed from the displacements */
    double place[MASSES]; /* j c modulo 1 */
    double y[2 * MASSES]; /* n displacements u_j, then n velocities */
};

struct surroundings {
    const struct chain *chain;
    int n;
    bool ring;
    double k, K, kappa, damping;
    double X, X_rate, X_curvature; /* the slider, without the turns: X + X_rate s + X_curvature s^2 / 2 */
    double F, F_rate;              /* force on each mass: F + F_rate s */
};

/* Return the number of periods per mass, which in a ring of n masses is a multiple of 1/n. */
static inline double spacing(int n, bool ring, double winding) { return ring ? floor(winding * n + 0.5) / n : winding; }

/* Initialise evenly spaced masses at rest, with a deflection of one mode. */
static inline void lay_chain(struct chain *c, int n, bool ring, double winding, double amplitude, int mode)
{
    const double whole = floor(winding * n + 0.5);
    c->turns = 0.0;
    for (int j = 0; j < n; j++) {
        c->place[j] = ring ? fmod(j * fmod(whole, n), n) / n : fmod(j * winding, 1.0);
        c->y[j] = amplitude * cos(TWO_PI * fmod((double)mode * j, n) / n);
        c->y[n + j] = 0.0;
    }
}

/* Return the phase for sin and cos of the substrate, within half a period. */
static inline double phase(const struct chain *c, const double *y, int j)
{
    const double x = y[j] + c->place[j];
    return TWO_PI * (x - floor(x + 0.5));
}

static inline void pull(const void *system, double s, const double *y, double *a)
{
    const struct surroundings *const at = (const struct surroundings *)system;
    const int n = at->n;
    const double *const u = y, *const w = y + n;
    const double X = at->X + path_after(at->X_rate, at->X_curvature, s), F = at->F + s * at->F_rate;

    for (int j = 0; j < n; j++) {
        const double left = j > 0 ? u[j - 1] : at->ring ? u[n - 1] : u[j];
        const double right = j < n - 1 ? u[j + 1] : at->ring ? u[0] : u[j];
        a[j] = at->k * ((left - u[j]) + (right - u[j])) - at->K / TWO_PI * sin(phase(at->chain, y, j)) +
               at->kappa * (X - u[j]) + F - at->damping * w[j];
    }
}

/* Move the chain over h from `time`, after removing whole periods from the displacements. Returns false like
   move_masses. */
static inline bool move_chain(struct chain *c, struct surroundings *at, double time, double h, double tolerance,
                              double *inner, double *left)
{
    double mean = 0.0;
    for (int j = 0; j < at->n; j++)
        mean += c->y[j] / at->n;
    const double turns = floor(mean + 0.5);
    for (int j = 0; j < at->n; j++)
        c->y[j] -= turns;
    c->turns += turns;
    at->X -= c->turns;
    const Dynamics d = {pull,
                        at,
                        at->n,
                        1.0 + sqrt(4.0 * at->k + at->K + at->kappa) + at->damping,
                        tolerance > 0.0 ? tolerance : CHAIN_TOLERANCE,
                        left};
    c->ready = true;
    c->time = time + h;
    return move_masses(&d, c->y, h, inner);
}

/* Outputs of the chain, per mass. */
struct view {
    double u, v, a;   /* mean displacement since the start, mean velocity and acceleration */
    double substrate; /* mean force of the substrate against positive motion */
    double slider;    /* mean force of the slider */
    double energy;    /* kinetic, of the springs, of the substrate, and of the slider's springs */
};

/* Return the chain at `time`: its state, or its extrapolation for derivatives with respect to time. */
static inline struct view view_chain(const struct chain *c, const struct surroundings *given_at, double time)
{
    struct surroundings at = *given_at;
    struct view seen = {0};
    const int n = at.n;
    const double s = c->ready ? time - c->time : 0.0;
    double a[MASSES], moved[2 * MASSES];
    const double *y = c->y;

    at.X -= c->turns;
    if (s != 0.0) { /* X and F are given at `time` */
        pull(&at, 0.0, c->y, a);
        for (int j = 0; j < n; j++) {
            moved[j] = c->y[j] + s * (c->y[n + j] + 0.5 * s * a[j]);
            moved[n + j] = c->y[n + j] + s * a[j];
        }
        y = moved;
    }
    for (int j = 0; j < n; j++) {
        const double angle = phase(c, y, j), u = y[j], w = y[n + j];
        const double stretch = j < n - 1 ? y[j + 1] - u : at.ring ? y[0] - u : 0.0;
        seen.u += u;
        seen.v += w;
        seen.substrate += at.K / TWO_PI * sin(angle);
        seen.slider += at.kappa * (at.X - u);
        seen.energy += 0.5 * w * w + 0.5 * at.k * stretch * stretch + 0.5 * at.kappa * (at.X - u) * (at.X - u) +
                       at.K / (TWO_PI * TWO_PI) * (1.0 - cos(angle));
    }
    seen.u = c->turns + seen.u / n;
    seen.v /= n;
    seen.substrate /= n;
    seen.slider /= n;
    seen.energy /= n;
    seen.a = at.F + seen.slider - seen.substrate - at.damping * seen.v;
    return seen;
}

#endif
