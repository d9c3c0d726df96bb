/* Operations on one part. Each returns a status of FMI 2.0; 0 (OK) and 1 (warning) are successes. */

#ifndef PART_H
#define PART_H

#include "engine.h"

/* All parts of a composite FMU are of FMI 2.0 and in C, which its compiler makes use of. */
#ifdef COMPOSITE
enum { OTHER_KINDS = false };
#else
enum { OTHER_KINDS = true };
#endif
static inline bool in_python(const EnginePart *p) { return OTHER_KINDS && p->call; }

static inline int64_t count_of(const int64_t *ranges, int type) { return ranges[type + 1] - ranges[type]; }

/* A fraction such as 0.5 on a connection to an Integer is an error of the system, not of the FMU. */
enum { NOT_WHOLE = 100 };

static int set_whole(EnginePart *p, const double *signals, int type, const uint32_t *references)
{
    const double *const values = signals + p->inputs[type];
    const int64_t n = count_of(p->inputs, type);
    for (int64_t i = 0; i < n; i++) {
        if (type == INTEGER && !(values[i] == floor(values[i]) && fabs(values[i]) <= 2147483647.0))
            return NOT_WHOLE;
        p->whole[i] = type == INTEGER ? (int)values[i] : values[i] != 0.0;
    }
    return p->set[type](p->component, references, (size_t)n, p->whole);
}

/* ---- FMI 3.0 FMUs, called without their adapter where that is possible: it takes up to 5 ns per call ------- */

/* Statuses of a step that the FMU itself accepted; the texts are in fmi3.py. */
enum { RUN_ENDED = 103, STEP_ENDED };

static inline int step_instance(DoStep3 *do_step, void *instance, double t, double h, bool *event, double *ended)
{
    bool terminate = false, early = false;
    double last = t + h;
    const int status = do_step(instance, t, h, true, event, &terminate, &early, &last);
    *ended = last;
    if (status <= 1 && terminate)
        return RUN_ENDED;
    /* a time beyond the step, or NaN, is no time either; apart from rounding */
    const bool elsewhere = early && !(fabs(last - (t + h)) <= 1e-9 * h + 1e-15 * fabs(t + h));
    return status <= 1 && elsewhere ? STEP_ENDED : status;
}

static inline int set_reals(EnginePart *p, const uint32_t *references, size_t n, void *values)
{
    return OTHER_KINDS && p->set_scalars ? p->set_scalars(p->instance, references, n, values, n)
                                         : p->set[REAL](p->component, references, n, values);
}

static inline int get_reals(EnginePart *p, const uint32_t *references, size_t n, void *values)
{
    return OTHER_KINDS && p->get_scalars ? p->get_scalars(p->instance, references, n, values, n)
                                         : p->get[REAL](p->component, references, n, values);
}

static inline int step_fmu(EnginePart *p, double t, double h)
{
    bool event = false;
    /* noSetFMUStatePriorToCurrentPoint: common importers always pass true, even those that roll back */
    return OTHER_KINDS && p->do_step_3 ? step_instance(p->do_step_3, p->instance, t, h, &event, &p->ended)
                                       : p->do_step(p->component, t, h, 1);
}

/* Return what the functions for states and slopes are called with. */
static inline void *owner_of(const EnginePart *p) { return OTHER_KINDS && p->do_step_3 ? p->instance : p->component; }

/* ---- operations ----------------------------------------------------------------------------------------------- */

/* Set the inputs of a part. */
static int hand_over(EnginePart *p, const double *signals)
{
    const int direct = p->direct ? p->direct->set(p->component, &p->ports, signals) : NOT_DIRECT;
    if (direct != NOT_DIRECT)
        return direct;
    if (in_python(p))
        return p->call(SET, 0.0, 0.0);
    int worst = 0;
    for (int type = REAL; type < TYPES; type++) {
        const int64_t n = count_of(p->inputs, type);
        if (n == 0)
            continue;
        const uint32_t *const references = p->input_references + (p->inputs[type] - p->inputs[REAL]);
        const int status = type == REAL
                               ? set_reals(p, references, (size_t)n, (void *)(uintptr_t)(signals + p->inputs[REAL]))
                               : set_whole(p, signals, type, references);
        if (status > 1)
            return status;
        worst = status > worst ? status : worst;
    }
    return worst;
}

