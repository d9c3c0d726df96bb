/* Leuven integrated friction model: a hysteresis force with nonlocal memory, stored in two stacks of reversal points,
   and a deflection that relaxes to the Stribeck curve.

   Swevers, Al-Bender, Ganseman, Prajogo: An integrated friction model structure with improved presliding behavior for
   accurate friction compensation, IEEE TAC 45(4), 2000.

       S(v)  = sgn(v) (Fc + (Fs - Fc) exp(-|v/vs|^delta))
       Fh    = Fb + Fd(z),   Fd(z) = A (1 - exp(-|z|/zc)) sgn z
       dz/dt = v (1 - sgn(r) |r|^n),   r = Fd(z) / (S(v) - Fb)
       F     = (Fh + sigma1 dz/dt) max(Fn, 0) / Fn0 + sigma2 v

       reversal of v:  Fh is stored as maximum or minimum;  Fb = Fh, z = 0
       loop closed:    Fh, rising, reaches the last maximum (falling: minimum):
                       this point and the one at which the inner loop began
                       are removed;  Fb = the reversal before, 0 if none;
                       z = Fd^-1(Fh - Fb)
       sliding:        |r| >= 1 - 1e-3: all points are removed;
                       Fb = 0,  z = Fd^-1(Fh)

   Details that the paper leaves open: several loops may close at once. An initial z is on the curve from Fb = 0 and was
   reached by a motion in its direction. A contact with Fb beyond the level that it moves towards, sgn(v) Fb >= |S(v)|,
   for example after a reversal in slow motion followed by fast motion, is sliding (otherwise r would change its sign).
   The stacks hold 64 points in total; when they are full, the innermost loop is discarded for the new point,
   stack_overflow stays true, and a warning is logged. With dead_band > 0, a branch that ends before |z| = dead_band is
   discarded instead of stored, so that noise in v does not fill the stacks. With A of at least 2 max(Fs, Fc), every
   branch reaches sliding; with a smaller A, Fd may end below S(v), and z may grow without bound.

   Start values: Table I of the LuGre paper, with its stiffness A/zc; A and n are specific to this library.

   The equations are solved to the tolerance, with the closing of loops and the onset of sliding located inside the
   step.

   Use it to reproduce results of the paper; ModifiedLeuven has its advantages without stacks.

   Limits: r, and thus F through sigma1, jumps when an inner loop closes. Loops close in the force and in z, but in the
   position only for large n. At the onset of sliding, dz/dt jumps by the order of 1e-3 n v. */

#define MODEL    Leuven
#define SUMMARY  "Leuven integrated friction model with two stacks of reversal points"
#define SOURCE   "Swevers, Al-Bender, Ganseman, Prajogo, IEEE TAC 45(4), 2000"
#define CITES    "Swevers2000"
#define STATUS   "not checked against the paper"
#define FEATURES "presliding, nonlocal memory, Stribeck, lag, rate dependent"

/* clang-format off */
#define VARIABLES                                                                                              \
    INPUT     (v,        VELOCITY, 0.0,              "relative sliding velocity")                              \
    OPTIONAL  (Fn,       "N",      1.0,              "normal force")                                           \
    OUTPUT    (F,        FORCE,                      "friction " FORCE_NOUN ", opposes v")                     \
    LOCAL     (Fh,       FORCE,                      "hysteresis " FORCE_NOUN " at the normal force Fn0")      \
    LOCAL     (Fb,       FORCE,                      "hysteresis " FORCE_NOUN " at the last stored reversal")  \
    TALLY     (depth,                                "reversal points on both stacks")                         \
    FLAG      (sliding,                              "r has reached 1 - 1e-3")                                 \
    FLAG      (stack_overflow,                       "an inner loop has been discarded")                       \
    STATE     (z,        LENGTH,   0.0,   1e-5,      "deflection since the last stored reversal")              \
    PARAMETER (A,        FORCE,    4.0,   1e-9,  INF, "limit of the hysteresis curve, at least 2 max(Fs, Fc)") \
    PARAMETER (zc,       LENGTH,   4e-5,  1e-15, INF, "deflection scale of the hysteresis curve")              \
    PARAMETER (n,        NO_UNIT,  2.0,   0.1,   1e4, "sharpness of the transition to sliding")                \
    PARAMETER (sigma1,   DAMPING,  316.22776601683796, 0.0, INF, "bristle damping")                            \
    PARAMETER (sigma2,   DAMPING,  0.4,   0.0,   INF, "viscous coefficient")                                   \
    PARAMETER (Fc,       FORCE,    1.0,   1e-9,  INF, "Coulomb friction")                                      \
    PARAMETER (Fs,       FORCE,    1.5,   1e-9,  INF, "static friction (usually above Fc)")                    \
    PARAMETER (vs,       VELOCITY, 1e-3,  1e-12, INF, "Stribeck velocity")                                     \
    PARAMETER (delta,    NO_UNIT,  2.0,   1e-3,  100.0, "Stribeck exponent")                                   \
    PARAMETER (dead_band, LENGTH,  0.0,   0.0,   INF, "deflection below which a reversal is discarded")        \
    PARAMETER (Fn0,      "N",      1.0,   1e-12, INF, "normal force for which the parameters are valid")

#define CONTACT               \
    COULOMB  (Fc)             \
    STATIC   (Fs)             \
    STRIBECK (vs, delta)      \
    VISCOUS  (sigma2)         \
    STIFFNESS(A / zc)         \
    DAMPING  (sigma1, sigma2)

#define IDENTIFIED                  \
    FIT (A, 2.5 * peak, loops)      \
    FIT (zc, 2.5 * distance, loops) \
    FIT (n, 1, loops)               \
    HELD(dead_band, 0, loops)
/* clang-format on */

#include "reversals.h"

#define STEPS_BY      step
#define EVENTS        3
#define DECIDES_BY    transition
#define REINITIALISES "z"
#define WARNING       "there are more reversal points than the stacks can store; inner loops are discarded"
#define MEMORY        struct reversals
#define VALID_BY      are_reversals

#include "block.h"
#include "leuven.h"
#include "until_change.h"

/* ---- model exchange ----------------------------------------------------------------------------------------- */

static double slow(const Model *m) { return 1e-7 * m->vs; } /* noise of a solver around v = 0 is not motion */

/* A reversal, the end of a loop, and the flag `sliding`. */
static void indicators(const Model *m, double *left)
{
    GIVEN(m)
    const double side = m->memory.direction;
    left[0] = side != 0.0 ? side * v + slow(m) : slow(m) - fabs(v);
    left[1] = left[2] = 1.0;
    if (side == 0.0)
        return;
    const struct branch b = branch_of(m, side);
    const double S = stribeck(v, Fc, Fs, vs, delta), beyond = curve(m, b.zeta) - slides_at * (S - b.base);
    if (b.depth >= 2)
        left[1] = closing_force(m, &b) - (b.base + curve(m, b.zeta));
    left[2] = until_change(m->memory.sliding, beyond, A);
}

static void transition(Model *m)
{
    GIVEN(m)
    const double side = m->memory.direction != 0.0 && fabs(v) < slow(m) * (1.0 - 1e-6) ? m->memory.direction : sign(v);
    if (side == 0.0)
        return;
    struct branch b = branch_of(m, side);
    for (int i = 0; i < 2; i++) /* sliding may end when the reversal points are forgotten */
        settle(m, &b, stribeck(v, Fc, Fs, vs, delta));
    store(m, &b);
    m->memory.sliding = b.sliding ? 1.0 : 0.0;
}
