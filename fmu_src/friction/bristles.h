/* Bristles that slip at the rate sigma0 |v| / g(v), over a ramp of the velocity, for any level g. The equation is
   linear in z, so its solution is an integral:

       dz/dt = v - sigma0 |v| z / g(v)
       z(h)  = z(0) exp(-P(h)) + integral of v(t) exp(P(t) - P(h)) dt,   P(t) = integral of sigma0 |v| / g(v) dt

   It is found by Lobatto's quadrature (Abramowitz, Stegun: Handbook of Mathematical Functions, 25.4.32) with error
   control. Included after presliding.h.                                                                             */

#ifndef BRISTLES_H
#define BRISTLES_H

/* All is told in the direction of motion, where speeds are not negative. */
typedef struct {
    double (*g)(const Model *m, double speed, bool backward);
    const Model *m;
    bool backward; /* the direction of motion                          */
    double sigma0;
    double width; /* of g: the speed over which it changes, as vs      */
} Bristles;

static inline double level_of(const Bristles *b, double speed) { return b->g(b->m, speed, b->backward); }

/* Five nodes on [0, 1], and the integrals from 0 to each node of the polynomials that are 1 at one node: order 8. The
   last row are the weights. */
/* clang-format off */
enum { NODES = 5 };
static const double node[NODES] = {0.0, 0.17267316464601143, 0.5, 0.8273268353539886, 1.0};
static const double weight[NODES][NODES] = {
    {0.0},
    {0.067728432186156898, 0.11974476934341168, -0.021735721866558114,  0.010635824225415492, -0.0037001392424145306},
    {0.040625,             0.30318418332304278,  0.17777777777777778,  -0.030961961100820556,  0.009375},
    {0.053700139242414531, 0.26158639799680673,  0.37729127742211367,   0.15247745287888054,  -0.017728432186156898},
    {0.05,                 0.27222222222222222,  0.35555555555555556,   0.27222222222222222,   0.05}};
/* clang-format on */

/* The end of a piece of a ramp. */
typedef struct {
    double z, speed, g;
    double error; /* of Simpson's rule on the same nodes, over the deflection of steady sliding */
} Piece;

/* Over a time dt, while the speed grows by `rise`. */
static Piece piece_of_ramp(const Bristles *b, Piece from, double rise, double dt)
{
    double speed[NODES], rate[NODES], passed[NODES], kept[NODES], g = from.g;
    for (int i = 0; i < NODES; i++) {
        speed[i] = fmax(from.speed + node[i] * rise, 0.0);
        if (i > 0)
            g = level_of(b, speed[i]);
        rate[i] = b->sigma0 * speed[i] / g * dt;
    }
    for (int i = 0; i < NODES; i++) {
        passed[i] = 0.0; /* P at the node */
        for (int j = 0; j < NODES; j++)
            passed[i] += weight[i][j] * rate[j];
    }
    const double all = passed[NODES - 1];
    double gained = 0.0;
    for (int i = 0; i < NODES; i++) {
        kept[i] = i == NODES - 1 ? 1.0 : exp(passed[i] - all);
        gained += weight[NODES - 1][i] * speed[i] * kept[i] * dt;
    }
    const double all_simpson = (rate[0] + 4.0 * rate[2] + rate[4]) / 6.0;
    const double gained_simpson = (speed[0] * kept[0] + 4.0 * speed[2] * kept[2] + speed[4] * kept[4]) / 6.0 * dt;

    return (Piece){
        .z = from.z * kept[0] + gained,
        .speed = speed[NODES - 1],
        .g = g,
        .error = b->sigma0 / g *
                 (fabs(gained - gained_simpson) + fabs(all - all_simpson) * (fabs(from.z) * kept[0] + gained)),
    };
}

/* Moves z over h seconds in which v of the block changes linearly and not its sign; false if no step is short enough.
 */
static bool bristles_over_ramp(const Bristles *b, double h, double *z)
{
    const Model *const m = b->m;
    const double tolerance = m->run.tolerance > 0.0 ? m->run.tolerance : DEFAULT_TOLERANCE;
    /* Simpson's error e goes with the fifth power of the step, that of the result with the ninth: about e^(9/5) */
    const double allowed = cbrt(square(tolerance));
    const double direction = b->backward ? -1.0 : 1.0, growth = direction * SLOPE(v);
    const double v_end = fmax(direction * (m->v + SLOPE(v) * h), 0.0), g_end = level_of(b, v_end);

    Piece now = {direction * *z, fabs(m->v), level_of(b, fabs(m->v)), 0.0};
    double rest = h;

    /* all but the last 40 bristle lengths of the path are forgotten: exp(-40) */
    const double memory = 40.0 * fmax(now.g, g_end) / b->sigma0;
    if (h * (now.speed + v_end) > 2.0 * memory) {
        rest = fmin(h, time_back(memory, v_end, growth));
        now.speed = fmax(v_end - growth * rest, 0.0);
        now.g = level_of(b, now.speed);
    }
    double dt = rest;
    for (int tries = 0; rest > 0.0 && now.g != g_end; tries++) {
        if (tries > 100000)
            return false;
        dt = fmin(dt, time_in_sight(now.speed, growth, b->width));
        const bool last = dt >= rest;
        if (last)
            dt = rest;
        const Piece next = piece_of_ramp(b, now, growth * dt, dt);
        const bool accepted = next.error <= allowed;
        if (accepted) {
            now = next;
            rest = last ? 0.0 : rest - dt;
        }
        if (!(accepted && last))
            dt *= clip(0.9 * pow(next.error / allowed + 1e-9, -0.2), 0.1, accepted ? 5.0 : 0.9);
    }
    /* a flat rest of the curve: relaxation over the path */
    *z = direction * relax(now.z, now.g / b->sigma0, b->sigma0 / now.g * rest * 0.5 * (now.speed + v_end));
    return true;
}

#endif
