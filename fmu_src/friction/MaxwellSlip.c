/* Maxwell slip: parallel elastic, perfectly plastic elements. Rate-independent hysteresis in the position with memory
   of all relevant reversal points.

   Iwan: A distributed-element model for hysteresis and its steady-state dynamic response, Journal of Applied Mechanics
   33(4), 1966; also known from Lazan: Damping of Materials and Members, 1968.

       dFi/dt = 0 if |Fi| = Wi and Fi v > 0, else ki v,   i = 1 ... N
       F      = (F1 + ... + FN) max(Fn, 0) / Fn0

   Between two sign changes of v, the step Fi -> clip(Fi + ki dx, -Wi, Wi) is exact for any length. An initial force
   beyond Wi is limited to Wi. Fi is the force at the normal force Fn0.

   From rest, F follows the virgin curve f(x) = sum min(ki x, Wi). After a reversal at (x_A, F_A), it follows F_A - 2
   f((x_A - x)/2) (Masing) until it meets an earlier reversal point; the loop in between is then erased (wiping-out). A
   loop with the amplitude a dissipates sum 4 Wi max(a - Wi/ki, 0).

   The start values are specific to this library: elements with equal Wi that best approximate the curve 1 N (1 - exp(-x
   / 10 um)), which is the Dahl model with Fc and sigma0 of Table I of the LuGre paper.

   Use it for presliding hysteresis, for example in guideways and piezo stages, and as a reference for other models. It
   needs the virgin curve, or half a loop, which the elements approximate by a polygon.

   Limits: no Stribeck effect, no lag, no viscous friction (add a Viscous block); one kink per element. */

#define MODEL    MaxwellSlip
#define SUMMARY  "Maxwell slip: N elastic, perfectly plastic elements in parallel"
#define SOURCE   "Iwan, Journal of Applied Mechanics 33(4), 1966"
#define CITES    "Iwan1966"
#define STATUS   "not checked against the paper"
#define FEATURES "presliding, nonlocal memory, drift-free"

/* clang-format off */
#define VARIABLES                                                                                          \
    INPUT     (v,        VELOCITY, 0.0,              "relative sliding velocity")                          \
    OPTIONAL  (Fn,       "N",      1.0,              "normal force")                                       \
    OUTPUT    (F,        FORCE,                      "friction " FORCE_NOUN ", opposes v")                 \
    FLAGS     (slipping, 10,                         "the element slips")                                  \
    STATES    (Fi,       10, FORCE, (0.0), 0.1,      FORCE_NOUN " of the element at the normal force Fn0") \
    COUNT     (N,        10,       1,     10,        "number of elements")                                 \
    PARAMETERS(k,        10, STIFFNESS, (28e3, 15e3, 10e3, 8e3, 6.5e3, 5.3e3, 4.3e3, 3.5e3, 2.8e3, 2.1e3), \
                                   0.0, INF,         "stiffness of the element")                           \
    PARAMETERS(W,        10, FORCE, (0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1),                    \
                                   0.0, INF,         FORCE_NOUN " at which the element slips")             \
    PARAMETER (Fn0,      "N",      1.0,   1e-12, INF, "normal force for which the parameters are valid")

#define CONTACT       \
    COULOMB  (sum(W)) \
    STIFFNESS(sum(k))

#define IDENTIFIED              \
    FIT   (k, stiffness, loops) \
    FIT   (W, level, loops)     \
    METHOD(hysteresis)
/* clang-format on */

#define STEPS_BY   step
#define EVENTS     10
#define DECIDES_BY transition
#define MEMORY     struct slip_memory
#define VALID_BY   is_slip_memory
#define KEEPS_BY   keep_decisions

struct slip_memory {
    double slips[10]; /* in model exchange: direction in which the element slips, or 0 */
};

#include "block.h"
#include "presliding.h"
#include "slip.h"

static bool is_slip_memory(const Model *m) { return are_directions(m->memory.slips, 10); }

static void equations(Model *m)
{
    GIVEN(m)
    const bool frozen = m->run.frozen;
    double sum = 0.0;
    for (int i = 0; i < 10; i++) {
        const bool slips = i < N && (frozen ? m->memory.slips[i] != 0.0 : v != 0.0 && !(sign(v) * Fi[i] < W[i]));
        m->slipping[i] = slips ? 1.0 : 0.0;
        m->der_Fi[i] = i < N && !slips ? k[i] * v : 0.0;
        sum += i < N ? limited(Fi[i], W[i]) : 0.0;
    }
    m->F = load_of(Fn, Fn0) * sum;
}

static bool step(Model *m, double h)
{
    GIVEN(m)
    const double dx = slide(m, h);
    for (int i = 0; i < N; i++)
        m->Fi[i] = limited(limited(Fi[i], W[i]) + k[i] * dx, W[i]);
    return true;
}

#define SLOW 1e-10 /* [m/s] or [rad/s] */

static void indicators(const Model *m, double *left)
{
    for (int i = 0; i < 10; i++)
        left[i] = i < m->N ? slip_indicator(m->memory.slips[i], m->v, SLOW, m->Fi[i], m->W[i]) : 1.0;
}

static void transition(Model *m)
{
    for (int i = 0; i < m->N; i++)
        m->memory.slips[i] = slip_after(m->memory.slips[i], m->v, SLOW, m->Fi[i], m->W[i]);
}
