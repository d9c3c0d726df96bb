/* Steps of an FMU of FMI 3.0 over the events of its clocks. */

#ifndef FMI3_STEPS_H
#define FMI3_STEPS_H

#include <float.h>

static int step_on(Fmi3 *a, double t, double h)
{
    bool event = false;
    const int status = step_instance(a->do_step, a->instance, t, h, &event, &a->ended);
    a->pending = event && a->uses_events;
    return status;
}

/* Return a bound of the rounding of a time, which may be a Unix time. */
static double rounding_3(const Fmi3 *a, double t) { return 4.0 * DBL_EPSILON * (fabs(t) + fabs(a->start)); }

static double slack_3(const Fmi3 *a, const Clock3 *clock, double t)
{
    return fmin(1e-6 * clock->interval + rounding_3(a, t), 0.25 * clock->interval);
}

/* Return the time of the first tick of a clock that is not before t, up to rounding. */
static double tick_from(const Fmi3 *a, const Clock3 *clock, double t)
{
    const double first = a->start + clock->shift;
    const double k = ceil((t - first - slack_3(a, clock, t)) / clock->interval);
    return k > 0.0 ? first + k * clock->interval : first;
}

static bool ticks_at(const Fmi3 *a, const Clock3 *clock, double t)
{
    return tick_from(a, clock, t) <= t + slack_3(a, clock, t);
}

/* In event mode: call the FMU until its discrete states are settled, then return to step mode. */
static int settle_3(Fmi3 *a)
{
    a->pending = 0;
    for (int tries = 0; tries < MOST_UPDATES_3; tries++) {
        bool again = false, terminate = false, nominals, states, defined = false;
        double next = INFINITY;
        const int status = a->update(a->instance, &again, &terminate, &nominals, &states, &defined, &next);
        if (status > 1)
            return status;
        if (terminate)
            return RUN_ENDED;
        a->next = defined ? next : INFINITY;
        if (!again)
            return a->enter_step_mode(a->instance);
    }
    return fails_3(a, UPDATES_3, 0);
}

EXPORT int fmi3_settle(Fmi3 *a);

EXPORT int fmi3_settle(Fmi3 *a) { return settle_3(a); }

/* Take the event at t, with the ticks of all clocks that are due. */
static int take_event(Fmi3 *a, double t)
{
    int status = a->enter_event_mode(a->instance);
    a->ended = t;
    for (int64_t i = 0; status <= 1 && i < a->clock_count; i++) {
        const bool ticks = true;
        if (ticks_at(a, &a->clocks[i], t))
            status = a->set_clock(a->instance, &a->clocks[i].reference, 1, &ticks);
    }
    return status > 1 ? status : settle_3(a);
}

static bool event_due_3(const Fmi3 *a, double t)
{
    for (int64_t i = 0; i < a->clock_count; i++)
        if (ticks_at(a, &a->clocks[i], t))
            return true;
    return a->pending || a->next <= t + rounding_3(a, t);
}

/* Return the next time at which an event is due, after those at t. */
static double next_event_3(const Fmi3 *a, double t)
{
    double next = a->next > t + rounding_3(a, t) ? a->next : INFINITY;
    for (int64_t i = 0; i < a->clock_count; i++) {
        const Clock3 *const clock = &a->clocks[i];
        next = fmin(next, ticks_at(a, clock, t) ? tick_from(a, clock, t) + clock->interval : tick_from(a, clock, t));
    }
    return next;
}

EXPORT int fmi3_event(Fmi3 *a, double t);

/* Take the event that is due at t, if there is one. */
EXPORT int fmi3_event(Fmi3 *a, double t)
{
    a->failure = 0;
    return a->uses_events && event_due_3(a, t) ? take_event(a, t) : 0;
}

EXPORT int fmi3_do_step(void *self, double t, double h, int keeps_no_state);

/* An event at the end of the step belongs to the next step, whose inputs it uses. */
EXPORT int fmi3_do_step(void *self, double t, double h, int keeps_no_state)
{
    (void)keeps_no_state;
    Fmi3 *const a = (Fmi3 *)self;
    a->failure = 0;
    if (!a->uses_events)
        return step_on(a, t, h);
    const double end = t + h;
    double now = t;
    for (int events = 0; events < MOST_EVENTS_3; events++) {
        int status = event_due_3(a, now) ? take_event(a, now) : 0;
        if (status > 1)
            return status;
        double target = next_event_3(a, now);
        target = target < end - fmax(1e-9 * h, fmin(rounding_3(a, end), 0.25 * h)) ? target : end;
        status = step_on(a, now, now == t && target == end ? h : target - now);
        if (status > 1 || target == end)
            return status;
        now = target;
    }
    return fails_3(a, EVENTS_3, 0);
}

#endif
