/* Prandtl-Tomlinson model: one tip over a periodic potential, pulled by a spring whose other end is moved. The
   mechanism of stick-slip and of friction without wear at the scale of atoms, as in friction force microscopy.

   Prandtl: Ein Gedankenmodell zur kinetischen Theorie der festen Koerper, ZAMM 8, 1928; Tomlinson: A molecular theory
   of friction, Philosophical Magazine 7, 1929; with temperature as in Sang, Dube, Grant, Physical Review Letters 87,
   2001; all from memory of reviews.

       m x'' + m damping x' = k (X - x) - (pi E0 / a) sin(2 pi x / a) + R
       F   = k (X - x),   dX/dt = v
       eta = 2 pi^2 E0 / (k a^2)

   v is the velocity of the driver and F the force that opposes it. Stick-slip occurs only for eta > 1, where the tip
   has several positions of rest; slow sliding at eta <= 1 has no friction but m damping v. R is the force of the
   thermal noise at the temperature kT (0: none): white noise sqrt(2 m damping kT) averaged over the intervals `dt` of
   a grid that starts with the simulation, each interval with a normal number of its own that follows from `seed` and
   the number of the interval alone, so a run is reproducible and does not depend on the communication steps. It is
   scaled so that a free tip has the exact temperature, R^2 = m damping^2 kT coth(damping dt / 2) on average; `dt` must
   be well below the period of the tip, 2 pi / sqrt(k (1 + eta) / m).

   Any consistent units do: accuracy is relative to a and to its rate. The start values are pure numbers, m = k = a = 1
   with critical damping, of the size in which the literature computes. A tip of a force microscope is about
   m = 1e-12 kg, k = 1 N/m, a = 0.3e-9 m, E0 = 1e-19 J (eta = 22), kT = 4.1e-21 J, damping = 2e6 1/s, dt = 1e-8 s.

   The solver is the Rosenbrock method of solver.h with exact derivatives, also for strong damping, to 1e-12 of a per
   inner step.

   Use it for friction at a single tip: the saw tooth of a friction force microscope, how stick-slip ends at eta = 1,
   how it depends on speed and temperature. It needs the velocity of the driver only, as the tip is inside.

   Limits: one dimension, one atom; the noise is white only above dt, and no force below dt is. There is no normal
   force; let E0 follow it. */

/* @article{Prandtl1928,
     author  = {Prandtl, L.},
     title   = {Ein {Gedankenmodell} zur kinetischen {Theorie} der festen {K{\"o}rper}},
     journal = {Zeitschrift f{\"u}r Angewandte Mathematik und Mechanik},
     volume  = {8}, number = {2}, pages = {85--106}, year = {1928}}
   @article{Tomlinson1929,
     author  = {Tomlinson, G. A.},
     title   = {A molecular theory of friction},
     journal = {Philosophical Magazine},
     volume  = {7}, number = {46}, pages = {905--939}, year = {1929}} */

#define MODEL    PrandtlTomlinson
#define SUMMARY  "Prandtl-Tomlinson model of a tip over a periodic potential, with temperature"
#define SOURCE   "Prandtl, ZAMM 8, 1928; Tomlinson, Philosophical Magazine 7, 1929"
#define FEATURES "presliding, drift-free, rate dependent, mass inside, random"

/* clang-format off */
#define VARIABLES                                                                                          \
    INPUT    (v,       VELOCITY,  0.0,                    "velocity of the driver")                        \
    OUTPUT   (F,       FORCE,                             "friction force, opposes v")                     \
    STATE    (X,       LENGTH,    0.0,  1.0,              "position of the driver")                        \
    STATE    (x,       LENGTH,    0.0,  1.0,              "position of the tip")                           \
    STATE    (w,       VELOCITY,  0.0,  1.0,              "velocity of the tip")                           \
    LOCAL    (R,       FORCE,                             "force of the thermal noise")                    \
    LOCAL    (eta,     NO_UNIT,                           "corrugation, stick-slip above 1")               \
    PARAMETER(m,       MASS,      1.0,  1e-40, INF,       "mass of the tip")                               \
    PARAMETER(damping, "1/s",     2.0,  0.0,   INF,       "gamma, damping rate")                           \
    PARAMETER(k,       STIFFNESS, 1.0,  1e-30, INF,       "stiffness of the spring to the driver")         \
    PARAMETER(E0,      "J",       0.25, 0.0,   INF,       "height of the potential, from peak to peak")    \
    PARAMETER(a,       LENGTH,    1.0,  1e-20, INF,       "period of the potential")                       \
    PARAMETER(kT,      "J",       0.0,  0.0,   INF,       "temperature times Boltzmann's constant, 0: no noise") \
    FIXED    (dt,      TIME,      0.01, 1e-30, INF,       "interval of the noise")                         \
    COUNT    (seed,    1,         0,    2147483647,       "of the noise")
/* clang-format on */

#define MEMORY   struct noise
#define VALID_BY is_noise
#define STEPS_BY step

#include <stdbool.h>
#include <stdint.h>

struct noise {
    bool drawn;       /* there has been a step with noise     */
    int64_t interval; /* of the grid                          */
    double number;    /* standard normal, that of the interval */
};

#include "block.h"
#include "random.h"

#define PI            3.141592653589793
#define TIP_TOLERANCE 1e-12

static bool is_noise(const Model *model) { return is_flag(&model->memory.drawn) && isfinite(model->memory.number); }

/* The normal number of an interval. */
static double drawn_for(int seed, int64_t interval)
{
    Random random;
    seed_random(&random, (uint64_t)seed * UINT64_C(0xd1342543de82ef95) + (uint64_t)interval);
    return normal(&random);
}

