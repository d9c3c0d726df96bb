/* Karnopp friction including the mass: below the velocity DV, the body is reported to be at rest.

   Karnopp: Journal of Dynamic Systems, Measurement, and Control 107(1), 1985. The state is the momentum m w, which is
   also integrated inside the band; only the reported velocity v is zero there.

       m dw/dt = F_ext - F,   dx/dt = v
       |w| <  DV:  F = F_ext, |F| <= load Fs;  v = 0
       |w| >= DV:  F = load Fc sign(w) + Fv w;          v = w
       load = max(Fn, 0) / Fn0

   A body that stops after sliding keeps w at the edge of the band, just below DV, and breaks away from there. It stays
   at the edge, at rest, as long as sliding at DV would decelerate it, even if F_ext exceeds load Fs; this is only
   possible for Fs < Fc + Fv DV.

   F_ext is the sum of all forces on the mass except friction. The step is exact for F_ext and Fn that are constant or
   linear in time: the motion is in closed form between events, which are located inside the step.

   Use it if a mass must come to rest exactly: positions at rest, limit cycles, stick-slip.

   Limits: the first break-away is late, as w must pass the whole band: by sqrt(2 m DV / (k V)) if F_ext grows at the
   rate k V. DV must be small compared with the relevant velocities; it need not exceed the change of velocity in one
   step, as events are located. No Stribeck effect, no presliding. */

#define MODEL    KarnoppMass
#define SUMMARY  "{Mass} with Karnopp friction, at rest inside a velocity dead band"
#define SOURCE   "Karnopp, ASME Journal of Dynamic Systems, Measurement, and Control 107(1), 1985"
#define CITES    "Karnopp1985"
#define STATUS   "not checked against the paper"
#define FEATURES "drift-free, rate dependent, needs force, mass inside"

/* clang-format off */
#define VARIABLES                                                                                                      \
    INPUT       (F_ext, FORCE,    0.0,              "sum of all " FORCE_NOUN "s on the " MASS_NOUN " except friction") \
    OPTIONAL    (Fn,    "N",      1.0,              "normal force")                                                    \
    OUTPUT      (v,     VELOCITY,                   "velocity, 0 inside the band")                                     \
    OUTPUT      (F,     FORCE,                      "friction " FORCE_NOUN)                                            \
    STATE_OUTPUT(x,     LENGTH,   x0,  1.0,         "position")                                                        \
    STATE_OUTPUT(w,     VELOCITY, v0,  1.0,         "momentum over " MASS_NOUN ": velocity without the dead band")     \
    FLAG        (stuck,                             "inside the band and held by friction")                            \
    PARAMETER   (m,     MASS,     1.0,  1e-12, INF, MASS_NOUN)                                                         \
    PARAMETER   (Fc,    FORCE,    1.0,  0.0,   INF, "Coulomb friction at Fn0")                                         \
    PARAMETER   (Fs,    FORCE,    1.5,  0.0,   INF, "static friction at Fn0 (usually above Fc)")                       \
    PARAMETER   (Fv,    DAMPING,  0.4,  0.0,   INF, "viscous coefficient")                                             \
    PARAMETER   (DV,    VELOCITY, 1e-3, 1e-12, INF, "half width of the velocity band treated as standstill")           \
    PARAMETER   (Fn0,   "N",      1.0,  1e-12, INF, "normal force for which the parameters are valid")                 \
    FIXED       (x0,    LENGTH,   0.0,  -INF,  INF, "initial position")                                                \
    FIXED       (v0,    VELOCITY, 0.0,  -INF,  INF, "initial velocity")

#define CONTACT \
    COULOMB(Fc) \
    STATIC (Fs) \
    VISCOUS(Fv)
/* clang-format on */

#define STEPS_BY      step
#define EVENTS        2
#define DECIDES_BY    transition
#define REINITIALISES "w"
#define MEMORY        struct band
#define VALID_BY      is_band
#define KEEPS_BY      keep_decisions

struct band {     /* in model exchange */
    double side;  /* of the band on which the mass slides; 0: inside */
    double stuck; /* 1: inside and held */
};

#include "block.h"
#include "ramp.h"
#include "roots.h"
#include "load.h"
#include "until_change.h"

static bool is_band(const Model *model)
{
    return is_direction(model->memory.side) && is_count(model->memory.stuck, 1.0);
}

/* Return the velocity just inside the band, which a body keeps when it comes to rest. */
static double edge(double DV) { return nextafter(DV, 0.0); }

