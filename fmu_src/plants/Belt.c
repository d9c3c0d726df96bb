/* Mass on a moving belt, connected to the wall by a spring and a damper: the textbook stick-slip experiment.

   Newton's second law; experiment as in Leine, van Campen, de Kraker, van den Steen: Stick-slip vibrations induced by
   alternate friction models, Nonlinear Dynamics 16, 1998.

       m dv/dt = F_load - k x - d v - F_friction,   dx/dt = v
       v_rel = v - v_belt
       F_ext = F_load - k x - d v - m a_belt

   v_rel is the velocity of the mass relative to the belt. Connect it to the input v of a friction model, whose force
   F_friction opposes v_rel, so that a faster belt pulls the mass along. F_ext is the force that friction must balance
   for the mass to move with the belt: all other forces on the mass and, if the belt accelerates, its inertia. a_belt is
   used only for F_ext and must be the derivative of v_belt. For a belt at constant speed, set the value of v_belt
   without a connection.

   The step is the exact solution for forces that are constant or linear in time over it; v_rel follows from v and
   v_belt.

   Use it to compare friction models in stick-slip, with friction as a separate block; set v0 = v_belt to begin stuck.

   Limits: the belt has no inertia, its drive is ideal, and the wall does not move. A connected friction model holds its
   force over a step: the step must be short compared with the time constants of friction, or the master must
   iterate. */

#define MODEL   Belt
#define SUMMARY "{Mass} on a moving belt, with a spring and a damper to the wall"
#define SOURCE  "Leine, van Campen, de Kraker, van den Steen, Nonlinear Dynamics 16, 1998"
#define CITES   "Leine1998"

/* clang-format off */
#define VARIABLES                                                                                                            \
    INPUT       (F_friction, FORCE,    0.0,              "friction " FORCE_NOUN ", opposes positive v_rel")                  \
    OPTIONAL    (v_belt,     VELOCITY, 0.1,              "velocity of the belt")                                             \
    OPTIONAL    (a_belt,     ACCELERATION, 0.0,          "acceleration of the belt, for F_ext")                              \
    OPTIONAL    (F_load,     FORCE,    0.0,              "further applied " FORCE_NOUN)                                      \
    STATE_OUTPUT(x,          LENGTH,   x0,  1.0,         "position; 0: the spring is relaxed")                               \
    STATE_OUTPUT(v,          VELOCITY, v0,  1.0,         "velocity")                                                         \
    OUTPUT      (v_rel,      VELOCITY,                   "velocity of the " MASS_NOUN " relative to the belt")               \
    OUTPUT      (a,          ACCELERATION,               "acceleration")                                                     \
    OUTPUT      (F_spring,   FORCE,                      FORCE_NOUN " of spring and damper on the wall")                     \
    OUTPUT      (F_ext,      FORCE,                      "friction " FORCE_NOUN " if the " MASS_NOUN " moves with the belt") \
    PARAMETER   (m,          MASS,      1.0, 1e-12, INF, MASS_NOUN)                                                          \
    PARAMETER   (k,          STIFFNESS, 2.0, 0.0,   INF, "stiffness of the spring to the wall")                              \
    PARAMETER   (d,          DAMPING,   0.0, 0.0,   INF, "damping to the wall")                                              \
    FIXED       (x0,         LENGTH,    0.0, -INF,  INF, "initial position")                                                 \
    FIXED       (v0,         VELOCITY,  0.0, -INF,  INF, "initial velocity")
/* clang-format on */

#define STEPS_BY step
#define CACHE    Oscillator

#include "oscillator.h"
#include "block.h"

static void equations(Model *model)
{
    GIVEN(model)
    model->F_spring = k * x + d * v;
    model->F_ext = F_load - model->F_spring - m * a_belt;
    model->v_rel = v - v_belt;
    model->a = (F_load - model->F_spring - F_friction) / m;
    model->der_x = v;
    model->der_v = model->a;
}

static bool step(Model *m, double h)
{
    oscillate(&m->cache, &m->x, &m->v, m->m, m->k, m->d, m->F_load - m->F_friction, SLOPE(F_load) - SLOPE(F_friction),
              h);
    return true;
}