static double thermal_force(const Model *model)
{
    GIVEN(model)
    const double number = model->memory.drawn ? model->memory.number : drawn_for(seed, 0);
    /* of the variance m damping^2 kT coth(damping dt / 2), near 2 m damping kT / dt */
    const double decay = damping * dt;
    const double ratio = decay > 0.0 ? decay / tanh(0.5 * decay) : 2.0;
    return sqrt(m * damping * kT / dt * ratio) * number;
}

static void equations(Model *model)
{
    GIVEN(model)
    model->eta = 2.0 * PI * PI * E0 / (k * a * a);
    model->R = thermal_force(model);
    model->F = k * (X - x);
    model->der_X = v;
    model->der_x = w;
    model->der_w = (model->F - PI * E0 / a * sin(2.0 * PI * (x / a - floor(x / a + 0.5))) + model->R) / m - damping * w;
}

/* One Rosenbrock step of size h from s seconds after the start of the step; the largest error over its tolerance. */
static double tip_step(const Model *model, double R, double s, double h, const double *y, double *y_new, double rate,
                       double tolerance)
{
    GIVEN(model)
    const double slope = model->slope[INPUT_v], shift = floor(y[0] / a + 0.5) * a, from = X - shift;
    const double curvature = -(k + 2.0 * PI * PI * E0 / (a * a) * cos(2.0 * PI * (y[0] - shift) / a)) / m; /* df/dx */
    const double f_t = k * (v + slope * s) / m, g = 1.0 / (rodas_gamma * h),
                 determinant = g * (g + damping) - curvature;
    double u[STAGES][2];

    for (int stage = 0; stage < STAGES; stage++) {
        double dx = 0.0, dw = 0.0;
        for (int j = 0; j < stage; j++) {
            dx += rodas_a[stage][j] * u[j][0];
            dw += rodas_a[stage][j] * u[j][1];
        }
        y_new[0] = y[0] + dx;
        y_new[1] = y[1] + dw;
        const double at = s + rodas_alpha[stage] * h, x_at = (y[0] - shift) + dx;
        const double driver = from + at * (v + 0.5 * slope * at);
        double right[2] = {y_new[1], (k * (driver - x_at) - PI * E0 / a * sin(2.0 * PI * x_at / a) + R) / m -
                                         damping * y_new[1] + rodas_d[stage] * h * f_t};
        for (int j = 0; j < stage; j++) {
            right[0] += rodas_c[stage][j] / h * u[j][0];
            right[1] += rodas_c[stage][j] / h * u[j][1];
        }
        u[stage][0] = ((g + damping) * right[0] + right[1]) / determinant;
        u[stage][1] = (curvature * right[0] + g * right[1]) / determinant;
    }
    y_new[0] += u[STAGES - 1][0];
    y_new[1] += u[STAGES - 1][1];
    const double error = fmax(fabs(u[STAGES - 1][0]), fabs(u[STAGES - 1][1]) / rate) / (tolerance * a);
    return isfinite(error) && isfinite(y_new[0]) && isfinite(y_new[1]) ? error : -1.0;
}

/* The tip from s to `end`, under the constant thermal force R, in no more than the inner steps that are left. */
static bool move_tip(Model *model, double R, double s, double end, double *y, long *left)
{
    GIVEN(model)
    const double rate = sqrt((k + 2.0 * PI * PI * E0 / (a * a)) / m) + 1e-3 * damping;
    const double tolerance = model->run.tolerance > 0.0 ? model->run.tolerance : TIP_TOLERANCE;
    double step_size = model->run.inner_step > 0.0 ? model->run.inner_step : 0.01 / rate;

    while (s < end) {
        const bool last = s + 1.01 * step_size >= end;
        const double taken = last ? end - s : step_size;
        double y_new[2];
        const double error = tip_step(model, R, s, taken, y, y_new, rate, tolerance);
        const double factor = error < 0.0 ? 0.2 : clip(0.9 * pow(fmax(error, 1e-12), -0.25), 0.2, 6.0);
        if (error >= 0.0 && error <= 1.0) {
            s = last ? end : s + taken;
            y[0] = y_new[0];
            y[1] = y_new[1];
            step_size = last ? fmax(step_size, taken * factor) : taken * factor;
        } else
            step_size = taken * fmin(factor, 0.9);
        if (--*left < 0 || !(step_size > 1e-9 * (end - s)))
            return false;
    }
    model->run.inner_step = step_size;
    return true;
}

static bool step(Model *model, double h)
{
    GIVEN(model)
    struct noise *const noise = &model->memory;
    double y[2] = {x, w};
    long left = 10L * MOST_TRIES;

    if (kT == 0.0) {
        if (!move_tip(model, 0.0, 0.0, h, y, &left))
            return false;
    } else {
        const double since = model->time - model->run.start;
        if (!(h / dt < 10.0 * MOST_TRIES) || !(fabs(since / dt) < 1e15))
            return false;
        for (double s = 0.0; s < h;) {
            const double interval = floor((since + s) / dt + 1e-6);
            double end = fmin((interval + 1.0) * dt - since, h);
            if (h - end < 1e-6 * dt)
                end = h;
            if (!noise->drawn || noise->interval != (int64_t)interval)
                noise->number = drawn_for(seed, (int64_t)interval);
            noise->interval = (int64_t)interval;
            noise->drawn = true;
            if (!move_tip(model, thermal_force(model), s, end, y, &left))
                return false;
            s = end;
        }
    }
    model->x = y[0];
    model->w = y[1];
    model->X += h * (v + 0.5 * h * model->slope[INPUT_v]);
    return true;
}
