/* The modified Leuven model as described in ModifiedLeuven.c, for all blocks with its parameters, an input or state v,
   and the results F, Fh, z, der_z, Fi, der_Fi and slipping. Included after block.h. */

#ifndef MODIFIED_LEUVEN_H
#define MODIFIED_LEUVEN_H

#include "presliding.h"
#include "relaxation.h"
#include "transition.h"

/* What a block has decided about an element at the last event. */
#ifndef SLIPS
#define SLIPS(m, i) false
#endif

static double hysteresis_force(const Model *m)
{
    GIVEN(m)
    double sum = 0.0;
    for (int i = 0; i < N; i++)
        sum += limited(Fi[i], W[i]);
    return sum;
}

static void contact(Model *m, double S)
{
    GIVEN(m)
    const double force = hysteresis_force(m);
    const double rate = v * (1.0 - signed_power(sign(v) * force / S, n));
    for (int i = 0; i < 10; i++) {
        const bool slips = i < N && (m->run.frozen ? SLIPS(m, i) : rate != 0.0 && !(sign(rate) * Fi[i] < W[i]));
        m->slipping[i] = slips ? 1.0 : 0.0;
        m->der_Fi[i] = i < N && !slips ? k[i] * rate : 0.0;
    }
    m->der_z = rate;
    m->Fh = force;
    m->F = load_of(Fn, Fn0) * (force + sigma1 * rate) + sigma2 * v;
}

static void equations(Model *m)
{
    GIVEN(m)
    contact(m, stribeck(v, Fc, Fs, vs, delta));
}

/* ---- Steps at constant or linear velocity. */

static const double nearness = 0.9; /* smallest ratio r of the force to the level that counts as near */

static const double grain = 1e-14; /* relative difference below which forces count as equal */

/* A part of the step in which z moves in one direction and no element changes between stick and slip: the force along v
   is force + sense stiffness zeta, where zeta is the distance that z has moved. */
struct piece {
    const Model *m;
    Motion motion;
    double S; /* the level, if v is constant */
    double force, stiffness, sense, reach;
    double size;    /* the elastic deflection at the level */
    double slack;   /* tolerance of r around 1 */
    bool backwards; /* r < 0 */
    bool flat;      /* |r|^n is negligible */
    bool near;      /* the force may follow the level */
};

static double piece_level(const struct piece *p, double s) { return level_along(p->m, &p->motion, p->S, s); }

static double piece_ratio(const struct piece *p, double s, double zeta)
{
    return (p->force + p->sense * p->stiffness * zeta) / piece_level(p, s);
}

static double piece_rate(double s, double zeta, const void *law)
{
    const struct piece *const p = (const struct piece *)law;
    const double speed = fabs(velocity(&p->motion, s));
    if (p->flat)
        return speed;
    return p->sense * speed * deflecting(piece_ratio(p, s, zeta), p->m->n, p->backwards);
}

/* Return the distance at which the force is at the level, or at the opposite level. */
static double piece_place(double s, double zeta, const void *law)
{
    const struct piece *const p = (const struct piece *)law;
    (void)zeta;
    return p->sense * ((p->backwards ? -1.0 : 1.0) * piece_level(p, s) - p->force) / p->stiffness;
}

/* Return a nonnegative length where z reverses, an element starts to slip, |r|^n ceases to be negligible, or the force
   comes near the level. */
static double piece_goal(double s, double zeta, const void *law)
{
    const struct piece *const p = (const struct piece *)law;
    const double r = piece_ratio(p, s, zeta), n = p->m->n;
    if (p->flat)
        return fmax(zeta - p->reach, (r - flat_until(n)) * p->size);
    if (p->motion.slope == 0.0)
        return zeta - p->reach;
    const double turns = p->sense * (r - 1.0) - p->slack, flattens = flat_until(n) - behind_flat - r;
    const double comes_near = p->near || p->backwards ? -INF : r - nearness;
    return fmax(zeta - p->reach, fmax(fmax(turns, comes_near), p->backwards ? turns : flattens) * p->size);
}

/* Return zeta after the path x at constant v: with r = force / S and q = stiffness x / S, dr/dq = 1 - sgn(r) |r|^n has
   a closed form for n = 1 and 2. The part ends before r < 0 changes its sign. */
static double closed_form(const struct piece *p, double x)
{
    const double r = p->force / p->S, q = p->stiffness * x / p->S;
    double gained; /* increase of r */
    if (p->m->n == 1.0)
        gained = (r - 1.0) * expm1(-q);
    else if (p->backwards)
        gained = q < 1.57 ? (1.0 + r * r) * tan(q) / (1.0 - r * tan(q)) : INF;
    else
        gained = (1.0 - r) * (1.0 + r) * tanh(q) / (1.0 + r * tanh(q));
    return p->sense * gained * p->S / p->stiffness;
}

/* Return the path x after which zeta = reach. */
static double closed_path(const struct piece *p)
{
    const double r = p->force / p->S, gained = p->sense * p->stiffness * p->reach / p->S, end = r + gained;
    double q;
    if (p->m->n == 1.0)
        q = -log1p(gained / (r - 1.0));
    else if (p->backwards)
        q = atan2(gained, 1.0 + r * end);
    else
        q = 0.5 * log1p(2.0 * gained / ((1.0 - end) * (1.0 + r)));
    return q * p->S / p->stiffness;
}

