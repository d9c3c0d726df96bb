/* Frenkel-Kontorova chain: atoms connected by springs on a periodic substrate, driven by a force. Pinning depends on
   the ratio of the periods of chain and substrate.

   Frenkel, Kontorova: Physikalische Zeitschrift der Sowjetunion 13, 1938; as reviewed in Braun, Kivshar: The
   Frenkel-Kontorova Model, Springer 2004. Quantities are scaled by the mass, the stiffness of the springs and the
   period of the substrate and are therefore dimensionless; the unit of time is one second of simulation.

       x_j'' = x_j+1 - 2 x_j + x_j-1 - (K / 2 pi) sin(2 pi x_j)
               + F_drive - damping x_j'
       v     = mean of x_j'
       F     = damping v + mean of (K / 2 pi) sin(2 pi x_j),   dv/dt = F_drive - F

   F is the friction force per atom. It equals the drive at rest (static friction) and, on average, in steady sliding.
   The springs have the rest length `winding`, in periods. In a ring (periodic = 1), the N atoms span an integer number
   of periods, the nearest to N winding, and `ratio` is the resulting winding number. Approximants of the golden mean
   are quotients of Fibonacci numbers, such as 34/55 (the start values) and 55/89. Initially, the atoms rest at j times
   the spacing, plus a deflection amplitude cos(2 pi mode j / N) of one mode.

   Known results: a chain with the golden mean slides without static friction below the Aubry transition K_c = 0.971635
   (for the infinite chain; approximants keep a barrier that decreases exponentially with N) and is pinned above. At
   winding 0 or 1, static friction is K / 2 pi, and small waves with the wave number q obey omega^2 = K + 4 sin^2(q/2).

   The equations are smooth and solved by extrapolation to 1e-12 of a period per inner step, independent of the
   communication step; the cost is proportional to N, and to the damping if that is far above 10.

   Use it to study the origin of static friction: pinning and free sliding of commensurate and incommensurate surfaces,
   the Aubry transition, and atomic motion under a given force. It needs this force as input, as the block contains the
   atoms.

   Limits: one dimension, no temperature. A driven chain is often chaotic, so that only averages can be compared. An
   evenly spaced chain is not in equilibrium: with damping, it moves to an equilibrium, which for even N may be a saddle
   unless `amplitude` breaks the symmetry. There is no normal force; vary K with it instead. */

#define MODEL       FrenkelKontorova
#define SUMMARY     "Frenkel-Kontorova chain of atoms on a periodic substrate, driven by a force"
#define SOURCE      "Frenkel, Kontorova, Physikalische Zeitschrift der Sowjetunion 13, 1938"
#define CITES       "FrenkelKontorova1938"
#define STATUS      "not checked against the papers"
#define FEATURES    "presliding, drift-free, rate dependent, needs force, mass inside"
#define NO_EXCHANGE "the atoms are integrated inside by a method that preserves their energy"

/* clang-format off */
#define VARIABLES                                                                                             \
    INPUT    (F_drive,   NO_UNIT, 0.0,                 "driving force on each atom")                          \
    OUTPUT   (F,         NO_UNIT,                      "friction force per atom, opposes v")                  \
    OUTPUT   (v,         NO_UNIT,                      "mean velocity of the atoms")                          \
    OUTPUT   (x,         NO_UNIT,                      "mean displacement of the atoms since the start")      \
    OUTPUT   (acceleration, NO_UNIT,                   "mean acceleration of the atoms")                      \
    OUTPUT   (energy,    NO_UNIT,                      "kinetic and potential energy per atom")               \
    LOCAL    (ratio,     NO_UNIT,                      "winding number in use: periods per atom")             \
    LOCALS   (atom, 10,  NO_UNIT,                      "positions of the first ten atoms")                    \
    PARAMETER(K,         NO_UNIT, 1.5, 0.0,  INF,      "strength of the substrate")                           \
    PARAMETER(damping,   NO_UNIT, 0.1, 0.0,  INF,      "gamma, damping rate")                                 \
    COUNT    (N,         55,      1,   MASSES,         "number of atoms")                                     \
    FIXED    (winding,   NO_UNIT, 0.6180339887498949, -1e6, 1e6, "rest length of the springs in periods of the substrate") \
    COUNT    (periodic,  1,       0,   1,              "1: a ring, 0: free ends")                             \
    FIXED    (amplitude, NO_UNIT, 0.0, -1e6, 1e6,      "initial deflection of one mode")                      \
    COUNT    (mode,      1,       0,   MASSES,         "mode that is deflected, with the wavelength N / mode")
/* clang-format on */

#include "chain.h"

#define MEMORY   struct chain
#define VALID_BY is_chain
#define STEPS_BY move

#include "block.h"
#include "chain_block.h"

static struct surroundings around(const Model *m)
{
    GIVEN(m)
    return (struct surroundings){.chain = &m->memory,
                                 .n = N,
                                 .ring = periodic != 0,
                                 .k = 1.0,
                                 .K = K,
                                 .damping = damping,
                                 .F = F_drive,
                                 .F_rate = SLOPE(F_drive)};
}

static void equations(Model *m)
{
    const struct view seen = see(m);
    m->v = seen.v;
    m->x = seen.u;
    m->F = seen.substrate + m->damping * seen.v;
}
