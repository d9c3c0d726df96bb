/* Generalised Maxwell slip (GMS): parallel elements that act as springs while sticking and are attracted to the
   Stribeck curve while slipping. Presliding hysteresis with nonlocal memory, Stribeck effect, frictional lag, no drift.

   Al-Bender, Lampaert, Swevers: The generalized Maxwell-slip model: a novel model for friction simulation and
   compensation, IEEE TAC 50(11), 2005, in its force form.

       S(v) = Fc + (Fs - Fc) exp(-|v/vs|^delta)
       stick: dFi/dt = ki v                       until  sgn(v) Fi >= alpha_i S(v)
              dzi/dt = v
       slip:  dFi/dt = sgn(v) Ci (alpha_i - sgn(v) Fi / S(v))     until  v = 0
              dzi/dt = (dFi/dt) / ki,   Ci = C unless given
       F = (sum Fi + sigma dzi/dt) max(Fn, 0) / Fn0 + sigma2 v

   Fi is the force at the normal force Fn0. The signs in the test and in the attraction matter: with |Fi| or an unsigned
   S, as often printed, an element that is unloaded from above the level slips, and one that slips backwards is
   repelled. After a reversal, and after a time at v = 0, Fi continues from its value in stick. Touching v = 0 without
   changing sign is not a reversal.

   alpha_i are weights, normalised by alpha_1 + ... + alpha_N, so that the friction in steady sliding is S(v) for any
   sum. C, in N/s, is the rate of approach: the lag has the time constant S/C. The form with deflections zi = Fi / ki is
   dzi/dt = ci (sgn v - zi/|si|) with ki si = alpha_i S and ci = C alpha_i / ki in m/s; for one element with k = 1e5
   N/m, ci = 1e-3 m/s corresponds to C = 100 N/s. With the optional damping sigma, F jumps by sigma |v| when an element
   starts to slip.

   Ci, if not negative, is the attraction of element i in place of C. If a paper gives ci in m/s, as above, Ci = ci ki /
   alpha_i; if it uses dFi/dt = sgn(v) bi (1 - Fi/si), Ci = bi / alpha_i; in both cases with alpha_i that sum to 1. Each
   element then has its own lag S/Ci.

   Start values: the levels of Table I of the LuGre paper, with elements that approximate its stiffness (specific to
   this library).

   The step is exact for constant v, including the onset of slip. For linear v, the onset of slip is located to
   rounding, and slip is an integral computed by quadrature with error control (attraction.h).

   Use it if presliding and slow sliding both matter, as in precise positioning with reversals, for simulation and for
   compensation. It needs the Stribeck curve from steady velocities, and the elements from a presliding loop.

   Limits: F has kinks; the lag of an element is a single time constant, both for increasing and for decreasing
   speed. */

#define MODEL    GMS
#define SUMMARY  "Generalised Maxwell slip: N elements attracted to the Stribeck curve in slip"
#define SOURCE   "Al-Bender, Lampaert, Swevers, IEEE TAC 50(11), 2005"
#define CITES    "AlBender2005"
#define STATUS   "not checked against the paper"
#define FEATURES "presliding, nonlocal memory, drift-free, Stribeck, lag, rate dependent"

/* clang-format off */
#define VARIABLES                                                                                          \
    INPUT     (v,        VELOCITY, 0.0,              "relative sliding velocity")                          \
    OPTIONAL  (Fn,       "N",      1.0,              "normal force")                                       \
    OUTPUT    (F,        FORCE,                      "friction " FORCE_NOUN ", opposes v")                 \
    FLAGS     (slipping, 10,                         "the element slips")                                  \
    STATES    (Fi,       10, FORCE, (0.0), 0.1,      FORCE_NOUN " of the element at the normal force Fn0") \
    COUNT     (N,        10,       1,     10,        "number of elements")                                 \
    PARAMETERS(k,        10, STIFFNESS, (28e3, 15e3, 10e3, 8e3, 6.5e3, 5.3e3, 4.3e3, 3.5e3, 2.8e3, 2.1e3), \
                                   0.0, INF,         "stiffness of the element")                           \
    PARAMETERS(alpha,    10, NO_UNIT, (0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1),                  \
                                   0.0, INF,         "weight of the element in the Stribeck level")        \
    PARAMETER (C,        FORCE "/s", 100.0, 0.0, INF, "attraction to the Stribeck level")                  \
    PARAMETERS(Ci,       10, FORCE "/s", (-1, -1, -1, -1, -1, -1, -1, -1, -1, -1),                         \
                                   -1.0, INF,        "attraction of the element; negative: C")             \
    PARAMETER (sigma,    DAMPING,  0.0,   0.0,   INF, "damping of each element")                           \
    PARAMETER (sigma2,   DAMPING,  0.4,   0.0,   INF, "viscous coefficient")                               \
    PARAMETER (Fc,       FORCE,    1.0,   1e-9,  INF, "Coulomb friction")                                  \
    PARAMETER (Fs,       FORCE,    1.5,   1e-9,  INF, "static friction (usually above Fc)")                \
    PARAMETER (vs,       VELOCITY, 1e-3,  1e-12, INF, "Stribeck velocity")                                 \
    PARAMETER (delta,    NO_UNIT,  2.0,   1e-3,  100.0, "Stribeck exponent")                               \
    PARAMETER (Fn0,      "N",      1.0,   1e-12, INF, "normal force for which the parameters are valid")

