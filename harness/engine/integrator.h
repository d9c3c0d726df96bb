/* An FMU for model exchange, integrated by CVODE over each communication step. The exported functions take the place of
   the functions of a co-simulation FMU; their component is an Integrator.

   At the end of a step the FMU is in continuous-time mode; inputs and the next step put it into event mode, where it
   accepts inputs of all types. So an event at a communication point happens at the beginning of the step from there,
   with the inputs of this point, as in a sampled block. Each step begins with an event iteration, and CVODE starts anew
   after each event: nothing but the FMU and its time has a state, and a step that is repeated gives the same bits. */

#ifndef INTEGRATOR_H
#define INTEGRATOR_H

#include "engine.h"

#include <float.h>
#include <stdlib.h>

/* fmi2EventInfo */
typedef struct {
    int iterate, terminate, nominals_changed, values_changed, has_next;
    double next;
} EventInfo;

typedef int FmuCall(void *component);
typedef int FmuValues(void *component, double *values, size_t n);

/* Functions of the FMU that have failed, and other failures; named in integrator.py. */
enum failure {
    NO_FAILURE,
    ENTER_EVENT_MODE,
    NEW_DISCRETE_STATES,
    ENTER_CONTINUOUS_TIME_MODE,
    COMPLETED_STEP,
    SET_TIME,
    SET_STATES,
    GET_STATES,
    GET_DERIVATIVES,
    GET_INDICATORS,
    GET_NOMINALS,
    SET_INPUTS,
    GET_INPUTS,
    BAD_DERIVATIVE,
    BAD_INDICATOR,
    BAD_STATE,
    TERMINATED,
    UNSETTLED,
    MANY_EVENTS,
    MANY_STEPS,
    SOLVER
};

typedef struct {
    void *component;
    Exchange *set[TYPES], *get[TYPES];
    GetState *get_state;
    SetState *set_state;
    GetState *free_state;
    FmuCall *enter_event_mode, *enter_continuous_time_mode;
    int (*new_discrete_states)(void *component, EventInfo *info);
    int (*completed_step)(void *component, int keeps_no_state, int *enter, int *terminate); /* NULL: not needed */
    int (*set_time)(void *component, double t);
    int (*set_states)(void *component, const double *x, size_t n);
    FmuValues *get_states, *get_derivatives, *get_indicators, *get_nominals;
    int64_t states, indicators;

    void *solver; /* CVODE; NULL: neither states nor indicators */
    int (*restart)(void *solver, double t, void *vector);
    int (*set_stop)(void *solver, double t);
    int (*set_tolerances)(void *solver, double relative, void *absolute);
    int (*solve)(void *solver, double t, void *vector, double *reached, int task);
    double *(*values_of)(void *vector);
    void *vector, *absolute_vector;
    double *x, *absolute; /* values of the vectors: states (one dummy if there are none), absolute tolerances */
    double tolerance;     /* relative */
    double *nominals, *z; /* buffers of a call */
    uint8_t *above;       /* of each indicator, whether it is positive since the last event */

    uint32_t *references; /* inputs that change linearly in this step, with begin + slope (t - from) */
    double *begin, *slopes, *u;
    int64_t moving, most_moving;
    double from;

    EventInfo event;
    double time;        /* [s] of the FMU between steps */
    int64_t continuous; /* it is in continuous-time mode */
    int64_t failure, status, index;
    double failed_at;
} Integrator;

MIRRORED(EventInfo)
MIRRORED(Integrator)

/* The state of an FMU together with its time. */
typedef struct {
    void *state;
    double time;
} TimedState;

enum { MOST_ITERATIONS = 100, MOST_EVENTS = 10000, MOST_STEPS = 1000000, ONE_STEP = 2, ROOT_RETURN = 2 };

static bool fails(Integrator *i, enum failure failure, int64_t index)
{
    i->failure = failure;
    i->index = index;
    i->status = 3;
    return false;
}

static bool works(Integrator *i, enum failure function, int status)
{
    if (status == 0 || status == 1)
        return true;
    (void)fails(i, function, 0);
    i->status = status;
    return false;
}

/* Times closer than this are one communication point. */
static double rounding(double t) { return 4.0 * DBL_EPSILON * fabs(t); }

static bool all_finite(Integrator *i, enum failure failure, const double *values, int64_t n)
{
    for (int64_t k = 0; k < n; k++)
        if (!isfinite(values[k]))
            return fails(i, failure, k);
    return true;
}

/* Give the FMU a time, and the inputs and states at this time. */
static bool go_to(Integrator *i, double t, const double *x)
{
    i->failed_at = t;
    if (!works(i, SET_TIME, i->set_time(i->component, t)))
        return false;
    for (int64_t k = 0; k < i->moving; k++)
        i->u[k] = i->begin[k] + i->slopes[k] * (t - i->from);
    if (i->moving > 0 && !works(i, SET_INPUTS, i->set[REAL](i->component, i->references, (size_t)i->moving, i->u)))
        return false;
    return i->states == 0 || works(i, SET_STATES, i->set_states(i->component, x, (size_t)i->states));
}

