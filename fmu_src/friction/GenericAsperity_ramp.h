/* Steps of GenericAsperity.c: each tip from event to event. Included at its end. */

#ifndef GENERIC_ASPERITY_RAMP_H
#define GENERIC_ASPERITY_RAMP_H

#include "oscillator.h"

/* Data for the force on a stuck tip beyond the cone of friction, to the side s, after the time t. */
typedef struct {
    const Model *model;
    const Course *course;
    double d, age, normal, slope, slack;
    int s;
} Hold;

static Taylor overload(const void *data, double t)
{
    const Hold *const hold = (const Hold *)data;
    GIVEN(hold->model)
    const Course *const c = hold->course;
    const double t_c = hold->age + t, fresh = exp(-t_c / tau), adhesion = mu0 + dmu * (1.0 - fresh);
    const double area = 1.0 + creep * log1p(t_c / t0), growth = creep / (t0 + t_c);
    const double largest = 1.0 + creep * log1p((hold->age + c->rest) / t0);
    return (Taylor){hold->s * (k_t * (hold->d + way_in(c, t)) - hold->normal * hold->slope) -
                        hold->normal * adhesion * area - hold->slack,
                    hold->s * k_t * (c->v + c->a * t) - hold->normal * (adhesion * growth + dmu / tau * fresh * area),
                    k_t * fabs(c->a) +
                        hold->normal * ((mu0 + dmu) * growth / (t0 + t_c) + dmu / (tau * tau) * fresh * largest)};
}

/* Detach a tip; it oscillates until the amplitude has decayed to 1 %. */
static void let_go(const Model *model, Tip *tip)
{
    GIVEN(model)
    const double omega = sqrt(k_t / m), zeta = 0.5 * k_h / k_t;
    const double decay = omega * (zeta > 1.0 ? 1.0 / (zeta + sqrt(zeta * zeta - 1.0)) : zeta);
    *tip = (Tip){.p = tip->p, .d = tip->d, .clock = log(100.0) / decay, .mode = FREE};
}

/* Advance a stuck tip until the force leaves the cone, immediately or later. */
static void stick(const Model *model, const Surface *surface, Tip *tip, Course *c, double *left)
{
    const double normal = surface->k_n * fmax(reach(surface, tip->p), 0.0);
    /* rounding of a force at the limit must not cause slip */
    const double slack = 1e-13 * surface->k_n * (surface->h + surface->A) * (surface->A * surface->k + surface->mu0);
    Hold hold = {model, c, tip->d, tip->clock, normal, incline(surface, tip->p), slack, c->side};
    const double limit = normal * bond(model, tip->clock) + slack, force = surface->k_t * tip->d - normal * hold.slope;
    const double then = force + surface->k_t * way_in(c, c->rest);
    double t = INF;
    if (fabs(force) > limit) {
        hold.s = force > 0.0 ? FORWARD : BACK;
        t = 0.0;
    } else if (c->side * then > limit) /* bonds only become stronger, so otherwise it holds */
        t = first_zero(overload, &hold, c->rest, left);

    const bool breaks = t < c->rest;
    t = fmin(t, c->rest);
    tip->d += way_in(c, t);
    tip->clock += t;
    pass(c, t);
    if (!breaks)
        return;
    /* the tip springs forward into balance */
    const double base = tip->p + tip->d;
    const SlipEnd reached = slip_to(surface, hold.s, tip->p, base, false, left);
    const double d = reached.lost ? base - reached.p : balanced(surface, hold.s, reached.p);
    *tip = (Tip){.p = reached.p, .d = d, .mode = hold.s};
    if (reached.lost)
        let_go(model, tip);
}

/* Advance quasi-static slip to the side s until the slider stops driving the tip or contact is lost. */
static void slip(const Model *model, const Surface *surface, Tip *tip, Course *c, double *left)
{
    GIVEN(model)
    const int s = tip->mode;
    const double spare = s * (balanced(surface, s, tip->p) - tip->d); /* nonzero if a parameter has changed */
    if (c->side != s || spare > 1e-9 * k_n / k_t * (surface->h + A) * (A * surface->k + mu0)) {
        tip->mode = STUCK;
        return;
    }
    const double base = tip->p + tip->d;
    const SlipEnd reached = slip_to(surface, s, tip->p, base + way_in(c, c->rest), true, left);
    const double t = reached.lost ? fmin(time_for(c, reached.base - base), c->rest) : c->rest;
    tip->p = reached.p;
    tip->d = reached.lost ? base + way_in(c, t) - reached.p : balanced(surface, s, reached.p);
    pass(c, t);
    if (reached.lost)
        let_go(model, tip);
}

/* Advance a free tip: it oscillates until it may land, and longer over a gap. */
static void swing_free(const Model *model, const Surface *surface, Tip *tip, Course *c)
{
    GIVEN(model)
    const double base = tip->p + tip->d;
    double t = c->rest;
    bool lands = false;
    if (tip->clock > 0.0)
        t = fmin(tip->clock, c->rest);
    else if (reach(surface, base) > 0.0) {
        t = 0.0;
        lands = true;
    } else if (c->side != 0 && surface->h + surface->A > 0.0) {
        const double to_land = time_for(c, c->side * to_next_contact(surface, c->side, base));
        lands = to_land < c->rest;
        t = lands ? to_land : c->rest;
    }
    double d_rate = c->v - tip->speed;
    const double moved = base + way_in(c, t);
    ring(&tip->d, &d_rate, k_t / m, 0.5 * k_h / k_t, c->a, t);
    tip->clock = fmax(tip->clock - t, 0.0);
    pass(c, t);
    tip->speed = c->v - d_rate;
    tip->p = moved - tip->d;
    if (lands)
        *tip = (Tip){.p = moved, .mode = STUCK};
}

static bool step(Model *model, double h)
{
    GIVEN(model)
    const double slope = model->slope[INPUT_v], mean = v + 0.5 * slope * h;
    if (A > 0.0 && !(N * fabs(mean) * h <= 2.0 * MOST_TRIES * wavelength))
        return too_much(model);

    struct population *const all = &model->memory;
    Sums sums = {0};
    double d = 0.0, speed = 0.0, left = MOST_WORK;
    for (int i = 0; i < N; i++) {
        const Surface surface = surface_of(model, i);
        Tip tip = all->started ? all->tip[i] : start_of(model, i);
        Course c = {v, slope, h, (mean > 0.0) - (mean < 0.0)};
        if (v == 0.0 && (tip.mode == FORWARD || tip.mode == BACK))
            tip.mode = STUCK; /* the slider has stopped, at least for an instant */
        while (c.rest > 0.0) {
            if ((left -= 2.0) < 0.0)
                return too_much(model);
            if (tip.mode == STUCK)
                stick(model, &surface, &tip, &c, &left);
            else if (tip.mode == FREE)
                swing_free(model, &surface, &tip, &c);
            else
                slip(model, &surface, &tip, &c, &left);
        }
        if (fabs(surface.k * tip.p) > 7.0) /* only the phase matters */
            tip.p -= TWO_PI / surface.k * round(surface.k * tip.p / TWO_PI);
        all->tip[i] = tip;
        count(model, &surface, &tip, &sums);
        d += tip.d; /* pairs first, so that F is exactly odd */
        speed += tip.mode == FREE ? tip.speed : 0.0;
        if (i % 2 == 1 || i == N - 1) {
            sums.d += d;
            sums.speed += speed;
            d = speed = 0.0;
        }
    }
    all->sums = sums;
    all->started = true;
    model->z = sums.d / N;
    return true;
}

#endif