/* Return the friction that holds the mass inside the band against a force in this direction. */
static inline double hold(const Model *model, double direction)
{
    GIVEN(model)
    const double load = load_of(Fn, Fn0), level = load * Fs;
    return direction * w == edge(DV) ? fmax(level, load * Fc + Fv * DV /* friction just outside */) : level;
}

/* Return how far F_ext is below that friction. */
static double margin(const Model *model)
{
    return fmin(model->F_ext + hold(model, -1.0), hold(model, 1.0) - model->F_ext);
}

static void equations(Model *model)
{
    GIVEN(model)
    const bool frozen = model->run.frozen;
    const double load = load_of(Fn, Fn0), side = frozen ? model->memory.side : fabs(w) < DV ? 0.0 : sign(w);
    const bool inside = side == 0.0;

    if (frozen)
        model->stuck = model->memory.stuck;
    else
        model->stuck = inside && (fabs(F_ext) <= load * Fs || margin(model) >= 0.0) ? 1.0 : 0.0;
    model->v = inside ? 0.0 : w;
    if (!inside)
        model->F = load * Fc * side + Fv * w;
    else
        model->F = model->stuck != 0.0 ? F_ext : clip(F_ext, -load * Fs, load * Fs);
    model->der_x = model->v;
    model->der_w = (F_ext - model->F) / m;
}

/* ---- model exchange ----------------------------------------------------------------------------------------- */

static void indicators(const Model *model, double *left)
{
    GIVEN(model)
    const double side = model->memory.side;
    left[0] = until_change(side, (side != 0.0 ? side * w : fabs(w)) - DV, DV);
    left[1] = side != 0.0 ? 1.0 : until_change(model->memory.stuck, margin(model), load_of(Fn, Fn0));
}

static void transition(Model *model)
{
    GIVEN(model)
    struct band *const now = &model->memory;
    if (fabs(w) >= DV)
        now->side = sign(w);
    else if (now->side != 0.0) {
        model->w = now->side * edge(DV);
        now->side = 0.0;
    }
    now->stuck = now->side == 0.0 && margin(model) >= 0.0 ? 1.0 : 0.0;
    if (now->side == 0.0 && now->stuck == 0.0 && fabs(model->w) == edge(DV) && F_ext * w > 0.0) {
        now->side = sign(w); /* slides on from the edge */
        model->w = now->side * DV;
    }
}

/* ---- Steps, exact for forces that are constant or linear in time: motion in closed form from event to
   event. */

/* A quantity that is linear in time. */
typedef struct {
    double now, rate;
} Line;
static Line later(Line a, double t) { return (Line){a.now + a.rate * t, a.rate}; }
static Line sum(double p, Line a, double q, Line b) { return (Line){p * a.now + q * b.now, p * a.rate + q * b.rate}; }

/* Return the time from which both lines are positive, or INF if never. */
static double both_positive(Line a, Line b)
{
    const Line lines[] = {a, b};
    double begin = 0.0, end = INF;
    for (int i = 0; i < 2; i++) {
        const Line l = lines[i];
        if (l.now <= 0.0)
            begin = fmax(begin, l.rate > 0.0 ? -l.now / l.rate : INF);
        else if (l.rate < 0.0)
            end = fmin(end, -l.now / l.rate);
    }
    return begin < end ? begin : INF;
}

/* Return the first time at which speed t + acceleration t^2 / 2 equals the distance > 0; speed >= 0. */
static double time_to_cover(double distance, double speed, double acceleration)
{
    const double squared = squared_speed_after(distance, speed, acceleration);
    return squared > 0.0 ? time_between(distance, speed, sqrt(squared)) : INF;
}

/* Sliding: y' = rate - a y + jerk t. The integrals of exp(-a t) use phi functions, with series for small a t. */
typedef struct {
    double y, dy, x; /* at time t */
} Slide;
static Slide slide(double y, double dy, double jerk, double a, double t)
{
    const double z = -a * t;
    double phi1, phi2, phi3; /* phi1 = (e^z - 1)/z, phi2 = (phi1 - 1)/z, phi3 = (phi2 - 1/2)/z */
    if (fabs(z) < 0.5) {
        phi3 = 1.0;
        for (int k = 16; k >= 4; k--)
            phi3 = 1.0 + phi3 * z / k;
        phi3 /= 6.0;
        phi2 = 0.5 + z * phi3;
        phi1 = 1.0 + z * phi2;
    } else {
        phi1 = expm1(z) / z;
        phi2 = (phi1 - 1.0) / z;
        phi3 = (phi2 - 0.5) / z;
    }
    return (Slide){y + t * (phi1 * dy + t * phi2 * jerk), dy * exp(z) + t * phi1 * jerk,
                   t * (y + t * (phi2 * dy + t * phi3 * jerk))};
}