/* What CVODE is told of a failure: try a shorter step if the FMU has discarded the values, else give up. */
static int solver_status(const Integrator *i) { return i->status == 2 || i->failure == BAD_DERIVATIVE ? 1 : -1; }

EXPORT int integrator_derivatives(double t, void *x, void *derivatives, void *self);

EXPORT int integrator_derivatives(double t, void *x, void *derivatives, void *self)
{
    Integrator *const i = self;
    double *const values = i->values_of(derivatives);
    if (i->states == 0) {
        values[0] = 0.0;
        return 0;
    }
    if (!go_to(i, t, i->values_of(x)) ||
        !works(i, GET_DERIVATIVES, i->get_derivatives(i->component, values, (size_t)i->states)) ||
        !all_finite(i, BAD_DERIVATIVE, values, i->states))
        return solver_status(i);
    return 0;
}

static bool read_indicators(Integrator *i, double *z)
{
    return i->indicators == 0 || (works(i, GET_INDICATORS, i->get_indicators(i->component, z, (size_t)i->indicators)) &&
                                  all_finite(i, BAD_INDICATOR, z, i->indicators));
}

EXPORT int integrator_roots(double t, void *x, double *z, void *self);

EXPORT int integrator_roots(double t, void *x, double *z, void *self)
{
    Integrator *const i = self;
    return go_to(i, t, i->values_of(x)) && read_indicators(i, z) ? 0 : -1;
}

/* Iterate in event mode until the discrete states have settled. */
static bool settle(Integrator *i, double t)
{
    i->failed_at = t;
    i->event.iterate = 1;
    for (int count = 0; i->event.iterate; count++) {
        if (count == MOST_ITERATIONS)
            return fails(i, UNSETTLED, 0);
        i->event = (EventInfo){0};
        if (!works(i, NEW_DISCRETE_STATES, i->new_discrete_states(i->component, &i->event)))
            return false;
        if (i->event.terminate)
            return fails(i, TERMINATED, 0);
    }
    return true;
}

/* Read the nominal values, which an event may have changed; those that are not positive count as 1. */
static bool scale_tolerances(Integrator *i)
{
    if (i->states == 0)
        return true;
    if (!works(i, GET_NOMINALS, i->get_nominals(i->component, i->nominals, (size_t)i->states)))
        return false;
    bool changed = false;
    for (int64_t k = 0; k < i->states; k++) {
        const double nominal = fabs(i->nominals[k]);
        const double absolute = i->tolerance * (nominal > 0.0 && isfinite(nominal) ? nominal : 1.0);
        changed = changed || absolute != i->absolute[k];
        i->absolute[k] = absolute;
    }
    const int flag = changed ? i->set_tolerances(i->solver, i->tolerance, i->absolute_vector) : 0;
    return flag == 0 || fails(i, SOLVER, flag);
}

/* Go from event mode to continuous time, and read what the events have made of the states. */
static bool enter_continuous_time(Integrator *i, double t)
{
    i->failed_at = t;
    if (!works(i, ENTER_CONTINUOUS_TIME_MODE, i->enter_continuous_time_mode(i->component)))
        return false;
    if (i->states > 0 && !(works(i, GET_STATES, i->get_states(i->component, i->x, (size_t)i->states)) &&
                           all_finite(i, BAD_STATE, i->x, i->states)))
        return false;
    if (!scale_tolerances(i) || !go_to(i, t, i->x) || !read_indicators(i, i->z))
        return false;
    for (int64_t k = 0; k < i->indicators; k++)
        i->above[k] = i->z[k] > 0.0;
    return true;
}

/* At the end of a solver step: whether the FMU or an indicator requires an event. CVODE does not report an indicator
   that is zero at its start and has the other sign afterwards. */
static bool step_is_over(Integrator *i, double t, bool *event)
{
    int enter = 0, terminate = 0;
    if (!go_to(i, t, i->x) ||
        (i->completed_step && !works(i, COMPLETED_STEP, i->completed_step(i->component, 0, &enter, &terminate))))
        return false;
    if (terminate)
        return fails(i, TERMINATED, 0);
    if (!read_indicators(i, i->z))
        return false;
    *event = *event || enter;
    for (int64_t k = 0; k < i->indicators; k++)
        *event = *event || (i->z[k] > 0.0) != i->above[k];
    return true;
}

/* Integrate to the target or to the first event before it. */
static bool integrate(Integrator *i, double *t, double target)
{
    bool event = false;
    if (i->solver == NULL || target - *t <= rounding(target)) {
        *t = target;
        return step_is_over(i, *t, &event);
    }
    int flag = i->restart(i->solver, *t, i->vector);
    if (flag == 0)
        flag = i->set_stop(i->solver, target);
    for (int64_t count = 0; flag >= 0 && !event && *t < target; count++) {
        if (count == MOST_STEPS)
            return fails(i, MANY_STEPS, 0);
        i->failure = NO_FAILURE;
        flag = i->solve(i->solver, target, i->vector, t, ONE_STEP);

        event = flag == ROOT_RETURN;
        if (flag >= 0 && !step_is_over(i, *t, &event))
            return false;
    }
    return flag >= 0 || (i->failure == NO_FAILURE && fails(i, SOLVER, flag));
}

