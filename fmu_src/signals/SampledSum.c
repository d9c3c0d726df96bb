/* SampledSum: the summing junction between sampled laws.

       y[k] = gain_1 u_1[k] + gain_2 u_2[k] + gain_3 u_3[k] + gain_4 u_4[k]

   Inputs that are not connected count as 0. Use it where the forces of two laws act on the input of a third one, in the
   same sample. With the block Sum, which is continuous, the third law would read the sum of the previous sample.

   Limits: inputs and output have no unit, so that a tool cannot check the units of the signals. Connect signals in the
   same unit. */

#define MODEL   SampledSum
#define SUMMARY "Weighted sum of up to four sampled signals, without a delay between laws"
#define SOURCE  "Franklin, Powell, Emami-Naeini: Feedback Control of Dynamic Systems, 8th ed., 2019"
#define CITES   "Franklin2019"

/* clang-format off */
#define VARIABLES                                                                                  \
    OPTIONAL  (u1,      NO_UNIT, 0.0,                              "first signal")                 \
    OPTIONAL  (u2,      NO_UNIT, 0.0,                              "second signal")                \
    OPTIONAL  (u3,      NO_UNIT, 0.0,                              "third signal")                 \
    OPTIONAL  (u4,      NO_UNIT, 0.0,                              "fourth signal")                \
    OUTPUT    (y,       NO_UNIT,                                   "sum")                          \
    FIXED     (Ts,      TIME, 1e-3, 1e-9, INF,                     "sample time")                  \
    PARAMETERS(gain, 4, NO_UNIT, (1.0, 1.0, 1.0, 1.0), -INF, INF,  "factor of each signal")
/* clang-format on */

#define SAMPLED

#include "block.h"

static void sample(Model *m)
{
    GIVEN(m)
    m->y = gain[0] * u1 + gain[1] * u2 + gain[2] * u3 + gain[3] * u4;
}
