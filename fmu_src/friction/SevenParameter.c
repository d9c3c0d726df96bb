/* Seven-parameter model: presliding spring, delayed Stribeck friction, static friction that grows with dwell time.

   Armstrong-Helouvry, Dupont, Canudas de Wit: Automatica 30(7), 1994; equations as in (7) to (9) of Olsson, Astrom,
   Canudas de Wit, Gaefvert, Lischinsky: European Journal of Control 4(3), 1998.

       stuck:    F = load kt d,   dd/dt = v,   dt2/dt = 1
       slipping: F = load (Fc + Fs(t2) / (1 + (v(t - tauL) / vs)^2)) sign(v) + Fv v
       Fs(t2) = Fs_last + (Fs_inf - Fs_last) t2 / (t2 + gamma)
       load = max(Fn, 0) / Fn0

   d is the deflection of the contact, and t2 is the time since it became stuck; during slip, both keep their values at
   break-away. Fs is the excess over Fc: break-away occurs at Fc + Fs. Fs_last is the Stribeck part, Fs(t2) over the
   bracket, at the end of the previous sliding; before the end of the first sliding, it is the parameter Fs_a. The seven
   parameters are kt, Fc, Fv, Fs_inf, vs, tauL and gamma.

   The authors do not define the transitions between stick and slip. In this block:
   - The contact becomes stuck at v = 0 or when v changes its sign. The spring then starts at d = F / kt with the
     contact part of F at v = 0, so that F is continuous; t2 starts at 0.
   - It slips in the direction of v as soon as kt d in this direction reaches Fc + Fs(t2). F then jumps by the viscous
     part and by the reduction due to the delayed velocity. At v = 0 it never slips.
   - Initially it is stuck (d and t2 have start values) after a rest: v(t) = 0 for t < start.

   tauL is a pure delay. The history of v is stored as segments that are constant or linear in time, so v(t - tauL) and
   F do not depend on the communication steps; at a jump of v, the later value counts. Break-away is located inside the
   step as the root of a polynomial.

   Use it for frictional lag, rising static friction and break-away from presliding in lubricated machines. It needs v
   only; Fs_inf and gamma follow from break-away after different dwell times.

   Limits: F is discontinuous at break-away. There is no hysteresis with memory in presliding, as the spring is linear.
   Fs_a has no effect after the first sliding. 1024 segments of v are stored: if there are more within tauL, short
   neighbours are joined, which preserves the distance, and a warning is logged once; v(t - tauL) is then accurate to
   about tauL / 250 in time. If tauL is increased during a run, the missing history is taken as constant. */

#define MODEL       SevenParameter
#define SUMMARY     "Presliding spring, delayed Stribeck effect and rising static friction"
#define SOURCE      "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994"
#define CITES       "ArmstrongHelouvry1994"
#define STATUS      "equations (7) to (9) of Olsson et al. 1998"
#define FEATURES    "presliding, drift-free, Stribeck, lag, dwell, rate dependent"
#define NO_EXCHANGE "friction depends on the velocity at an earlier time, which a solver does not provide"
#define WARNING     "the velocity changed more than 1024 times within tauL; its history is thinned out"

/* clang-format off */
#define VARIABLES                                                                                                  \
    INPUT    (v,         VELOCITY,  0.0,               "relative sliding velocity")                                \
    OPTIONAL (Fn,        "N",       1.0,               "normal force")                                             \
    OUTPUT   (F,         FORCE,                        "friction " FORCE_NOUN ", opposes v")                       \
    STATE    (d,         LENGTH,    0.0,  1e-5,        "deflection of the contact while it is stuck")              \
    STATE    (t2,        TIME,      0.0,  1.0,         "dwell time: time since the contact became stuck")          \
    FLAG     (stuck,                                   "the contact is stuck")                                     \
    LOCAL    (v_delayed, VELOCITY,                     "v(t - tauL)")                                              \
    LOCAL    (Fs_last,   FORCE,                        "Stribeck part at the end of the previous sliding")         \
    LOCAL    (level,     FORCE,                        "break-away " FORCE_NOUN " at Fn0, Fc + Fs(t2)")            \
    PARAMETER(kt,        STIFFNESS, 1e5,  1e-9,  INF,  "stiffness of the contact at Fn0")                          \
    PARAMETER(Fc,        FORCE,     1.0,  0.0,   INF,  "Coulomb friction at Fn0")                                  \
    PARAMETER(Fv,        DAMPING,   0.4,  0.0,   INF,  "viscous coefficient")                                      \
    PARAMETER(Fs_a,      FORCE,     0.2,  0.0,   INF,  "static friction over Fc before the first sliding, at Fn0") \
    PARAMETER(Fs_inf,    FORCE,     0.5,  0.0,   INF,  "static friction over Fc after a long rest, at Fn0")        \
    PARAMETER(vs,        VELOCITY,  1e-3, 1e-12, INF,  "Stribeck velocity")                                        \
    PARAMETER(tauL,      TIME,      5e-3, 0.0,   INF,  "delay of the Stribeck effect, frictional lag")             \
    PARAMETER(gamma,     TIME,      1.0,  0.0,   INF,  "dwell time for half of the rise of static friction")       \
    PARAMETER(Fn0,       "N",       1.0,  1e-12, INF,  "normal force for which the parameters are valid")