#define CONTACT                  \
    COULOMB  (Fc)                \
    STATIC   (Fs)                \
    STRIBECK (vs, delta)         \
    VISCOUS  (sigma2)            \
    STIFFNESS(sum(k))            \
    DAMPING  (N * sigma, sigma2)

#define IDENTIFIED                     \
    FIT   (k, stiffness, loops)        \
    FIT   (alpha, 1, loops)            \
    FIT   (C, 100 * level, swinging)   \
    HELD  (Ci, 100 * level, swinging)  \
    HELD  (sigma, damping, small_fast) \
    METHOD(hysteresis)
/* clang-format on */

#define STEPS_BY   step
#define EVENTS     10
#define DECIDES_BY transition
#define MEMORY     struct slip_memory
#define VALID_BY   is_slip_memory

struct slip_memory {
    double slips[10]; /* direction in which the element slipped in the last motion; 0: it did not */
};

#include "block.h"
#include "attraction.h"
#include "presliding.h"
#include "slip.h"
#include "stribeck.h"

static bool is_slip_memory(const Model *m) { return are_directions(m->memory.slips, 10); }

/* Return the factor that normalises alpha. */
static double share(const Model *m)
{
    GIVEN(m)
    double sum = 0.0;
    for (int i = 0; i < N; i++)
        sum += alpha[i];
    return sum > 0.0 ? 1.0 / sum : 0.0;
}

static inline double attraction_of(const Model *m, int i) { return m->Ci[i] < 0.0 ? m->C : m->Ci[i]; }

/* Compute outputs and rates at the Stribeck level S. */
static void contact(Model *m, double S, double alpha_scale)
{
    GIVEN(m)
    const bool frozen = m->run.frozen;
    const double moving = sign(v);
    double sum = 0.0, rate = 0.0;
    for (int i = 0; i < N; i++) {
        const double direction = frozen ? m->memory.slips[i] : moving;
        const double level = alpha[i] * alpha_scale, force = direction * Fi[i];
        const bool slips = direction != 0.0 && (m->memory.slips[i] == direction || !(force < level * S));
        m->slipping[i] = slips ? 1.0 : 0.0;
        m->der_Fi[i] = slips ? direction * attraction_of(m, i) * (level - force / S) : k[i] * v;
        rate += !slips ? v : k[i] > 0.0 ? m->der_Fi[i] / k[i] : 0.0;
        sum += Fi[i];
    }
    for (int i = N; i < 10; i++)
        m->slipping[i] = m->der_Fi[i] = 0.0;
    m->F = load_of(Fn, Fn0) * (sum + sigma * rate) + sigma2 * v;
}

static void equations(Model *m)
{
    GIVEN(m)
    contact(m, stribeck(v, Fc, Fs, vs, delta), share(m));
}

/* ---- model exchange ----------------------------------------------------------------------------------------- */

static double slow(const Model *m) { return 1e-7 * m->vs; }

/* Return S divided by the sum of alpha. */
static double levels(const Model *m)
{
    GIVEN(m)
    return share(m) * stribeck(v, Fc, Fs, vs, delta);
}

static void indicators(const Model *m, double *left)
{
    const double S = levels(m);
    for (int i = 0; i < 10; i++)
        left[i] = i < m->N ? slip_indicator(m->memory.slips[i], m->v, slow(m), m->Fi[i], m->alpha[i] * S) : 1.0;
}

static void transition(Model *m)
{
    const double S = levels(m);
    for (int i = 0; i < m->N; i++)
        m->memory.slips[i] = slip_after(m->memory.slips[i], m->v, slow(m), m->Fi[i], m->alpha[i] * S);
}

/* ---- Steps: exact at constant velocity, by quadrature over a ramp of the velocity. */

