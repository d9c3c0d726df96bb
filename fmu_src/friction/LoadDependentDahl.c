/* Dahl friction of strain-wave and cycloidal gears, proportional to the transmitted force, with one coefficient when
   the motor drives the load and another when the load drives the motor.

   A comment of the user andyabateagility in issue 3528 of google-deepmind/mujoco, "Torque-proportional loss in
   dcmotor", GitHub, 2026, gives the equations without Fv v, which it leaves to the joint, with the electrical torque of
   the motor as F_t. By its plots, the four parameters fit records of such gears better than three variants of LuGre
   with seven and eight; neither the records nor the fits are published, and they were not repeated here.

       dz/dt = (v - |v| z) / eps
       F     = mu_avg |F_t| z + mu_dif F_t z^2 + Fv v

   Use it for gears with a varying load, for example in robot joints. Connect F_t, for example to the torque of the
   motor in the rotational twin; otherwise it is constant. The parameters need slow reversals under several loads.

   Limits: no friction without load and no Stribeck effect (add a Coulomb or Stribeck block); reversal points are not
   remembered; at rest F changes with F_t. The torsion of the gear is not included.

   The step is exact: z(h) = s + (z - s) exp(-|dx| / eps) with dx = x(h) - x(0) and s = sgn(dx). A z beyond +-1, which
   no motion reaches, would drive the axis; it counts as +-1.

   In steady sliding z = sgn(v), and the coefficient is mu_avg + mu_dif for F_t v > 0, else mu_avg - mu_dif. Under a
   constant F_t with mu_dif = 0, it is Dahl with n = 1, Fc = mu_avg |F_t| and sigma = Fc / eps.

   Without viscous friction the efficiency is 1 - (mu_avg + mu_dif) if the motor drives the load and 1 / (1 + mu_avg -
   mu_dif) if the load drives the motor. The contact stores eps |F_t| (mu_avg z^2 / 2 + sgn(F_t) mu_dif z^3 / 3) and
   dissipates |v| z (F - Fv v). Neither is negative for |mu_dif| <= mu_avg (derived for this library); other values are
   rejected. Two measured records show no dependence on the load: it hardly changes on the tribometer, and the ball
   screw of EMPS has none within two standard errors. */

#define MODEL    LoadDependentDahl
#define SUMMARY  "Dahl friction proportional to the transmitted {force}, for strain-wave gears"
#define SOURCE   "andyabateagility, issue 3528 of google-deepmind/mujoco, GitHub, 2026"
#define CITES    "TorqueProportionalLoss2026"
#define STATUS   "checked against an excerpt of this discussion, not against a paper"
#define FEATURES "presliding, rate dependent"

/* clang-format off */
#define VARIABLES                                                                                                          \
    INPUT    (v,      VELOCITY, 0.0,               "relative sliding velocity")                                            \
    OPTIONAL (F_t,    FORCE,    1.0,               "transmitted " FORCE_NOUN ", positive if it drives towards positive v") \
    OUTPUT   (F,      FORCE,                       "friction " FORCE_NOUN ", opposes v")                                   \
    STATE    (z,      NO_UNIT,  0.0,  1.0,         "deflection over the deflection of steady sliding")                     \
    PARAMETER(mu_avg, NO_UNIT,  0.1,  0.0,   INF,  "mean of the friction coefficients of driving and back-driving")        \
    PARAMETER(mu_dif, NO_UNIT,  0.03, -INF,  INF,  "half of the difference of driving and back-driving, at most mu_avg")                             \
    PARAMETER(eps,    LENGTH,   1e-3, 1e-12, INF,  "path constant after a reversal")                                       \
    PARAMETER(Fv,     DAMPING,  0.4,  0.0,   INF,  "viscous coefficient")

#define IDENTIFIED                   \
    FIT    (mu_avg, 0.1, sliding)    \
    FIT    (mu_dif, 0, directions)   \
    FIT    (eps, distance, loops)    \
    FIT    (Fv, viscous, sliding)    \
    SLIDING(z, 1)
/* clang-format on */

#define STEPS_BY step
#define REQUIRES dissipative

#include "block.h"
#include "presliding.h"

static const char *dissipative(const Model *m) { return fabs(m->mu_dif) <= m->mu_avg ? NULL : "|mu_dif| <= mu_avg"; }

static void equations(Model *m)
{
    GIVEN(m)
    const double bent = clip(z, -1.0, 1.0);
    m->der_z = (v - fabs(v) * bent) / eps;
    m->F = mu_avg * fabs(F_t) * bent + mu_dif * F_t * bent * bent + Fv * v;
}

static bool step(Model *m, double h)
{
    GIVEN(m)
    const double dx = slide(m, h);

    m->z = relax(clip(z, -1.0, 1.0), sign(dx), fabs(dx) / eps);
    equations(m);
    m->run.outputs_done = true;
    return true;
}
