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
#define SUMMARY     "{Mass}, spring and belt with the switch model of friction by Leine"
#define SOURCE      "Leine, Van Campen, De Kraker, Van den Steen, Nonlinear Dynamics 16, 1998"
#define CITES       "Leine1998"
#define STATUS      "not checked against the paper"
#define FEATURES    "drift-free, Stribeck, rate dependent, mass inside"
#define NO_EXCHANGE "at rest on the belt it follows the belt's acceleration, which model exchange does not give"

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
#include "ramp.h"
#include "roots.h"
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

/* ---- Steps: stick in closed form, slip and transition by integration up to the next switching point. */

/* ---- stick -------------------------------------------------------------------------------------------------- */

/* Return the first time at which a t^2 + b t + c, which is not positive at 0, becomes positive, or INF. */
static double rises(double a, double b, double c)
{
    if (c >= 0.0) /* positive at most by rounding */
        return b > 0.0 || (b == 0.0 && a > 0.0) ? 0.0 : a > 0.0 ? -b / a : INF;
    const double root = squared_speed_after(-c, b, 2.0 * a);
    if (root < 0.0 || (a <= 0.0 && b <= 0.0))
        return INF;
    return b > 0.0 ? time_between(-c, b, sqrt(root)) : (sqrt(root) - b) / (2.0 * a);
}

/* Stick for at most h; return the time after which the required force exceeds Fs in the direction s, or h. */
static double stick(Model *model, double h, double *s)
{
    GIVEN(model)
    const double b = model->slope[INPUT_v_belt], P = needed(model), level = static_friction(model);
    const double P_rate = model->slope[INPUT_F_load] - k * v_belt;
    const double Fn_rate = model->slope[INPUT_Fn];
    const double level_rate = Fn > 0.0 || (Fn == 0.0 && Fn_rate > 0.0) ? Fn_rate / Fn0 * Fs : 0.0;

    double t = h;
    *s = 0.0;
    for (int i = 0; i < 2; i++) {
        const double direction = i == 0 ? -1.0 : 1.0;
        const double until = rises(-0.5 * direction * k * b, direction * P_rate - level_rate, direction * P - level);
        if (until < t) {
            t = until;
            *s = direction;
        }
    }
    model->x += path_after(v_belt, b, t);
    model->v = v_belt + t * b + (v - v_belt) * exp(-sqrt(k / m) * t);
    return t;
}

/* ---- slip and transition ------------------------------------------------------------------------------------ */

/* Return a positive value once the equation is no longer valid: slip ends at the band; transition ends when the band is
   left or the required force has decreased to Fs (`*inside`). */
static double invalid(const Model *model, bool *inside)
{
    const double s = model->memory.s, beyond = s * (model->v - model->v_belt) - model->eta;
    *inside = false;
    if (model->memory.phase == SLIP)
        return -beyond;
    const double held = static_friction(model) - s * needed(model);
    *inside = held > 0.0 && beyond <= 0.0;
    return held > 0.0 ? held : beyond;
}

/* Return the validity of the equation at the state y, at the time t after the inputs of `at`. */
static double invalid_at(const Model *at, Model *work, double t, const double *y, bool *inside)
{
    inputs_after(at, work, t);
    set_states(work, y);
    return invalid(work, inside);
}

/* Return the rate at which slip approaches the band. */
static double approach(const Model *at, Model *work, double t, const double *y)
{
    double f[ALL_STATES];
    derivatives(at, work, t, y, f);
    return -at->memory.s * (f[1] - at->slope[INPUT_v_belt]);
}

/* End the inner step from (s, y), initially of size *t, where the equation ceases to be valid: false position with
   halved weights on the size of the step. */
static void locate(const Model *at, Model *work, double s, const double *y, double *t, double *y_end, bool *inside)
{
    const double nominal[ALL_STATES] = {1.0, 1.0}, resolution = 1e-14 * *t;
    bool inside_trial;
    double y_trial[ALL_STATES];
    const double f_begin = invalid_at(at, work, s, y, &inside_trial),
                 f_end = invalid_at(at, work, s + *t, y_end, inside);
    /* nonnegative at the beginning only by rounding */
    Bracket b = {0.0, *t, f_begin >= 0.0 ? -f_end : f_begin, f_end, 0};
    for (int i = 0; i < 100 && b.high - b.low > resolution; i++) {
        const double trial = kept_inside(secant(b.low, b.f_low, b.high, b.f_high), b.low, b.high);
        if (!(trial > b.low && trial < b.high) || rodas_step(at, work, s, trial, y, y_trial, nominal, 1.0) < 0.0)
            break;
        const double f = invalid_at(at, work, s + trial, y_trial, &inside_trial);
        narrow(&b, trial, f, f >= 0.0);
        if (f >= 0.0) {
            *inside = inside_trial;
            for (int j = 0; j < ALL_STATES; j++)
                y_end[j] = y_trial[j];
        }
        if (f == 0.0)
            break;
    }
    *t = b.high;
}

