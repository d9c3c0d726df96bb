/* Attraction to a Stribeck curve S(v) over a ramp of the velocity. The equation is linear in y, so its solution is an
   integral:

       dy/dt = a (1 - y / S(v)),   a = strength |v| or a = strength
       y(h)  = y(0) exp(-P(0)) + integral of a exp(-P(t)) dt,   P(t) = integral of a / S(v) from t to h

   It is computed by Lobatto quadrature (Abramowitz, Stegun: Handbook of Mathematical Functions, 25.4.32) with error
   control, backwards from the end of the ramp until earlier contributions, which have the weight exp(-P), are
   negligible. */

#ifndef ATTRACTION_H
#define ATTRACTION_H

#include "constants.h"
#include "stribeck.h"

/* All quantities are in the direction of motion, so that speeds are nonnegative. */
typedef struct {
    double strength;
    bool by_path;             /* a = strength |v|, else a = strength */
    double Fc, Fs, vs, delta; /* of S */
    double tolerance;
} Attraction;

static inline double level_of(const Attraction *a, double speed)
{
    return stribeck(speed, a->Fc, a->Fs, a->vs, a->delta);
}

static inline double pull_of(const Attraction *a, double speed)
{
    return a->by_path ? a->strength * speed : a->strength;
}

/* Return the tolerance of y. It is finer than the tolerance of F because later steps may magnify an error of y. */
static inline double quadrature_tolerance(const Model *m) { return m->run.tolerance > 0.0 ? m->run.tolerance : 1e-11; }

/* Five nodes on [0, 1] and, for each node, the integrals of the Lagrange polynomials from 0 to it; order 8. The last
   row contains the weights of the quadrature. */
/* clang-format off */
enum { NODES = 5 };
static const double lobatto_node[NODES] = {0.0, 0.17267316464601143, 0.5, 0.8273268353539886, 1.0};
static const double lobatto_weight[NODES][NODES] = {
    {0.0},
    {0.067728432186156898, 0.11974476934341168, -0.021735721866558114,  0.010635824225415492, -0.0037001392424145306},
    {0.040625,             0.30318418332304278,  0.17777777777777778,  -0.030961961100820556,  0.009375},
    {0.053700139242414531, 0.26158639799680673,  0.37729127742211367,   0.15247745287881054,  -0.017728432186156898},
    {0.05,                 0.27222222222222222,  0.35555555555555556,   0.27222222222222222,   0.05}};
/* clang-format on */

/* The part of a ramp covered so far, from its end backwards. */
typedef struct {
    double gone;           /* [s] */
    double speed, S;       /* at its beginning */
    double passed, gained; /* P at its beginning; y at its end if y = 0 at its beginning */
} Piece;

/* Extend the part by a piece of duration dt that begins at `speed`. `error` is the difference to Simpson's rule on the
   same nodes, relative to `size`. */
static Piece piece_of_ramp(const Attraction *a, const Piece *after, double speed, double dt, double size, double *error)
{
    const double rise = after->speed - speed, S_begin = level_of(a, speed), longest = 2.0;
    double pull[NODES], rate[NODES], passed[NODES], kept[NODES], gained = 0.0;
    for (int i = 0; i < NODES; i++) {
        const double now = speed + lobatto_node[i] * rise;
        pull[i] = pull_of(a, now) * dt;
        rate[i] = pull[i] / (i == 0 ? S_begin : i == NODES - 1 ? after->S : level_of(a, now));
    }
    for (int i = 0; i < NODES; i++) {
        passed[i] = 0.0;
        for (int j = 0; j < NODES; j++)
            passed[i] += lobatto_weight[i][j] * rate[j];
    }
    const double all = passed[NODES - 1];
    for (int i = 0; i < NODES; i++) {
        kept[i] = i == NODES - 1 ? 1.0 : exp(passed[i] - all);
        gained += lobatto_weight[NODES - 1][i] * pull[i] * kept[i];
    }
    const double all_simpson = (rate[0] + 4.0 * rate[2] + rate[4]) / 6.0;
    const double gained_simpson = (pull[0] * kept[0] + 4.0 * pull[2] * kept[2] + pull[4] * kept[4]) / 6.0;

    *error = all > longest ? INF : fabs(gained - gained_simpson) / size + fabs(all - all_simpson);
    return (Piece){after->gone + dt, speed, S_begin, after->passed + all, after->gained + exp(-after->passed) * gained};
}

