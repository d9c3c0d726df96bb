/* Bliman-Sorine friction: linear in the path. A fast and a slow Dahl element with opposite signs give a force that
   overshoots from rest (stiction) and settles at f1 - f2.

   Bliman, Sorine: Friction modelling by hysteresis operators, application to Dahl, stiction and Stribeck effects, Proc.
   Models of Hysteresis, Trento, 1991 (Pitman 1993), and: Easy-to-use realistic dry friction models for automatic
   control, European Control Conference, Rome, 1995. In the form of equations (15) to (17) of Olsson, Astrom, Canudas de
   Wit, Gaefvert, Lischinsky: Friction models and friction compensation, European Journal of Control 4, 1998.

       ds = |v| dt
       order 2:  dF_fast/ds = ( f1 sgn(v) - F_fast) / (eta eps)
                 dF_slow/ds = (-f2 sgn(v) - F_slow) / eps
                 F = (F_fast + F_slow) Fn/Fn0
       order 1:  dF_fast/ds = ( f1 sgn(v) - F_fast) / eps
                 F = F_fast Fn/Fn0

   Order 1 is Dahl's model with n = 1, Fc = f1 and sigma = f1/eps. From rest, order 2 peaks after the path eta eps/(1 -
   eta) ln(f1/(eta f2)); after sliding in the opposite direction, the transient is twice as large. The step is the exact
   solution over the path: two exponentials.

   Use it for a rate-independent law that is linear in the path and has a break-away peak, for example in controller
   design. It requires 0 < eta <= 1 and f1 >= f2 >= 0; with f2 above f1, friction would drive.

   Limits: the force depends on the path only, so there is no Stribeck effect in v. The peak depends on the history and
   may cause oscillation of a mass on a spring. Like Dahl's model, it does not remember reversal points and drifts under
   a constant force with vibration. */

#define MODEL    BlimanSorine
#define SUMMARY  "Bliman-Sorine friction of order 1 or 2, linear in the path"
#define SOURCE   "Bliman, Sorine, European Control Conference, 1995"
#define CITES    "BlimanSorine1995"
#define STATUS   "in the form of (15) to (17) of Olsson et al. 1998"
#define FEATURES "presliding"

/* clang-format off */
#define VARIABLES                                                                                                \
    INPUT    (v,      VELOCITY, 0.0,              "relative sliding velocity")                                   \
    OPTIONAL (Fn,     "N",      1.0,              "normal force")                                                \
    OUTPUT   (F,      FORCE,                      "friction " FORCE_NOUN ", opposes v")                          \
    STATE    (F_fast, FORCE,    0.0,  1.0,        FORCE_NOUN " of the fast element at Fn0")                      \
    STATE    (F_slow, FORCE,    0.0,  1.0,        FORCE_NOUN " of the slow element at Fn0; not used in order 1") \
    COUNT    (order,  2,        1,    2,          "1: fast element only, 2: both")                               \
    PARAMETER(f1,     FORCE,    1.8,  0.0,   INF, "level of the fast element")                                   \
    PARAMETER(f2,     FORCE,    0.8,  0.0,   INF, "level of the slow element, at most f1")                       \
    PARAMETER(eta,    NO_UNIT,  0.1,  1e-9,  1.0, "ratio of the path constants, fast over slow element")         \
    PARAMETER(eps,    LENGTH,   1e-3, 1e-12, INF, "path constant")                                               \
    PARAMETER(Fn0,    "N",      1.0,  1e-12, INF, "normal force for which the parameters are valid")

#define IDENTIFIED                  \
    FIT    (f1, 1.5 * level, loops) \
    FIT    (f2, 0.5 * level, loops) \
    FIT    (eta, 0.3, loops)        \
    FIT    (eps, distance, loops)   \
    SLIDING(F_fast, f1)
/* clang-format on */

#define STEPS_BY step
#define REQUIRES opposing

#include "block.h"
#include "presliding.h"

static const char *opposing(const Model *m) { return m->order < 2.0 || m->f2 <= m->f1 ? NULL : "f2 <= f1"; }

/* Compute the derivatives and F from the inverse path constants of both elements. */
static void contact(Model *m, double per_fast, double per_slow)
{
    GIVEN(m)
    const double s = sign(v);
    m->der_F_fast = fabs(v) * (s * f1 - F_fast) * per_fast;
    m->der_F_slow = order == 2 ? fabs(v) * (-s * f2 - F_slow) * per_slow : 0.0;
    m->F = load_of(Fn, Fn0) * (order == 2 ? F_fast + F_slow : F_fast);
}

static double one_over_fast(const Model *m) { return 1.0 / (m->order == 2.0 ? m->eta * m->eps : m->eps); }

static void equations(Model *m) { contact(m, one_over_fast(m), 1.0 / m->eps); }

static bool step(Model *m, double h)
{
    GIVEN(m)
    const double dx = slide(m, h), u = fabs(dx), s = sign(dx);
    const double per_fast = one_over_fast(m), per_slow = 1.0 / eps;

    m->F_fast = relax(F_fast, s * f1, u * per_fast);
    if (order == 2)
        m->F_slow = relax(F_slow, -s * f2, u * per_slow);
    contact(m, per_fast, per_slow);
    m->run.outputs_done = true;
    return true;
}
