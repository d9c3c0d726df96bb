/* One instance of the block as an FMU: modes, messages, and evaluation of outputs. */

#ifndef BLOCK_FMI2_INSTANCE_H
#define BLOCK_FMI2_INSTANCE_H

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PASTE_(a, b)         a##b
#define PASTE(a, b)          PASTE_(a, b)
#define QUOTE_(name)         #name
#define QUOTE(name)          QUOTE_(name)
#define FMI2_FUNCTION_PREFIX PASTE(MODEL, _)
#include "fmi2Functions.h"

/* Modes, and the modes in which each function may be called (table in section 4.2.4). Two columns are more lenient than
   the table, as importers require: inputs may be set directly after fmi2Instantiate. */
/* clang-format off */
enum { INSTANTIATED = 1, INITIALIZING = 2, STEP_COMPLETE = 4, STEP_FAILED = 8, TERMINATED = 16 };
enum {
    BEFORE_STEPPING             = INSTANTIATED | INITIALIZING,
    WITH_RESULTS                = INITIALIZING | STEP_COMPLETE | STEP_FAILED | TERMINATED,
    ANY_MODE                    = INSTANTIATED | WITH_RESULTS,
    MAY_SetDebugLogging         = ANY_MODE,
    MAY_SetupExperiment         = INSTANTIATED,
    MAY_EnterInitializationMode = INSTANTIATED,
    MAY_ExitInitializationMode  = INITIALIZING,
    MAY_Terminate               = STEP_COMPLETE | STEP_FAILED,
    MAY_Reset                   = ANY_MODE,
    MAY_Get                     = WITH_RESULTS,
    MAY_Set                     = BEFORE_STEPPING | STEP_COMPLETE,
    MAY_FMUstate                = ANY_MODE,
    MAY_GetDirectionalDerivative = WITH_RESULTS,
    MAY_SetRealInputDerivatives = BEFORE_STEPPING | STEP_COMPLETE,
    MAY_GetRealOutputDerivatives = STEP_COMPLETE | STEP_FAILED | TERMINATED,
    MAY_DoStep                  = STEP_COMPLETE,
    MAY_GetStatus               = STEP_COMPLETE | STEP_FAILED | TERMINATED
};
/* clang-format on */

static const char *const categories[] = {"logStatusWarning", "logStatusDiscard", "logStatusError", "logEvents",
                                         "logAll"};
enum { LOG_WARNING = 1, LOG_DISCARD = 2, LOG_ERROR = 4, LOG_EVENTS = 8, LOG_EVERYTHING = 31, LOG_CATEGORIES = 5 };

enum { GUID_LENGTH = 38 }; /* {8-4-4-4-12} */

typedef struct {
    Model model;               /* everything in a saved state */
    Model backup;              /* state at the start of the step, or work space */
    bool follows;              /* the backup is from the last step */
    const Row *row_of[VALUES]; /* rows by value reference */
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
    int logging;
    char guid[GUID_LENGTH + 2];
    char name[]; /* of the instance */
} Instance;

/* Send a message; every % is doubled, because importers use the text as a format. */
static fmi2Status report(const Instance *c, fmi2Status status, int category, const char *format, ...)
{
    if (!c->logger || !(c->logging & category))
        return status;
    char text[512], doubled[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    for (size_t end = strlen(text); end == sizeof text - 1 && (text[end - 1] & 0x80); end--)
        text[end - 1] = '\0'; /* do not cut a UTF-8 character */
    size_t length = 0;
    for (const char *from = text; *from; from++) {
        if (*from == '%')
            doubled[length++] = '%';
        doubled[length++] = *from;
    }
    doubled[length] = '\0';
    int which = 0;
    while (!(category >> which & 1))
        which++;
    c->logger(c->environment, c->name, status, categories[which], doubled);
    return status;
}

static const char *mode_name(int mode)
{
    switch (mode) {
    case INSTANTIATED: return "instantiated";
    case INITIALIZING: return "initialization mode";
    case STEP_COMPLETE: return "step complete";
    case STEP_FAILED: return "step failed";
    default: return "terminated";
    }
}

#define MODE(c) ((c)->model.run.mode)

/* Begin a function: get the instance `c` and check that the call is allowed. */
#define ENTER(function, allowed)                                                                                       \
    Instance *const c = (Instance *)component;                                                                         \
    if (!c)                                                                                                            \
        return fmi2Error;                                                                                              \
    if (!(MODE(c) & (allowed)))                                                                                        \
        return report(c, fmi2Error, LOG_ERROR, "fmi2%s is not allowed in the mode \"%s\"", function,                   \
                      mode_name(MODE(c)));

#define REQUIRE(condition, ...)                                                                                        \
    if (!(condition))                                                                                                  \
        return report(c, fmi2Error, LOG_ERROR, __VA_ARGS__);

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
enum { VARYING = offsetof(Model, time), VARYING_SIZE = offsetof(Model, run) + offsetof(Run, start) - VARYING };

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
    memset(&c->model, 0, sizeof c->model);
    for (size_t i = 0; i < ROWS; i++) {
        if (rows[i].starts)
            memcpy(value_of(&c->model, rows[i].index), rows[i].starts, rows[i].length * sizeof(double));
        else
            *value_of(&c->model, rows[i].index) = isnan(rows[i].start) ? 0.0 : rows[i].start;
    }
    c->follows = false;
    c->model.run.mode = INSTANTIATED;
    c->model.run.stop = INF;
    c->model.run.stale = true;
}

#endif
