/* Prandtl-Tomlinson model: a tip in a periodic potential, pulled by a spring whose other end moves. It explains
   stick-slip and wearless friction on the atomic scale, as in friction force microscopy.

   Prandtl: Ein Gedankenmodell zur kinetischen Theorie der festen Koerper, ZAMM 8, 1928; Tomlinson: A molecular theory
   of friction, Philosophical Magazine 7, 1929; with temperature after Sang, Dube, Grant, Physical Review Letters 87,
   2001.

       m x'' + m damping x' = k (X - x) - (pi E0 / a) sin(2 pi x / a) + R
       F   = k (X - x),   dX/dt = v
       eta = 2 pi^2 E0 / (k a^2)

   v is the velocity of the driver, and F is the force that opposes it. Stick-slip occurs only for eta > 1, where the
   tip has several equilibrium positions; for eta <= 1, friction in slow sliding is m damping v. R is the thermal force
   at the temperature kT (0: none), white noise sqrt(2 m damping kT).

   With kT > 0, damping and noise act together at the start of each interval `dt` of a grid that starts with the
   first step of this kind, by the exact solution of w' = -damping w + R/m over dt. Between these instants, the tip
   moves without both, with the time scaled by b. Sivak, Chodera, Crooks: Journal of Physical Chemistry B 118, 2014:

       w <- exp(-y) w + sqrt((1 - exp(-2 y)) kT / m) n,   y = damping dt
       x' = b w,   m w' = b (k (X - x) - (pi E0 / a) sin(2 pi x / a))
       b^2 = tanh(y/2) / (y/2),   n: standard normal

   Both parts preserve Boltzmann's distribution, so with the driver at rest, x and w have the exact temperature at all
   times, for any y and any potential. The factor b also makes the mean drag m damping v and the diffusion kT / (m
   damping) of a tip exact. `dt` only needs to resolve the motion: choose it well below the period 2 pi / sqrt(k (1 +
   eta) / m) of a weakly damped tip, or below the relaxation time m damping / (k (1 + eta)) of a strongly damped one. R
   is the mean over the interval. n follows from `seed` and the number of the interval only, so a run is reproducible
   and independent of the communication steps.

   Any consistent units can be used: accuracy is relative to a and to its rate. The start values are dimensionless, m =
   k = a = 1 with critical damping, as in the literature. A tip of a force microscope has about m = 1e-12 kg, k = 1 N/m,
   a = 0.3e-9 m, E0 = 1e-19 J (eta = 22), kT = 4.1e-21 J, damping = 2e6 1/s, dt = 1e-8 s.

   The solver is the Rosenbrock method of solver.h with exact derivatives, also for strong damping, to 1e-12 of a per
   inner step.

   Use it for friction at a single tip: the saw-tooth of a friction force microscope, the end of stick-slip at eta = 1,
   and the dependence on speed and temperature. It needs the velocity of the driver only, as the block contains the tip.

   Limits: one dimension, one atom. With kT > 0, damping within dt is not resolved. There is no normal force; vary E0
   with it instead. */

#define MODEL       PrandtlTomlinson
#define SUMMARY     "Prandtl-Tomlinson model of a tip in a periodic potential, with temperature"
#define SOURCE      "Prandtl, ZAMM 8, 1928; Tomlinson, Philosophical Magazine 7, 1929"
#define CITES       "Prandtl1928, Tomlinson1929"
#define STATUS      "not checked against the papers"
#define FEATURES    "presliding, drift-free, rate dependent, mass inside, random"
#define NO_EXCHANGE "thermal noise acts between the points of a grid in time and is integrated inside"

