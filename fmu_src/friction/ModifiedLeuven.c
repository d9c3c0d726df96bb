/* Modified Leuven model: a hysteresis force of Maxwell slip elements whose deflection z relaxes to the Stribeck level.
   Presliding hysteresis with nonlocal memory, continuous where the force of Leuven jumps.

   Lampaert, Swevers, Al-Bender: Modification of the Leuven integrated friction model structure, IEEE TAC 47(4), 2002.

       S(v)  = sgn(v) (Fc + (Fs - Fc) exp(-|v/vs|^delta))
       Fh    = F1 + ... + FN
       dz/dt = v (1 - sgn(r) |r|^n),   r = Fh / S(v)
       dFi/dt = 0 if |Fi| = Wi and Fi dz/dt > 0, else ki dz/dt
       F     = (Fh + sigma1 dz/dt) max(Fn, 0) / Fn0 + sigma2 v

   Fi is the force at the normal force Fn0; an initial force beyond Wi is limited to Wi. z reverses without a sign
   change of v if S(v) decreases below Fh, for example while the contact accelerates through the Stribeck velocity; the
   elements then unload with their full stiffness. For n to infinity and constant S, this is the Maxwell slip model.

   W1 + ... + WN must be at least Fs and Fc. Otherwise, Fh is limited to this sum below S(v), z grows without bound in
   steady sliding, and a warning is logged.

   Start values: Table I of the LuGre paper for sigma1, sigma2 and the Stribeck curve, with elements that approximate
   its stiffness, and n = 2 (specific to this library).

   The equations are solved between the points at which an element starts to slip or z reverses, which are located: in
   closed form for constant v and n = 1 or 2, otherwise to the tolerance.

   Use it in place of Leuven for presliding with memory of all reversal points, and sliding, in one model without stacks
   and jumps. It needs the Stribeck curve, elements as for MaxwellSlip whose sum reaches the curve, and n.

   Limits: F jumps with v, through sigma1. With small n, loops do not close, and the contact drifts. */

#define MODEL    ModifiedLeuven
#define SUMMARY  "Modified Leuven model: Maxwell slip hysteresis that relaxes to the Stribeck curve"
#define SOURCE   "Lampaert, Swevers, Al-Bender, IEEE TAC 47(4), 2002"
#define CITES    "Lampaert2002"
#define STATUS   "not checked against the paper"
#define FEATURES "presliding, nonlocal memory, Stribeck, lag, rate dependent"

/* clang-format off */
#define VARIABLES                                                                                          \
    INPUT     (v,        VELOCITY, 0.0,              "relative sliding velocity")                          \
    OPTIONAL  (Fn,       "N",      1.0,              "normal force")                                       \
    OUTPUT    (F,        FORCE,                      "friction " FORCE_NOUN ", opposes v")                 \
    LOCAL     (Fh,       FORCE,                      "hysteresis " FORCE_NOUN " at the normal force Fn0")  \
    FLAGS     (slipping, 10,                         "the element slips")                                  \
    STATE     (z,        LENGTH,   0.0,   1e-5,      "mean deflection")                                    \
    STATES    (Fi,       10, FORCE, (0.0), 0.1,      FORCE_NOUN " of the element at the normal force Fn0") \
    COUNT     (N,        10,       1,     10,        "number of elements")                                 \
    PARAMETERS(k,        10, STIFFNESS, (28e3, 15e3, 10e3, 8e3, 6.5e3, 5.3e3, 4.3e3, 3.5e3, 2.8e3, 2.1e3), \
                                   0.0, INF,         "stiffness of the element")                           \
    PARAMETERS(W,        10, FORCE, (0.15, 0.15, 0.15, 0.15, 0.15, 0.15, 0.15, 0.15, 0.15, 0.15),          \
                                   0.0, INF,         FORCE_NOUN " at which the element slips")             \
    PARAMETER (n,        NO_UNIT,  2.0,   0.1,   1e4, "sharpness of the transition to sliding")            \
    PARAMETER (sigma1,   DAMPING,  316.22776601683796, 0.0, INF, "bristle damping")                        \
    PARAMETER (sigma2,   DAMPING,  0.4,   0.0,   INF, "viscous coefficient")                               \
    PARAMETER (Fc,       FORCE,    1.0,   1e-9,  INF, "Coulomb friction")                                  \
    PARAMETER (Fs,       FORCE,    1.5,   1e-9,  INF, "static friction (usually above Fc)")                  \
    PARAMETER (vs,       VELOCITY, 1e-3,  1e-12, INF, "Stribeck velocity")                                 \
    PARAMETER (delta,    NO_UNIT,  2.0,   1e-3,  100.0, "Stribeck exponent")                               \
    PARAMETER (Fn0,      "N",      1.0,   1e-12, INF, "normal force for which the parameters are valid")

#define CONTACT               \
    COULOMB  (Fc)             \
    STATIC   (Fs)             \
    STRIBECK (vs, delta)      \
    VISCOUS  (sigma2)         \
    STIFFNESS(sum(k))         \
    DAMPING  (sigma1, sigma2)

/* n and the elements are correlated in a record */
#define IDENTIFIED METHOD(none)
/* clang-format on */

#define STEPS_BY   step
#define EVENTS     10
#define DECIDES_BY transition
#define MEMORY     struct slip_memory
#define VALID_BY   is_slip_memory
#define KEEPS_BY   keep_decisions
#define WARNING    "the sum of W is below Fs or Fc, so the force cannot reach the Stribeck curve; increase W"

struct slip_memory {
    double slips[10]; /* in model exchange: direction in which the element slips, or 0 */
};

#include "block.h"
#define SLIPS(m, i) ((m)->memory.slips[i] != 0.0)
#include "modified_leuven.h"
#include "slip.h"

static bool is_slip_memory(const Model *m) { return are_directions(m->memory.slips, 10); }

static double slow(const Model *m) { return 1e-9 * m->vs; }

static void indicators(const Model *m, double *left)
{
    for (int i = 0; i < 10; i++)
        left[i] = i < m->N ? slip_indicator(m->memory.slips[i], m->der_z, slow(m), m->Fi[i], m->W[i]) : 1.0;
}

static void transition(Model *m)
{
    equations(m); /* elements follow the rate of z */
    for (int i = 0; i < m->N; i++)
        m->memory.slips[i] = slip_after(m->memory.slips[i], m->der_z, slow(m), m->Fi[i], m->W[i]);
}
