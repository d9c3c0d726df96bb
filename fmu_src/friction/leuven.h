/* The Leuven model as described in Leuven.c, for all blocks with its parameters, its MEMORY, an input or state v, and
   the results F, Fh, Fb, z, der_z, depth, sliding and stack_overflow. Included after block.h. */

#ifndef LEUVEN_H
#define LEUVEN_H

#include "presliding.h"
#include "relaxation.h"
#include "transition.h"

static const double slides_at = 1.0 - 1e-3;

static bool are_reversals(const Model *m)
{
    const struct reversals *const memory = &m->memory;
    return is_count(memory->depth, DEEPEST) && is_direction(memory->direction) && is_count(memory->overflow, 1.0) &&
           is_count(memory->sliding, 1.0) && all_finite(memory->force, (size_t)memory->depth);
}

/* Position of the contact on its hysteresis curve, in the direction of motion `side`. */
struct branch {
    double side, base, zeta; /* base = side Fb, zeta = side z */
    int depth;
    bool full, sliding;
};

static double curve(const Model *m, double zeta) { return copysign(m->A * -expm1(-fabs(zeta) / m->zc), zeta); }

/* Return the inverse of the curve; a force beyond its limit is replaced by one just below it. */
static double inverse_curve(const Model *m, double force)
{
    return copysign(-m->zc * log1p(-fmin(fabs(force) / m->A, 1.0 - 1e-15)), force);
}

/* Continue along the branch that starts at the reversal point number `depth`. */
static void continue_on(const Model *m, struct branch *b, int depth)
{
    const double force = b->base + curve(m, b->zeta);
    b->depth = depth;
    b->base = depth > 0 ? b->side * m->memory.force[depth - 1] : 0.0;
    b->zeta = inverse_curve(m, force - b->base);
}

/* Return the next force that closes a loop, in the direction of motion. */
static double closing_force(const Model *m, const struct branch *b)
{
    return b->depth >= 2 ? b->side * m->memory.force[b->depth - 2] : INF;
}

/* Apply the immediate effects of a level S on the branch: closed loops, sliding. */
static void settle(const Model *m, struct branch *b, double S)
{
    const double slack = 1e-14 * m->A;
    while (b->depth >= 2 && b->base + curve(m, b->zeta) >= closing_force(m, b) - slack)
        continue_on(m, b, b->depth - 2);
    b->sliding = curve(m, b->zeta) >= slides_at * (S - b->base) - slack;
    if (b->sliding && b->depth > 0)
        continue_on(m, b, 0);
}

/* Return the branch for a velocity with the sign `side`, which is a new one after a reversal. */
static struct branch branch_of(const Model *m, double side)
{
    GIVEN(m)
    const struct reversals *const memory = &m->memory;
    const double direction = memory->direction != 0.0 ? memory->direction : z != 0.0 ? sign(z) : side;
    struct branch b = {direction, 0.0, direction * z, (int)memory->depth, false, false};
    b.base = b.depth > 0 ? direction * memory->force[b.depth - 1] : 0.0;
    if (side * direction >= 0.0)
        return b;

    b.side = side;
    b.base = -b.base;
    b.zeta = -b.zeta;
    if (fabs(z) <= dead_band) {
        if (b.depth > 0)
            continue_on(m, &b, b.depth - 1);
    } else {
        b.full = b.depth == DEEPEST;
        b.depth += b.full ? -1 : 1;
        b.base += curve(m, b.zeta);
        b.zeta = 0.0;
    }
    return b;
}

static void contact(Model *m, const struct branch *b, double S)
{
    GIVEN(m)
    const double force = curve(m, b->zeta), ratio = force == 0.0 ? 0.0 : force / (S - b->base);
    m->der_z = v * (1.0 - signed_power(ratio, n));
    m->Fb = b->side * b->base;
    m->Fh = b->side * (b->base + force);
    m->depth = b->depth;
    m->sliding = b->sliding ? 1.0 : 0.0;
    m->stack_overflow = b->full ? 1.0 : m->memory.overflow;
    m->F = load_of(Fn, Fn0) * (m->Fh + sigma1 * m->der_z) + sigma2 * v;
}

static void equations(Model *m)
{
    GIVEN(m)
    const double S = stribeck(v, Fc, Fs, vs, delta);
    const bool frozen = m->run.frozen && m->memory.direction != 0.0;
    struct branch b = branch_of(m, frozen ? m->memory.direction : sign(v));
    if (frozen)
        b.sliding = m->memory.sliding != 0.0;
    else if (v != 0.0)
        settle(m, &b, S);
    contact(m, &b, S);
}

/* Store the branch: the reversal points, and the deflection since the last one. */
static void store(Model *m, const struct branch *b)
{
    struct reversals *const memory = &m->memory;
    memory->direction = b->side;
    memory->depth = b->depth;
    if (b->depth > 0)
        memory->force[b->depth - 1] = b->side * b->base;
    if (b->full) {
        memory->overflow = 1.0;
        m->run.warning = true;
    }
    m->z = b->side * b->zeta;
}