/* clang-format off */
#define VARIABLES                                                                                                \
    INPUT    (v,       VELOCITY,  0.0,                    "velocity of the driver")                              \
    OUTPUT   (F,       FORCE,                             "friction " FORCE_NOUN ", opposes v")                  \
    STATE    (X,       LENGTH,    0.0,  1.0,              "position of the driver")                              \
    STATE    (x,       LENGTH,    0.0,  1.0,              "position of the tip")                                 \
    STATE    (w,       VELOCITY,  0.0,  1.0,              "velocity of the tip")                                 \
    LOCAL    (R,       FORCE,                             "thermal " FORCE_NOUN ", mean over the interval dt")   \
    LOCAL    (eta,     NO_UNIT,                           "corrugation; stick-slip above 1")                     \
    PARAMETER(m,       MASS,      1.0,  1e-40, INF,       MASS_NOUN " of the tip")                               \
    PARAMETER(damping, "1/s",     2.0,  0.0,   INF,       "gamma, damping rate")                                 \
    PARAMETER(k,       STIFFNESS, 1.0,  1e-30, INF,       "stiffness of the spring to the driver")               \
    PARAMETER(E0,      "J",       0.25, 0.0,   INF,       "height of the potential, from peak to peak")          \
    PARAMETER(a,       LENGTH,    1.0,  1e-20, INF,       "period of the potential")                             \
    PARAMETER(kT,      "J",       0.0,  0.0,   INF,       "temperature times Boltzmann's constant; 0: no noise") \
    FIXED    (dt,      TIME,      0.01, 1e-30, INF,       "interval of noise and damping, for kT > 0")           \
    COUNT    (seed,    1,         0,    2147483647,       "seed of the noise")
/* clang-format on */

#define MEMORY   struct noise
#define VALID_BY is_noise
#define STEPS_BY step

#include <stdbool.h>
#include <stdint.h>

struct noise {
    bool drawn;       /* a step with noise has been made */
    int64_t interval; /* last interval of the grid begun */
    double number;    /* its standard normal random number */
    double left;      /* [s] of the interval */
};

#include "block.h"
#include "ramp.h"
#include "constants.h"
#include "random.h"

#define TIP_TOLERANCE  1e-12
#define WORK_OF_A_STEP 10 /* work of a solver step */

static bool is_noise(const Model *model)
{
    const struct noise *const noise = &model->memory;
    return is_flag(&noise->drawn) && isfinite(noise->number) && noise->interval >= 0 &&
           noise->interval <= INT64_C(1) << 53 && fabs(noise->left) <= 1.01 * model->dt;
}

/* Return the standard normal random number of an interval. */
static double drawn_for(int seed, int64_t interval)
{
    Random random;
    seed_random(&random, (uint64_t)seed * UINT64_C(0xd1342543de82ef95) + (uint64_t)interval);
    return normal(&random);
}

/* Return the change of w by noise in an interval with the standard normal random number 1. */
static double thermal_velocity(const Model *model)
{
    GIVEN(model)
    return sqrt(-expm1(-2.0 * damping * dt) * kT / m);
}

/* The motion x' = pace w, w' = pace f / m - damping w. */
typedef struct {
    double pace, damping;
} Motion;

static Motion motion_of(const Model *model)
{
    GIVEN(model)
    const double half = 0.5 * damping * dt;
    if (kT == 0.0)
        return (Motion){1.0, damping};
    return (Motion){half > 0.0 ? sqrt(tanh(half) / half) : 1.0, 0.0};
}

static void equations(Model *model)
{
    GIVEN(model)
    const Motion motion = motion_of(model);
    const double number = model->memory.drawn ? model->memory.number : drawn_for(seed, 0);
    model->eta = TWO_PI * PI * E0 / (k * a * a);
    model->R = m / dt * thermal_velocity(model) * number;
    model->F = k * (X - x);
    model->der_X = v;
    model->der_x = motion.pace * w;
    model->der_w =
        motion.pace * (model->F - PI * E0 / a * sin(TWO_PI * (x / a - floor(x / a + 0.5)))) / m - motion.damping * w;
}

/* ---- Steps: Rosenbrock steps with the exact Jacobian, from one kick of the noise to the next. */

/* Perform one Rosenbrock step of size h from s seconds after the start of the step; return the largest error over its
   tolerance. */
