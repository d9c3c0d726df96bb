/* Generic asperity friction: elastic asperities with a mass at the tip stick, slip and swing free on a rigid profile.

   After the ideas of Al-Bender, Lampaert, Swevers: A novel generic model at asperity level for dry friction force
   dynamics, Tribology Letters 16, 2004 (life cycle of contact, three springs and a tip mass, adhesion, creep, loss of
   contact). The equations below are this implementation's own and not to be taken for those of the paper. The start
   values give about 1 N at 1e5 N/m.

   Asperity i stands at b_i on the slider (db_i/dt = v), its tip at p_i, d_i = b_i - p_i. The other side is rigid:

       w(p) = A cos(2 pi p/wavelength)            height of the profile
       N_i  = k_n max(h_i + w(p_i), 0)            normal force, at the depth h_i
       mu(t_c) = mu0 + dmu (1 - exp(-t_c/tau))    adhesion at the contact age t_c
       C(t_c)  = 1 + creep ln(1 + t_c/t0)         creep: growth of the real area
       F = load sum k_t d_i + c (v - dp_i/dt if free),   load = max(Fn, 0)/Fn0

   Life cycle, which a step follows from event to event, none of them missed, for v constant or linear in time:

   1. Stuck: p_i stays, t_c grows, until the tangential force leaves the cone of friction,

       |k_t d_i - N_i w'(p_i)| > N_i mu(t_c) C(t_c)

   2. Slipping, forward or back (s = 1 or -1): the bond is broken, t_c = 0. Inertia is neglected against friction:

       k_t d_i = N_i (w'(p_i) + s mu0)

   that is g(p_i) = b_i. As the bond breaks the tip snaps forward to the first such place, then the slider drives it
   on. It sticks again as soon as the slider stops, if only for an instant, or turns.

   3. Loss of contact: where N_i falls to 0, or driven slip becomes unstable (dg/dp = 0). The free tip swings, as a
   damped oscillator that starts at rest, as inertia was neglected before:

       m d2p_i/dt2 = k_t d_i + c (v - dp_i/dt),   c = k_h sqrt(m/k_t)

   k_h is the third spring, the one with hysteresis: its loss at the natural frequency is the damping.

   4. Landing: when the swing has died down to 1 % (the impact takes the rest: d_i = 0), as soon as h_i + w(b_i) > 0.

   By seed, and uniform: heights height (1 +- height_spread), wavelengths wavelength (1 +- wavelength_spread), places
   +- position_spread wavelength/2. Asperities come in pairs with mirrored places, so F is odd; an odd one out stands on
   a crest. At the start d_i = z and the contacts are age0 old.

   In its limits it is known: (i) flat (A = 0) and without aging it is the Maxwell slip of N elements k_t with W_i = mu0
   k_n h_i; (ii) with creep alone, break-away grows with ln t; (iii) on a profile so rough that slip becomes unstable,
   about k_n A (2 pi/wavelength)^2 (height + A) > k_t, friction falls with speed, as contacts are younger and more tips
   swing free; (iv) N equal asperities are N times one.

   Use it to compare simpler laws with, and to see where memory, lag, dwell and velocity weakening come from. It needs
   numbers of the surfaces, which a drive does not tell.

   Limits: dissipative only if the profile is nowhere steeper than mu0; N times and more as slow as a simple law; a
   slipping bond does not age, so on flat ground speed matters at break-away only; no normal motion of slider and tip;
   single tips may be chaotic if height < A; at most 2e6/N wavelengths a step. */

/* @article{AlBender2004,
     author  = {Al-Bender, F. and Lampaert, V. and Swevers, J.},
     title   = {A novel generic model at asperity level for dry friction force dynamics},
     journal = {Tribology Letters},
     volume  = {16}, number = {1--2}, pages = {81--93}, year = {2004}} */

#define MODEL    GenericAsperity
#define SUMMARY  "Population of asperities that stick, slip and swing free on a rough profile"
#define SOURCE   "after Al-Bender, Lampaert, Swevers, Tribology Letters 16, 2004"
#define STATUS   "equations of our own, after the paper from memory"
#define FEATURES "presliding, nonlocal memory, drift-free, Stribeck, lag, dwell, rate dependent, random"

