/* Steps of KarnoppMass.c, exact for forces that are constant or linear in time: motion in closed form from event to
   event. Included at its end. */

#ifndef KARNOPP_MASS_RAMP_H
#define KARNOPP_MASS_RAMP_H

#include "ramp.h"
#include "roots.h"

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

#endif
