/* Generic asperity friction: elastic asperities with a tip mass stick, slip and oscillate freely on a rigid profile.

   After the ideas of Al-Bender, Lampaert, Swevers: A novel generic model at asperity level for dry friction force
   dynamics, Tribology Letters 16, 2004 (life cycle of contact, three springs and a tip mass, adhesion, creep, loss of
   contact). The equations below are specific to this implementation and differ from the paper. The start values give
   about 1 N at 1e5 N/m.

   Asperity i has its base at b_i on the slider (db_i/dt = v), its tip at p_i, and the deflection d_i = b_i - p_i. The
   other side is rigid:

       w(p) = A cos(2 pi p/wavelength)            height of the profile
       N_i  = k_n max(h_i + w(p_i), 0)            normal force, at the depth h_i
       mu(t_c) = mu0 + dmu (1 - exp(-t_c/tau))    adhesion for the contact age t_c
       C(t_c)  = 1 + creep ln(1 + t_c/t0)         creep: growth of the real area
       F = load sum k_t d_i + c (v - dp_i/dt if free),   load = max(Fn, 0)/Fn0

   A step follows the life cycle of each asperity from event to event, exactly for v constant or linear in time:

   1. Stuck: p_i is constant and t_c grows, until the tangential force leaves the cone of friction,

       |k_t d_i - N_i w'(p_i)| > N_i mu(t_c) C(t_c)

   2. Slipping, forward or backward (s = 1 or -1): the bond is broken, t_c = 0. Inertia is neglected:

       k_t d_i = N_i (w'(p_i) + s mu0)

   that is, g(p_i) = b_i. When the bond breaks, the tip springs forward to the first such position and then follows the
   slider. It sticks again as soon as the slider stops, even for an instant, or reverses.

   3. Loss of contact: if N_i decreases to 0, or driven slip becomes unstable (dg/dp = 0), the tip detaches. The free
   tip is a damped oscillator that starts at rest, as inertia was neglected before:

       m d2p_i/dt2 = k_t d_i + c (v - dp_i/dt),   c = k_h sqrt(m/k_t)

   k_h is the third spring, with hysteresis: its loss at the natural frequency provides the damping.

   4. Landing: after the oscillation has decayed to 1 % (the impact dissipates the rest: d_i = 0), as soon as h_i +
   w(b_i) > 0.

   Uniformly distributed, by seed: heights height (1 +- height_spread), wavelengths wavelength (1 +- wavelength_spread),
   positions +- position_spread wavelength/2. Asperities form pairs with mirrored positions, so F is odd; with an odd N,
   one asperity is at a crest. Initially, d_i = z, and the contacts have the age age0.

   Known limits: (i) flat (A = 0) and without aging, the model is the Maxwell slip model with N elements k_t and W_i =
   mu0 k_n h_i; (ii) with creep only, the break-away force grows with ln t; (iii) on a profile so rough that slip
   becomes unstable, about k_n A (2 pi/wavelength)^2 (height + A) > k_t, friction decreases with speed, as contacts are
   younger and more tips are free; (iv) N equal asperities give N times the force of one.

   Use it as a reference for simpler models, and to study the origin of memory, lag, dwell and velocity weakening. It
   needs surface data that cannot be measured on a drive.

   Limits: the model is dissipative only if the slope of the profile nowhere exceeds mu0. It is at least N times slower
   than a simple model. A slipping bond does not age, so on a flat profile speed matters only at break-away. There is no
   normal motion of slider and tip. Single tips may be chaotic if height < A. A step may cover at most 2e6/N
   wavelengths. */

#define MODEL       GenericAsperity
#define SUMMARY     "Population of asperities that stick, slip and oscillate freely on a rough profile"
#define SOURCE      "after Al-Bender, Lampaert, Swevers, Tribology Letters 16, 2004"
#define CITES       "AlBender2004"
#define STATUS      "equations of this library, not checked against the paper"
#define FEATURES    "presliding, nonlocal memory, drift-free, Stribeck, lag, dwell, rate dependent, random"
#define NO_EXCHANGE "each of its thousands of asperities would be an event"