/* clang-format off */
#define VARIABLES                                                                                              \
    INPUT    (v,         VELOCITY,  0.0,                "relative sliding velocity")                           \
    OPTIONAL (Fn,        FORCE,     1.0,                "normal force")                                        \
    OUTPUT   (F,         FORCE,                         "friction force, opposes v")                           \
    OUTPUT   (F_N,       FORCE,                         "normal force of all contacts at Fn0")                 \
    OUTPUT   (F_max,     FORCE,                         "friction that the contacts can bear on flat ground at Fn0") \
    STATE    (z,         LENGTH,    0.0,  1e-5,         "mean deflection of the asperities")                   \
    TALLY    (stuck,                                    "asperities that stick")                               \
    TALLY    (slipping,                                 "asperities that slip")                                \
    TALLY    (loose,                                    "asperities without contact")                          \
    COUNT    (N,         20,        1,    MOST,         "number of asperities")                                \
    COUNT    (seed,      1,         0,    COUNTS,       "seed of the random numbers")                          \
    FIXED    (height_spread,   NO_UNIT, 0.5, 0.0, 1.0,  "spread of the heights about their mean")              \
    FIXED    (wavelength_spread, NO_UNIT, 0.3, 0.0, 0.9, "spread of the wavelengths about their mean")           \
    FIXED    (position_spread, NO_UNIT, 1.0, 0.0, 1.0,  "spread of the places over a wavelength")              \
    FIXED    (age0,      TIME,      0.0,  0.0,   INF,   "age of the contacts at the start")                    \
    PARAMETER(m,         MASS,      1e-7, 1e-18, INF,   "mass of a tip")                                       \
    PARAMETER(k_n,       STIFFNESS, 2e5,  1e-9,  INF,   "normal spring of an asperity")                        \
    PARAMETER(k_t,       STIFFNESS, 5e3,  1e-9,  INF,   "tangential spring of an asperity")                    \
    PARAMETER(k_h,       STIFFNESS, 2e3,  1e-9,  INF,   "hysteresis spring of an asperity, damps the free tip") \
    PARAMETER(height,    LENGTH,    1e-6, 0.0,   INF,   "mean height of an asperity over the mean of the profile") \
    PARAMETER(A,         LENGTH,    2.5e-7, 0.0, INF,   "amplitude of the profile, 0: flat")                   \
    PARAMETER(wavelength, LENGTH,   1e-5, 1e-7,  INF,   "wavelength of the profile")                           \
    PARAMETER(mu0,       NO_UNIT,   0.25, 0.0,   INF,   "coefficient of friction of a new contact")            \
    PARAMETER(dmu,       NO_UNIT,   0.1,  0.0,   INF,   "how much of it adhesion adds with age")               \
    PARAMETER(tau,       TIME,      0.1,  1e-9,  INF,   "time constant of adhesion")                           \
    PARAMETER(creep,     NO_UNIT,   0.02, 0.0,   INF,   "growth of a contact per e-fold of its age")           \
    PARAMETER(t0,        TIME,      1e-3, 1e-9,  INF,   "age at which creep sets in")                          \
    PARAMETER(Fn0,       FORCE,     1.0,  1e-12, INF,   "normal force for which the parameters are valid")
/* clang-format on */

#include <stdbool.h>

enum { MOST = 1000 };

#define STEPS_BY step
#define MEMORY   struct population
#define VALID_BY is_population
#define KEEPS_BY keep_population

enum { BACK = -1, STUCK = 0, FORWARD = 1, FREE = 2 }; /* of which BACK and FORWARD slip */

typedef struct {
    double p, d, speed; /* place of the tip, deflection, velocity of a free tip */
    double clock;       /* age of a contact; time that a free tip still swings */
    int mode;
} Tip;

typedef struct {
    double d, speed, normal, capacity;       /* sums over all, over the free, over the contacts, over the contacts */
    double stuck, loose, slip[2], moving[2]; /* numbers; slipping back and forward; of these the sum of dp/db */
} Sums;

struct population {
    Sums sums;
    bool started;
    Tip tip[MOST]; /* N in use */
};

#include "asperity.h"
#include "block.h"
#include "constants.h"
#include "load.h"
#include "counter_random.h"

