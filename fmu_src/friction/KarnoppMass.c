/* Karnopp friction including the mass: below the velocity DV, the body is reported to be at rest.

   Karnopp: Journal of Dynamic Systems, Measurement, and Control 107(1), 1985. The state is the momentum m w, which is
   also integrated inside the band; only the reported velocity v is zero there.

       m dw/dt = F_ext - F,   dx/dt = v
       |w| <  DV:  F = F_ext, |F| <= load Fs;  v = 0
       |w| >= DV:  F = load Fc sign(w) + Fv w;          v = w
       load = max(Fn, 0) / Fn0

   A body that stops after sliding keeps w at the edge of the band, just below DV, and breaks away from there. It stays
   at the edge, at rest, as long as sliding at DV would decelerate it, even if F_ext exceeds load Fs; this is only
   possible for Fs < Fc + Fv DV.

   F_ext is the sum of all forces on the mass except friction. The step is exact for F_ext and Fn that are constant or
   linear in time: the motion is in closed form between events, which are located inside the step.

   Use it if a mass must come to rest exactly: positions at rest, limit cycles, stick-slip.

   Limits: the first break-away is late, as w must pass the whole band: by sqrt(2 m DV / (k V)) if F_ext grows at the
   rate k V. DV must be small compared with the relevant velocities; it need not exceed the change of velocity in one
   step, as events are located. No Stribeck effect, no presliding. */

#define MODEL    KarnoppMass
#define SUMMARY  "Mass with Karnopp friction, at rest inside a velocity dead band"
#define SOURCE   "Karnopp, ASME Journal of Dynamic Systems, Measurement, and Control 107(1), 1985"
#define CITES    "Karnopp1985"
#define STATUS   "equations from memory of the paper"
#define FEATURES "drift-free, rate dependent, needs force, mass inside"
#define PORTRAIT "pushed_mass"
#define NEEDS    "real stop"

/* clang-format off */
#define VARIABLES                                                                                                      \
    INPUT       (F_ext, FORCE,    0.0,              "sum of all " FORCE_NOUN "s on the " MASS_NOUN " except friction") \
    OPTIONAL    (Fn,    "N",      1.0,              "normal force")                                                    \
    OUTPUT      (v,     VELOCITY,                   "velocity, 0 inside the band")                                     \
    OUTPUT      (F,     FORCE,                      "friction " FORCE_NOUN)                                            \
    STATE_OUTPUT(x,     LENGTH,   x0,  1.0,         "position")                                                        \
    STATE_OUTPUT(w,     VELOCITY, v0,  1.0,         "momentum over " MASS_NOUN ": velocity without the dead band")     \
    FLAG        (stuck,                             "inside the band and held by friction")                            \
    PARAMETER   (m,     MASS,     1.0,  1e-12, INF, MASS_NOUN)                                                         \
    PARAMETER   (Fc,    FORCE,    1.0,  0.0,   INF, "Coulomb friction at Fn0")                                         \
    PARAMETER   (Fs,    FORCE,    1.5,  0.0,   INF, "static friction at Fn0, may be below Fc")                         \
    PARAMETER   (Fv,    DAMPING,  0.4,  0.0,   INF, "viscous coefficient")                                             \
    PARAMETER   (DV,    VELOCITY, 1e-3, 1e-12, INF, "half width of the velocity band treated as standstill")           \
    PARAMETER   (Fn0,   "N",      1.0,  1e-12, INF, "normal force for which the parameters are valid")                 \
    FIXED       (x0,    LENGTH,   0.0,  -INF,  INF, "initial position")                                                \
    FIXED       (v0,    VELOCITY, 0.0,  -INF,  INF, "initial velocity")

#define CONTACT \
    COULOMB(Fc) \
    STATIC (Fs) \
    VISCOUS(Fv)

#define IN_LOOP   \
    FORCES(F_ext) \
    MASS  (m)
/* clang-format on */

#define STEPS_BY      step
#define EVENTS        2
#define DECIDES_BY    transition
#define REINITIALISES "w"
#define MEMORY        struct band
#define VALID_BY      is_band
#define KEEPS_BY      keep_decisions

struct band {     /* in model exchange */
    double side;  /* of the band on which the mass slides; 0: inside */
    double stuck; /* 1: inside and held */
};

#include "block.h"
#include "load.h"
#include "until_change.h"

static bool is_band(const Model *model)
{
    return is_direction(model->memory.side) && is_count(model->memory.stuck, 1.0);
}

/* Return the velocity just inside the band, which a body keeps when it comes to rest. */
static double edge(double DV) { return nextafter(DV, 0.0); }

/* Return the friction that holds the mass inside the band against a force in this direction. */
static inline double hold(const Model *model, double direction)
{
    GIVEN(model)
    const double load = load_of(Fn, Fn0), level = load * Fs;
    return direction * w == edge(DV) ? fmax(level, load * Fc + Fv * DV /* friction just outside */) : level;
}

/* Return how far F_ext is below that friction. */
static double reserve(const Model *model)
{
    return fmin(model->F_ext + hold(model, -1.0), hold(model, 1.0) - model->F_ext);
}

static void equations(Model *model)
{
    GIVEN(model)
    const bool frozen = model->run.frozen;
    const double load = load_of(Fn, Fn0), side = frozen ? model->memory.side : fabs(w) < DV ? 0.0 : sign(w);
    const bool inside = side == 0.0;

    if (frozen)
        model->stuck = model->memory.stuck;
    else
        model->stuck = inside && (fabs(F_ext) <= load * Fs || reserve(model) >= 0.0) ? 1.0 : 0.0;
    model->v = inside ? 0.0 : w;
    if (!inside)
        model->F = load * Fc * side + Fv * w;
    else
        model->F = model->stuck != 0.0 ? F_ext : clip(F_ext, -load * Fs, load * Fs);
    model->der_x = model->v;
    model->der_w = (F_ext - model->F) / m;
}

/* ---- model exchange ----------------------------------------------------------------------------------------- */

static void indicators(const Model *model, double *left)
{
    GIVEN(model)
    const double side = model->memory.side;
    left[0] = until_change(side, (side != 0.0 ? side * w : fabs(w)) - DV, DV);
    left[1] = side != 0.0 ? 1.0 : until_change(model->memory.stuck, reserve(model), load_of(Fn, Fn0));
}

static void transition(Model *model)
{
    GIVEN(model)
    struct band *const now = &model->memory;
    if (fabs(w) >= DV)
        now->side = sign(w);
    else if (now->side != 0.0) {
        model->w = now->side * edge(DV);
        now->side = 0.0;
    }
    now->stuck = now->side == 0.0 && reserve(model) >= 0.0 ? 1.0 : 0.0;
    if (now->side == 0.0 && now->stuck == 0.0 && fabs(model->w) == edge(DV) && F_ext * w > 0.0) {
        now->side = sign(w); /* slides on from the edge */
        model->w = now->side * DV;
    }
}

#include "KarnoppMass_ramp.h"
