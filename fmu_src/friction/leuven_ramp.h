/* Steps of the Leuven model at constant or linear velocity. Included at the end of leuven.h. */

#ifndef LEUVEN_RAMP_H
#define LEUVEN_RAMP_H

#include "relaxation.h"

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
