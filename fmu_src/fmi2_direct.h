/* The calls of direct.h. */

#ifndef FMI2_DIRECT_H
#define FMI2_DIRECT_H

#include "direct.h"

static inline bool finite_values(const double *values, int64_t n)
{
    double sum = 0.0;
    for (int64_t i = 0; i < n; i++)
        sum += 0.0 * values[i];
    return sum == 0.0;
}

/* Return whether inputs may have these values. */
static inline bool accepts(const double *values, int64_t n)
{
#ifdef GUARDED
    (void)values;
    (void)n;
    return true;
#else
    return finite_values(values, n);
#endif
}

static int direct_set(void *component, const Ports *p, const double *signals)
{
    Instance *const c = (Instance *)component;
    double *const own = (double *)(void *)&c->model;
    const double *const values = signals + p->inputs;
    if (MODE(c) != STEP_COMPLETE || !accepts(values, p->reals))
        return NOT_DIRECT;
    for (int64_t i = 0; i < p->reals; i++)
        own[p->input_references[i]] = values[i];
    for (int64_t i = p->reals; i < p->reals + p->flags; i++)
        own[p->input_references[i]] = (double)(values[i] != 0.0);
    c->model.run.stale = c->model.run.stale || p->reals + p->flags > 0;
    return fmi2OK;
}

static int set_slopes(void *component, const Ports *p, const double *slopes)
{
    Instance *const c = (Instance *)component;
    if (MODE(c) != STEP_COMPLETE || !finite_values(slopes, p->reals))
        return NOT_DIRECT;
    memset(c->model.slope, 0, sizeof c->model.slope);
    c->model.run.slopes_used = false;
    c->model.run.sloped = true;
    for (int64_t i = 0; i < p->reals; i++)
        for (int k = 0; k < INPUTS; k++)
            if (inputs[k] == p->input_references[i])
                c->model.slope[k] = slopes[i];
    return fmi2OK;
}

static int direct_step(void *component, double t, double h)
{
    Instance *const c = (Instance *)component;
    Model *const m = &c->model;
    if (MODE(c) != STEP_COMPLETE || !(fabs(t - m->time) <= 1e-6 * h && t + h <= m->run.stop))
        return NOT_DIRECT;
    if (violated_relation(c))
        return fmi2Discard;
    const bool done = take_step(m, t, h);
    return (int)(done && results_finite(m) ? accept_step(c, t, h) : refuse_step(c, t, h, done, m->run.too_much));
}

static int direct_move(void *component, const Ports *p, const double *signals, const double *slopes, double t, double h)
{
    const int set = direct_set(component, p, signals), status = set == fmi2OK ? set_slopes(component, p, slopes) : set;
    return status == fmi2OK ? direct_step(component, t, h) : status;
}

static inline void read_outputs(const Model *m, const Ports *p, double *values)
{
    const double *const own = (const double *)(const void *)m;
    const int64_t whole = p->out_reals, flags = whole + p->out_counts, end = flags + p->out_flags;
    for (int64_t i = 0; i < whole; i++)
        values[i] = own[p->output_references[i]];
    for (int64_t i = whole; i < flags; i++)
        values[i] = (double)(int)own[p->output_references[i]];
    for (int64_t i = flags; i < end; i++)
        values[i] = (double)(own[p->output_references[i]] != 0.0);
}

static int direct_get(void *component, const Ports *p, double *signals)
{
    Instance *const c = (Instance *)component;
    if (MODE(c) != STEP_COMPLETE || !refresh(c))
        return NOT_DIRECT;
    read_outputs(&c->model, p, signals + p->outputs);
    return fmi2OK;
}

static bool direct_turn(void *component, const Ports *p, double *signals, double t, double h)
{
    Instance *const c = (Instance *)component;
    Model *const m = &c->model;
    double *const own = (double *)(void *)m, *const values = signals + p->inputs;
    for (int64_t i = 0; i < p->reals; i++)
        own[p->input_references[i]] = values[i] = signals[p->sources[i]];
    for (int64_t i = p->reals; i < p->reals + p->flags; i++) {
        values[i] = signals[p->sources[i]];
        own[p->input_references[i]] = (double)(values[i] != 0.0);
    }
    if (MODE(c) != STEP_COMPLETE || (m->run.stale && violated(m)) || !take_step(m, t, h))
        return false;
    read_outputs(m, p, signals + p->outputs);
    return true;
}

static int direct_verify(void *component, const Ports *p, const double *signals, double t, double h, bool done)
{
    Instance *const c = (Instance *)component;
    if (done && results_finite(&c->model))
        return (int)accept_step(c, t, h);
    if (MODE(c) != STEP_COMPLETE || !accepts(signals + p->inputs, p->reals))
        return NOT_DIRECT;
    return (int)(violated_relation(c) ? fmi2Discard : refuse_step(c, t, h, done, c->model.run.too_much));
}

static void direct_save(const void *component, void *state)
{
    memcpy(&((Saved *)state)->model, &((const Instance *)component)->model, STATE_SIZE);
}

static void direct_restore(void *component, const void *state) { restore((Instance *)component, (const Saved *)state); }

static void *direct_place(void *component, int64_t *size, int64_t *fixed)
{
    Instance *const c = (Instance *)component;
    *size = STATE_SIZE;
    *fixed = VARYING;
    return &c->model;
}

#define blockDirect fmi2FullName(blockDirect)
#ifdef PACKAGER_EXPORT
PACKAGER_EXPORT
#endif
DirectCalls blockDirect;

const Direct *blockDirect(void)
{
    static const Direct calls = {DIRECT_VERSION, direct_set,    direct_step, direct_move,    direct_get,
                                 direct_turn,    direct_verify, direct_save, direct_restore, direct_place};
    return &calls;
}

#endif
