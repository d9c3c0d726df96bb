/* Karnopp's friction with the mass inside: below the velocity DV the body is reported to be at rest.

   Karnopp: Journal of Dynamic Systems, Measurement, and Control 107(1), 1985, from memory of the paper. Its state is
   the momentum m w, which goes on to be integrated inside the band; only the reported velocity v is zero there.

       m dw/dt = F_ext - F,   dx/dt = v
       |w| <  DV:  F = F_ext, at most load Fs in size;  v = 0
       |w| >= DV:  F = load Fc sign(w) + Fv w;          v = w
       load = max(Fn, 0) / Fn0

   A body that was sliding and is held keeps w at the edge of the band, just below DV, and breaks away from there. It
   stays at the edge, at rest, as long as sliding at DV would slow it down, even if F_ext exceeds load Fs; this can
   only be so for Fs < Fc + Fv DV.

   F_ext is the sum of all forces on the mass but friction. The step is exact for an F_ext and Fn that are constant
   or linear in time: motion in closed form between the events, which are located inside the step.

   Use it to let a mass really stop and stick: positions at rest, limit cycles, stick-slip.

   Limits: the first break-away is late, as w has to pass the whole band: by sqrt(2 m DV / (k V)) if F_ext grows at the
   rate k V. DV has to be small compared with the velocities that matter, and need not be larger than a change of
   velocity in one step, as the events are located. No Stribeck effect, no presliding. */

/* @article{Karnopp1985,
     author  = {Karnopp, D.},
     title   = {Computer simulation of stick-slip friction in mechanical dynamic systems},
     journal = {Journal of Dynamic Systems, Measurement, and Control},
     volume  = {107}, number = {1}, pages = {100--103}, year = {1985}} */

#define MODEL    KarnoppMass
#define SUMMARY  "A mass with Karnopp's friction, at rest inside a dead band of velocity"
#define SOURCE   "Karnopp, ASME Journal of Dynamic Systems, Measurement, and Control 107(1), 1985"
#define FEATURES "drift-free, rate dependent, needs force, mass inside"
#define PORTRAIT "pushed_mass"
#define NEEDS    "real stop"

/* clang-format off */
#define VARIABLES                                                                                           \
    INPUT       (F_ext, FORCE,    0.0,              "sum of all forces on the mass but friction")           \
    OPTIONAL    (Fn,    "N",      1.0,              "normal force")                                         \
    OUTPUT      (v,     VELOCITY,                   "velocity, 0 inside the band")                          \
    OUTPUT      (F,     FORCE,                      "friction force")                                       \
    STATE_OUTPUT(x,     LENGTH,   x0,  1.0,         "position")                                             \
    STATE_OUTPUT(w,     VELOCITY, v0,  1.0,         "momentum over mass: the velocity, not zeroed inside the band") \
    FLAG        (stuck,                             "inside the band and held by friction")                 \
    PARAMETER   (m,     MASS,     1.0,  1e-12, INF, "mass")                                                 \
    PARAMETER   (Fc,    FORCE,    1.0,  0.0,   INF, "Coulomb friction at Fn0")                              \
    PARAMETER   (Fs,    FORCE,    1.5,  0.0,   INF, "static friction at Fn0, may be below Fc")              \
    PARAMETER   (Fv,    DAMPING,  0.4,  0.0,   INF, "viscous coefficient")                                  \
    PARAMETER   (DV,    VELOCITY, 1e-3, 1e-12, INF, "half width of the band of velocity that counts as rest") \
    PARAMETER   (Fn0,   "N",      1.0,  1e-12, INF, "normal force at which the parameters hold")            \
    FIXED       (x0,    LENGTH,   0.0,  -INF,  INF, "initial position")                                     \
    FIXED       (v0,    VELOCITY, 0.0,  -INF,  INF, "initial velocity")

#define CONTACT \
    COULOMB(Fc) \
    STATIC (Fs) \
    VISCOUS(Fv)

#define IN_LOOP   \
    FORCES(F_ext) \
    MASS  (m)
/* clang-format on */

#define STEPS_BY step

#include "block.h"
#include "load.h"

/* Just inside the band: a body that comes to rest from sliding stays there. */
static double edge(double DV) { return nextafter(DV, 0.0); }