/* ---- Steps at constant or linear velocity. */

/* A part of the step in which the contact stays on its branch. */
struct piece {
    const Model *m;
    Motion motion;
    double S; /* the level, if v is constant */
    double base, closing;
    bool backwards; /* r < 0 */
    bool flat;      /* |r|^n is negligible */
    bool remembers; /* there are reversal points */
};

static double piece_level(const struct piece *p, double s) { return level_along(p->m, &p->motion, p->S, s); }

/* Return r, or 1 if the level has been passed beyond the end of the part. */
static double piece_ratio(const struct piece *p, double s, double zeta)
{
    const double distance = piece_level(p, s) - p->base, r = distance > 0.0 ? curve(p->m, zeta) / distance : 1.0;
    return p->remembers ? fmin(r, 1.0) : r;
}

static double piece_rate(double s, double zeta, const void *law)
{
    const struct piece *const p = (const struct piece *)law;
    const double speed = fabs(velocity(&p->motion, s));
    if (p->flat)
        return speed;
    return speed * deflecting(piece_ratio(p, s, zeta), p->m->n, p->backwards);
}

/* Return the deflection at which the force is at the level, if there is no earlier event. */
static double piece_place(double s, double zeta, const void *law)
{
    const struct piece *const p = (const struct piece *)law;
    (void)zeta;
    return inverse_curve(p->m, piece_level(p, s));
}

/* Return a nonnegative length where a loop closes, sliding starts, r passes 0 (|r|^n has a kink there), or |r|^n ceases
   to be negligible. */
static double piece_goal(double s, double zeta, const void *law)
{
    const struct piece *const p = (const struct piece *)law;
    const double length = p->m->zc;
    double goal = zeta - p->closing;
    if (p->backwards)
        goal = fmax(goal, zeta);
    if (p->flat)
        goal = fmax(goal, (piece_ratio(p, s, zeta) - flat_until(p->m->n)) * length);
    else if (!p->backwards && p->motion.slope != 0.0)
        goal = fmax(goal, (flat_until(p->m->n) - behind_flat - piece_ratio(p, s, zeta)) * length);
    if (p->remembers)
        goal = fmax(goal, (curve(p->m, zeta) - slides_at * (piece_level(p, s) - p->base)) / p->m->A * length);
    return goal;
}

static bool follow_motion(Model *m, Motion motion)
{
    GIVEN(m)
    const double slope = motion.slope, side = sign(m->v != 0.0 ? m->v : slope), S = stribeck(v, Fc, Fs, vs, delta);
    if (side == 0.0)
        return true;

    struct branch b = branch_of(m, side);
    store(m, &b);
    struct piece p = {m, motion, S, 0.0, 0.0, false, false, false};
    const double arrival = motion.end;
    double s = motion.start;
    int budget = BUDGET;
    for (int pieces = 0; s < arrival; pieces++) {
        if (pieces > 1000)
            return false;
        const double level = piece_level(&p, s);
        settle(m, &b, level);
        const double force = curve(m, b.zeta);
        if (slope == 0.0 && b.depth == 0 && fabs(force - S) <= 4.0 * DBL_EPSILON * S)
            break;
        if (b.depth == 0 && fabs(force) > level && fabs(force) > falls_to(n) * level)
            b.zeta = copysign(inverse_curve(m, falls_to(n) * level), b.zeta);
        p.base = b.base;
        p.closing = b.depth >= 2 ? inverse_curve(m, closing_force(m, &b) - b.base) : INF;
        p.remembers = b.depth > 0;
        p.backwards = b.zeta < 0.0;
        p.flat = !p.backwards && piece_ratio(&p, s, b.zeta) < flat_until(n) - 0.5 * behind_flat;
        const double next = s + stribeck_piece(velocity(&p.motion, s), slope, Fc, Fs, vs, delta);
        const double end = next < arrival && next > s ? next : arrival;
        const bool near = slope != 0.0 && !p.remembers && curve(m, b.zeta) > 0.9 * level &&
                          1.01 * fmax(level, piece_level(&p, end)) < A;
        const double size = zc * (p.remembers ? level - b.base : fmax(Fs, Fc)) / A; /* of zeta at r = 1 */
        const Law law = {piece_rate, piece_goal, near ? piece_place : NULL, &p, slope == 0.0, &budget};
        const int how = follow(m, &law, &s, &b.zeta, end, size, size * (p.flat ? 1.0 : sharpness(n)));
        if (how == FAILED)
            return failed(m, budget);
        if (how == REACHED && b.zeta >= p.closing)
            continue_on(m, &b, b.depth - 2);
    }
    settle(m, &b, piece_level(&p, arrival));
    store(m, &b);
    if (slope == 0.0) {
        b.full = false;
        contact(m, &b, S);
        m->run.outputs_done = true;
    }
    return true;
}

#endif