/* Integrate the equation until it is no longer valid, for at most h; return the elapsed time, or -1 if this fails or
   takes more inner steps than are left. */
static double slide(Model *model, double h, long *left, bool *ended, bool *inside)
{
    const double nominal[ALL_STATES] = {1.0, 1.0};
    const double tolerance = model->run.tolerance > 0.0 ? model->run.tolerance : 0.03 * DEFAULT_TOLERANCE;
    Model work = *model;
    double y[ALL_STATES], y_new[ALL_STATES], s = 0.0;
    RodasSize size = {.size = model->run.inner_step > 0.0 ? model->run.inner_step : 1e-3 * h};
    get_states(model, y);
    *ended = *inside = false;
    while (s < h && !*ended) {
        rodas_try(&size, s, h);
        double t = size.taken;
        const double error = rodas_step(model, &work, s, t, y, y_new, nominal, tolerance);
        if (--*left < 0)
            return -1.0;
        if (!rodas_accepts(&size, error)) {
            if (size.size < 1e-15 * h)
                return -1.0;
            continue;
        }
        *ended = invalid_at(model, &work, s + t, y_new, inside) > 0.0;
        if (model->memory.phase == SLIP && !*ended) {
            /* if the band may be reached and left again in between, end the step where slip is closest to it */
            bool unused;
            const double distance = -invalid_at(model, &work, s, y, &unused);
            const double begin = approach(model, &work, s, y);
            double end = approach(model, &work, s + t, y_new);
            for (int i = 0; i < 4 && begin * t > distance && end < 0.0 && t > 1e-12 * h && !*ended; i++) {
                t *= begin / (begin - end);
                if (rodas_step(model, &work, s, t, y, y_new, nominal, 1.0) < 0.0)
                    return -1.0;
                *ended = invalid_at(model, &work, s + t, y_new, inside) > 0.0;
                end = approach(model, &work, s + t, y_new);
            }
        }
        if (*ended)
            locate(model, &work, s, y, &t, y_new, inside);
        s = size.last && t == h - s ? h : s + t;
        for (int i = 0; i < ALL_STATES; i++)
            y[i] = y_new[i];
    }
    model->run.inner_step = size.size;
    set_states(model, y);
    return fmin(s, h);
}

/* Return the velocity at the edge of the band: within it, or just outside. */
static double at_edge(double v_belt, double s, double eta, bool outside)
{
    double v = v_belt + s * eta;
    while (outside ? fabs(v - v_belt) <= eta : fabs(v - v_belt) > eta)
        v = nextafter(v, outside ? s * INF : v_belt);
    return v;
}

static bool step(Model *model, double h)
{
    enum { MOST_SWITCHES = 1000 };
    const Model begin = *model;
    double rest = h;
    long inner_steps = MOST_TRIES;
    int switches = 0;
    model->memory = by_state(model);
    while (rest > 0.0 && switches++ < MOST_SWITCHES) {
        struct fixed *const now = &model->memory;
        bool ended = false, inside = false;
        double s = now->s;
        const double t =
            now->phase == STICK ? stick(model, rest, &s) : slide(model, rest, &inner_steps, &ended, &inside);
        if (!(t >= 0.0))
            return inner_steps < 0 ? too_much(model) : false;
        move_inputs(model, t);
        rest -= t;

        if (now->phase == STICK && s != 0.0) {
            *now = (struct fixed){TRANSITION, s};
        } else if (now->phase == SLIP && ended) {
            model->v = at_edge(model->v_belt, s, model->eta, false);
            *now = by_state(model);
        } else if (ended && inside) {
            *now = (struct fixed){STICK, 0.0};
        } else if (ended) {
            model->v = at_edge(model->v_belt, s, model->eta, true);
            *now = (struct fixed){SLIP, s};
        }
    }
    for (int i = 0; i < INPUTS; i++) /* the caller advances the inputs */
        *value_of(model, inputs[i]) = ((const double *)(const void *)&begin)[inputs[i]];
    model->memory = begin.memory;
    return rest <= 0.0 ? true : too_much(model);
}