/* Compute `kept` and `gained` of y = kept y(0) + gained after a ramp of h seconds that begins at the speed `first`. The
   error is small compared with the smallest S over `sensitivity`, for |y(0)| up to `size`. Returns false if no piece is
   short enough. */
static bool attract(const Attraction *a, double first, double growth, double h, double size, double sensitivity,
                    double *kept, double *gained)
{
    const double last = fmax(first + growth * h, 0.0), S_first = level_of(a, first), S_last = level_of(a, last);
    const double smallest = fmin(a->Fs, fmin(S_first, S_last)), largest = fmax(size, fmax(S_first, S_last));
    const double allowed = fmax(a->tolerance * smallest / (sensitivity * largest), 1e-16);
    const bool smooth_at_rest = (a->delta == 1.0 || a->delta == 2.0) && a->Fs > 0.1 * a->Fc;

    Piece now = {0.0, last, S_last, 0.0, 0.0};
    double dt = 0.5 * S_last / fmax(pull_of(a, last), DBL_MIN), border = 0.0, S_border = S_last;
    bool whole = false; /* no border before the start */
    *kept = 0.0;
    for (int tries = 0; !whole || now.gone < h; tries++) {
        const double weight = exp(-now.passed);
        if (weight < 1e-6 * allowed) /* all earlier parts are negligible */
            break;
        if (tries > 100000)
            return false;
        if (now.gone >= border) { /* S is smooth up to the next one */
            border = now.gone + stribeck_piece(now.speed, -growth, a->Fc, a->Fs, a->vs, a->delta);
            whole = !(border < h && border > now.gone);
            border = whole ? h : border;
            S_border = whole ? S_first : level_of(a, fmax(last - growth * border, 0.0));
        }
        const double rest = border - now.gone;
        if (S_border == now.S) {
            const double speed = whole ? first : fmax(last - growth * border, 0.0);
            const double P = 0.5 * (pull_of(a, speed) + pull_of(a, now.speed)) * rest / now.S;
            now = (Piece){border, speed, now.S, now.passed + P, now.gained - weight * now.S * expm1(-P)};
            continue;
        }
        const bool shortest = dt <= 4.0 * DBL_EPSILON * now.gone, all = dt >= rest;
        const double taken = all ? rest : dt, begins = all ? border : now.gone + dt;
        const double speed = fmax(2.0 * begins < h ? last - growth * begins : first + growth * (h - begins), 0.0);
        /* the error e of Simpson's rule is of fifth order in the step and the error of the result of ninth order, about
           e^(9/5), where S is smooth */
        const bool smooth = smooth_at_rest || 2.0 * fmin(speed, now.speed) >= fmax(speed, now.speed);
        const double limit = smooth ? fmin(0.1 * cbrt(square(allowed / weight)), 0.1) : fmin(allowed / weight, 0.1);
        double error;
        const Piece next = piece_of_ramp(a, &now, speed, taken, largest, &error);
        const bool accepted = error <= fmax(limit, DBL_EPSILON) || shortest;
        if (accepted) {
            now = next;
            now.gone = begins;
        }
        if (!(accepted && all))
            dt = taken * clip(0.9 * pow(error / limit + 1e-9, -0.2), 0.1, accepted ? 5.0 : 0.9);
        dt = fmax(dt, 2.0 * DBL_EPSILON * now.gone);
    }
    *kept = now.gone >= h ? exp(-now.passed) : 0.0;
    *gained = now.gained;
    return true;
}

#endif
