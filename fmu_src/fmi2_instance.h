/* One instance of the block as an FMU: modes, messages, and evaluation of outputs. */

#ifndef BLOCK_FMI2_INSTANCE_H
#define BLOCK_FMI2_INSTANCE_H

#include "fmi2_modes.h"

/* whether the block can be used for model exchange, and what it decides there */
#ifdef NO_EXCHANGE
enum { EXCHANGES = 0 };
#else
enum { EXCHANGES = 1 };
#endif
#ifdef DECIDES_BY
enum { DECIDES = 1 };
#else
enum { DECIDES = 0 };
#endif
#ifdef EVENTS
enum { INDICATORS = EVENTS };
#else
enum { INDICATORS = 0 };
#endif

typedef struct {
    Model model;                           /* everything in a saved state, and the cache */
    double gap[2 - sizeof(Model) / 8 % 2]; /* aligns the backup like the model, so that copying is fast */
    Model backup;                          /* state at the start of the step, or work space */
    bool follows;                          /* the backup is from the last step */
    const Row *row_of[VALUES];             /* rows by value reference */
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
    int logging;
    char guid[GUID_LENGTH + 2];
    char name[]; /* of the instance */
} Instance;

#define MODE(c)        ((c)->model.run.mode)
#define SLOPES_USED(c) ((c)->model.run.slopes_used)
#define NOW(c)         ((c)->model.time)
#define KIND(c)        ((c)->model.run.exchange ? fmi2ModelExchange : fmi2CoSimulation)
#define ENDED(c)       ((void)(c), false)

#include "fmi2_calls.h"

static bool before_stepping(const Model *m) { return (m->run.mode & BEFORE_STEPPING) != 0; }

/* Before the first step, states that are outputs follow the parameters that hold their initial values. */
static void initialise_states(Model *m)
{
    if (before_stepping(m))
        for (size_t i = 0; i < ROWS; i++)
            if (rows[i].role == ROLE_STATE_OUTPUT)
                *value_of(m, rows[i].index) = *value_of(m, rows[i].from);
}

#ifdef GUARDED
enum { FIRST_CHECKED = AT(time) + 1 + INPUTS }; /* the inputs follow the time */

/* Return the first input that is not finite, or INPUTS if all are finite. */
static int bad_input(const Model *m)
{
    const double *value = (const double *)(const void *)m;
    int i = 0;
    while (i < INPUTS && isfinite(value[inputs[i]]))
        i++;
    return i;
}

static void take_sample(Model *m)
{
    m->fault = bad_input(m) < INPUTS;
    if (m->fault == 0.0)
        sample(m);
#ifdef SKIPS_BY
    else
        SKIPS_BY(m);
#endif
}
#elif defined SAMPLED
static void take_sample(Model *m) { sample(m); }
#endif
#ifndef GUARDED
enum { FIRST_CHECKED = AT(time) };
#endif

#ifdef SAMPLED
static double next_sample(const Model *m) { return m->run.start + (double)m->run.tick * m->Ts; }

/* Return the time to the next sample. In co-simulation the steps are counted, as their lengths have less rounding than
   the time, which may be a Unix time or a sum of 1e8 steps. */
static double to_next_sample(const Model *m) { return m->run.exchange ? next_sample(m) - m->time : m->run.rest; }

/* Return the rounding of a time in which a sample is still due. */
static double sample_slack(const Model *m)
{
    return fmin(1e-6 * m->Ts + time_rounding(m->time, m->run.start), 0.25 * m->Ts);
}

/* Follow the time of the importer if its steps do not add up to it. */
static void follow_time(Model *m, double t)
{
    const double rest = next_sample(m) - t;
    if (!(fabs(rest - m->run.rest) <= m->run.drift + time_rounding(t, m->run.start)))
        m->run.rest = rest;
}
#endif

/* Evaluate the block on a model that may be overwritten. */
static void evaluate(Model *m)
{
    initialise_states(m);
#ifdef SAMPLED
    take_sample(m);
#else
    equations(m);
#endif
}