/* Data for the distance of y below a floor. */
typedef struct {
    double y, dy, jerk, a, floor;
} Fall;
static Taylor below(const void *data, double t)
{
    const Fall *const f = (const Fall *)data;
    const Slide at = slide(f->y, f->dy, f->jerk, f->a, t);
    return (Taylor){.value = f->floor - at.y, .slope = -at.dy};
}

/* Return the time at which y decreases to `floor`, or INF if not within h. As y' is monotone, y has at most one
   extremum. */
static double time_to_fall(double y, double dy, double jerk, double a, double floor, double h)
{
    if (y <= floor && (dy < 0.0 || (dy == 0.0 && jerk < 0.0)))
        return 0.0;
    double low = 0.0, high = h;
    if (dy * jerk < 0.0) {
        const double turn = a > 0.0 ? log1p(-a * dy / jerk) / a : -dy / jerk;
        if (turn < h && dy > 0.0)
            low = turn;
        else if (turn < h)
            high = turn;
    }
    if (slide(y, dy, jerk, a, high).y >= floor)
        return INF;
    const Fall fall = {y, dy, jerk, a, floor};
    return newton_between(below, &fall, high, &low, &high);
}

static bool step(Model *model, double h)
{
    GIVEN(model)
    enum { MOST_EVENTS = 100 };
    const double Fn_rate = model->slope[INPUT_Fn];
    Line force = {F_ext, model->slope[INPUT_F_ext]};
    Line load = {load_of(Fn, Fn0), Fn > 0.0 || (Fn == 0.0 && Fn_rate > 0.0) ? Fn_rate / Fn0 : 0.0};

    bool spent[] = {false, false}; /* the force has returned to the static range, for s = -1 and 1 */
    bool leaving = false;          /* w has just reached the edge from inside and continues */
    double rest = h, at = w;
    int events = 0;
    while (rest > 0.0 && events++ < MOST_EVENTS) {
        if (fabs(at) >= DV) { /* sliding, until the band is reached */
            const double s = sign(at), y = s * at, a = Fv / m;
            const Line drive = sum(s / m, force, -Fc / m, load);
            const double dy = leaving ? fmax(drive.now - a * y, 0.0) : drive.now - a * y;
            const double stop = time_to_fall(y, dy, drive.rate, a, DV, rest), t = fmin(stop, rest);
            const Slide end = slide(y, dy, drive.rate, a, t);
            model->x += s * end.x;
            at = stop <= rest ? s * edge(DV) : s * end.y;
            leaving = false;
            force = later(force, t);
            load = later(load, t);
            rest -= t;
            continue;
        }
        /* inside the band: held until the force exceeds static friction and, at the edge, also sliding friction */
        double wait = INF, s = 0.0;
        for (int i = 0; i < 2; i++) {
            const double direction = i == 0 ? -1.0 : 1.0;
            const Line beyond = sum(direction, force, -Fs, load);
            Line outside = sum(direction, force, -Fc, load);
            outside.now -= Fv * DV;
            const double until = spent[i] ? INF : both_positive(beyond, at == direction * edge(DV) ? outside : beyond);
            if (until < wait) {
                wait = until;
                s = direction;
            }
        }
        const double held = fmin(wait, rest);
        force = later(force, held);
        load = later(load, held);
        rest -= held;
        if (rest <= 0.0 || s == 0.0)
            break;
        if (at == s * edge(DV)) {
            at = s * DV;
            leaving = true;
            continue;
        }
        /* accelerated across the band by the force beyond static friction */
        const Line beyond = sum(s, force, -Fs, load);
        const double push = fmax(beyond.now, 0.0) / m, jerk = beyond.rate / m;
        const double cross = time_to_cover(DV - s * at, push, jerk);
        const double fall = jerk < 0.0 ? -push / jerk : INF;
        const double t = fmin(rest, fmin(cross, fall));
        at += s * path_after(push, jerk, t);
        force = later(force, t);
        load = later(load, t);
        rest -= t;
        if (t == cross)
            at = s * edge(DV); /* slides on immediately from there, or is held */
        else if (t == fall)
            spent[s > 0.0] = true;
    }
    model->w = at;
    return rest <= 0.0 ? true : too_much(model);
}
