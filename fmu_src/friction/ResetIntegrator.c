/* Reset integrator of Haessig and Friedland: the contact is a spring whose deflection z is limited to z0. While stuck,
   it is stiffer by the factor 1 + a, which models static friction, and damped by beta.

   Haessig, Friedland: On the modeling and simulation of friction, ASME Journal of Dynamic Systems, Measurement, and
   Control 113(3), 1991; in the form of equations (13) and (14) of Olsson, Astrom, Canudas de Wit, Gaefvert, Lischinsky:
   Friction models and friction compensation, European Journal of Control 4, 1998.

       dz/dt = 0  if v > 0 and z >= z0, or v < 0 and z <= -z0,  else v
       F     = ((1 + a(z)) sigma0 z + beta dz/dt) Fn/Fn0
       a(z)  = a if |z| < z0, else 0

   Coulomb friction is sigma0 z0, static friction (1 + a) sigma0 z0; beta = 2 zeta sqrt(sigma0 (1 + a) m) damps a stuck
   mass m. The step is exact: z follows the displacement and is limited.

   Use it as the cheapest model with stiction and presliding if F_ext is unknown. It needs the break-away deflection z0
   and, for beta, the mass.

   Limits: F drops by a sigma0 z0 + beta |v| when |z| reaches z0, which acts on a mass like an impulse. No Stribeck
   effect and no viscous friction. Within |z| < z0, the contact is elastic, so it does not drift. */

#define MODEL    ResetIntegrator
#define SUMMARY  "Reset-integrator friction: a spring with a stop, stiffer while stuck"
#define SOURCE   "Haessig, Friedland, ASME J. Dynamic Systems, Measurement, and Control 113(3), 1991"
#define CITES    "Haessig1991"
#define STATUS   "in the form of (13) and (14) of Olsson et al. 1998"
#define FEATURES "presliding, drift-free, rate dependent"

/* clang-format off */
#define VARIABLES                                                                            \
    INPUT    (v,      VELOCITY,  0.0,               "relative sliding velocity")             \
    OPTIONAL (Fn,     "N",       1.0,               "normal force")                          \
    OUTPUT   (F,      FORCE,                        "friction " FORCE_NOUN ", opposes v")    \
    STATE    (z,      LENGTH,    0.0,   1e-5,       "deflection of the contact")             \
    FLAG     (stuck,                                "deflection below its limit")            \
    PARAMETER(sigma0, STIFFNESS, 1e5,   1e-9,  INF, "stiffness while sliding")               \
    PARAMETER(z0,     LENGTH,    1e-5,  1e-15, INF, "largest deflection")                    \
    PARAMETER(a,      NO_UNIT,   0.5,   0.0,   INF, "static over Coulomb friction, minus 1") \
    PARAMETER(beta,   DAMPING,   774.6, 0.0,   INF, "damping while stuck")                   \
    PARAMETER(Fn0,    "N",       1.0,   1e-12, INF, "normal force for which the parameters are valid")

#define IDENTIFIED                     \
    FIT    (sigma0, stiffness, small)  \
    FIT    (z0, distance, loops)       \
    FIT    (a, 0.1, slow)              \
    FIT    (beta, damping, small_fast) \
    SLIDING(z, z0)
/* clang-format on */

#define STEPS_BY   step
#define EVENTS     2
#define DECIDES_BY transition
#define MEMORY     struct stop
#define VALID_BY   is_stop
#define KEEPS_BY   keep_decisions

struct stop {     /* in model exchange */
    double side;  /* where the deflection is stopped; 0: free */
    double below; /* 1: it is below its limit */
};

#include "block.h"
#include "presliding.h"
#include "slip.h"

static bool is_stop(const Model *m) { return is_direction(m->memory.side) && is_count(m->memory.below, 1.0); }

static void equations(Model *m)
{
    GIVEN(m)
    const bool at_stop = (v > 0.0 && z >= z0) || (v < 0.0 && z <= -z0);
    const bool stopped = m->run.frozen ? m->memory.side != 0.0 : at_stop;
    const bool below = m->run.frozen ? m->memory.below != 0.0 : fabs(z) < z0;

    m->der_z = stopped ? 0.0 : v;
    m->F = load_of(Fn, Fn0) * ((1.0 + (below ? a : 0.0)) * sigma0 * z + beta * m->der_z);
    m->stuck = below ? 1.0 : 0.0;
}

static bool step(Model *m, double h)
{
    GIVEN(m)
    const double dx = slide(m, h);

    if (dx > 0.0 && z < z0)
        m->z = fmin(z + dx, z0);
    else if (dx < 0.0 && z > -z0)
        m->z = fmax(z + dx, -z0);
    equations(m);
    m->run.outputs_done = true;
    return true;
}

#define SLOW 1e-10 /* [m/s] or [rad/s] */

static void indicators(const Model *m, double *left)
{
    left[0] = slip_indicator(m->memory.side, m->v, SLOW, m->z, m->z0);
    left[1] = m->memory.side == 0.0 && m->memory.below == 0.0 ? fabs(m->z) - m->z0 * (1.0 - 1e-12) : 1.0;
}

static void transition(Model *m)
{
    struct stop *const now = &m->memory;
    const bool leaves = now->side * m->v < 0.0; /* z may exceed z0 by rounding */
    now->side = slip_after(now->side, m->v, SLOW, m->z, m->z0);
    now->below = now->side == 0.0 && (leaves || fabs(m->z) < m->z0) ? 1.0 : 0.0;
}