#define CONTACT            \
    COULOMB  (Fc)          \
    STATIC   (Fc + Fs_inf) \
    VISCOUS  (Fv)          \
    STIFFNESS(kt)

#define IDENTIFIED                     \
    FIT    (Fs_inf, 0.2 * level, rest) \
    FIT    (vs, 0.1 * speed, slow)     \
    HELD   (Fs_a, 0.2 * level, rest)   \
    HELD   (tauL, 5e-3, swinging)      \
    HELD   (gamma, 1, rest)            \
    SLIDING(d, Fc / kt)
/* clang-format on */

enum { PIECES = 1024 };

/* Segment v(t) = v + rate (t - begin), until the next segment begins. */
struct piece {
    double begin, v, rate;
};

struct memory {
    double slip, Fs_last; /* direction of slip; 0: stuck */
    int slid;             /* a sliding phase has ended */
    int forgot;           /* segments have been discarded */
    unsigned thinned;     /* number of times segments were joined */
    int first, count;     /* ring buffer of the segments */
    struct piece ring[PIECES];
};

#define STEPS_BY step
#define MEMORY   struct memory
#define VALID_BY is_history
#define KEEPS_BY keep_history

#include "block.h"
#include "ramp.h"
#include "roots.h"
#include "search.h"
#include "load.h"

/* ---- The history of the velocity. */

static bool is_history(const Model *m)
{
    const struct memory *const past = &m->memory;
    bool good = is_direction(past->slip) && isfinite(past->Fs_last) && is_count(past->slid, 1.0) &&
                is_count(past->forgot, 1.0) && past->first < PIECES && is_count(past->first, PIECES) &&
                is_count(past->count, PIECES);
    for (int i = 0; good && i < past->count; i++)
        good = isfinite(past->ring[(past->first + i) % PIECES].begin);
    return good;
}

static struct piece *piece(struct memory *past, int i) { return &past->ring[(past->first + i) % PIECES]; }

/* A step appends a few segments, the first of which may replace the last one, unless the history is thinned out. */
static void keep_history(Memory *to, const Memory *from, const Model *m, bool follows)
{
    (void)m;
    if (follows && to->thinned == from->thinned && to->count > 0) {
        const int end = (from->first + from->count) % PIECES;
        int i = (to->first + to->count - 1) % PIECES;
        memcpy(to, from, offsetof(struct memory, ring));
        do {
            to->ring[i] = from->ring[i];
            i = (i + 1) % PIECES;
        } while (i != end);
    } else
        *to = *from;
}

static double along(const struct piece *p, double t) { return p->v + p->rate * (t - p->begin); }

/* Return v up to now: at a jump, the earlier value. */
static double until_now(const Model *m)
{
    const struct memory *const past = &m->memory;
    return past->count > 0 ? along(&past->ring[(past->first + past->count - 1) % PIECES], m->time) : 0.0;
}

static double begin_of(const void *past, int64_t i)
{
    const struct memory *const of = (const struct memory *)past;
    return of->ring[(of->first + i) % PIECES].begin;
}

