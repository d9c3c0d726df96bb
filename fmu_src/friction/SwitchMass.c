/* A mass on a belt with friction by the switch model of Leine: smooth equations for slip, transition and stick.

   Leine, Van Campen, De Kraker, Van den Steen: Nonlinear Dynamics 16, 1998. A mass m is held by a spring k and dragged
   by a belt with the velocity v_belt. A narrow band |v_r| <= eta of the relative velocity v_r = v - v_belt and the
   force P that is needed for sticking select the equation:

       P = F_load - k x - m dv_belt/dt
       slip:        |v_r| >  eta
                    F = load Fs sign(v_r) (ratio + (1 - ratio) / (1 + delta |v_r|))
       transition:  |v_r| <= eta and |P| > load Fs
                    F = load Fs sign(P)
       stick:       |v_r| <= eta and |P| <= load Fs
                    F = P + m v_r sqrt(k/m)
       m dv/dt = F_load - k x - F;  dx/dt = v, in stick dx/dt = v_belt
       load = max(Fn, 0) / Fn0

   In stick, the relative velocity decays to zero at the rate sqrt(k/m), dv/dt = dv_belt/dt - v_r sqrt(k/m); setting it
   to zero would cause a drift of x. The paper has ratio = 0, a belt with constant velocity and no F_load. This block
   adds the acceleration of the belt in P, and ratio, the fraction of friction that does not decrease with speed.

   Stick is stepped in closed form, slip and transition are integrated with error control, and the switching points are
   located inside the step.

   Use it to study stick-slip vibration and its bifurcations without smoothing and without stiff equations.

   Limits: errors are of first order in eta, or of order sqrt(eta) if friction drops abruptly (very large delta). The
   period of the oscillator in the paper is 12.0627 s, 12.0040 s and 12.00114 s for eta = 1e-2, 1e-3 and 1e-4 m/s, and
   12.00103 s for an ideal switch. eta must be small compared with v_belt. The block contains the mass and a single
   contact. No presliding. */

#define MODEL       SwitchMass
#define SUMMARY     "Mass, spring and belt with the switch model of friction by Leine"
#define SOURCE      "Leine, Van Campen, De Kraker, Van den Steen, Nonlinear Dynamics 16, 1998"
#define CITES       "Leine1998"
#define STATUS      "equations from memory of the paper"
#define FEATURES    "drift-free, Stribeck, rate dependent, mass inside"
#define NO_EXCHANGE "at rest on the belt it follows the belt's acceleration, which model exchange does not give"
#define PORTRAIT    "stick_slip"

/* clang-format off */
#define VARIABLES                                                                                              \
    INPUT       (v_belt, VELOCITY, 0.2,              "velocity of the belt")                                   \
    OPTIONAL    (F_load, FORCE,    0.0,              "further applied " FORCE_NOUN)                            \
    OPTIONAL    (Fn,     "N",      1.0,              "normal force")                                           \
    STATE_OUTPUT(x,      LENGTH,   x0,    1.0,       "position")                                               \
    STATE_OUTPUT(v,      VELOCITY, v0,    1.0,       "velocity")                                               \
    OUTPUT      (F,      FORCE,                      "friction " FORCE_NOUN ", opposes the relative velocity") \
    LOCAL       (v_r,    VELOCITY,                   "relative velocity, v - v_belt")                          \
    FLAG        (stuck,                              "the stick equation is active")                           \
    FLAG        (slipping,                           "the slip equation is active; neither: transition")       \
    PARAMETER   (m,      MASS,      1.0,  1e-12, INF, MASS_NOUN)                                               \
    PARAMETER   (k,      STIFFNESS, 1.0,  1e-12, INF, "stiffness of the spring to the ground")                 \
    PARAMETER   (Fs,     FORCE,     1.0,  0.0,   INF, "static friction at Fn0")                                \
    PARAMETER   (delta,  "s/" LENGTH, 3.0, 0.0,  INF, "decrease of friction with the relative velocity")       \
    PARAMETER   (ratio,  NO_UNIT,   0.0,  0.0,   1.0, "ratio of friction at high speed to static friction")    \
    PARAMETER   (eta,    VELOCITY,  1e-6, 1e-12, INF, "half width of the relative-velocity band")              \
    PARAMETER   (Fn0,    "N",       1.0,  1e-12, INF, "normal force for which the parameters are valid")       \
    FIXED       (x0,     LENGTH,    0.0,  -INF,  INF, "initial position")                                      \
    FIXED       (v0,     VELOCITY,  0.2,  -INF,  INF, "initial velocity")
/* clang-format on */

enum phase { BY_STATE, STICK, TRANSITION, SLIP };

/* The active equation is a function of the state, but fixed while a step searches for the end of its validity. */
struct fixed {
    int phase;
    double s; /* direction of slip or of the required force */
};

#define STEPS_BY step
#define MEMORY   struct fixed
#define VALID_BY is_by_state

#include "block.h"
#include "load.h"

/* Return whether the state selects the equation, as is the case between two steps. */
static bool is_by_state(const Model *model) { return model->memory.phase == BY_STATE && model->memory.s == 0.0; }

static double static_friction(const Model *model) { return load_of(model->Fn, model->Fn0) * model->Fs; }

/* Return P, the friction force with which the mass follows the belt. */
static double needed(const Model *model)
{
    GIVEN(model)
    return F_load - k * x - m * model->slope[INPUT_v_belt];
}

static struct fixed by_state(const Model *model)
{
    const double v_r = model->v - model->v_belt, P = needed(model);
    if (fabs(v_r) > model->eta)
        return (struct fixed){SLIP, sign(v_r)};
    return fabs(P) > static_friction(model) ? (struct fixed){TRANSITION, sign(P)} : (struct fixed){STICK, 0.0};
}

static void equations(Model *model)
{
    GIVEN(model)
    const struct fixed now = model->memory.phase == BY_STATE ? by_state(model) : model->memory;
    const double slip = v - v_belt, level = static_friction(model);

    model->v_r = slip;
    model->stuck = now.phase == STICK ? 1.0 : 0.0;
    model->slipping = now.phase == SLIP ? 1.0 : 0.0;
    if (now.phase == SLIP)
        model->F = now.s * level * (ratio + (1.0 - ratio) / (1.0 + delta * fabs(slip)));
    else if (now.phase == TRANSITION)
        model->F = now.s * level;
    else
        model->F = needed(model) + m * slip * sqrt(k / m);
    model->der_x = now.phase == STICK ? v_belt : v;
    model->der_v = (F_load - k * x - model->F) / m;
}

#include "SwitchMass_ramp.h"
