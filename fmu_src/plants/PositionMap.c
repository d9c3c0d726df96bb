/* Position map: cogging and position-dependent friction of an axis, from a table over position.

   Cogging is conservative and does not depend on the direction of motion; position-dependent friction changes sign with
   it. Both are cubic interpolations (Catmull-Rom) of the table in "map.h", with continuous slopes. For the separation
   by strokes in both directions and the compensation by a table, see Otten, de Vries, van Amerongen, Rankers, Gaal:
   Linear motor motion control using a learning feedforward controller, IEEE/ASME Transactions on Mechatronics 2(3),
   1997.

       F_position = F0 + a_c C(x) - a_f D(x) tanh(v / v_sign)

   C and D are the columns of the table, a_c = cogging_gain and a_f = friction_gain. F_position acts on the mass in the
   positive direction, unlike a friction force; connect it to the input F_load of a plant. D adds to the friction model
   beside this block and is negative where friction is below its mean. At v = 0 the second part is zero: only the
   friction model holds the mass.

   With the reference position and velocity as inputs, -F_position is the feedforward that compensates the map.

   Use it for an axis whose force depends on position; `identify` and `study` write the table. The file shipped with
   this block contains three periods of a ripple; packaging the FMU with another table replaces it.

   Limits: outside the table the force at its end holds, unless the table is periodic. No dependence on speed, current
   or load. Below v_sign, where D is negative, the force drives the mass; the friction model must be larger. */

#define MODEL   PositionMap
#define SUMMARY "{Force} over position: cogging and position-dependent friction from a table"
#define SOURCE  "Otten et al., IEEE/ASME Transactions on Mechatronics 2(3), 1997; table in map.h"
#define CITES   "Otten1997"

/* clang-format off */
#define VARIABLES                                                                                              \
    INPUT    (x,             LENGTH,   0.0,             "position")                                            \
    INPUT    (v,             VELOCITY, 0.0,             "velocity")                                            \
    OUTPUT   (F_position,    FORCE,                     FORCE_NOUN " on the " MASS_NOUN ", positive forward")  \
    OUTPUT   (cogging,       FORCE,                     "C(x): cogging, positive forward")                     \
    OUTPUT   (friction,      FORCE,                     "D(x): friction that opposes v, added to the average") \
    LOCAL    (x_begin,       LENGTH,                    "begin of the table")                                  \
    LOCAL    (x_end,         LENGTH,                    "end of the table or of its period")                   \
    PARAMETER(F0,            FORCE,    0.0, -INF,  INF, "constant " FORCE_NOUN)                                \
    PARAMETER(cogging_gain,  NO_UNIT,  1.0, -INF,  INF, "factor of the cogging")                               \
    PARAMETER(friction_gain, NO_UNIT,  1.0, -INF,  INF, "factor of the position-dependent friction")           \
    PARAMETER(v_sign,        VELOCITY, 1e-3, 1e-12, INF, "velocity over which the sign of v is smoothed")
/* clang-format on */

#include "block.h"

/* static const double map_begin, map_spacing; static const bool map_periodic;
   static const double map[][2] = { { C, D }, ... }, one row per node; a periodic table has no row for its end */
#include "map.h"

enum { NODES = sizeof map / sizeof map[0], LAST = NODES - 1 };
typedef char map_has_four_rows[NODES >= 4 ? 1 : -1];

/* Return a column at node i; beyond the ends of a table that is not periodic, it continues linearly. */
static double node(int i, int column)
{
    if (map_periodic)
        return map[(i + NODES) % NODES][column];
    if (i < 0)
        return 2.0 * map[0][column] - map[1][column];
    return i > LAST ? 2.0 * map[LAST][column] - map[LAST - 1][column] : map[i][column];
}

static double interpolated(int i, double w, int column)
{
    const double a = node(i - 1, column), b = node(i, column), c = node(i + 1, column), d = node(i + 2, column);
    return b + 0.5 * w * (c - a + w * (2.0 * a - 5.0 * b + 4.0 * c - d + w * (3.0 * (b - c) + d - a)));
}

static void equations(Model *m)
{
    GIVEN(m)
    const int span = map_periodic ? NODES : LAST;
    const double along = map_periodic ? fmod(x - map_begin, span * map_spacing) : x - map_begin;
    const double place = clip(along / map_spacing + (map_periodic && along < 0.0 ? span : 0), 0.0, span);
    const int i = place < span ? (int)place : span - 1;

    m->x_begin = map_begin;
    m->x_end = map_begin + span * map_spacing;
    m->cogging = interpolated(i, place - i, 0);
    m->friction = interpolated(i, place - i, 1);
    m->F_position = F0 + cogging_gain * m->cogging - friction_gain * m->friction * tanh(v / v_sign);
}
