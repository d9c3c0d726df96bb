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
#define SUMMARY  "Karnopp friction with a velocity dead band, as a force"
#define SOURCE   "Karnopp, ASME Journal of Dynamic Systems, Measurement, and Control 107(1), 1985"
#define CITES    "Karnopp1985"
#define STATUS   "equations from memory of the paper"
#define FEATURES "rate dependent, needs force"

/* clang-format off */
#define VARIABLES                                                                                           \
    INPUT    (v,     VELOCITY, 0.0,               "relative sliding velocity")                              \
    INPUT    (F_ext, FORCE,    0.0,               "sum of the other forces on the mass; determines friction at rest") \
    OPTIONAL (Fn,    "N",      1.0,               "normal force")                                           \
    OUTPUT   (F,     FORCE,                       "friction force")                                         \
    LOCAL    (v_reported, VELOCITY,               "velocity, 0 inside the band")                            \
    FLAG     (stuck,                              "inside the band and held by friction")                   \
    PARAMETER(Fc,    FORCE,    1.0,  0.0,   INF,  "Coulomb friction at Fn0")                                \
    PARAMETER(Fs,    FORCE,    1.5,  0.0,   INF,  "static friction at Fn0, may be below Fc")                \
    PARAMETER(Fv,    DAMPING,  0.4,  0.0,   INF,  "viscous coefficient")                                    \
    PARAMETER(DV,    VELOCITY, 1e-3, 0.0,   INF,  "half width of the velocity band treated as standstill")  \
    PARAMETER(Fn0,   "N",      1.0,  1e-12, INF,  "normal force for which the parameters are valid")

#define CONTACT \
    COULOMB(Fc) \
    STATIC (Fs) \
    VISCOUS(Fv)

/* its dead band in the velocity is only meaningful together with a mass */
#define IDENTIFIED METHOD(none)
/* clang-format on */

#include "block.h"
#include "load.h"

static void equations(Model *m)
{
    GIVEN(m)
    const double load = load_of(Fn, Fn0);
    const bool rest = fabs(v) < DV || v == 0.0;

    m->stuck = rest && fabs(F_ext) <= load * Fs ? 1.0 : 0.0;
    m->v_reported = rest ? 0.0 : v;
    m->F = rest ? clip(F_ext, -load * Fs, load * Fs) : sign(v) * load * Fc + Fv * v;
}
