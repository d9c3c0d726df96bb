/* Elasto-plastic friction: LuGre bristles that do not slip up to a break-away deflection z_ba, so that small motions
   are exactly elastic and do not drift.

   Dupont, Armstrong, Hayward: Elasto-plastic friction model: contact compliance and stiction, American Control
   Conference, 2000; Dupont, Hayward, Armstrong, Altpeter: Single state elastoplastic friction models, IEEE TAC 47(5),
   2002; with the exponent i = 1.

       dz/dt = v (1 - alpha z / z_ss(v))
       z_ss  = sgn(v) z_max,   z_max(v) = S(v) / sigma0
       S(v)  = Fc + (Fs - Fc) exp(-|v/vs|^delta)
       sgn(z) /= sgn(v) or |z| <= z_ba:  alpha = 0
       z_ba < |z| < z_max:
            alpha = 1/2 + 1/2 sin(pi (|z| - (z_max + z_ba)/2) / (z_max - z_ba))
       |z| >= z_max:  alpha = 1
       F     = (sigma0 z + sigma1(v) dz/dt) Fn/Fn0 + sigma2 v
       sigma1(v) = sigma1 exp(-(v/v_d)^2) if v_d > 0, else sigma1

   sigma1(v) is from LuGre and not in the papers. Some publications omit |.| in the sine or exchange the two cases of
   sgn(z), which both break the model. z_ba should satisfy 0 < z_ba < z_max(v) for all v. A larger z_ba is replaced by
   z_max, and the contact is then elastic-perfectly plastic.

   In the elastic part of a step, z changes by the displacement. At constant velocity, the rest is a differential
   equation in the path: a Taylor series between z_ba and z_max, an exponential beyond. At linear velocity, the same
   holds where S is constant. Elsewhere, the equation is integrated numerically with error control from z_ba on
   (relaxation.h); beyond z_max, it is linear and solved by quadrature (attraction.h).

   Use it if friction holds a joint under vibration or small loads and the joint must not drift; otherwise like LuGre.
   It has one more parameter than LuGre, z_ba.

   Limits: F jumps with v, as in LuGre; beyond z_ba, reversal points are not remembered. */

#define MODEL    ElastoPlastic
#define SUMMARY  "Elasto-plastic bristle friction without drift below break-away"
#define SOURCE   "Dupont, Hayward, Armstrong, Altpeter, IEEE TAC 47(5), 2002"
#define CITES    "Dupont2002"
#define STATUS   "equations from memory of the papers"
#define FEATURES "presliding, drift-free, Stribeck, lag, rate dependent"
#define NEEDS    "held under vibration"

/* clang-format off */
#define VARIABLES                                                                                                      \
    INPUT    (v,      VELOCITY,  0.0,                "relative sliding velocity")                                      \
    OPTIONAL (Fn,     "N",       1.0,                "normal force")                                                   \
    OUTPUT   (F,      FORCE,                         "friction " FORCE_NOUN ", opposes v")                             \
    STATE    (z,      LENGTH,    0.0,    1e-5,       "mean bristle deflection")                                        \
    FLAG     (elastic,                               "the bristles follow the motion without slip")                    \
    PARAMETER(sigma0, STIFFNESS, 1e5,    1e-9,  INF, "bristle stiffness")                                              \
    PARAMETER(sigma1, DAMPING,   316.22776601683796, 0.0, INF, "bristle damping")                                      \
    PARAMETER(sigma2, DAMPING,   0.4,    0.0,   INF, "viscous coefficient")                                            \
    PARAMETER(Fc,     FORCE,     1.0,    1e-9,  INF, "Coulomb friction")                                               \
    PARAMETER(Fs,     FORCE,     1.5,    1e-9,  INF, "static friction, may be below Fc")                               \
    PARAMETER(vs,     VELOCITY,  1e-3,   1e-12, INF, "Stribeck velocity")                                              \
    PARAMETER(delta,  NO_UNIT,   2.0,    1e-3,  100.0, "Stribeck exponent")                                            \
    PARAMETER(v_d,    VELOCITY,  0.0,    0.0,   INF, "speed at which the bristle damping decays; 0: constant damping") \
    PARAMETER(z_ba,   LENGTH,    0.7e-5, 0.0,   INF, "break-away deflection, below Fc/sigma0")                         \
    PARAMETER(Fn0,    "N",       1.0,    1e-12, INF, "normal force for which the parameters are valid")

#define CONTACT               \
    COULOMB  (Fc)             \
    STATIC   (Fs)             \
    STRIBECK (vs, delta)      \
    VISCOUS  (sigma2)         \
    STIFFNESS(sigma0)         \
    DAMPING  (sigma1, sigma2)

#define IDENTIFIED SLIDING(z, Fc / sigma0)
/* clang-format on */

#define STEPS_BY   step
#define EVENTS     1
#define DECIDES_BY transition
#define MEMORY     struct stage
#define VALID_BY   is_stage
#define KEEPS_BY   keep_decisions

struct stage {
    double elastic; /* in model exchange: the flag */
};

#include "block.h"
#include "constants.h"
#include "presliding.h"
#include "stribeck.h"
#include "until_change.h"

/* Return the plastic part of the motion, alpha z / z_ss, for a deflection in the direction of motion. */
static double plastic(double deflection, double z_max, double z_ba)
{
    if (deflection >= z_max)
        return deflection / z_max;
    if (deflection <= z_ba)
        return 0.0;
    return square(sin(HALF_PI * (deflection - z_ba) / (z_max - z_ba))) * deflection / z_max;
}

static bool is_stage(const Model *m) { return is_count(m->memory.elastic, 1.0); }

static void contact(Model *m, double S)
{
    GIVEN(m)
    const double part = plastic(sign(v) * z, S / sigma0, z_ba);
    const double damping = fading(sigma1, v, v_d);

    m->der_z = v * (1.0 - part);
    m->F = load_of(Fn, Fn0) * (sigma0 * z + damping * m->der_z) + sigma2 * v;
    m->elastic = m->run.frozen ? m->memory.elastic : part == 0.0 ? 1.0 : 0.0;
}

static void equations(Model *m) { contact(m, stribeck(m->v, m->Fc, m->Fs, m->vs, m->delta)); }

/* Return the deflection that is left until the bristles slip, for model exchange. */
static double reserve(const Model *m)
{
    GIVEN(m)
    const double direction = fabs(v) < 1e-7 * vs ? 0.0 : sign(v); /* noise of a solver around v = 0 is not motion */
    return fmin(z_ba, stribeck(v, Fc, Fs, vs, delta) / sigma0) - direction * z;
}

static void indicators(const Model *m, double *left) { left[0] = until_change(m->memory.elastic, reserve(m), m->z_ba); }

static void transition(Model *m) { m->memory.elastic = reserve(m) >= 0.0 ? 1.0 : 0.0; }

#include "ElastoPlastic_ramp.h"