static void keep_population(Memory *to, const Memory *from, const Model *m, bool follows)
{
    (void)follows;
    memcpy(to, from, offsetof(struct population, tip) + (size_t)m->N * sizeof(Tip));
}

static bool is_tip(const Tip *tip)
{
    return (tip->mode == BACK || tip->mode == STUCK || tip->mode == FORWARD || tip->mode == FREE) && isfinite(tip->p) &&
           isfinite(tip->d) && isfinite(tip->speed) && tip->clock >= 0.0;
}

static bool is_population(const Model *m)
{
    const struct population *const all = &m->memory;
    const Sums *const sums = &all->sums;
    const double N = m->N, in_contact[] = {sums->stuck, sums->slip[0], sums->slip[1]};
    double members = sums->loose;
    bool good = is_flag(&all->started) && is_count(sums->loose, N) && isfinite(sums->d) && isfinite(sums->speed) &&
                isfinite(sums->normal) && isfinite(sums->capacity) && all_finite(sums->moving, 2);
    for (int i = 0; i < 3; i++) {
        good = good && is_count(in_contact[i], N);
        members += in_contact[i];
    }
    for (int i = 0; good && i < (int)N; i++)
        good = is_tip(&all->tip[i]);
    return good && (!all->started || members == N);
}

/* Under asperity i; pairs have the same. */
static Surface surface_of(const Model *model, int i)
{
    GIVEN(model)
    const double h = height * (1.0 + height_spread * (2.0 * uniform_at(seed, i / 2, 1) - 1.0));
    const double length = wavelength * (1.0 + wavelength_spread * (2.0 * uniform_at(seed, i / 2, 2) - 1.0));
    return (Surface){h, A, TWO_PI / length, k_n, k_t, mu0};
}

static Tip start_of(const Model *model, int i)
{
    GIVEN(model)
    const Surface surface = surface_of(model, i);
    const double away = PI / surface.k * position_spread * (2.0 * uniform_at(seed, i / 2, 0) - 1.0);
    const double p = i % 2 == 1 ? -away : i == N - 1 ? 0.0 : away;
    const bool contact = reach(&surface, p) > 0.0;
    return (Tip){.p = p, .d = z, .clock = contact ? age0 : 0.0, .mode = contact ? STUCK : FREE};
}

/* mu(t_c) C(t_c) */
static double bond(const Model *model, double t_c)
{
    GIVEN(model)
    return (mu0 - dmu * expm1(-t_c / tau)) * (1.0 + creep * log1p(t_c / t0));
}

static void count(const Model *model, const Surface *surface, const Tip *tip, Sums *sums)
{
    const double normal = tip->mode == FREE ? 0.0 : surface->k_n * fmax(reach(surface, tip->p), 0.0);
    sums->normal += normal;
    if (tip->mode == STUCK) {
        sums->stuck += 1.0;
        sums->capacity += normal * bond(model, tip->clock);
    } else if (tip->mode == FREE) {
        sums->loose += 1.0;
    } else {
        const int way = tip->mode == FORWARD;
        sums->slip[way] += 1.0;
        sums->moving[way] += 1.0 / fmax(balance(surface, tip->mode, tip->p).slope, 1e-9);
        sums->capacity += normal * surface->mu0;
    }
}

/* The sums of the start, as long as no step was taken. */
static Sums sums_now(const Model *model)
{
    if (model->memory.started)
        return model->memory.sums;
    Sums sums = {0};
    for (int i = 0; i < (int)model->N; i++) {
        const Tip tip = start_of(model, i);
        const Surface surface = surface_of(model, i);
        count(model, &surface, &tip, &sums);
    }
    return sums;
}

static void equations(Model *model)
{
    GIVEN(model)
    const Sums sums = sums_now(model);
    const double load = load_of(Fn, Fn0), c = k_h * sqrt(m / k_t);
    const int way = v > 0.0;
    model->F = load * (k_t * (N * z) + c * (sums.loose * v - sums.speed));
    model->F_N = sums.normal;
    model->F_max = sums.capacity;
    model->stuck = sums.stuck;
    model->slipping = sums.slip[0] + sums.slip[1];
    model->loose = sums.loose;
    model->der_z = v == 0.0 ? -sums.speed / N : v - (v * sums.moving[way] + sums.speed) / N;
}

#include "GenericAsperity_ramp.h"