/* clang-format off */
#define VARIABLES                                                                                                    \
    INPUT    (v,         VELOCITY,  0.0,                "relative sliding velocity")                                 \
    OPTIONAL (Fn,        "N",       1.0,                "normal force")                                              \
    OUTPUT   (F,         FORCE,                         "friction " FORCE_NOUN ", opposes v")                        \
    OUTPUT   (F_N,       FORCE,                         "normal force of all contacts at Fn0; in the rotational twin, times the radius") \
    OUTPUT   (F_max,     FORCE,                         "largest friction of the contacts on a flat profile at Fn0") \
    STATE    (z,         LENGTH,    0.0,  1e-5,         "mean deflection of the asperities")                         \
    TALLY    (stuck,                                    "number of sticking asperities")                             \
    TALLY    (slipping,                                 "number of slipping asperities")                             \
    TALLY    (loose,                                    "number of asperities without contact")                      \
    COUNT    (N,         20,        1,    MOST,         "number of asperities")                                      \
    COUNT    (seed,      1,         0,    COUNTS,       "seed of the random numbers")                                \
    FIXED    (height_spread,   NO_UNIT, 0.5, 0.0, 1.0,  "spread of the heights about their mean")                    \
    FIXED    (wavelength_spread, NO_UNIT, 0.3, 0.0, 0.9, "spread of the wavelengths about their mean")               \
    FIXED    (position_spread, NO_UNIT, 1.0, 0.0, 1.0,  "spread of the positions over a wavelength")                 \
    FIXED    (age0,      TIME,      0.0,  0.0,   INF,   "initial age of the contacts")                               \
    PARAMETER(m,         MASS,      1e-7, 1e-18, INF,   MASS_NOUN " of a tip")                                       \
    PARAMETER(k_n,       STIFFNESS, 2e5,  1e-9,  INF,   "normal spring of an asperity")                              \
    PARAMETER(k_t,       STIFFNESS, 5e3,  1e-9,  INF,   "tangential spring of an asperity")                          \
    PARAMETER(k_h,       STIFFNESS, 2e3,  1e-9,  INF,   "hysteresis spring of an asperity; damps the free tip")      \
    PARAMETER(height,    LENGTH,    1e-6, 0.0,   INF,   "mean height of an asperity above the mean of the profile")  \
    PARAMETER(A,         LENGTH,    2.5e-7, 0.0, INF,   "amplitude of the profile; 0: flat")                         \
    PARAMETER(wavelength, LENGTH,   1e-5, 1e-7,  INF,   "wavelength of the profile")                                 \
    PARAMETER(mu0,       NO_UNIT,   0.25, 0.0,   INF,   "coefficient of friction of a new contact")                  \
    PARAMETER(dmu,       NO_UNIT,   0.1,  0.0,   INF,   "increase of the coefficient by adhesion with age")          \
    PARAMETER(tau,       TIME,      0.1,  1e-9,  INF,   "time constant of adhesion")                                 \
    PARAMETER(creep,     NO_UNIT,   0.02, 0.0,   INF,   "growth of a contact per e-fold of its age")                 \
    PARAMETER(t0,        TIME,      1e-3, 1e-9,  INF,   "age at which creep begins")                                 \
    PARAMETER(Fn0,       "N",       1.0,  1e-12, INF,   "normal force for which the parameters are valid")
/* clang-format on */

#include <stdbool.h>

enum { MOST = 1000 };

#define STEPS_BY step
#define MEMORY   struct population
#define VALID_BY is_population
#define KEEPS_BY keep_population

enum { BACK = -1, STUCK = 0, FORWARD = 1, FREE = 2 }; /* BACK and FORWARD are slip */

typedef struct {
    double p, d, speed; /* position of the tip, deflection, velocity of a free tip */
    double clock;       /* age of a contact; remaining oscillation time of a free tip */
    int mode;
} Tip;

typedef struct {
    double d, speed, normal, capacity;       /* sums over all tips, free tips, contacts, contacts */
    double stuck, loose, slip[2], moving[2]; /* numbers; slipping back and forward; sums of their dp/db */
} Sums;

struct population {
    Sums sums;
    bool started;
    Tip tip[MOST]; /* N in use */
};

#include "asperity.h"
#include "block.h"
#include "oscillator.h"
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