static int fetch_outputs(EnginePart *p, double *signals)
{
    const int direct = p->direct ? p->direct->get(p->component, &p->ports, signals) : NOT_DIRECT;
    if (direct != NOT_DIRECT)
        return direct;
    if (in_python(p))
        return p->call(GET, 0.0, 0.0);
    for (int type = REAL; type < TYPES; type++) {
        const int64_t n = count_of(p->outputs, type);
        if (n == 0)
            continue;
        const uint32_t *const references = p->output_references + (p->outputs[type] - p->outputs[REAL]);
        double *const values = signals + p->outputs[type];
        const int status = type == REAL ? get_reals(p, references, (size_t)n, values)
                                        : p->get[type](p->component, references, (size_t)n, p->whole);
        if (status > 1)
            return status;
        for (int64_t i = 0; type != REAL && i < n; i++)
            values[i] = (double)p->whole[i];
    }
    return 0;
}

static int step_part(EnginePart *p, double t, double h)
{
    const int direct = p->direct ? p->direct->step(p->component, t, h) : NOT_DIRECT;
    if (direct != NOT_DIRECT)
        return direct;
    return in_python(p) ? p->call(STEP, t, h) : step_fmu(p, t, h);
}

/* Set the inputs and the derivatives of the Reals, and step. */
static int move_on_slopes(EnginePart *p, const double *signals, double t, double h)
{
    const int direct = p->direct ? p->direct->move(p->component, &p->ports, signals, p->slopes, t, h) : NOT_DIRECT;
    if (direct != NOT_DIRECT)
        return direct;
    const size_t reals = (size_t)count_of(p->inputs, REAL);
    int status = hand_over(p, signals);
    if (status <= 1)
        status = p->set_slopes(owner_of(p), p->input_references, reals, p->orders, p->slopes);
    return status <= 1 ? step_part(p, t, h) : status;
}

/* Save the state of an FMU, and return to it. */
static int save_to(const EnginePart *p, void **state)
{
    if (!p->direct || !*state)
        return p->get_state(owner_of(p), state);
    p->direct->save(p->component, *state);
    return 0;
}

static int restore_from(const EnginePart *p, void *state)
{
    if (!p->direct)
        return p->set_state(owner_of(p), state);
    p->direct->restore(p->component, state);
    return 0;
}

static int save_part(EnginePart *p) { return in_python(p) ? p->call(SAVE, 0.0, 0.0) : save_to(p, &p->state); }

static int restore_part(EnginePart *p) { return in_python(p) ? p->call(RESTORE, 0.0, 0.0) : restore_from(p, p->state); }

/* Exchange the two saved states of a part. */
static void swap_part(EnginePart *p)
{
    if (in_python(p)) {
        p->call(SWAP, 0.0, 0.0);
        return;
    }
    void *const state = p->state;
    p->state = p->other_state;
    p->other_state = state;
}

/* A plain connection keeps the sign of zero. With gain 0 the value does not depend on the output. */
static inline double map_of(double gain, double offset, double output)
{
    return gain == 1.0 && offset == 0.0 ? output : gain == 0.0 ? offset : gain * output + offset;
}

/* Return the value of an input for this value of the output that drives it. */
static inline double carried(const Engine *e, int64_t input, double output)
{
    return e->gains == NULL ? output : map_of(e->gains[input], e->offsets[input], output);
}

static inline double arriving(const Engine *e, int64_t input)
{
    return carried(e, input, e->signals[e->sources[input]]);
}

/* Update the inputs of this part from their connections. */
static inline void fetch_inputs(const Engine *e, const EnginePart *p)
{
    if (e->gains == NULL)
        for (int64_t i = p->inputs[REAL]; i < p->inputs[TYPES]; i++)
            e->signals[i] = e->signals[e->sources[i]];
    else
        for (int64_t i = p->inputs[REAL]; i < p->inputs[TYPES]; i++)
            e->signals[i] = arriving(e, i);
}

static inline double time_of(const Engine *e, int64_t tick) { return e->start + (double)tick * e->step; }

/* Return whether a part is stepped in this span: a sampled part at the beginning of a tick, a slow part at the end. */
static inline bool is_due(const Engine *e, const EnginePart *p, int64_t tick)
{
    if (p->every == 1 && !p->sampled)
        return true;
    return (p->sampled ? e->begins : e->ends) && (p->every == 1 || tick % p->every == p->phase);
}

/* Set t and h to the interval over which a part that is due is stepped. */
static inline void interval_of(const Engine *e, const EnginePart *p, int64_t tick, double *t, double *h)
{
    const bool spans = p->every == 1 && !p->sampled;
    *t = spans ? e->time : time_of(e, tick - p->phase);
    *h = spans ? e->length : (double)p->every * e->step;
}

/* Let the span be a whole tick. */
static inline void span_tick(Engine *e, int64_t tick)
{
    e->time = time_of(e, tick);
    e->length = e->step;
    e->begins = e->ends = true;
}

/* Store the failure and return false. */
static bool failed(Engine *e, int64_t part, int operation, int status, double t)
{
    e->failed_part = part;
    e->failed_operation = operation;
    e->status = status;
    e->failed_time = t;
    return false;
}

#endif
