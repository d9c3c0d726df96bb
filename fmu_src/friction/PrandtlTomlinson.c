/* Prandtl-Tomlinson model: one tip over a periodic potential, pulled by a spring whose other end is moved. The
   mechanism of stick-slip and of friction without wear at the scale of atoms, as in friction force microscopy.

   Prandtl: Ein Gedankenmodell zur kinetischen Theorie der festen Koerper, ZAMM 8, 1928; Tomlinson: A molecular theory
   of friction, Philosophical Magazine 7, 1929; with temperature as in Sang, Dube, Grant, Physical Review Letters 87,
   2001.

       m x'' + m damping x' = k (X - x) - (pi E0 / a) sin(2 pi x / a) + R
       F   = k (X - x),   dX/dt = v
       eta = 2 pi^2 E0 / (k a^2)

   v is the velocity of the driver and F the force that opposes it. Stick-slip occurs only for eta > 1, where the tip
   has several positions of rest; slow sliding at eta <= 1 has no friction but m damping v. R is the thermal force at
   the temperature kT (0: none), white noise sqrt(2 m damping kT).

   With kT > 0 damping and noise act together, at the start of each interval `dt` of a grid that starts with the
   simulation, by the exact solution of w' = -damping w + R/m over dt; between these instants the tip moves without
   both, at the pace b. Sivak, Chodera, Crooks: Journal of Physical Chemistry B 118, 2014:

       w <- exp(-y) w + sqrt((1 - exp(-2 y)) kT / m) n,   y = damping dt
       x' = b w,   m w' = b (k (X - x) - (pi E0 / a) sin(2 pi x / a))
       b^2 = tanh(y/2) / (y/2),   n: standard normal

   Both parts keep Boltzmann's distribution, so with the driver at rest x and w have the exact temperature at every
   time, for every y and every potential; b makes the drag m damping v and the diffusion kT / (m damping) of a tip on
   average exact as well. `dt` must resolve the motion only: be well below the period 2 pi / sqrt(k (1 + eta) / m) of
   a weakly damped tip, or below the relaxation time m damping / (k (1 + eta)) of a strongly damped one. R is the mean
   over the interval. n follows from `seed` and the number of the interval alone, so a run is reproducible and does
   not depend on the communication steps.

   Any consistent units do: accuracy is relative to a and to its rate. The start values are pure numbers, m = k = a = 1
   with critical damping, of the size in which the literature computes. A tip of a force microscope is about
   m = 1e-12 kg, k = 1 N/m, a = 0.3e-9 m, E0 = 1e-19 J (eta = 22), kT = 4.1e-21 J, damping = 2e6 1/s, dt = 1e-8 s.

   The solver is the Rosenbrock method of solver.h with exact derivatives, also for strong damping, to 1e-12 of a per
   inner step.

   Use it for friction at a single tip: the saw tooth of a friction force microscope, how stick-slip ends at eta = 1,
   how it depends on speed and temperature. It needs the velocity of the driver only, as the tip is inside.

   Limits: one dimension, one atom; with kT > 0 what damping does within dt is not resolved. There is no normal force;
   let E0 follow it. */

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
#define STATUS   "equations from memory of reviews"
#define FEATURES "presliding, drift-free, rate dependent, mass inside, random"
#define PORTRAIT "tomlinson"

/* clang-format off */
#define VARIABLES                                                                                          \
    INPUT    (v,       VELOCITY,  0.0,                    "velocity of the driver")                        \
    OUTPUT   (F,       FORCE,                             "friction force, opposes v")                     \
    STATE    (X,       LENGTH,    0.0,  1.0,              "position of the driver")                        \
    STATE    (x,       LENGTH,    0.0,  1.0,              "position of the tip")                           \
    STATE    (w,       VELOCITY,  0.0,  1.0,              "velocity of the tip")                           \
    LOCAL    (R,       FORCE,                             "thermal force, mean over the interval dt")      \
    LOCAL    (eta,     NO_UNIT,                           "corrugation, stick-slip above 1")               \
    PARAMETER(m,       MASS,      1.0,  1e-40, INF,       "mass of the tip")                               \
    PARAMETER(damping, "1/s",     2.0,  0.0,   INF,       "gamma, damping rate")                           \
    PARAMETER(k,       STIFFNESS, 1.0,  1e-30, INF,       "stiffness of the spring to the driver")         \
    PARAMETER(E0,      "J",       0.25, 0.0,   INF,       "height of the potential, from peak to peak")    \
    PARAMETER(a,       LENGTH,    1.0,  1e-20, INF,       "period of the potential")                       \
    PARAMETER(kT,      "J",       0.0,  0.0,   INF,       "temperature times Boltzmann's constant, 0: no noise") \
    FIXED    (dt,      TIME,      0.01, 1e-30, INF,       "interval of noise and damping, for kT > 0")     \
    COUNT    (seed,    1,         0,    2147483647,       "of the noise")
/* clang-format on */

#define MEMORY   struct noise
#define VALID_BY is_noise
#define STEPS_BY step

#include <stdbool.h>
#include <stdint.h>

struct noise {
    bool drawn;       /* there has been a step with noise     */
    int64_t interval; /* of the grid, the last one begun       */
    double number;    /* standard normal, that of the interval */
};

#include "block.h"
#include "constants.h"
#include "random.h"

#define TIP_TOLERANCE  1e-12
#define WORK_OF_A_STEP 10 /* of the solver */

static bool is_noise(const Model *model) { return is_flag(&model->memory.drawn) && isfinite(model->memory.number); }

/* The normal number of an interval. */
static double drawn_for(int seed, int64_t interval)
{
    Random random;
    seed_random(&random, (uint64_t)seed * UINT64_C(0xd1342543de82ef95) + (uint64_t)interval);
    return normal(&random);
}

/* What damping and noise add to w in an interval with the standard normal number 1. */
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

#include "PrandtlTomlinson_ramp.h"
