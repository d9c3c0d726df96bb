/* Bristle friction: a population of elastic bonds that break at a critical deflection and re-bond at a random place.

   Haessig, Friedland: On the modeling and simulation of friction, ASME Journal of Dynamic Systems, Measurement, and
   Control 113(3), 1991; as described by Olsson, Astrom, Canudas de Wit, Gaefvert, Lischinsky: European Journal of
   Control 4, 1998. Of the start values, only N is published; the others give 1 N at the stiffness of the LuGre paper.

       d_i = x - b_i,   i = 1 ... N          stretch of bristle i, bonded at b_i
       |d_i| > delta_s:  b_i <- b_i + sign(d_i) U
       U uniform in (0, D),   D = min(Delta, 2 delta_s)
       F = load sigma0 sum d_i,   load = max(Fn, 0)/Fn0
       mean of F over long sliding = load N sigma0 (delta_s - D/3)

   A step follows every bristle through all of its re-bonds; between them, F is elastic. The k-th U of bristle i is a
   function of the seed, i and k only, so the force depends on the path only, not on the rate or on the communication
   steps. D is limited to 2 delta_s, so that a bristle never jumps past the other end of its range. With Delta = 0, a
   bristle is dragged at its limit.

   Initially, all bristles have the deflection z, usually 0. They then break simultaneously for the first time, at the
   peak N sigma0 delta_s. With spread > 0, they start at random deflections within spread delta_s of z, in pairs on
   opposite sides, so that z is their mean.

   Use it to study friction that varies randomly along the path and to understand the idea behind LuGre; 20 to 25
   bristles are common. It needs no F_ext for the force at rest, as the bristles are springs.

   Limits: there is no damping, so a mass on it rings. Speed does not affect the mean force. The cost grows with N and
   with the number of re-bonds in a step (a step with more than about 1e8 re-bonds is discarded). */

#define MODEL       Bristle
#define SUMMARY     "Population of bristles that break and re-bond at random places"
#define SOURCE      "Haessig, Friedland, ASME J. Dynamic Systems, Measurement, and Control 113(3), 1991"
#define CITES       "Haessig1991"
#define STATUS      "equations as given by Olsson et al. 1998"
#define FEATURES    "presliding, drift-free, random"
#define NO_EXCHANGE "its bristles are renewed at random, and each would be an event"

/* clang-format off */
#define VARIABLES                                                                                         \
    INPUT    (v,       VELOCITY,  0.0,                  "relative sliding velocity")                      \
    OPTIONAL (Fn,      "N",       1.0,                  "normal force")                                   \
    OUTPUT   (F,       FORCE,                           "friction " FORCE_NOUN ", opposes v")             \
    OUTPUT   (F_mean,  FORCE,                           "mean friction " FORCE_NOUN " in long sliding")   \
    OUTPUT   (E,       "J",                             "elastic energy in the bristles")                 \
    STATE    (z,       LENGTH,    0.0,    1e-5,         "mean deflection of the bristles")                \
    TALLY    (rebonds,                                  "number of re-bonds of all bristles so far")      \
    COUNT    (N,       20,        1,      MOST,         "number of bristles")                             \
    COUNT    (seed,    1,         0,      COUNTS,       "seed of the random numbers")                     \
    FIXED    (spread,  NO_UNIT,   0.0,    0.0,   1.0,   "spread of the initial deflections over delta_s") \
    PARAMETER(sigma0,  STIFFNESS, 5e3,    1e-9,  INF,   "stiffness of one bristle")                       \
    PARAMETER(delta_s, LENGTH,    1.2e-5, 1e-12, INF,   "deflection at which a bristle breaks")           \
    PARAMETER(Delta,   LENGTH,    6e-6,   0.0,   INF,   "largest distance of a re-bond")                  \
    PARAMETER(Fn0,     "N",       1.0,    1e-12, INF,   "normal force for which the parameters are valid")
/* clang-format on */

#include <stdbool.h>
#include <stdint.h>

enum { MOST = 1000 };

#define STEPS_BY step
#define MEMORY   struct bristles
#define KEEPS_BY keep_bristles
#define VALID_BY are_bristles

struct bristle {
    double d;         /* deflection */
    uint32_t rebonds; /* number of random numbers used */
};

struct bristles {
    double squares, total;    /* sums of d^2 and of the re-bonds */
    bool moved;               /* false: still at the start */
    struct bristle one[MOST]; /* N in use */
};

#include "block.h"
#include "load.h"
#include "counter_random.h"
#include "ramp.h"

static void keep_bristles(Memory *to, const Memory *from, const Model *m, bool follows)
{
    (void)follows;
    memcpy(to, from, offsetof(struct bristles, one) + (size_t)m->N * sizeof(struct bristle));
}

static bool are_bristles(const Model *m)
{
    const struct bristles *const all = &m->memory;
    bool good = is_flag(&all->moved) && isfinite(all->squares) && is_count(all->total, DBL_MAX);
    for (int i = 0; good && i < (int)m->N; i++)
        good = isfinite(all->one[i].d);
    return good;
}

/* Return the initial deflection of bristle i: its random number 0, with the sign of its place in the pair. */
static double start_of(const Model *m, int i)
{
    GIVEN(m)
    const bool single = i == N - 1 && N % 2 == 1;
    if (spread == 0.0 || single)
        return z;
    const double away = spread * delta_s * (2.0 * uniform_at(seed, i / 2, 0) - 1.0);
    return i % 2 == 0 ? z + away : z - away;
}

static void equations(Model *m)
{
    GIVEN(m)
    const double load = load_of(Fn, Fn0);
    double squares = m->memory.squares;
    if (!m->memory.moved) {
        squares = 0.0;
        for (int i = 0; i < N; i++)
            squares += square(start_of(m, i));
    }
    m->der_z = v; /* between re-bonds */
    m->F = load * sigma0 * (N * z);
    m->F_mean = load * sigma0 * (N * (delta_s - fmin(Delta, 2.0 * delta_s) / 3.0));
    m->E = 0.5 * load * sigma0 * squares;
    m->rebonds = fmin(m->memory.total, COUNTS);
}

static bool step(Model *m, double h)
{
    GIVEN(m)
    const double most = 3.0 * MOST_WORK; /* number of re-bonds, 8 ns each */
    struct bristles *const all = &m->memory;
    const double path = path_after(v, SLOPE(v), h), width = fmin(Delta, 2.0 * delta_s);
    const double D = width > 4.0 * DBL_EPSILON * delta_s ? width : 0.0; /* a re-bond must exceed rounding */
    const double farthest = 0.5 * D * most;                             /* total distance of all re-bonds */
    if (!(N * fabs(path) <= farthest) && D > 0.0)
        return too_much(m);

    double sum = 0.0, squares = 0.0;
    for (int i = 0; i < N; i++) {
        struct bristle *const bristle = &all->one[i];
        double d = (all->moved ? bristle->d : start_of(m, i)) + path;
        if (D == 0.0)
            d = clip(d, -delta_s, delta_s);
        if (fabs(d) > delta_s && !(N * (fabs(d) - delta_s) <= farthest)) /* by the setting of z or delta_s */
            return too_much(m);
        while (fabs(d) > delta_s) {
            d -= sign(d) * D * uniform_at(seed, i, ++bristle->rebonds);
            all->total += 1.0;
        }
        bristle->d = d;
        sum += d;
        squares += d * d;
    }
    all->squares = squares;
    all->moved = true;
    m->z = sum / N;
    return true;
}