/* Begin the part from time s to `end` at most; return false if z is at rest. */
static bool begin(struct piece *p, double side, double s, double end)
{
    GIVEN(p->m)
    p->force = side * hysteresis_force(given);
    const double S = piece_level(p, s), change = piece_level(p, end) - S;
    if (fabs(p->force - S) <= grain * S && fabs(change) <= grain * S)
        return false;
    p->sense = p->force < S ? 1.0 : -1.0;
    if (fabs(p->force - S) <= p->slack * S && change != 0.0)
        p->sense = sign(change);
    p->stiffness = 0.0;
    p->reach = INF;
    for (int i = 0; i < N; i++) {
        const double room = W[i] - p->sense * side * Fi[i];
        if (k[i] > 0.0 && room > grain * W[i]) {
            p->stiffness += k[i];
            p->reach = fmin(p->reach, room / k[i]);
        }
    }
    p->backwards = p->force < -grain * S;
    if (p->backwards && p->stiffness > 0.0) /* |r|^n has a kink at 0 */
        p->reach = fmin(p->reach, -p->force / p->stiffness);
    p->flat = !p->backwards && p->force < (flat_until(n) - 0.5 * behind_flat) * S;
    return true;
}

static void move(Model *m, double sense, double zeta, double reach)
{
    GIVEN(m)
    m->z = z + sense * zeta;
    for (int i = 0; i < N; i++) {
        const double room = W[i] - sense * Fi[i];
        const bool arrives =
            k[i] > 0.0 && (room <= grain * W[i] || (zeta >= reach && room <= k[i] * reach * 1.000000000001));
        m->Fi[i] = arrives ? sense * W[i] : limited(Fi[i] + sense * k[i] * zeta, W[i]);
    }
}

static bool follow_motion(Model *m, Motion motion)
{
    GIVEN(m)
    const double slope = motion.slope, side = sign(m->v != 0.0 ? m->v : slope), S = stribeck(v, Fc, Fs, vs, delta);
    const double v_end = fabs(velocity(&motion, motion.end)), S_end = stribeck(v_end, Fc, Fs, vs, delta);
    const double sensitivity = 1.0 + n * sigma1 * v_end / S_end; /* of F to Fh at the end, in sliding */
    double strongest = 0.0, stiffest = 0.0;
    for (int i = 0; i < N; i++) {
        m->Fi[i] = limited(Fi[i], W[i]);
        strongest += W[i];
        stiffest += k[i];
    }
    if (strongest < (1.0 - 1e-9) * fmax(Fs, Fc))
        m->run.warning = true;
    struct piece p = {m, motion, S, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, false, false, false};
    p.slack = 10.0 * relaxation_tolerance(m);
    const double arrival = motion.end;
    double s = motion.start;
    int budget = BUDGET;
    const double instant = 1e-18 * (arrival - s); /* time in which nothing moves */
    for (int pieces = 0; side != 0.0 && s < arrival - instant; pieces++) {
        if (pieces > 1000)
            return false;
        const double next = s + fmax(stribeck_piece(velocity(&p.motion, s), slope, Fc, Fs, vs, delta), instant),
                     end = next < arrival && next > s ? next : arrival;
        if (!begin(&p, side, s, end)) {
            s = end;
            continue;
        }
        p.size = stiffest > 0.0 ? fmin(piece_level(&p, s), piece_level(&p, end)) / stiffest : 1e-5;
        const double fine = p.size / fmin(sensitivity, 10.0); /* below this, rounding dominates */
        const double soon = s + 1e-12 * (end - s), level = fmax(piece_level(&p, s), piece_level(&p, soon));
        const double x = fabs(v) * (arrival - s), highest = falls_to(n) * level;
        double zeta = 0.0;
        if (fabs(p.force) > highest * (1.0 + 1e-9) && p.stiffness > 0.0) {
            zeta = fmin((fabs(p.force) - highest) * (1.0 + grain) / p.stiffness, p.reach);
        } else if (slope == 0.0 && p.stiffness == 0.0) {
            zeta = x * fabs(1.0 - signed_power(p.force / S, n));
            s = arrival;
        } else if (slope == 0.0 && (n == 1.0 || n == 2.0)) {
            zeta = closed_form(&p, x);
            if (zeta >= p.reach) {
                zeta = p.reach;
                s += fmin(closed_path(&p) / fabs(v), arrival - s);
            } else {
                s = arrival;
            }
        } else {
            p.near = slope != 0.0 && (p.backwards ? -p.force : p.force) > 0.999 * nearness * piece_level(&p, s);
            Curve *const place = p.near && p.stiffness > 0.0 ? piece_place : NULL;
            const Law law = {piece_rate, piece_goal, place, &p, slope == 0.0, &budget};
            const int how = follow(m, &law, &s, &zeta, end, fine, p.size * (p.flat ? 1.0 : sharpness(n)));
            if (how == FAILED)
                return failed(m, budget);
            if (how == REACHED && zeta >= p.reach - 1e-14 * p.size)
                zeta = p.reach;
        }
        move(m, side * p.sense, zeta, p.reach);
    }
    if (slope == 0.0) {
        contact(m, S);
        m->run.outputs_done = true;
    }
    return true;
}

#endif
