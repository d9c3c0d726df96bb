/* LuGre friction: the mean deflection z of elastic bristles that slip at a rate set by the Stribeck curve g(v).

   Canudas de Wit, Olsson, Astrom, Lischinsky: A new model for control of systems with friction, IEEE TAC 40(3),
   1995, equations (2), (3), (5); start values from its Table I. The bristle damping that falls with speed is
   equation (30) of Olsson, Astrom, Canudas de Wit, Gaefvert, Lischinsky: Friction models and friction
   compensation, European Journal of Control 4, 1998.

       g(v)  = Fc + (Fs - Fc) exp(-|v/vs|^delta)
       dz/dt = v - sigma0 |v| z / g(v)
       F     = (sigma0 z + sigma1(v) dz/dt) Fn/Fn0 + sigma2 v
       sigma1(v) = sigma1 exp(-(v/v_d)^2) if v_d > 0, else sigma1

   For constant v the step is the exact solution. For v that changes linearly it is the solution as an integral,

       z(h) = z(0) exp(-P(h)) + integral of v(t) exp(P(t) - P(h)) dt,   P(t) = integral of sigma0 |v| / g(v) dt

   by Lobatto's quadrature with error control; where g is flat it is exact again.

   Limits: F jumps with a jump of v by sigma1 times the jump, and with the published values that may even push
   (F < 0 for v > 0); v_d < 4 sqrt(2 e) Fc / sigma1 prevents it. z drifts under a bias with vibration, and the model
   keeps no memory of reversal points. With asymmetric, v < 0 has its own set of parameters. */

/* @article{CanudasDeWit1995,
     author  = {Canudas de Wit, C. and Olsson, H. and {\AA}str{\"o}m, K. J. and Lischinsky, P.},
     title   = {A new model for control of systems with friction},
     journal = {IEEE Transactions on Automatic Control},
     volume  = {40}, number = {3}, pages = {419--425}, year = {1995}} */

#define MODEL    LuGre
#define SUMMARY  "LuGre bristle friction with Stribeck effect"
#define SOURCE   "Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995"
#define FEATURES "presliding, Stribeck, lag, rate dependent"

/* clang-format off */
#define VARIABLES                                                                                       \
    INPUT    (v,          VELOCITY,  0.0,                    "relative sliding velocity")               \
    OPTIONAL (Fn,         "N",       1.0,                    "normal force")                            \
    OUTPUT   (F,          FORCE,                             "friction force, opposes v")               \
    STATE    (z,          LENGTH,    0.0,  1e-5,             "mean bristle deflection")                 \
    PARAMETER(sigma0,     STIFFNESS, 1e5,  1e-9, INF,        "bristle stiffness")                       \
    PARAMETER(sigma1,     DAMPING,   316.22776601683796, 0.0, INF, "bristle damping")                   \
    PARAMETER(sigma2,     DAMPING,   0.4,  0.0,  INF,        "viscous coefficient")                     \
    PARAMETER(Fc,         FORCE,     1.0,  1e-9, INF,        "Coulomb friction")                        \
    PARAMETER(Fs,         FORCE,     1.5,  1e-9, INF,        "static friction, may be below Fc")        \
    PARAMETER(vs,         VELOCITY,  1e-3, 1e-12, INF,       "Stribeck velocity")                       \
    PARAMETER(delta,      NO_UNIT,   2.0,  1e-3, 100.0,      "Stribeck exponent")                       \
    PARAMETER(v_d,        VELOCITY,  0.0,  0.0,  INF,        "speed at which the bristle damping fades, 0: never") \
    SWITCH   (asymmetric, 0,                                 "v < 0 has its own parameters, the ones named _neg") \
    PARAMETER(sigma2_neg, DAMPING,   0.4,  0.0,  INF,        "viscous coefficient for v < 0")           \
    PARAMETER(Fc_neg,     FORCE,     1.0,  1e-9, INF,        "Coulomb friction for v < 0")              \
    PARAMETER(Fs_neg,     FORCE,     1.5,  1e-9, INF,        "static friction for v < 0")               \
    PARAMETER(vs_neg,     VELOCITY,  1e-3, 1e-12, INF,       "Stribeck velocity for v < 0")             \
    PARAMETER(delta_neg,  NO_UNIT,   2.0,  1e-3, 100.0,      "Stribeck exponent for v < 0")             \
    PARAMETER(Fn0,        "N",       1.0,  1e-12, INF,       "normal force at which the parameters hold")
/* clang-format on */

#define STEPS_BY step

#include "block.h"
#include "presliding.h"
#include "stribeck.h"

