/* Flexible drive: motor and load, two masses connected by a spring and a damper, with friction on either side.

   Newton's second law; the usual model of a drive with a flexible transmission or frame, as in Munnig Schmidt,
   Schitter, Rankers, van Eijk: The Design of High Performance Mechatronics, 3rd ed. 2020.

       F_spring = k (x1 - x2) + d (v1 - v2)
       m1 dv1/dt = F_drive - F_spring - F_friction1,   dx1/dt = v1
       m2 dv2/dt = F_load  + F_spring - F_friction2,   dx2/dt = v2
       F_ext1 = F_drive - F_spring,   F_ext2 = F_load + F_spring

   F_ext1 and F_ext2 are the sums of all forces on a side except its friction; a friction model needs them at rest. The
   drive has a double integrator (the centre of mass) and, for k > 0, a resonance at w_r and, from F_drive to x1, an
   antiresonance at w_a:

       w_r = sqrt(k / mu),   mu = m1 m2 / (m1 + m2),   w_a = sqrt(k / m2)

   The step is the exact solution for forces that are constant or linear in time over it. The equations of the centre of
   mass and of the stretch q = x1 - x2 are decoupled, also for very stiff springs:

       (m1 + m2) d2X/dt2 = F1 + F2,   F1, F2 = external forces
       mu d2q/dt2 = mu (F1 / m1 - F2 / m2) - k q - d dq/dt

   Use it for an axis whose motor moves while the load still sticks, for feedback with a resonance in the loop, and to
   compare the effects of friction on the load and on the motor.

   Limits: linear spring without backlash, a single mode. F_spring contains the rounding error of the positions, 1e-16 k
   x1: 1e-8 N for k = 1e8 N/m at 1 m. A connected friction model holds its force over a step: the step must be short
   compared with the time constants of friction, or the master must iterate. */

#define MODEL   TwoMass
#define SUMMARY "Flexible drive: motor and load connected by a spring and a damper"
#define SOURCE  "Munnig Schmidt, Schitter, Rankers, van Eijk: The Design of High Performance Mechatronics, 2020"
#define CITES   "MunnigSchmidt2020"

/* clang-format off */
#define VARIABLES                                                                                                    \
    INPUT       (F_drive,     FORCE,    0.0,             FORCE_NOUN " of the drive, on the motor")                   \
    OPTIONAL    (F_load,      FORCE,    0.0,             FORCE_NOUN " on the load")                                  \
    OPTIONAL    (F_friction1, FORCE,    0.0,             "friction of the motor, opposes positive v1")               \
    OPTIONAL    (F_friction2, FORCE,    0.0,             "friction of the load, opposes positive v2")                \
    STATE_OUTPUT(x1,          LENGTH,   x1_0, 1.0,       "position of the motor")                                    \
    STATE_OUTPUT(v1,          VELOCITY, v1_0, 1.0,       "velocity of the motor")                                    \
    STATE_OUTPUT(x2,          LENGTH,   x2_0, 1.0,       "position of the load")                                     \
    STATE_OUTPUT(v2,          VELOCITY, v2_0, 1.0,       "velocity of the load")                                     \
    OUTPUT      (a1,          ACCELERATION,              "acceleration of the motor")                                \
    OUTPUT      (a2,          ACCELERATION,              "acceleration of the load")                                 \
    OUTPUT      (F_spring,    FORCE,                     FORCE_NOUN " of spring and damper, pulls the load forward") \
    OUTPUT      (F_ext1,      FORCE,                     "sum of all " FORCE_NOUN "s on the motor except friction")  \
    OUTPUT      (F_ext2,      FORCE,                     "sum of all " FORCE_NOUN "s on the load except friction")   \
    PARAMETER   (m1,          MASS,      0.5, 1e-12, INF, MASS_NOUN " of the motor")                                 \
    PARAMETER   (m2,          MASS,      0.5, 1e-12, INF, MASS_NOUN " of the load")                                  \
    PARAMETER   (k,           STIFFNESS, 1e5, 0.0,   INF, "stiffness of the transmission")                           \
    PARAMETER   (d,           DAMPING,   5.0, 0.0,   INF, "damping of the transmission")                             \
    FIXED       (x1_0,        LENGTH,    0.0, -INF,  INF, "initial position of the motor")                           \
    FIXED       (v1_0,        VELOCITY,  0.0, -INF,  INF, "initial velocity of the motor")                           \
    FIXED       (x2_0,        LENGTH,    0.0, -INF,  INF, "initial position of the load")                            \
    FIXED       (v2_0,        VELOCITY,  0.0, -INF,  INF, "initial velocity of the load")
/* clang-format on */

#define STEPS_BY step
#define CACHE    Oscillator

#include "oscillator.h"
#include "ramp.h"
#include "block.h"

static void equations(Model *m)
{
    GIVEN(m)
    m->F_spring = k * (x1 - x2) + d * (v1 - v2);
    m->F_ext1 = F_drive - m->F_spring;
    m->F_ext2 = F_load + m->F_spring;
    m->a1 = (m->F_ext1 - F_friction1) / m1;
    m->a2 = (m->F_ext2 - F_friction2) / m2;
    m->der_x1 = v1;
    m->der_v1 = m->a1;
    m->der_x2 = v2;
    m->der_v2 = m->a2;
}

static bool step(Model *m, double h)
{
    GIVEN(m)
    const double share1 = m1 / (m1 + m2), share2 = m2 / (m1 + m2), mu = m1 * share2;
    const double F1 = F_drive - F_friction1, F1_rate = SLOPE(F_drive) - SLOPE(F_friction1);
    const double F2 = F_load - F_friction2, F2_rate = SLOPE(F_load) - SLOPE(F_friction2);

    /* centre of mass */
    const double a = (F1 + F2) / (m1 + m2), jerk = (F1_rate + F2_rate) / (m1 + m2);
    const double V = share1 * v1 + share2 * v2, V_end = V + path_after(a, jerk, h);
    const double dX = path_with_jerk(V, a, jerk, h);

    /* stretch; mu/m1 = share2 and mu/m2 = share1 */
    double q = x1 - x2, q_dot = v1 - v2;
    oscillate(&m->cache, &q, &q_dot, mu, k, d, share2 * F1 - share1 * F2, share2 * F1_rate - share1 * F2_rate, h);

    const double dq = q - (x1 - x2);
    m->x1 += dX + share2 * dq;
    m->x2 += dX - share1 * dq;
    m->v1 = V_end + share2 * q_dot;
    m->v2 = V_end - share1 * q_dot;
    return true;
}
