/* Dahl friction: the contact is a spring with the stiffness sigma that softens as its force approaches the Coulomb
   level. The force depends on the path only, not on the rate.

   Dahl: A solid friction model, The Aerospace Corporation TOR-158(3107-18), 1968, and: Solid friction damping of
   mechanical vibrations, AIAA Journal 14(12), 1976. See also Olsson, Astrom, Canudas de Wit, Gaefvert, Lischinsky:
   Friction models and friction compensation, European Journal of Control 4, 1998.

       dz/dx = |w|^n sgn(w),   w = 1 - sgn(v) sigma z / Fc,   F = sigma z
       F     = (sigma z) Fn/Fn0 with a normal force

   The factor sgn(w), often omitted in the literature, returns a force above Fc to Fc; without it, such a force diverges
   for most n. The step is the exact solution over the path u = |x(h) - x(0)|, without a solver or a step size:

       n = 1:   w(u) = w exp(-sigma u / Fc)
       n /= 1:  |w(u)|^(1-n) = |w|^(1-n) - (1 - n) sigma u / Fc

   With n < 1, the Coulomb level is reached after a finite path and kept. With n = 0, the contact is elastic-perfectly
   plastic (one Maxwell slip element). With n = 1, it is LuGre without Stribeck effect, damping and viscous friction.

   Use it for rate-independent hysteresis in small motions, for example in ball bearings. It needs the level Fc, the
   stiffness sigma after a reversal, and n for the shape of the loop.

   Limits: no Stribeck effect and thus no stick-slip; no static friction above Fc; no viscous friction (add a Viscous
   block). z drifts under a constant force with vibration, and reversal points are not remembered. */

#define MODEL    Dahl
#define SUMMARY  "Dahl friction, rate-independent presliding hysteresis"
#define SOURCE   "Dahl, The Aerospace Corporation TOR-158(3107-18), 1968; AIAA Journal 14(12), 1976"
#define CITES    "Dahl1968, Dahl1976"
#define STATUS   "checked against Olsson et al. 1998"
#define FEATURES "presliding"

/* clang-format off */
#define VARIABLES                                                                                 \
    INPUT    (v,     VELOCITY,  0.0,              "relative sliding velocity")                    \
    OPTIONAL (Fn,    "N",       1.0,              "normal force")                                 \
    OUTPUT   (F,     FORCE,                       "friction " FORCE_NOUN ", opposes v")           \
    STATE    (z,     LENGTH,    0.0,  1e-5,       "deflection of the contact")                    \
    PARAMETER(sigma, STIFFNESS, 1e5,  1e-9,  INF, "stiffness at zero " FORCE_NOUN)                \
    PARAMETER(Fc,    FORCE,     1.0,  1e-9,  INF, "Coulomb friction")                             \
    PARAMETER(n,     NO_UNIT,   1.0,  0.0,   100.0, "exponent of the softening, ductile above 1") \
    PARAMETER(Fn0,   "N",       1.0,  1e-12, INF, "normal force for which the parameters are valid")

#define CONTACT      \
    COULOMB  (Fc)    \
    STIFFNESS(sigma)

#define IDENTIFIED         \
    FIT    (n, 1, loops)   \
    SLIDING(z, Fc / sigma)
/* clang-format on */

#define STEPS_BY   step
#define EVENTS     1
#define DECIDES_BY transition
#define MEMORY     struct level
#define VALID_BY   is_level
#define KEEPS_BY   keep_decisions

struct level {      /* in model exchange with n < 1 */
    double reached; /* direction in which the Coulomb level has been reached, or 0 */
    double beyond;  /* 1: z is above the level */
};

#include "block.h"
#include "presliding.h"

static bool is_level(const Model *m) { return is_direction(m->memory.reached) && is_count(m->memory.beyond, 1.0); }

/* Compute dz/dt and F; softening = sigma/Fc is the inverse path constant of the hysteresis. */
static void contact(Model *m, double softening)
{
    GIVEN(m)
    if (m->memory.reached != 0.0)
        m->der_z = 0.0;
    else if (n == 1.0 || v == 0.0)
        m->der_z = v - fabs(v) * softening * z;
    else {
        const double gap = sign(v) * (Fc / sigma) - z; /* distance to the deflection of steady sliding */
        const double side = m->run.frozen ? sign(v) * (m->memory.beyond != 0.0 ? -1.0 : 1.0) : sign(gap);
        m->der_z = fabs(v) * side * (n == 0.0 ? 1.0 : pow(fabs(gap) * softening, n));
    }
    m->F = load_of(Fn, Fn0) * sigma * z;
}

static void equations(Model *m) { contact(m, m->sigma / m->Fc); }

/* Return the part of the gap |w| > 0 that closes over the path p = sigma u / Fc > 0: 1 - |w(p)| / |w|. */
static double closed(double w, double p, double n)
{
    if (n == 2.0)
        return 1.0 / (1.0 + 1.0 / (p * w));
    const double above = n - 1.0, q = p * pow(w, above);
    if (above * q <= -1.0)
        return 1.0; /* level reached, n < 1 */
    return -expm1(-log1p(above * q) / above);
}

static bool step(Model *m, double h)
{
    GIVEN(m)
    const double dx = slide(m, h), u = fabs(dx), softening = sigma / Fc;
    const double level = sign(dx) * (Fc / sigma), gap = level - z;

    if (dx == 0.0 || gap == 0.0)
        m->z = z;
    else if (n == 1.0)
        m->z = relax(z, level, u * softening);
    else if (n == 0.0)
        m->z = u >= fabs(gap) ? level : z + copysign(u, gap);
    else {
        const double part = closed(fabs(gap) * softening, u * softening, n);
        m->z = part < 1.0 ? z + part * gap : level;
    }
    contact(m, softening);
    m->run.outputs_done = true;
    return true;
}

#define SLOW 1e-10 /* [m/s] or [rad/s]: noise of a solver around v = 0 is not a reversal */

/* Return the distance to the deflection of steady sliding, positive below it. */
static double gap_of(const Model *m) { return m->Fc / m->sigma - (m->v < 0.0 ? -m->z : m->z); }

static void indicators(const Model *m, double *left)
{
    const struct level *const now = &m->memory;
    const double until_level = now->beyond != 0.0 ? -gap_of(m) : gap_of(m);
    left[0] = m->n >= 1.0 ? 1.0 : now->reached != 0.0 ? now->reached * m->v + SLOW : until_level;
}

static void transition(Model *m)
{
    struct level *const now = &m->memory;
    const double gap = gap_of(m);
    if (now->reached == 0.0 || now->reached * m->v < -0.5 * SLOW)
        now->reached = m->n < 1.0 && fabs(gap) <= 1e-9 * m->Fc / m->sigma ? sign(m->v) : 0.0;
    now->beyond = gap < 0.0 ? 1.0 : 0.0;
}