/* Go to event mode, if the FMU is not there already. */
static bool enter_events(Integrator *i)
{
    const bool continuous = i->continuous;
    i->continuous = 0;
    return !continuous || works(i, ENTER_EVENT_MODE, i->enter_event_mode(i->component));
}

/* Integrate to the end of the step, from event to event. */
static bool advance_to(Integrator *i, double t, double end)
{
    for (int events = 0;; events++) {
        if (events > MOST_EVENTS)
            return fails(i, MANY_EVENTS, 0);
        i->failed_at = t;
        if (!enter_events(i) || !settle(i, t))
            return false;
        const bool due = i->event.has_next && i->event.next < end - rounding(end);
        const double target = due ? fmax(i->event.next, t) : end;
        i->continuous = 1;
        if (!enter_continuous_time(i, t) || (t < target && !integrate(i, &t, target)))
            return false;
        if (t >= end)
            break;
    }
    i->time = t;
    return true;
}

EXPORT int integrator_step(void *self, double t, double h, int keeps_no_state);

EXPORT int integrator_step(void *self, double t, double h, int keeps_no_state)
{
    (void)keeps_no_state;
    Integrator *const i = self;
    i->failure = NO_FAILURE;
    i->from = i->failed_at = t;
    const bool good = (i->moving == 0 ||
                       works(i, GET_INPUTS, i->get[REAL](i->component, i->references, (size_t)i->moving, i->begin))) &&
                      /* the last step may have ended a rounding error later */
                      advance_to(i, i->time > t && i->time - t <= 2.0 * rounding(t) ? i->time : t, t + h);
    i->moving = 0;
    return good ? 0 : (int)i->status;
}

EXPORT int integrator_begin(Integrator *i, double t);

/* Begin a run after initialisation mode, which ends in event mode. */
EXPORT int integrator_begin(Integrator *i, double t)
{
    i->failure = NO_FAILURE;
    i->time = t;
    i->moving = i->continuous = 0;
    return settle(i, t) ? 0 : (int)i->status;
}

EXPORT int integrator_set_slopes(void *self, const uint32_t *references, size_t n, const int *orders,
                                 const double *slopes);

/* The inputs change linearly in the next step. */
EXPORT int integrator_set_slopes(void *self, const uint32_t *references, size_t n, const int *orders,
                                 const double *slopes)
{
    (void)orders;
    Integrator *const i = self;
    i->moving = 0;
    for (size_t k = 0; k < n; k++) {
        if (slopes[k] == 0.0 || i->moving == i->most_moving)
            continue;
        i->references[i->moving] = references[k];
        i->slopes[i->moving++] = slopes[k];
    }
    return 0;
}

#define PASS_ON(name, place, ready)                                                                                    \
    EXPORT int integrator_##name(void *self, const uint32_t *references, size_t n, void *values);                      \
    EXPORT int integrator_##name(void *self, const uint32_t *references, size_t n, void *values)                       \
    {                                                                                                                  \
        Integrator *const i = self;                                                                                    \
        return ready ? i->place(i->component, references, n, values) : (int)i->status;                                 \
    }

PASS_ON(set_real, set[REAL], enter_events(i))
PASS_ON(set_integer, set[INTEGER], enter_events(i))
PASS_ON(set_boolean, set[BOOLEAN], enter_events(i))
PASS_ON(get_real, get[REAL], true)
PASS_ON(get_integer, get[INTEGER], true)
PASS_ON(get_boolean, get[BOOLEAN], true)

EXPORT int integrator_enter_events(Integrator *i);

/* Go to the mode in which states are saved and restored: some FMUs do not save their mode. */
EXPORT int integrator_enter_events(Integrator *i) { return enter_events(i) ? 0 : (int)i->status; }

EXPORT int integrator_get_state(void *self, void **saved);

EXPORT int integrator_get_state(void *self, void **saved)
{
    Integrator *const i = self;
    if (*saved == NULL)
        *saved = calloc(1, sizeof(TimedState));
    TimedState *const timed = *saved;
    if (timed == NULL)
        return 3;
    timed->time = i->time;
    return enter_events(i) ? i->get_state(i->component, &timed->state) : (int)i->status;
}

EXPORT int integrator_set_state(void *self, void *saved);

EXPORT int integrator_set_state(void *self, void *saved)
{
    Integrator *const i = self;
    const TimedState *const timed = saved;
    i->time = timed->time;
    return enter_events(i) ? i->set_state(i->component, timed->state) : (int)i->status;
}

EXPORT int integrator_free_state(void *self, void **saved);

EXPORT int integrator_free_state(void *self, void **saved)
{
    Integrator *const i = self;
    TimedState *const timed = *saved;
    *saved = NULL;
    const int status = timed->state ? i->free_state(i->component, &timed->state) : 0;
    free(timed);
    return status;
}

#endif