/* Return v(t - tauL): at a jump, the later value, even if the times differ by rounding. */
static double delayed(const Model *m)
{
    const struct memory *const past = &m->memory;
    const double t = m->time - m->tauL, later = t + 1e-9 * m->tauL + 1e-15 * fabs(m->time);
    if (m->tauL == 0.0)
        return m->v;
    const int last = (int)last_not_above(begin_of, past, -1, past->count, later); /* segment that has begun */
    const struct piece at_rest = {0.0, 0.0, 0.0}, oldest = {0.0, past->ring[past->first].v, 0.0};
    if (last < 0)
        return along(past->forgot ? &oldest : &at_rest, t);
    return along(&past->ring[(past->first + last) % PIECES], t);
}

/* Join neighbours whose total duration is at most four times the mean duration, at least a quarter of the segments, by
   the line through their mean values, which preserves the distance. */
static void thin_out(struct memory *past, double now)
{
    const double longest = 4.0 * (now - piece(past, 0)->begin) / (double)PIECES;
    int kept = 0;
    for (int i = 0; i < PIECES; i++) {
        struct piece a = *piece(past, i);
        const double end = i + 2 < PIECES ? piece(past, i + 2)->begin : now;
        if (i + 1 < PIECES && end - a.begin <= longest) {
            const struct piece b = *piece(past, ++i);
            const double at_a = 0.5 * (a.begin + b.begin), at_b = 0.5 * (b.begin + end);
            const double rate = (along(&b, at_b) - along(&a, at_a)) / (at_b - at_a);
            a = (struct piece){a.begin, along(&a, at_a) - rate * (at_a - a.begin), rate};
        }
        *piece(past, kept++) = a;
    }
    past->count = kept;
    past->thinned++;
}

/* Append v for the step from now over h, unless it continues the last segment. */
static void remember(Model *m, double h)
{
    struct memory *const past = &m->memory;
    const double now = m->time, v = m->v, rate = m->slope[INPUT_v], end = v + rate * h;
    if (past->count > 0) {
        struct piece *const last = piece(past, past->count - 1);
        const double same = 1e-14 * fmax(fabs(v), fabs(end));
        if (fabs(along(last, now) - v) <= same && fabs(along(last, now + h) - end) <= same)
            return;
        if (!(now > last->begin))
            past->count--; /* it had no duration */
    }
    if (past->count == PIECES) {
        while (past->count > 1 && piece(past, 1)->begin < now - (1.0 + 1e-6) * m->tauL) {
            past->first = (past->first + 1) % PIECES;
            past->count--;
            past->forgot = 1;
        }
        if (past->count == PIECES) {
            thin_out(past, now);
            m->run.warning = true;
        }
    }
    *piece(past, past->count++) = (struct piece){now, v, rate};
}

typedef struct {
    double slip, d, t2, Fs_last;
    bool stopped; /* just now */
} Contact;

/* Return Fs(t2), the static friction in excess of Fc. */
static double excess(const Model *m, double t2, double Fs_last)
{
    return m->gamma > 0.0 ? Fs_last + (m->Fs_inf - Fs_last) * (t2 / (t2 + m->gamma)) : m->Fs_inf;
}

/* Return the fraction of the Stribeck effect at the delayed velocity. */
static double share(const Model *m, double v_delayed) { return 1.0 / (1.0 + square(v_delayed / m->vs)); }

/* Return whether the spring force has reached the break-away level in the direction s, or is at the level and rises
   faster. */
static bool breaks_away(const Model *m, const Contact *c, double s)
{
    const double level = m->Fc + excess(m, c->t2, c->Fs_last), over = m->kt * s * c->d - level;
    const double level_rate = m->gamma > 0.0 ? (m->Fs_inf - c->Fs_last) * m->gamma / square(c->t2 + m->gamma) : 0.0;
    return over > 1e-13 * level || (over >= -1e-13 * level && m->kt * fabs(m->v) >= level_rate);
}

/* Return the contact at the current velocity with the direction s: it stops if it slipped in another direction, and
   slips if the spring force is large enough. */
static Contact contact(const Model *m, double s)
{
    const struct memory *const past = &m->memory;
    const double v_delayed = m->tauL > 0.0 ? delayed(m) : until_now(m);
    Contact c = {past->slip, m->d, m->t2, past->slid ? past->Fs_last : m->Fs_a, false};
    if (c.slip != 0.0 && s != c.slip) {
        c.Fs_last = excess(m, c.t2, c.Fs_last) * share(m, v_delayed);
        c.d = c.slip * (m->Fc + c.Fs_last) / m->kt;
        c.t2 = c.slip = 0.0;
        c.stopped = true;
    }
    if (c.slip == 0.0 && s != 0.0 && breaks_away(m, &c, s))
        c.slip = s;
    return c;
}

