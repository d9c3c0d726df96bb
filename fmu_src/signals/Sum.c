/* Sum: the summing junction of a block diagram, for up to four signals of one quantity.

       y = gain_1 u_1 + gain_2 u_2 + gain_3 u_3 + gain_4 u_4

   Inputs that are not connected count as 0. Use it for forces on a mass, or to add measurement noise to a signal; use
   SampledSum where two sampled laws act on a third one.

   Limits: inputs and output have no unit, so that a tool cannot check the units of the signals. Connect signals in the
   same unit. */

#define MODEL   Sum
#define SUMMARY "Weighted sum of up to four signals"
#define SOURCE  "Franklin, Powell, Emami-Naeini: Feedback Control of Dynamic Systems, 8th ed., 2019"
#define CITES   "Franklin2019"

/* clang-format off */
#define VARIABLES                                                                                  \
    OPTIONAL  (u1,      NO_UNIT, 0.0,                              "first signal")                 \
    OPTIONAL  (u2,      NO_UNIT, 0.0,                              "second signal")                \
    OPTIONAL  (u3,      NO_UNIT, 0.0,                              "third signal")                 \
    OPTIONAL  (u4,      NO_UNIT, 0.0,                              "fourth signal")                \
    OUTPUT    (y,       NO_UNIT,                                   "sum")                          \
    PARAMETERS(gain, 4, NO_UNIT, (1.0, 1.0, 1.0, 1.0), -INF, INF,  "factor of each signal")
/* clang-format on */

#include "block.h"

static void equations(Model *m)
{
    GIVEN(m)
    m->y = gain[0] * u1 + gain[1] * u2 + gain[2] * u3 + gain[3] * u4;
}