static void equations(Model *model)
{
    GIVEN(model)
    const double load = load_of(Fn, Fn0);
    const double sliding = load * Fc + Fv * DV; /* friction just outside the band */
    const double high = w == edge(DV) ? fmax(load * Fs, sliding) : load * Fs;
    const double low = w == -edge(DV) ? fmax(load * Fs, sliding) : load * Fs;
    const bool inside = fabs(w) < DV;

    model->stuck = inside && F_ext >= -low && F_ext <= high ? 1.0 : 0.0;
    model->v = inside ? 0.0 : w;
    if (!inside)
        model->F = load * Fc * sign(w) + Fv * w;
    else
        model->F = model->stuck != 0.0 ? F_ext : clip(F_ext, -load * Fs, load * Fs);
    model->der_x = model->v;
    model->der_w = (F_ext - model->F) / m;
}

/* A quantity that is linear in time. */
typedef struct {
    double now, rate;
} Line;
static Line later(Line a, double t) { return (Line){a.now + a.rate * t, a.rate}; }
static Line sum(double p, Line a, double q, Line b) { return (Line){p * a.now + q * b.now, p * a.rate + q * b.rate}; }

/* Time from which both lines are positive, INF if never. */
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

/* First time at which the distance is covered by speed t + acceleration t^2 / 2; distance > 0, speed >= 0. */
static double time_to_cover(double distance, double speed, double acceleration)
{
    const double root = speed * speed + 2.0 * acceleration * distance;
    return root > 0.0 ? 2.0 * distance / (speed + sqrt(root)) : INF;
}

/* Sliding: y' = rate - a y + jerk t. The integrals over exp(-a t) by phi functions, by series where a t is small. */
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

/* Time at which y falls to `floor`, INF if not within h. As y' is monotone, y has at most one extremum. */
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
    double t = high;
    for (int i = 0; i < 200 && low < high; i++) {
        const Slide at = slide(y, dy, jerk, a, t);
        if (at.y < floor)
            high = t;
        else
            low = t;
        const double newton = t - (at.y - floor) / at.dy;
        const double next = newton > low && newton < high ? newton : 0.5 * (low + high);
        if (next == t || next <= low || next >= high)
            break;
        t = next;
    }
    return t;
}

static bool step(Model *model, double h)
{
    GIVEN(model)
    enum { MOST_EVENTS = 100 };
    const double Fn_rate = model->slope[INPUT_Fn];
    Line force = {F_ext, model->slope[INPUT_F_ext]};
    Line load = {load_of(Fn, Fn0), Fn > 0.0 || (Fn == 0.0 && Fn_rate > 0.0) ? Fn_rate / Fn0 : 0.0};

    bool spent[] = {false, false}; /* the force has fallen back into the static range, for s = -1 and 1 */
    bool leaving = false;          /* w has just come to the edge from inside, and goes on */
    double rest = h, at = w;
    int events = 0;
    while (rest > 0.0 && events++ < MOST_EVENTS) {
        if (fabs(at) >= DV) { /* sliding, until the band is met */
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
        /* inside the band: held until the force passes static friction, at the edge also that of sliding */
        double wait = INF, s = 0.0;
        for (int i = 0; i < 2; i++) {
            const double way = i == 0 ? -1.0 : 1.0;
            const Line beyond = sum(way, force, -Fs, load);
            Line outside = sum(way, force, -Fc, load);
            outside.now -= Fv * DV;
            const double until = spent[i] ? INF : both_positive(beyond, at == way * edge(DV) ? outside : beyond);
            if (until < wait) {
                wait = until;
                s = way;
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
        /* pushed across the band by what exceeds static friction */
        const Line beyond = sum(s, force, -Fs, load);
        const double push = fmax(beyond.now, 0.0) / m, jerk = beyond.rate / m;
        const double cross = time_to_cover(DV - s * at, push, jerk);
        const double fall = jerk < 0.0 ? -push / jerk : INF;
        const double t = fmin(rest, fmin(cross, fall));
        at += s * t * (push + 0.5 * t * jerk);
        force = later(force, t);
        load = later(load, t);
        rest -= t;
        if (t == cross)
            at = s * edge(DV); /* from where it slides on at once, or is held */
        else if (t == fall)
            spent[s > 0.0] = true;
    }
    model->w = at;
    return rest <= 0.0 ? true : too_much(model);
}