/* Return the surface below asperity i, which is the same for both asperities of a pair. */
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
        const int forward = tip->mode == FORWARD;
        sums->slip[forward] += 1.0;
        sums->moving[forward] += 1.0 / fmax(balance(surface, tip->mode, tip->p).slope, 1e-9);
        sums->capacity += normal * surface->mu0;
    }
}

/* Return the current sums; before the first step, from the start values. */
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
    const int forward = v > 0.0;
    model->F = load * (k_t * (N * z) + c * (sums.loose * v - sums.speed));
    model->F_N = sums.normal;
    model->F_max = sums.capacity;
    model->stuck = sums.stuck;
    model->slipping = sums.slip[0] + sums.slip[1];
    model->loose = sums.loose;
    model->der_z = v == 0.0 ? -sums.speed / N : v - (v * sums.moving[forward] + sums.speed) / N;
}

/* ---- Steps: each tip from event to event. */

/* Data for the force on a stuck tip beyond the cone of friction, to the side s, after the time t. */
typedef struct {
    const Model *model;
    const Interval *interval;
    double d, age, normal, slope, slack;
    int s;
} Hold;

static Taylor overload(const void *data, double t)
{
    const Hold *const hold = (const Hold *)data;
    GIVEN(hold->model)
    const Interval *const c = hold->interval;
    const double t_c = hold->age + t, fresh = exp(-t_c / tau), adhesion = mu0 + dmu * (1.0 - fresh);
    const double area = 1.0 + creep * log1p(t_c / t0), growth = creep / (t0 + t_c);
    const double largest = 1.0 + creep * log1p((hold->age + c->rest) / t0);
    return (Taylor){hold->s * (k_t * (hold->d + distance_in(c, t)) - hold->normal * hold->slope) -
                        hold->normal * adhesion * area - hold->slack,
                    hold->s * k_t * (c->v + c->a * t) - hold->normal * (adhesion * growth + dmu / tau * fresh * area),
                    k_t * fabs(c->a) +
                        hold->normal * ((mu0 + dmu) * growth / (t0 + t_c) + dmu / (tau * tau) * fresh * largest)};
}

/* Detach a tip; it oscillates until the amplitude has decayed to 1 %. */
static void let_go(const Model *model, Tip *tip)
{
    GIVEN(model)
    const double omega = sqrt(k_t / m), zeta = 0.5 * k_h / k_t;
    const double decay = omega * (zeta > 1.0 ? 1.0 / (zeta + sqrt(zeta * zeta - 1.0)) : zeta);
    *tip = (Tip){.p = tip->p, .d = tip->d, .clock = log(100.0) / decay, .mode = FREE};
}

/* Advance a stuck tip until the force leaves the cone, immediately or later. */
static void stick(const Model *model, const Surface *surface, Tip *tip, Interval *c, double *left)
{
    const double normal = surface->k_n * fmax(reach(surface, tip->p), 0.0);
    /* rounding of a force at the limit must not cause slip */
    const double slack = 1e-13 * surface->k_n * (surface->h + surface->A) * (surface->A * surface->k + surface->mu0);
    Hold hold = {model, c, tip->d, tip->clock, normal, incline(surface, tip->p), slack, c->side};
    const double limit = normal * bond(model, tip->clock) + slack, force = surface->k_t * tip->d - normal * hold.slope;
    const double then = force + surface->k_t * distance_in(c, c->rest);
    double t = INF;
    if (fabs(force) > limit) {
        hold.s = force > 0.0 ? FORWARD : BACK;
        t = 0.0;
    } else if (c->side * then > limit) /* bonds only become stronger, so otherwise it holds */
        t = first_zero(overload, &hold, c->rest, left);

    const bool breaks = t < c->rest;
    t = fmin(t, c->rest);
    tip->d += distance_in(c, t);
    tip->clock += t;
    pass(c, t);
    if (!breaks)
        return;
    /* the tip springs forward into balance */
    const double base = tip->p + tip->d;
    const SlipEnd reached = slip_to(surface, hold.s, tip->p, base, false, left);
    const double d = reached.lost ? base - reached.p : balanced(surface, hold.s, reached.p);
    *tip = (Tip){.p = reached.p, .d = d, .mode = hold.s};
    if (reached.lost)
        let_go(model, tip);
}