static double tip_step(const Model *model, const Motion *motion, double s, double h, const double *y, double *y_new,
                       double rate, double tolerance)
{
    GIVEN(model)
    const double pace = motion->pace, slope = model->slope[INPUT_v];
    const double shift = floor(y[0] / a + 0.5) * a, from = X - shift;
    const double curvature = -(k + TWO_PI * PI * E0 / (a * a) * cos(TWO_PI * (y[0] - shift) / a)) / m; /* df/dx */
    const double f_t = pace * k * (v + slope * s) / m, g = 1.0 / (rodas_gamma * h), damped = g + motion->damping,
                 determinant = g * damped - pace * pace * curvature;
    double u[STAGES][2];

    for (int stage = 0; stage < STAGES; stage++) {
        const double dx = rodas_place(stage, 0.0, &u[0][0], 2), dw = rodas_place(stage, 0.0, &u[0][1], 2);
        y_new[0] = y[0] + dx;
        y_new[1] = y[1] + dw;
        const double at = s + rodas_alpha[stage] * h, x_at = (y[0] - shift) + dx;
        const double driver = from + path_after(v, slope, at);
        const double force = k * (driver - x_at) - PI * E0 / a * sin(TWO_PI * x_at / a);
        const double w_rate = pace * force / m - motion->damping * y_new[1] + rodas_d[stage] * h * f_t;
        const double right[2] = {rodas_side(stage, pace * y_new[1], h, &u[0][0], 2),
                                 rodas_side(stage, w_rate, h, &u[0][1], 2)};
        u[stage][0] = (damped * right[0] + pace * right[1]) / determinant;
        u[stage][1] = (pace * curvature * right[0] + g * right[1]) / determinant;
    }
    y_new[0] += u[STAGES - 1][0];
    y_new[1] += u[STAGES - 1][1];
    const double error = fmax(fabs(u[STAGES - 1][0]), fabs(u[STAGES - 1][1]) / rate) / (tolerance * a);
    return isfinite(error) && isfinite(y_new[0]) && isfinite(y_new[1]) ? error : -1.0;
}

/* Move the tip from s to `end`, with at most the number of inner steps left. */
static bool move_tip(Model *model, double s, double end, double *y, long *left)
{
    GIVEN(model)
    const Motion motion = motion_of(model);
    const double rate = sqrt((k + TWO_PI * PI * E0 / (a * a)) / m) + 1e-3 * motion.damping;
    const double tolerance = model->run.tolerance > 0.0 ? model->run.tolerance : TIP_TOLERANCE;
    RodasSize step_size = {.size = model->run.inner_step > 0.0 ? model->run.inner_step : 0.01 / rate};

    while (s < end) {
        double y_new[2];
        rodas_try(&step_size, s, end);
        if (rodas_accepts(&step_size, tip_step(model, &motion, s, step_size.taken, y, y_new, rate, tolerance))) {
            s = step_size.last ? end : s + step_size.taken;
            y[0] = y_new[0];
            y[1] = y_new[1];
        }
        if (--*left < 0)
            return too_much(model);
        if (!(step_size.size * rate > 1e-12))
            return false;
    }
    model->run.inner_step = step_size.size;
    return true;
}

/* Step from one kick of the noise to the next. */
static bool warm_step(Model *model, double h, double *y, long *left)
{
    GIVEN(model)
    struct noise *const noise = &model->memory;
    const double kept = exp(-damping * dt), kick = thermal_velocity(model), slack = 1e-6 * dt;
    if (!(h / dt < (double)*left))
        return too_much(model);
    for (double s = 0.0; s < h;) {
        if (!noise->drawn || noise->left <= slack) {
            noise->interval += noise->drawn;
            noise->left += dt;
            noise->drawn = true;
            noise->number = drawn_for(seed, noise->interval);
            y[1] = kept * y[1] + kick * noise->number;
        }
        const double end = h - s - noise->left < slack ? h : s + noise->left;
        if (!move_tip(model, s, end, y, left))
            return false;
        noise->left -= end - s;
        s = end;
    }
    return true;
}

static bool step(Model *model, double h)
{
    double y[2] = {model->x, model->w};
    long left = (long)(MOST_WORK / WORK_OF_A_STEP);

    if (!(model->kT == 0.0 ? move_tip(model, 0.0, h, y, &left) : warm_step(model, h, y, &left)))
        return false;
    model->x = y[0];
    model->w = y[1];
    model->X += path_after(model->v, model->slope[INPUT_v], h);
    return true;
}
