/* Quantiser: rounds to the nearest multiple of a step q, like an encoder or an analogue-to-digital converter.

   Widrow, Kollar: Quantization Noise, Cambridge University Press 2008 (the mid-tread uniform quantiser).

       y = q round(x / q),   halves away from zero;   y = x if q = 0

   Limits: no saturation and no hysteresis: a position at rest halfway between two multiples flickers with the last bit
   of x. The error is at most q/2. */

#define MODEL    Quantiser
#define SUMMARY  "Rounding to the nearest multiple of a step"
#define SOURCE   "Widrow, Kollar: Quantization Noise, 2008"
#define CITES    "WidrowKollar2008"
#define PORTRAIT "staircase"

/* clang-format off */
#define VARIABLES                                                            \
    INPUT    (x, LENGTH, 0.0,             "value to be measured")            \
    OUTPUT   (y, LENGTH,                  "measured value")                  \
    PARAMETER(q, LENGTH, 1e-6, 0.0, INF,  "quantisation step; 0: none, y = x")

#define IN_LOOP \
    SENSOR ()   \
    QUANTUM(q)
/* clang-format on */

#include "block.h"

static void equations(Model *m)
{
    GIVEN(m)
    m->y = q == 0.0 ? x : q * round(x / q);
}