/* Advance quasi-static slip to the side s until the slider stops driving the tip or contact is lost. */
static void slip(const Model *model, const Surface *surface, Tip *tip, Interval *c, double *left)
{
    GIVEN(model)
    const int s = tip->mode;
    const double spare = s * (balanced(surface, s, tip->p) - tip->d); /* nonzero if a parameter has changed */
    if (c->side != s || spare > 1e-9 * k_n / k_t * (surface->h + A) * (A * surface->k + mu0)) {
        tip->mode = STUCK;
        return;
    }
    const double base = tip->p + tip->d;
    const SlipEnd reached = slip_to(surface, s, tip->p, base + distance_in(c, c->rest), true, left);
    const double t = reached.lost ? fmin(time_for(c, reached.base - base), c->rest) : c->rest;
    tip->p = reached.p;
    tip->d = reached.lost ? base + distance_in(c, t) - reached.p : balanced(surface, s, reached.p);
    pass(c, t);
    if (reached.lost)
        let_go(model, tip);
}

/* Advance a free tip: it oscillates until it may land, and longer over a gap. */
static void swing_free(const Model *model, const Surface *surface, Tip *tip, Interval *c)
{
    GIVEN(model)
    const double base = tip->p + tip->d;
    double t = c->rest;
    bool lands = false;
    if (tip->clock > 0.0)
        t = fmin(tip->clock, c->rest);
    else if (reach(surface, base) > 0.0) {
        t = 0.0;
        lands = true;
    } else if (c->side != 0 && surface->h + surface->A > 0.0) {
        const double to_land = time_for(c, c->side * to_next_contact(surface, c->side, base));
        lands = to_land < c->rest;
        t = lands ? to_land : c->rest;
    }
    double d_rate = c->v - tip->speed;
    const double moved = base + distance_in(c, t);
    ring(&tip->d, &d_rate, k_t / m, 0.5 * k_h / k_t, c->a, t);
    tip->clock = fmax(tip->clock - t, 0.0);
    pass(c, t);
    tip->speed = c->v - d_rate;
    tip->p = moved - tip->d;
    if (lands)
        *tip = (Tip){.p = moved, .mode = STUCK};
}

static bool step(Model *model, double h)
{
    GIVEN(model)
    const double slope = model->slope[INPUT_v], mean = v + 0.5 * slope * h;
    if (A > 0.0 && !(N * fabs(mean) * h <= 2.0 * MOST_TRIES * wavelength))
        return too_much(model);

    struct population *const all = &model->memory;
    Sums sums = {0};
    double d = 0.0, speed = 0.0, left = MOST_WORK;
    for (int i = 0; i < N; i++) {
        const Surface surface = surface_of(model, i);
        Tip tip = all->started ? all->tip[i] : start_of(model, i);
        Interval c = {v, slope, h, (mean > 0.0) - (mean < 0.0)};
        if (v == 0.0 && (tip.mode == FORWARD || tip.mode == BACK))
            tip.mode = STUCK; /* the slider has stopped, at least for an instant */
        while (c.rest > 0.0) {
            if ((left -= 2.0) < 0.0)
                return too_much(model);
            if (tip.mode == STUCK)
                stick(model, &surface, &tip, &c, &left);
            else if (tip.mode == FREE)
                swing_free(model, &surface, &tip, &c);
            else
                slip(model, &surface, &tip, &c, &left);
        }
        if (fabs(surface.k * tip.p) > 7.0) /* only the phase matters */
            tip.p -= TWO_PI / surface.k * round(surface.k * tip.p / TWO_PI);
        all->tip[i] = tip;
        count(model, &surface, &tip, &sums);
        d += tip.d; /* pairs first, so that F is exactly odd */
        speed += tip.mode == FREE ? tip.speed : 0.0;
        if (i % 2 == 1 || i == N - 1) {
            sums.d += d;
            sums.speed += speed;
            d = speed = 0.0;
        }
    }
    all->sums = sums;
    all->started = true;
    model->z = sums.d / N;
    return true;
}
