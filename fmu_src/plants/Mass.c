/* Mass driven by forces, with an optional spring and damper to a support that may move.

   Newton's second law; the step is its exact solution for forces and a support velocity that are constant or linear
   in time over the communication step.

       m dv/dt = F_drive + F_load - F_friction
                 - k (x - x_support) - d (v - v_support)
       dx/dt = v,  dx_support/dt = v_support
       F_ext = sum of these forces except F_friction

   A friction model needs F_ext at rest. With k = d = 0, the support has no effect. */

#define MODEL   Mass
#define SUMMARY "{Mass} with an optional spring and damper to a moving support"
#define SOURCE  "Newton's second law"
#define CITES   "Newton1687"

/* clang-format off */
#define VARIABLES                                                                                       \
    INPUT       (F_drive,    FORCE,    0.0,              "driving " FORCE_NOUN)                         \
    OPTIONAL    (F_load,     FORCE,    0.0,              "further applied " FORCE_NOUN)                 \
    INPUT       (F_friction, FORCE,    0.0,              "friction " FORCE_NOUN ", opposes positive v") \
    OPTIONAL    (v_support,  VELOCITY, 0.0,              "velocity of the support")                     \
    STATE_OUTPUT(x,          LENGTH,   x0,  1.0,         "position")                                    \
    STATE_OUTPUT(v,          VELOCITY, v0,  1.0,         "velocity")                                    \
    STATE_OUTPUT(x_support,  LENGTH,   x_support0, 1.0,  "position of the support")                     \
    OUTPUT      (a,          ACCELERATION,               "acceleration")                                \
    OUTPUT      (F_ext,      FORCE,                      "sum of all " FORCE_NOUN "s except friction")  \
    PARAMETER   (m,          MASS,      1.0, 1e-12, INF, MASS_NOUN)                                     \
    PARAMETER   (k,          STIFFNESS, 0.0, 0.0,   INF, "stiffness of the spring to the support")      \
    PARAMETER   (d,          DAMPING,   0.0, 0.0,   INF, "damping to the support")                      \
    FIXED       (x0,         LENGTH,    0.0, -INF,  INF, "initial position")                            \
    FIXED       (v0,         VELOCITY,  0.0, -INF,  INF, "initial velocity")                            \
    FIXED       (x_support0, LENGTH,    0.0, -INF,  INF, "initial position of the support")
/* clang-format on */

#define STEPS_BY step
#define CACHE    Oscillator

#define LINEAR_STATES 3

#include "oscillator.h"
#include "ramp.h"
#include "block.h"

static void equations(Model *model)
{
    GIVEN(model)
    const double external = F_drive + F_load - k * (x - x_support) - d * (v - v_support);

    model->F_ext = external;
    model->a = (external - F_friction) / m;
    model->der_x = v;
    model->der_v = model->a;
    model->der_x_support = v_support;
}

static bool step(Model *model, double h)
{
    GIVEN(model)
    const double *const rate = model->slope;
    const double jerk =
        (rate[INPUT_F_drive] + rate[INPUT_F_load] - rate[INPUT_F_friction] + d * rate[INPUT_v_support]) / m;
    const double push =
        (F_drive + F_load - F_friction + d * v_support) / m; /* acceleration without spring and friction */

    if (k == 0.0 && d == 0.0) {
        model->x += path_with_jerk(v, push, jerk, h);
        model->v += path_after(push, jerk, h);
        model->x_support += path_after(v_support, rate[INPUT_v_support], h);
        return true;
    }
    /* y = (w x, v, w x_support) */
    Oscillator *const last = &model->cache;
    const bool renews = differs(last, m, k, d, h);
    const double w = last->w, A[] = {0.0, w, 0.0, -k / (m * w), -d / m, k / (m * w), 0.0, 0.0, 0.0};
    if (renews)
        exponential(A, h, &last->of);
    const double b[] = {0.0, push, w * v_support};
    const double c[] = {0.0, jerk, w * rate[INPUT_v_support]};
    double y[] = {w * x, v, w * x_support};
    linear_step(&last->of, b, c, y);
    model->x = y[0] / w;
    model->v = y[1];
    model->x_support = y[2] / w;
    return true;
}
