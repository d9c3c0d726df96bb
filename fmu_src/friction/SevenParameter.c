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
#define NEEDS       "dwell"
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

#define IDENTIFIED SLIDING(d, Fc / kt)
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
#include "load.h"
#include "SevenParameter_history.h"

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

#include "SevenParameter_ramp.h"
