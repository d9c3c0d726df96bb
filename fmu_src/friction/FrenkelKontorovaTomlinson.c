/* Frenkel-Kontorova-Tomlinson chain: atoms connected by springs on a periodic substrate, each also connected to a
   moving slider. It models friction of two surfaces and lies between the Frenkel-Kontorova and the Prandtl-Tomlinson
   model.

   Weiss, Elmer: Dry friction in the Frenkel-Kontorova-Tomlinson model: static properties, Physical Review B 53, 1996.
   Quantities are scaled by the mass, the stiffness of the springs and the period of the substrate and are therefore
   dimensionless; the unit of time is one second of simulation.

       x_j'' = k (x_j+1 - 2 x_j + x_j-1) - (K / 2 pi) sin(2 pi x_j)
               + kappa (X + j c - x_j) - damping x_j'
       F     = mean of kappa (X + j c - x_j),   dX/dt = v

   F is the force per atom against the motion of the slider. c is `winding`, in periods; in a ring (periodic = 1), the N
   atoms span an integer number of periods, the nearest to N winding, and `ratio` is the resulting c. In the paper, K =
   2 pi b and k = 1. Initially, the atoms rest at j c, plus a deflection amplitude cos(2 pi mode j / N) of one mode.

   Known limits: kappa = 0 is the Frenkel-Kontorova chain without drive. k = 0 gives N independent Prandtl-Tomlinson
   atoms with eta = K / kappa at uniformly distributed phases, without quasi-static friction for K <= kappa and with the
   mean of their forces above.

   The equations are smooth and solved by extrapolation to 1e-12 of a period per inner step, independent of the
   communication step; the cost is proportional to N, and to the damping if that is far above 10.

   Use it to study the friction of two flat surfaces on the atomic scale: how static friction and memory grow with the
   corrugation, and the effect of the springs between atoms. It needs the velocity of the slider only.

   Limits: one dimension, no temperature; fast or strongly coupled sliding may be chaotic. The start values describe a
   pinned golden-mean chain and are not published ones. There is no normal force; vary K with it instead. */

#define MODEL       FrenkelKontorovaTomlinson
#define SUMMARY     "Frenkel-Kontorova-Tomlinson chain: atoms on a periodic substrate, connected to a slider"
#define SOURCE      "Weiss, Elmer, Physical Review B 53, 1996"
#define CITES       "WeissElmer1996"
#define STATUS      "not checked against the paper"
#define FEATURES    "presliding, nonlocal memory, drift-free, rate dependent, mass inside"
#define NO_EXCHANGE "the atoms are integrated inside by a method that preserves their energy"

/* clang-format off */
#define VARIABLES                                                                                             \
    INPUT    (v,         NO_UNIT, 0.0,                 "velocity of the slider")                              \
    OUTPUT   (F,         NO_UNIT,                      "friction force per atom, opposes v")                  \
    STATE    (X,         NO_UNIT, 0.0, 1.0,            "position of the slider")                              \
    LOCAL    (x,         NO_UNIT,                      "mean displacement of the atoms since the start")      \
    LOCAL    (w,         NO_UNIT,                      "mean velocity of the atoms")                          \
    OUTPUT   (acceleration, NO_UNIT,                   "mean acceleration of the atoms")                      \
    OUTPUT   (energy,    NO_UNIT,                      "kinetic and potential energy per atom")               \
    LOCAL    (ratio,     NO_UNIT,                      "winding number in use: periods per atom")             \
    LOCALS   (atom, 10,  NO_UNIT,                      "positions of the first ten atoms")                    \
    PARAMETER(K,         NO_UNIT, 2.0, 0.0,  INF,      "strength of the substrate")                           \
    PARAMETER(k,         NO_UNIT, 1.0, 0.0,  INF,      "stiffness of the springs between neighbours")         \
    PARAMETER(kappa,     NO_UNIT, 0.1, 0.0,  INF,      "stiffness of the springs to the slider")              \
    PARAMETER(damping,   NO_UNIT, 0.5, 0.0,  INF,      "gamma, damping rate")                                 \
    COUNT    (N,         55,      1,   MASSES,         "number of atoms")                                     \
    FIXED    (winding,   NO_UNIT, 0.6180339887498949, -1e6, 1e6, "spacing of the slider atoms in periods of the substrate") \
    COUNT    (periodic,  1,       0,   1,              "1: a ring, 0: free ends")                             \
    FIXED    (amplitude, NO_UNIT, 0.0, -1e6, 1e6,      "initial deflection of one mode")                      \
    COUNT    (mode,      1,       0,   MASSES,         "mode that is deflected, with the wavelength N / mode")
/* clang-format on */

#include "chain.h"

#define MEMORY   struct chain
#define VALID_BY is_chain
#define STEPS_BY step

#include "block.h"
#include "chain_block.h"

static struct surroundings around(const Model *m)
{
    GIVEN(m)
    return (struct surroundings){.chain = &m->memory,
                                 .n = N,
                                 .ring = periodic != 0,
                                 .k = k,
                                 .K = K,
                                 .kappa = kappa,
                                 .damping = damping,
                                 .X = X,
                                 .X_rate = v,
                                 .X_curvature = SLOPE(v)};
}

static void equations(Model *m)
{
    const struct view seen = see(m);
    m->der_X = m->v;
    m->F = seen.slider;
    m->x = seen.u;
    m->w = seen.v;
}

static bool step(Model *m, double h)
{
    if (!move(m, h))
        return false;
    m->X += h * (m->v + 0.5 * h * SLOPE(v));
    return true;
}