/* In model exchange: decide what is fixed until the next event. */
static void decide(Model *m)
{
#ifdef DECIDES_BY
    DECIDES_BY(m);
    m->run.frozen = true;
#endif
    m->run.stale = true;
}

/* Return the violated relation of parameters, or NULL if all hold. */
static const char *violated(const Model *m)
{
#ifdef REQUIRES
    return REQUIRES(m);
#else
    (void)m;
    return NULL;
#endif
}

/* Return whether time, inputs (unless guarded), states and outputs are finite. Each value is multiplied by 0 and added:
   NaN and INF give NaN. Four sums are used, because each addition waits for the previous one. */
static bool results_finite(const Model *m)
{
    const size_t count = VALUES - FIRST_CHECKED, fours = count - count % 4;
    const double *const value = (const double *)(const void *)m + FIRST_CHECKED;
    double sum[4] = {0.0, 0.0, 0.0, 0.0};
    for (size_t i = 0; i < fours; i += 4)
        for (size_t k = 0; k < 4; k++)
            sum[k] += 0.0 * value[i + k];
    for (size_t i = fours; i < count; i++)
        sum[0] += 0.0 * value[i];
    return (sum[0] + sum[1]) + (sum[2] + sum[3]) == 0.0;
}

/* Everything that a step may change is copied to the backup and, if the step fails, back. */
#ifdef SAMPLED
#define KEPT_BEFORE start
#else
#define KEPT_BEFORE rest /* the time to the next sample, which there is not */
#endif
enum { VARYING = offsetof(Model, time), VARYING_SIZE = offsetof(Model, run) + offsetof(Run, KEPT_BEFORE) - VARYING };

static void keep(Instance *c)
{
    memcpy((char *)&c->backup + VARYING, (const char *)&c->model + VARYING, VARYING_SIZE);
#if defined KEEPS_BY
    KEEPS_BY(&c->backup.memory, &c->model.memory, &c->model, c->follows);
    c->follows = true;
#elif defined MEMORY
    c->backup.memory = c->model.memory;
#endif
}

static void roll_back(Instance *c)
{
    memcpy((char *)&c->model + VARYING, (const char *)&c->backup + VARYING, VARYING_SIZE);
#if defined KEEPS_BY
    KEEPS_BY(&c->model.memory, &c->backup.memory, &c->model, false); /* the rest of the backup may be older */
#elif defined MEMORY
    c->model.memory = c->backup.memory;
#endif
}

/* Return a copy of the model as work space. */
static Model *spare(Instance *c)
{
    c->follows = false;
    c->backup = c->model;
    return &c->backup;
}

/* Update the outputs after values were set; change nothing if one of them is not finite. A sampled block holds its
   outputs between samples; before the first sample, they have the values that it would produce. */
static bool refresh(Instance *c)
{
    Model *const m = &c->model;
    double before[VALUES];
    if (!m->run.stale)
        return true;
    memcpy(before, m, sizeof before);
#ifdef SAMPLED
    initialise_states(m);
    if (m->run.tick == 0) {
        Model *const preview = spare(c);
        evaluate(preview);
        for (size_t i = 0; i < ROWS; i++)
            if (rows[i].role == ROLE_OUTPUT || rows[i].role == ROLE_LOCAL)
                *value_of(m, rows[i].index) = *value_of(preview, rows[i].index);
    }
#else
    evaluate(m);
#endif
    if (!results_finite(m)) {
        memcpy(m, before, sizeof before);
        return false;
    }
    m->run.stale = false;
    return true;
}

static void set_start_values(Instance *c)
{
    const int exchange = c->model.run.exchange;
    memset(&c->model, 0, sizeof c->model);
    for (size_t i = 0; i < ROWS; i++) {
        if (rows[i].starts)
            memcpy(value_of(&c->model, rows[i].index), rows[i].starts, rows[i].length * sizeof(double));
        else
            *value_of(&c->model, rows[i].index) = isnan(rows[i].start) ? 0.0 : rows[i].start;
    }
    c->follows = false;
    c->model.run.exchange = exchange;
    c->model.run.mode = INSTANTIATED;
    c->model.run.stop = INF;
    c->model.run.stale = true;
}

#endif
