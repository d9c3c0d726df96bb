/* Karnopp friction: below the velocity DV, the body is considered at rest, and friction balances the external force.

   Karnopp: Journal of Dynamic Systems, Measurement, and Control 107(1), 1985. This block computes the force for a
   separate mass; KarnoppMass contains the mass.

       |v| <  DV:  F = F_ext, |F| <= load Fs;  v_reported = 0
       |v| >= DV:  F = load Fc sign(v) + Fv v;          v_reported = v
       load = max(Fn, 0) / Fn0

   F_ext is the sum of all other forces on the mass and must be connected. With DV = 0, the model equals Stiction.

   Use it with a mass whose velocity is known at discrete times only: the band replaces v = 0, which a step never meets
   exactly. DV must exceed the change of v in one step, h |F_ext| / m; otherwise, v skips the band.

   Limits: the connected mass must also report the velocity 0 inside the band (v_reported), or it creeps at up to DV.
   The force between two such contacts in series is undetermined. Inside the band, F opposes F_ext instead of v. No
   Stribeck effect, no presliding. */

#define MODEL    Karnopp
#define SUMMARY  "Karnopp friction with a velocity dead band, as a {force}"
#define SOURCE   "Karnopp, ASME Journal of Dynamic Systems, Measurement, and Control 107(1), 1985"
#define CITES    "Karnopp1985"
#define STATUS   "not checked against the paper"
#define FEATURES "rate dependent, needs force"

/* clang-format off */
#define VARIABLES                                                                                                                       \
    INPUT    (v,     VELOCITY, 0.0,               "relative sliding velocity")                                                          \
    INPUT    (F_ext, FORCE,    0.0,               "sum of the other " FORCE_NOUN "s on the " MASS_NOUN "; determines friction at rest") \
    OPTIONAL (Fn,    "N",      1.0,               "normal force")                                                                       \
    OUTPUT   (F,     FORCE,                       "friction " FORCE_NOUN)                                                               \
    LOCAL    (v_reported, VELOCITY,               "velocity, 0 inside the band")                                                        \
    FLAG     (stuck,                              "inside the band and held by friction")                                               \
    PARAMETER(Fc,    FORCE,    1.0,  0.0,   INF,  "Coulomb friction at Fn0")                                                            \
    PARAMETER(Fs,    FORCE,    1.5,  0.0,   INF,  "static friction at Fn0 (usually above Fc)")                                          \
    PARAMETER(Fv,    DAMPING,  0.4,  0.0,   INF,  "viscous coefficient")                                                                \
    PARAMETER(DV,    VELOCITY, 1e-3, 0.0,   INF,  "half width of the velocity band treated as standstill")                              \
    PARAMETER(Fn0,   "N",      1.0,  1e-12, INF,  "normal force for which the parameters are valid")

#define CONTACT \
    COULOMB(Fc) \
    STATIC (Fs) \
    VISCOUS(Fv)

/* its dead band in the velocity is only meaningful together with a mass */
#define IDENTIFIED METHOD(none)
/* clang-format on */

#define EVENTS     2
#define DECIDES_BY transition
#define MEMORY     struct band
#define VALID_BY   is_band
#define KEEPS_BY   keep_decisions

struct band {     /* in model exchange */
    double side;  /* of the band in which the velocity is; 0: inside */
    double stuck; /* 1: inside and held */
};

#include "block.h"
#include "load.h"
#include "until_change.h"

static bool is_band(const Model *m) { return is_direction(m->memory.side) && is_count(m->memory.stuck, 1.0); }

static double side_of(double v, double DV) { return fabs(v) < DV || v == 0.0 ? 0.0 : sign(v); }

/* Return how far F_ext is below the friction that holds the mass inside the band. */
static double margin(const Model *m) { return load_of(m->Fn, m->Fn0) * m->Fs - fabs(m->F_ext); }

static void equations(Model *m)
{
    GIVEN(m)
    const bool frozen = m->run.frozen, rest = frozen ? m->memory.side == 0.0 : fabs(v) < DV || v == 0.0;
    const double load = load_of(Fn, Fn0);

    m->stuck = !rest ? 0.0 : frozen ? m->memory.stuck : margin(m) >= 0.0 ? 1.0 : 0.0;
    m->v_reported = rest ? 0.0 : v;
    m->F = rest ? clip(F_ext, -load * Fs, load * Fs) : (frozen ? m->memory.side : sign(v)) * load * Fc + Fv * v;
}

/* Return DV, or a speed that no drive resolves: a solver does not reach v = 0 exactly. */
static double band(const Model *m) { return fmax(m->DV, 1e-9); }

static void indicators(const Model *m, double *left)
{
    const struct band *const now = &m->memory;
    const double speed = now->side != 0.0 ? now->side * m->v : fabs(m->v);
    left[0] = until_change(now->side, speed - band(m), band(m));
    left[1] = now->side != 0.0 ? 1.0 : until_change(now->stuck, margin(m), load_of(m->Fn, m->Fn0));
}

static void transition(Model *m)
{
    m->memory.side = side_of(m->v, band(m));
    m->memory.stuck = m->memory.side == 0.0 && margin(m) >= 0.0 ? 1.0 : 0.0;
}