/* g of a speed in the direction of motion, backward or not */
static double level(const Model *m, double speed, bool backward)
{
    GIVEN(m)
    return asymmetric && backward ? stribeck(speed, Fc_neg, Fs_neg, vs_neg, delta_neg)
                                  : stribeck(speed, Fc, Fs, vs, delta);
}

/* dz/dt and F, with the rate sigma0 |v| / g at which the bristles slip */
static void contact(Model *m, double rate)
{
    GIVEN(m)
    const double damping = v_d > 0.0 ? sigma1 * exp(-square(v / v_d)) : sigma1;
    const double viscous = asymmetric && v < 0.0 ? sigma2_neg : sigma2;

    m->der_z = v - rate * z;                                                   /* (2), (3) */
    m->F = load_of(Fn, Fn0) * (sigma0 * z + damping * m->der_z) + viscous * v; /* (5) */
}

static void equations(Model *m) { contact(m, m->sigma0 * fabs(m->v) / level(m, m->v, m->v < 0.0)); }

/* Lobatto's quadrature of order 8 on [0, 1]: nodes, and the integrals from 0 to each node of the polynomials that
   are 1 at one node. The last row are the weights. */
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

/* A piece of a ramp: the deflection z over a time dt, while the speed grows by `rise` from `speed`. Here z is in the
   direction of motion and speed >= 0. */
typedef struct {
    double z, speed, g; /* at the end                                          */
    double error;       /* of Simpson's rule on the same nodes, over the deflection of steady sliding */
} Piece;

static Piece piece_of_ramp(const Model *m, Piece from, double rise, double dt, bool backward)
{
    double speed[NODES], rate[NODES], passed[NODES], kept[NODES], g = from.g;
    for (int i = 0; i < NODES; i++) {
        speed[i] = fmax(from.speed + node[i] * rise, 0.0);
        if (i > 0)
            g = level(m, speed[i], backward);
        rate[i] = m->sigma0 * speed[i] / g * dt;
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
        .error = m->sigma0 / g *
                 (fabs(gained - gained_simpson) + fabs(all - all_simpson) * (fabs(from.z) * kept[0] + gained)),
    };
}

/* z after h seconds of linear velocity that does not change its sign. */
static bool ramp(Model *m, double h)
{
    GIVEN(m)
    const double tolerance = m->run.tolerance > 0.0 ? m->run.tolerance : DEFAULT_TOLERANCE;
    /* Simpson's error e goes with the fifth power of the step, that of the result with the ninth: about e^(9/5) */
    const double allowed = cbrt(square(tolerance));
    const double direction = sign(slide(m, h));
    const bool backward = direction < 0.0;
    const double v_end = fmax(direction * (v + SLOPE(v) * h), 0.0), growth = direction * SLOPE(v);
    const double width = asymmetric && backward ? vs_neg : vs;
    const double g_end = level(m, v_end, backward);

    Piece now = {direction * z, fabs(v), level(m, v, backward), 0.0};
    double rest = h;

    /* all but the last 40 bristle lengths of the path are forgotten: exp(-40) */
    const double memory = 40.0 * fmax(now.g, g_end) / sigma0;
    if (h * (now.speed + v_end) > 2.0 * memory) {
        rest = fmin(h, time_back(memory, v_end, growth));
        now.speed = fmax(v_end - growth * rest, 0.0);
        now.g = level(m, now.speed, backward);
    }
    double dt = rest;
    for (int tries = 0; rest > 0.0 && now.g != g_end; tries++) {
        if (tries > 100000)
            return false;
        dt = fmin(dt, time_in_sight(now.speed, growth, width));
        const bool last = dt >= rest;
        if (last)
            dt = rest;
        const Piece next = piece_of_ramp(m, now, growth * dt, dt, backward);
        const bool accepted = next.error <= allowed;
        if (accepted) {
            now = next;
            rest = last ? 0.0 : rest - dt;
        }
        if (!(accepted && last))
            dt *= clip(0.9 * pow(next.error / allowed + 1e-9, -0.2), 0.1, accepted ? 5.0 : 0.9);
    }
    /* a flat rest of the curve: relaxation over the path */
    m->z = direction * relax(now.z, now.g / sigma0, sigma0 / now.g * rest * 0.5 * (now.speed + v_end));
    return true;
}

/* At constant velocity z relaxes to sign(v) g/sigma0 at the rate sigma0 |v| / g. */
static bool step(Model *m, double h)
{
    GIVEN(m)
    if (SLOPE(v) != 0.0)
        return slide(m, h) == 0.0 || ramp(m, h);
    const double g = level(m, v, v < 0.0), rate = sigma0 * fabs(v) / g;
    m->z = relax(z, sign(v) * g / sigma0, rate * h);
    contact(m, rate);
    m->run.outputs_done = true;
    return true;
}
