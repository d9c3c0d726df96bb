/* Quantiser: rounds to the nearest multiple of a step q, like an encoder or an analogue-to-digital converter.

   Widrow, Kollar: Quantization Noise, Cambridge University Press 2008 (the mid-tread uniform quantiser).

       y = q round(x / q),   halves away from zero;   y = x if q = 0

   Limits: no saturation and no hysteresis: a position at rest halfway between two multiples flickers with the last bit
   of x. The error is at most q/2. */

#define MODEL   Quantiser
#define SUMMARY "Rounding to the nearest multiple of a step"
#define SOURCE  "Widrow, Kollar: Quantization Noise, 2008"
#define CITES   "WidrowKollar2008"

/* clang-format off */
#define VARIABLES                                                            \
    INPUT    (x, LENGTH, 0.0,             "value to be measured")            \
    OUTPUT   (y, LENGTH,                  "measured value")                  \
    PARAMETER(q, LENGTH, 1e-6, 0.0, INF,  "quantisation step; 0: none, y = x")
/* clang-format on */

#define EVENTS     2
#define DECIDES_BY transition
#define MEMORY     struct level
#define VALID_BY   is_level
#define KEEPS_BY   keep_decisions

#include <math.h>
#include <stdbool.h>

struct level {
    double number; /* of the step in model exchange */
};

#include "block.h"

static bool is_level(const Model *m)
{
    return isfinite(m->memory.number) && m->memory.number == floor(m->memory.number);
}

static void equations(Model *m)
{
    GIVEN(m)
    m->y = q == 0.0 ? x : q * (m->run.frozen ? m->memory.number : round(x / q));
}

/* The step ends just beyond its edges: noise of a solver at an edge is not motion. */
static void indicators(const Model *m, double *left)
{
    const double place = m->q == 0.0 ? 0.0 : m->x / m->q - m->memory.number;
    left[0] = 0.5 + 1e-9 - place;
    left[1] = 0.5 + 1e-9 + place;
}

static void transition(Model *m)
{
    if (m->q != 0.0 && fabs(m->x / m->q - m->memory.number) >= 0.5)
        m->memory.number = round(m->x / m->q);
}
