/* Direct-current motor behind a pulse-width modulator, without the inductance of its winding.

       F = on K (clip(duty, -1, 1) U - K v) / R

   U is the supply voltage, K the force or torque per current and the voltage per velocity, R the resistance of winding
   and bridge. While the motor is switched on, K^2/R brakes like viscous friction. With on = 0 no current flows.

   Use it for servos that turn a position error into a duty cycle, and for axes whose log shows a voltage. With a gear,
   K is that of the motor times the ratio.

   Limits: the current follows the voltage at once; no limit of the current, no heating. */

#define MODEL   DCMotor
#define SUMMARY "{Force} of a direct-current motor from duty cycle and supply voltage"
#define SOURCE  "Ellis: Control System Design Guide, 4th ed., 2012"
#define CITES   "Ellis2012"

/* clang-format off */
#define VARIABLES                                                                                              \
    INPUT    (duty, NO_UNIT,  0.0,              "duty cycle; beyond +-1 it is limited")                        \
    OPTIONAL (U,    "V",      12.0,             "supply voltage")                                              \
    INPUT    (v,    VELOCITY, 0.0,              "velocity")                                                    \
    OPTIONAL (on,   NO_UNIT,  1.0,              "1 if the motor is switched on, 0 if not")                     \
    OUTPUT   (F,    FORCE,                      FORCE_NOUN " of the motor")                                    \
    OUTPUT   (i,    "A",                        "current")                                                     \
    PARAMETER(K,    PER_AMPERE, 1.0, 1e-12, INF, FORCE_NOUN " per current, and voltage per velocity")           \
    PARAMETER(R,    "Ohm", 1.0, 1e-12, INF, "resistance")
/* clang-format on */

#include "block.h"

static void equations(Model *m)
{
    GIVEN(m)
    m->i = on * (clip(duty, -1.0, 1.0) * U - K * v) / R;
    m->F = K * m->i;
}