/* Step with constant v: the level is constant, so an element that reaches it stays there. */
static void held_step(Model *m, double h, double S, double alpha_scale)
{
    GIVEN(m)
    const double direction = sign(v), x = fabs(v) * h;
    double decay = NAN, strength = NAN; /* decay of the distance to the level in the step, for this attraction */
    for (int i = 0; i < N; i++) {
        const double level = alpha[i] * alpha_scale * S, force = direction * Fi[i];
        if (m->memory.slips[i] != 0.0 || force >= level) {
            m->memory.slips[i] = direction;
            if (attraction_of(m, i) != strength) { /* usually the same for all elements */
                strength = attraction_of(m, i);
                decay = exp(-strength * h / S);
            }
            m->Fi[i] = direction * (level + (force - level) * decay);
        } else if (force + k[i] * x < level) {
            m->Fi[i] = Fi[i] + k[i] * v * h;
        } else {
            m->memory.slips[i] = direction;
            m->Fi[i] = direction * level;
        }
    }
}

static double level_at(const Model *m, double s)
{
    GIVEN(m)
    return stribeck(v + SLOPE(v) * s, Fc, Fs, vs, delta);
}

/* Return the first time in (0, h) at which a stuck element reaches its level, or h if it does not; *reached is the
   force there. The force only increases and S is monotonic, so the values at the ends of an interval can exclude a
   crossing. */
static double arrival(const Model *m, double force, double stiffness, double level, double h, double *reached)
{
    double a = 0.0, S_a = level_at(m, 0.0), force_a = force, width = h;
    for (int tries = 0; a < h; tries++) {
        const double b = a + 1.000001 * width >= h ? h : a + width;
        const double S_b = level_at(m, b), force_b = force + stiffness * fabs(slide(m, b));
        if (force_b < level * fmin(S_a, S_b)) {
            a = b;
            S_a = S_b;
            force_a = force_b;
            width *= 2.0;
        } else if (b - a <= 4.0 * DBL_EPSILON * b || tries > 100000) {
            *reached = clip(level * S_b, force_a, force_b); /* one of them may jump */
            return b;
        } else {
            width = (b - a) / 2.0;
        }
    }
    return h;
}

/* Compute slip from time s to h, which is linear in the force: the result is E force + P level. */
static bool slip(const Model *m, double s, double h, double strength, double *E, double *P)
{
    GIVEN(m)
    const Attraction slips = {strength, false, Fc, Fs, vs, delta, quadrature_tolerance(m)};
    const double growth = sign(slide(m, h)) * SLOPE(v);
    double softest = INF; /* sigma times the speed of the elements also contributes to F */
    for (int i = 0; i < N; i++)
        softest = k[i] > 0.0 ? fmin(softest, k[i]) : softest;
    const double sensitivity = 1.0 + sigma * strength / (softest * level_at(m, h));
    return attract(&slips, fabs(v + SLOPE(v) * s), growth, h - s, fmax(Fc, Fs), sensitivity, E, P);
}

static bool ramp_step(Model *m, double h, double direction, double alpha_scale)
{
    GIVEN(m)
    double E = NAN, P = NAN, known = NAN; /* for slip over the whole step, with the attraction `known` */
    for (int i = 0; i < N; i++) {
        const double level = alpha[i] * alpha_scale, force = direction * Fi[i], strength = attraction_of(m, i);
        if (m->memory.slips[i] != 0.0 || force >= level * level_at(m, 0.0)) {
            m->memory.slips[i] = direction;
            if (strength != known && !slip(m, 0.0, h, strength, &E, &P))
                return false;
            known = strength;
            m->Fi[i] = direction * (E * force + P * level);
            continue;
        }
        double reached = 0.0, E_rest, P_rest;
        const double start = arrival(m, force, k[i], level, h, &reached);
        if (start < h) {
            m->memory.slips[i] = direction;
            if (!slip(m, start, h, strength, &E_rest, &P_rest))
                return false;
            m->Fi[i] = direction * (E_rest * reached + P_rest * level);
        } else {
            m->Fi[i] = Fi[i] + direction * k[i] * fabs(slide(m, h));
        }
    }
    return true;
}

static bool step(Model *m, double h)
{
    GIVEN(m)
    const double direction = sign(slide(m, h)), alpha_scale = share(m);
    for (int i = 0; i < 10; i++) /* from another motion */
        m->memory.slips[i] = m->memory.slips[i] == direction ? direction : 0.0;
    if (SLOPE(v) != 0.0)
        return direction == 0.0 || ramp_step(m, h, direction, alpha_scale);
    const double S = stribeck(v, Fc, Fs, vs, delta);
    if (direction != 0.0)
        held_step(m, h, S, alpha_scale);
    contact(m, S, alpha_scale);
    m->run.outputs_done = true;
    return true;
}