/* If the contact has stopped at the end of a step, the outputs show it immediately, d and t2 from the next step on. */
static void equations(Model *m)
{
    GIVEN(m)
    const double load = load_of(Fn, Fn0), before = delayed(m);
    const Contact c = contact(m, sign(v));
    const double Fs = excess(m, c.t2, c.Fs_last);

    m->F = c.slip != 0.0 ? load * (Fc + Fs * share(m, before)) * c.slip + Fv * v : load * kt * c.d;
    m->der_d = c.slip != 0.0 ? 0.0 : v;
    m->der_t2 = c.slip != 0.0 ? 0.0 : 1.0;
    m->stuck = c.slip != 0.0 ? 0.0 : 1.0;
    m->v_delayed = before;
    m->Fs_last = c.Fs_last;
    m->level = Fc + Fs;
}

/* ---- Steps: break-away as the root of a polynomial. */

/* c0 + c1 t + c2 t^2 + c3 t^3 */
static Taylor cubic(const void *data, double t)
{
    const double *const c = (const double *)data;
    return (Taylor){.value = c[0] + t * (c[1] + t * (c[2] + t * c[3])),
                    .slope = c[1] + t * (2.0 * c[2] + t * 3.0 * c[3])};
}

/* Return the first time within h at which the cubic, which is not positive at 0, becomes positive, or INF. */
static double first_rise(const double *c, double h)
{
    double ends[4] = {0.0, h, h, h};
    int n = 1;
    /* the cubic is monotone between the roots of 3 c3 t^2 + 2 c2 t + c1 */
    const double discriminant = c[2] * c[2] - 3.0 * c[3] * c[1];
    if (discriminant > 0.0) {
        const double q = -(c[2] + copysign(sqrt(discriminant), c[2]));
        const double one = c[3] != 0.0 ? q / (3.0 * c[3]) : INF, other = c[1] / q;
        const double early = fmin(one, other), late = fmax(one, other);
        if (early > 0.0 && early < h)
            ends[n++] = early;
        if (late > 0.0 && late < h)
            ends[n++] = late;
    }
    for (int i = 0; i < n; i++)
        if (cubic(c, ends[i + 1]).value > 0.0) {
            double low = ends[i], high = ends[i + 1];
            newton_between(cubic, c, 0.5 * (low + high), &low, &high);
            return high;
        }
    return INF;
}

/* Return the time until kt d in the direction s reaches Fc + Fs(t2), or INF if not within h: (kt s d - Fc - Fs_last)
   (t2 + gamma) - (Fs_inf - Fs_last) t2 = 0, where d is quadratic and t2 linear in time. */
static double time_to_break_away(const Model *m, const Contact *c, double s, double h)
{
    const double over = m->kt * s * c->d - m->Fc - c->Fs_last, rise = m->Fs_inf - c->Fs_last;
    const double pull = m->kt * fabs(m->v), half = 0.5 * m->kt * s * m->slope[INPUT_v], t = c->t2 + m->gamma;
    const double at_once[] = {fmin(over - rise, 0.0), pull, half, 0.0};
    const double in_time[] = {fmin(over * t - rise * c->t2, 0.0), over + pull * t - rise, pull + half * t, half};
    return first_rise(m->gamma > 0.0 ? in_time : at_once, h);
}

static bool step(Model *m, double h)
{
    GIVEN(m)
    const double rate = m->slope[INPUT_v], s = v != 0.0 ? sign(v) : sign(rate);

    Contact c = contact(m, sign(v));
    remember(m, h);
    if (c.stopped) {
        m->memory.slid = 1;
        m->memory.Fs_last = c.Fs_last;
    }
    if (c.slip == 0.0 && s != 0.0 && breaks_away(m, &c, s))
        c.slip = s;
    if (c.slip == 0.0) {
        const double wait = s != 0.0 ? time_to_break_away(m, &c, s, h) : INF, t = fmin(wait, h);
        c.d += path_after(v, rate, t);
        c.t2 += t;
        if (wait <= h)
            c.slip = s;
    }
    m->d = c.d;
    m->t2 = c.t2;
    m->memory.slip = c.slip;
    return true;
}
