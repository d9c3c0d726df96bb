/* Steps of BurridgeKnopoff.c: extrapolation from event to event, and in closed form while no block moves. Included at
   its end. */

#ifndef BURRIDGE_KNOPOFF_RAMP_H
#define BURRIDGE_KNOPOFF_RAMP_H

#include "roots.h"

/* While all blocks are stuck, return the time until the force has grown by `gap`, or INF if it never does. */
static double time_at_rest(double gap, double rate, double curvature)
{
    if (gap <= 0.0)
        return 0.0;
    const double discriminant = squared_speed_after(gap, rate, curvature);
    if (discriminant < 0.0)
        return INF;
    const double root = sqrt(discriminant);
    if (rate >= 0.0)
        return rate + root > 0.0 ? time_between(gap, rate, root) : INF;
    return curvature > 0.0 ? (root - rate) / curvature : INF;
}

/* Start blocks that have reached the threshold, and stop blocks that have come to rest. */
static void switch_blocks(struct fault *f, const Train *t)
{
    const int n = t->n;
    for (int j = 0; j < n; j++) {
        if (f->slips[j] && f->y[n + j] <= SAME && force(t, t->X, f->y, j) < 1.0 - t->sigma) {
            f->slips[j] = false;
            f->y[n + j] = 0.0;
            f->moving--;
        } else if (!f->slips[j] && force(t, t->X, f->y, j) >= 1.0 - SAME) {
            if (f->moving == 0)
                f->before = mean(f->y, n);
            f->slips[j] = true;
            f->moving++;
        }
    }
    if (f->moving == 0) {
        f->moment = n * (mean(f->y, n) - f->before);
        f->avalanches += f->avalanches < INT32_MAX;
    }
}

/* Return a positive value if a stuck block has exceeded the threshold or a slipping block has reversed. */
static double excess(const Train *t, double s, const double *y)
{
    const double X = driver(t, s);
    double worst = -INF;
    for (int j = 0; j < t->n; j++)
        worst = fmax(worst, t->fault->slips[j] ? -y[t->n + j] : force(t, X, y, j) - 1.0);
    return worst;
}

/* Shorten a step over H, in which an event has occurred, to the first zero of `excess`: bisection until values of both
   signs bracket it, then false position (Illinois). */
static double locate(const Dynamics *d, const Train *t, double H, double *y_end)
{
    Bracket b = {0.0, H, excess(t, 0.0, t->fault->y), excess(t, H, y_end), 0};
    double y[2 * MASSES];

    for (int tries = 0; tries < 100 && b.f_high > 0.1 * SAME && b.high - b.low > 1e-15 / d->rate; tries++) {
        const bool usable = b.f_low < -SAME;
        const double trial = usable ? secant(b.high, b.f_high, b.low, b.f_low) : 0.5 * (b.low + b.high);
        const double middle = kept_inside(trial, b.low, b.high);
        if (extrapolate(d, 0.0, t->fault->y, middle, y) == 0)
            return 0.0;
        const double value = excess(t, middle, y);
        narrow(&b, middle, value, value > 0.0);
        if (value > 0.0)
            for (int i = 0; i < 2 * d->n; i++)
                y_end[i] = y[i];
    }
    return b.high;
}

static void pass(Train *t, double s)
{
    t->X = driver(t, s);
    t->X_rate += t->X_curvature * s;
}

static bool step(Model *m, double h)
{
    struct fault *const f = &m->memory;
    if (!f->ready)
        lay(m, f);
    f->ready = true;
    Train t = train_of(m);
    const double rate = 1.0 + sqrt(1.0 + 4.0 * t.coupling) + 2.0 * t.alpha;
    const double tolerance = m->run.tolerance > 0.0 ? m->run.tolerance : CHAIN_TOLERANCE;
    double y[2 * MASSES], H = m->run.inner_step > 0.0 ? m->run.inner_step : 0.1 / rate, left = 10.0 * MOST_WORK;
    const Dynamics d = {accelerations, &t, t.n, rate, tolerance, &left};

    double s = 0.0;
    while (s < h) {
        left -= t.n; /* forces between the steps; each takes 4 ns */
        if (f->moving == 0) {
            const double largest = largest_force(&t, t.X, f->y),
                         rest = time_at_rest(1.0 - largest, t.X_rate, t.X_curvature);
            if (!(rest < h - s)) {
                pass(&t, h - s);
                break;
            }
            pass(&t, rest);
            s += rest;
            t.X += fmax(1.0 - largest_force(&t, t.X, f->y), 0.0); /* rounding */
            switch_blocks(f, &t);
            H = fmin(H, 0.1 / rate);
        }
        const double taken = fmin(fmin(H, 1.0 / rate), h - s);
        const int columns = extrapolate(&d, 0.0, f->y, taken, y);
        double done = columns > 0 ? taken : 0.0;
        const bool event = columns > 0 && excess(&t, taken, y) > SAME;
        if (event)
            done = locate(&d, &t, taken, y);
        if (done > 0.0) {
            for (int i = 0; i < 2 * t.n; i++)
                f->y[i] = y[i];
            pass(&t, done);
            s = done < h - s ? s + done : h;
        }
        if (event && done > 0.0)
            switch_blocks(f, &t);
        else {
            const double next = next_step(taken, columns);
            H = taken < H && columns > 0 ? fmax(H, next) : next;
        }
        if (!goes_on(&d, H))
            return left < 0.0 ? too_much(m) : false;
    }
    m->run.inner_step = H;
    m->X = t.X;
    f->time = m->time + h;
    return true;
}

#endif
