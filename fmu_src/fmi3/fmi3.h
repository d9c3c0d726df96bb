/* FMI 3.0 around the FMI 2.0 functions of a block or composite, which are included before: every rule on values, steps
   and states is in one place. Here are the modes, arrays, clocks and calls that FMI 3.0 adds. */

/* clang-format off */
/* The generated file has defined before:

   TOKEN                  the instantiation token, as text; GUID_INSIDE: the GUID of FMI 2.0
   REFERENCES             the number of value references of FMI 2.0, each of one element
   INDICATORS_REFERENCE   value reference of the first of INDICATOR_COUNT event indicators
   CLOCK_REFERENCE        value reference of the clock of samples; that of another variable is its position in
                          modelDescription.xml, from 1
   ALL_REFERENCES         one more than the last value reference
   variables_3[]          the variables by reference
   state_variables[]      references of the STATE_VARIABLES continuous states, in the order of FMI 2.0
   STRUCTURAL             the reference in FMI 2.0 of the structural parameter, if there is one
   HAS_MODEL_EXCHANGE, HAS_EVENT_MODE: 0 or 1 */
/* clang-format on */

#ifndef FMI3_H
#define FMI3_H

#ifndef FMI3_FUNCTION_PREFIX /* an importer that compiles may choose another one */
#define FMI3_FUNCTION_PREFIX PASTE(MODEL, _)
#endif
#include "fmi3Functions.h"

/* ---- One instance: the instance of FMI 2.0 inside, modes, and messages. */

/* Modes, and the modes in which each function may be called (FMI 3.0.2, tables in sections 2.3, 3.2 and 4.2). */
/* clang-format off */
enum {
    NEW_3 = 1, CONFIGURATION_3 = 2, INITIALIZATION_3 = 4, EVENTS_3 = 8, STEPS_3 = 16, CONTINUOUS_3 = 32, TERMINATED_3 = 64,
    INTERMEDIATE_3 = 128 /* in the callback of fmi3DoStep */
};
enum {
    RUNNING_3                    = EVENTS_3 | STEPS_3 | CONTINUOUS_3,
    ANY_3                        = NEW_3 | CONFIGURATION_3 | INITIALIZATION_3 | RUNNING_3 | TERMINATED_3,
    MAY3_EnterConfigurationMode  = NEW_3,
    MAY3_ExitConfigurationMode   = CONFIGURATION_3,
    MAY3_EnterInitializationMode = NEW_3,
    MAY3_ExitInitializationMode  = INITIALIZATION_3,
    MAY3_EnterEventMode          = STEPS_3 | CONTINUOUS_3,
    MAY3_EnterStepMode           = EVENTS_3,
    MAY3_EnterContinuousTimeMode = EVENTS_3,
    MAY3_Terminate               = RUNNING_3,
    MAY3_Get                     = INITIALIZATION_3 | RUNNING_3 | TERMINATED_3 | INTERMEDIATE_3,
    MAY3_Set                     = NEW_3 | INITIALIZATION_3 | RUNNING_3,
    MAY3_SetStructural           = CONFIGURATION_3,
    MAY3_GetStructural           = MAY3_Get | CONFIGURATION_3,
    MAY3_SetClock                = EVENTS_3,
    MAY3_GetInterval             = INITIALIZATION_3 | EVENTS_3 | STEPS_3,
    MAY3_UpdateDiscreteStates    = EVENTS_3,
    MAY3_DoStep                  = STEPS_3,
    MAY3_GetDerivative           = INITIALIZATION_3 | RUNNING_3 | TERMINATED_3,
    MAY3_GetOutputDerivatives    = STEPS_3 | TERMINATED_3 | INTERMEDIATE_3,
    MAY3_GetContinuousStates     = INITIALIZATION_3 | EVENTS_3 | CONTINUOUS_3 | TERMINATED_3,
    MAY3_InContinuousTime        = CONTINUOUS_3,
    MAY3_SetTime                 = EVENTS_3 | CONTINUOUS_3
};
/* clang-format on */

/* Before a function that is called rarely: its caller, which is called at every step, saves fewer registers. */
#if defined __GNUC__
#define APART __attribute__((noinline))
#else
#define APART
#endif

typedef struct {
    Instance *inside;
    fmi2FMUstate begin; /* of a step in pieces */
    int mode;
    bool ticking;         /* the clock was set in this event */
    bool events, returns; /* event mode is used; steps may end early */
    bool told;            /* the interval of the clock was read */
    const char *function; /* the function that is called, for messages */
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback logger;
    fmi3IntermediateUpdateCallback update;
    fmi2CallbackFunctions callbacks;
    fmi2ValueReference elements[REFERENCES + 1]; /* 0, 1, 2, ... */
    fmi2ValueReference listed[REFERENCES + 1];   /* elements of the variables in a call */
    double numbers[REFERENCES + INDICATOR_COUNT + 1];
    int whole[REFERENCES + 1];
} Shell;

/* Pass on a message from inside; in place of the function of FMI 2.0, the message names the one that was called. */
static void forward_3(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                      fmi2String message, ...)
{
    const Shell *const c = (const Shell *)environment;
    char text[1024], named[1100];
    va_list arguments;
    va_start(arguments, message);
    vsnprintf(text, sizeof text, message, arguments);
    va_end(arguments);
    (void)name;
    if (!c->logger)
        return;
    const char *rest = strncmp(text, "fmi2", 4) == 0 ? text + strcspn(text, " :") : NULL;
    snprintf(named, sizeof named, "%s%s", rest ? c->function : "", rest ? rest : text);
    c->logger(c->environment, (fmi3Status)status, category, named);
}

static const char *mode_name_3(int mode)
{
    switch (mode) {
    case NEW_3: return "instantiated";
    case CONFIGURATION_3: return "configuration mode";
    case INITIALIZATION_3: return "initialization mode";
    case EVENTS_3: return "event mode";
    case STEPS_3: return "step mode";
    case CONTINUOUS_3: return "continuous-time mode";
    case INTERMEDIATE_3: return "intermediate update mode";
    default: return "terminated";
    }
}

static fmi3Status rejected_3(const Shell *c)
{
    return (fmi3Status)report(c->inside, fmi2Error, LOG_ERROR, "%s is not allowed in the mode \"%s\"", c->function,
                              mode_name_3(c->mode));
}

/* Begin a function: get the instance `c` and check that the call is allowed. */
#define ENTER_3(name, allowed)                                                                                         \
    Shell *const c = (Shell *)instance;                                                                                \
    if (!c)                                                                                                            \
        return fmi3Error;                                                                                              \
    c->function = "fmi3" name;                                                                                         \
    if (!(c->mode & (allowed)))                                                                                        \
        return rejected_3(c);

/* The same for a function of one kind of FMU, co-simulation or model exchange. */
#define ENTER_3_AS(kind, name, allowed)                                                                                \
    ENTER_3(name, allowed)                                                                                             \
    if (KIND(c->inside) != (kind))                                                                                     \
        return fail_3(c, "is not allowed in %s",                                                                       \
                      KIND(c->inside) == fmi2ModelExchange ? "model exchange" : "co-simulation");

/* Report an error: the name of the function, then the text. */
static fmi3Status fail_3(const Shell *c, const char *format, ...)
{
    char text[400];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    return (fmi3Status)report(c->inside, fmi2Error, LOG_ERROR, "%s %s", c->function, text);
}

#define REQUIRE_3(condition, ...)                                                                                      \
    if (!(condition))                                                                                                  \
        return fail_3(c, __VA_ARGS__);

/* Pass on a status, and store the mode that a successful call leads to. */
static fmi3Status entered_3(Shell *c, fmi2Status status, int mode)
{
    if (status <= fmi2Warning)
        c->mode = mode;
    return (fmi3Status)status;
}

/* Return the number of elements of the variable with this reference. */
static size_t size_of_3(const Shell *c, fmi3ValueReference reference)
{
    const Variable3 *const v = &variables_3[reference];
#ifdef STRUCTURAL
    if (v->resized)
        return (size_t)*value_of(&c->inside->model, STRUCTURAL);
#else
    (void)c;
#endif
    return v->length;
}

/* ---- Life of an instance, from instantiation to termination. */

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean on, size_t n, const fmi3String categories_wanted[])
{
    ENTER_3("SetDebugLogging", ANY_3)
    return (fmi3Status)fmi2SetDebugLogging(c->inside, on, n, categories_wanted);
}

/* Return a new instance, or NULL after a message. `fault` is a reason known before. */
static Shell *instantiated_3(fmi3String name, fmi3String token, fmi2Type kind, fmi3Boolean visible, fmi3Boolean logging,
                             fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger, const char *fault)
{
    Shell *const c = (Shell *)calloc(1, sizeof(Shell));
    if (!c)
        return NULL;
    const fmi2CallbackFunctions callbacks = {forward_3, calloc, free, NULL, c};
    memcpy(&c->callbacks, &callbacks, sizeof callbacks); /* its members are const */
    c->function = kind == fmi2ModelExchange ? "fmi3InstantiateModelExchange" : "fmi3InstantiateCoSimulation";
    c->environment = environment;
    c->logger = logger;
    c->mode = NEW_3;
    for (fmi2ValueReference i = 0; i < REFERENCES; i++)
        c->elements[i] = i;
    if (!fault && (!token || strcmp(token, TOKEN) != 0))
        fault = "the instantiation token differs from that of this binary: modelDescription.xml and library do not "
                "match";
    if (fault && logger) {
        char text[400];
        snprintf(text, sizeof text, "%s of %s: %s", c->function, QUOTE(MODEL), fault);
        logger(environment, fmi3Error, categories[2], text);
    }
    c->inside = fault ? NULL
                      : (Instance *)fmi2Instantiate(name, kind, GUID_INSIDE, "", &c->callbacks, visible ? 1 : 0,
                                                    logging ? 1 : 0);
    if (!c->inside) {
        free(c);
        return NULL;
    }
    return c;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback logger)
{
    (void)resources;
    const char *const fault = HAS_MODEL_EXCHANGE ? NULL : "this FMU is for co-simulation only";
    return instantiated_3(name, token, fmi2ModelExchange, visible, logging, environment, logger, fault);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean returns,
                                         const fmi3ValueReference intermediate[], size_t intermediates,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                         fmi3IntermediateUpdateCallback update)
{
    (void)resources;
    const char *fault = NULL;
    if (events && !HAS_EVENT_MODE)
        fault = "it has no event mode; instantiate it with eventModeUsed = false";
    for (size_t i = 0; i < intermediates; i++)
        if (!intermediate || intermediate[i] >= ALL_REFERENCES || !variables_3[intermediate[i]].intermediate)
            fault = "a required intermediate variable is not marked with intermediateUpdate in modelDescription.xml";
    Shell *const c = instantiated_3(name, token, fmi2CoSimulation, visible, logging, environment, logger, fault);
    if (c) {
        c->events = events;
        c->returns = returns;
        c->update = update;
    }
    return c;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                               fmi3ClockUpdateCallback tick, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)tick, (void)lock, (void)unlock;
    if (logger)
        logger(environment, fmi3Error, categories[2],
               "fmi3InstantiateScheduledExecution of " QUOTE(MODEL) ": this FMU is not for scheduled execution");
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance)
{
    Shell *const c = (Shell *)instance;
    if (c) {
        (void)fmi2FreeFMUstate(c->inside, &c->begin);
        fmi2FreeInstance(c->inside);
    }
    free(c);
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance)
{
    ENTER_3("EnterConfigurationMode", MAY3_EnterConfigurationMode)
#ifdef STRUCTURAL
    c->mode = CONFIGURATION_3;
    return fmi3OK;
#else
    return fail_3(c, "is not allowed: %s has no structural parameters", QUOTE(MODEL));
#endif
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance)
{
    ENTER_3("ExitConfigurationMode", MAY3_ExitConfigurationMode)
    c->mode = NEW_3;
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean tolerance_given, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_given, fmi3Float64 stop)
{
    ENTER_3("EnterInitializationMode", MAY3_EnterInitializationMode)
    const fmi2Status status = fmi2SetupExperiment(c->inside, tolerance_given, tolerance, start, stop_given, stop);
    return status > fmi2Warning ? (fmi3Status)status
                                : entered_3(c, fmi2EnterInitializationMode(c->inside), INITIALIZATION_3);
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    ENTER_3("ExitInitializationMode", MAY3_ExitInitializationMode)
    const bool in_event_mode = c->events || KIND(c->inside) == fmi2ModelExchange;
    return entered_3(c, fmi2ExitInitializationMode(c->inside), in_event_mode ? EVENTS_3 : STEPS_3);
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    ENTER_3("Terminate", MAY3_Terminate)
    return entered_3(c, fmi2Terminate(c->inside), TERMINATED_3);
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    ENTER_3("Reset", ANY_3)
    c->ticking = c->told = false;
    return entered_3(c, fmi2Reset(c->inside), NEW_3);
}

#include "fmi3_values.h"

/* ---- Event mode: in co-simulation, the samples of a sampled block; in model exchange, the events of FMI 2.0. */

#if HAS_EVENT_MODE
/* Return the time to the next sample, after the one that is due, which begins the next step. */
static double to_next_event_3(const Model *m)
{
    return m->run.rest <= sample_slack(m) ? m->run.rest + m->Ts : m->run.rest;
}
#endif

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    ENTER_3("EnterEventMode", MAY3_EnterEventMode)
#if HAS_MODEL_EXCHANGE
    if (KIND(c->inside) == fmi2ModelExchange)
        return entered_3(c, fmi2EnterEventMode(c->inside), EVENTS_3);
#endif
    REQUIRE_3(c->events, "is not allowed: the FMU was instantiated with eventModeUsed = false")
    c->mode = EVENTS_3;
    return fmi3OK;
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    ENTER_3_AS(fmi2CoSimulation, "EnterStepMode", MAY3_EnterStepMode)
    c->ticking = false;
    c->mode = STEPS_3;
    return fmi3OK;
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    ENTER_3("EvaluateDiscreteStates", MAY3_UpdateDiscreteStates)
    return fail_3(c, "is not available: providesEvaluateDiscreteStates is false");
}

/* Take what is due at an event. */
static fmi2Status update_3(Shell *c, fmi2EventInfo *info)
{
    memset(info, 0, sizeof *info);
#if HAS_MODEL_EXCHANGE
    if (KIND(c->inside) == fmi2ModelExchange)
        return fmi2NewDiscreteStates(c->inside, info);
#endif
#if HAS_EVENT_MODE
    if (c->ticking)
        return new_discrete_states(c->inside, info);
    info->nextEventTimeDefined = fmi2True; /* without the clock, the sample is left to fmi3DoStep */
    info->nextEventTime = c->inside->model.time + to_next_event_3(&c->inside->model);
#endif
    (void)c;
    return fmi2OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *again, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals_changed, fmi3Boolean *states_changed,
                                    fmi3Boolean *next_time_defined, fmi3Float64 *next_time)
{
    ENTER_3("UpdateDiscreteStates", MAY3_UpdateDiscreteStates)
    REQUIRE_3(again && terminate && nominals_changed && states_changed && next_time_defined && next_time,
              "was called with a null pointer")
    fmi2EventInfo info;
    const fmi2Status status = update_3(c, &info);
    if (status > fmi2Warning)
        return (fmi3Status)status;
    c->ticking = false;
    *again = info.newDiscreteStatesNeeded != fmi2False;
    *terminate = info.terminateSimulation != fmi2False;
    *nominals_changed = info.nominalsOfContinuousStatesChanged != fmi2False;
    *states_changed = info.valuesOfContinuousStatesChanged != fmi2False;
    *next_time_defined = info.nextEventTimeDefined != fmi2False;
    *next_time = info.nextEventTime;
    return (fmi3Status)status;
}

/* ---- The clock of a sampled block: it ticks at start + k Ts. An importer that uses event mode takes each sample in an
   event; one that does not leaves the samples to fmi3DoStep. The numbers are the same. */

/* Check the clocks of a call; the only one is that of the samples. */
static fmi3Status check_clocks_3(const Shell *c, const fmi3ValueReference references[], size_t n, const void *values)
{
    REQUIRE_3(n == 0 || (references && values), "was called with a null pointer")
    for (size_t i = 0; i < n; i++)
        REQUIRE_3(references[i] == CLOCK_REFERENCE && variables_3[CLOCK_REFERENCE].type == IS_CLOCK,
                  "was called with value reference %u: there is no clock with it", references[i])
    return fmi3OK;
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference references[], size_t n, fmi3Clock values[])
{
    ENTER_3("GetClock", MAY3_SetClock)
    const fmi3Status status = check_clocks_3(c, references, n, values);
    for (size_t i = 0; i < n && status == fmi3OK; i++)
        values[i] = c->ticking;
    return status;
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                        const fmi3Clock values[])
{
    ENTER_3("SetClock", MAY3_SetClock)
    const fmi3Status status = check_clocks_3(c, references, n, values);
#if HAS_EVENT_MODE
    const Model *const m = &c->inside->model;
    for (size_t i = 0; i < n && status == fmi3OK; i++) {
        /* in model exchange, an event takes the sample even without the clock */
        const double ahead = to_next_sample(m), taken = m->run.exchange && m->run.tick > 0 ? ahead - m->Ts : ahead;
        REQUIRE_3(!values[i] || fmin(fabs(ahead), fabs(taken)) <= sample_slack(m),
                  "was called at t = %.17g s, but the next tick is at %.17g s", m->time, m->time + ahead)
        c->ticking = values[i];
    }
#endif
    return status;
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                                  fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
{
    ENTER_3("GetIntervalDecimal", MAY3_GetInterval)
    const fmi3Status status = check_clocks_3(c, references, n, intervals);
    REQUIRE_3(n == 0 || qualifiers, "was called with a null pointer")
#if HAS_EVENT_MODE
    for (size_t i = 0; i < n && status == fmi3OK; i++) {
        intervals[i] = c->inside->model.Ts;
        qualifiers[i] = c->told ? fmi3IntervalUnchanged : fmi3IntervalChanged;
        c->told = c->mode != INITIALIZATION_3; /* Ts may still change there */
    }
#endif
    return status;
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                               fmi3Float64 shifts[])
{
    ENTER_3("GetShiftDecimal", MAY3_GetInterval)
    const fmi3Status status = check_clocks_3(c, references, n, shifts);
    for (size_t i = 0; i < n && status == fmi3OK; i++)
        shifts[i] = 0.0;
    return status;
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                                   fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
{
    ENTER_3("GetIntervalFraction", MAY3_GetInterval)
    (void)references, (void)counters, (void)resolutions, (void)qualifiers;
    REQUIRE_3(n == 0, "is not possible: the interval is a decimal number (supportsFraction is false)")
    return fmi3OK;
}

fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                                fmi3UInt64 counters[], fmi3UInt64 resolutions[])
{
    ENTER_3("GetShiftFraction", MAY3_GetInterval)
    (void)references, (void)counters, (void)resolutions;
    REQUIRE_3(n == 0, "is not possible: the shift is a decimal number (supportsFraction is false)")
    return fmi3OK;
}

/* The importer may set the interval of no clock, as modelDescription.xml states none: set the parameter Ts instead. */
#define CANNOT_SET(name, unused, ...)                                                                                  \
    fmi3Status fmi3Set##name(fmi3Instance instance, const fmi3ValueReference references[], size_t n, __VA_ARGS__)      \
    {                                                                                                                  \
        ENTER_3("Set" #name, MAY3_GetInterval)                                                                         \
        (void)references, unused;                                                                                      \
        REQUIRE_3(n == 0, "is not possible: the interval is the parameter Ts")                                         \
        return fmi3OK;                                                                                                 \
    }
#define BOTH_UNUSED ((void)counters, (void)resolutions)
CANNOT_SET(IntervalDecimal, (void)intervals, const fmi3Float64 intervals[])
CANNOT_SET(ShiftDecimal, (void)shifts, const fmi3Float64 shifts[])
CANNOT_SET(IntervalFraction, BOTH_UNUSED, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
CANNOT_SET(ShiftFraction, BOTH_UNUSED, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 time)
{
    ENTER_3("ActivateModelPartition", ANY_3)
    (void)clock, (void)time;
    return fail_3(c, "is not possible: this FMU is not for scheduled execution");
}

/* ---- Steps of co-simulation. A step is cut at the samples of a sampled block, and at the grid of a composite, where
   the importer wants to take part: in event mode with early return, or by intermediate updates. */

/* Return the end of the next piece of a step that ends at `end`. */
static double next_stop_3(const Shell *c, double now, double end)
{
    double stop = INFINITY;
    if (!c->update && !(c->events && c->returns))
        return end;
#if HAS_EVENT_MODE
    const Model *const m = &c->inside->model;
    const double slack = sample_slack(m);
    stop = now + to_next_event_3(m);
#elif defined COMPOSITE_H
    const double slack = tick_slack(&c->inside->memory), rest = STEP_SIZE - c->inside->memory.spent;
    stop = now + (rest <= slack ? rest + STEP_SIZE : rest);
#else
    const double slack = 0.0;
    (void)now;
#endif
    return stop < end - slack ? stop : end;
}

/* Return whether a sample is due, which the importer takes in event mode. */
static bool event_due_3(const Shell *c)
{
#if HAS_EVENT_MODE
    const Model *const m = &c->inside->model;
    return c->events && m->run.rest <= sample_slack(m);
#else
    (void)c;
    return false;
#endif
}

/* Let the importer read values at the end of a piece; return whether it ends the step here. `end` is moved to the time
   at which it wants to. */
static bool ended_by_importer(Shell *c, double now, double *end)
{
    fmi3Boolean wanted = false;
    fmi3Float64 when = now;
    if (!c->update)
        return false;
    c->mode = INTERMEDIATE_3;
    c->update(c->environment, now, false, true, true, c->returns, &wanted, &when);
    c->mode = STEPS_3;
    c->function = "fmi3DoStep";
    if (!wanted || !c->returns)
        return false;
    *end = when < *end ? when : *end;
    return when <= now;
}

/* FMI 3.0 has no time derivatives of inputs. This function offers those of FMI 2.0 to an importer that knows it. */
#define harness_SetInputDerivatives fmi3FullName(harness_SetInputDerivatives)

FMI3_Export fmi3Status harness_SetInputDerivatives(fmi3Instance instance, const fmi3ValueReference references[],
                                                   size_t n, const fmi3Int32 orders[], const fmi3Float64 values[]);

fmi3Status harness_SetInputDerivatives(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                                       const fmi3Int32 orders[], const fmi3Float64 values[])
{
    ENTER_3_AS(fmi2CoSimulation, "SetInputDerivatives", NEW_3 | INITIALIZATION_3 | STEPS_3)
    const fmi3Status status = check_variables_3(c, references, n, values, n, IS_FLOAT64);
    if (status != fmi3OK)
        return status;
    REQUIRE_ELEMENTS(list, references, n, n)
    return (fmi3Status)fmi2SetRealInputDerivatives(c->inside, list, n, orders, values);
}

/* Step in pieces. */
static APART fmi3Status pieces_3(Shell *c, double t, double h, bool keeps_no_state, bool *event, bool *early,
                                 double *last)
{
    const double whole_end = t + h;
    double end = whole_end;
    fmi2Status worst = fmi2OK;
    for (double now = t;;) {
        const double stop = next_stop_3(c, now, end);
        const bool whole = now == t && stop == whole_end;
        if (now == t && !whole && fmi2GetFMUstate(c->inside, &c->begin) > fmi2Warning)
            return fmi3Error;
        if (now > t) /* the input derivatives are of the whole step */
            SLOPES_USED(c->inside) = false;
        const fmi2Status status = fmi2DoStep(c->inside, now, whole ? h : stop - now, keeps_no_state ? 1 : 0);
        if (status == fmi2Discard && now > t && fmi2SetFMUstate(c->inside, c->begin) > fmi2Warning)
            return fmi3Error;
        if (status > fmi2Warning)
            return (fmi3Status)status;
        worst = status > worst ? status : worst;
        *last = now = stop;
        *event = event_due_3(c);
        if (ended_by_importer(c, now, &end) || !(now < end) || (*event && c->returns)) {
            *early = now < whole_end;
            return (fmi3Status)worst;
        }
    }
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 t, fmi3Float64 h, fmi3Boolean keeps_no_state,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last)
{
    ENTER_3("DoStep", MAY3_DoStep) /* no mode of model exchange is among them */
    REQUIRE_3(event && terminate && early && last, "was called with a null pointer")
    *event = *terminate = *early = false;
    *last = t + h;
    const fmi3Status status = c->update || c->events ? pieces_3(c, t, h, keeps_no_state, event, early, last)
                                                     : (fmi3Status)fmi2DoStep(c->inside, t, h, keeps_no_state ? 1 : 0);
    if (status > fmi3Warning) {
        *event = *early = false;
        *last = t;
    }
    if (status != fmi3Discard)
        return status;
    MODE(c->inside) = STEP_COMPLETE; /* all is as before the call: a shorter step may follow */
    *terminate = *early = ENDED(c->inside);
    return *terminate ? fmi3OK : fmi3Discard;
}

/* ---- Saved states: the mode of FMI 3.0, and the state of FMI 2.0. */

static const char magic_3[MAGIC_SIZE] = "shell 3";
static const char token_3[GUID_SIZE] = TOKEN;

typedef struct {
    SavedHeader header; /* with the checksum of what follows and of the bytes of `inside` */
    int32_t mode, exchange, events, ticking;
    fmi2FMUstate inside;
} Saved3;

enum { STORED_3 = offsetof(Saved3, inside), CHECKED_3 = offsetof(Saved3, mode) };

/* The mode of the instance inside, in its saved state. */
#ifdef COMPOSITE_H
#define MODE_IN(state) (((const Saved *)(state))->memory.mode)
#else
#define MODE_IN(state) (((const Saved *)(state))->model.run.mode)
#endif

/* Return the mode of FMI 2.0 in which the instance inside is, in a mode of FMI 3.0; several may apply. */
static int modes_inside(int mode, bool exchange)
{
    switch (mode) {
    case NEW_3:
    case CONFIGURATION_3: return INSTANTIATED;
    case INITIALIZATION_3: return INITIALIZING;
    case EVENTS_3: return exchange ? EVENT_MODE : STEP_COMPLETE | STEP_FAILED;
    case STEPS_3: return exchange ? 0 : STEP_COMPLETE | STEP_FAILED;
    case CONTINUOUS_3: return exchange ? CONTINUOUS_TIME : 0;
    default: return mode == TERMINATED_3 ? TERMINATED : 0;
    }
}

static const char *fault_of_3(const Shell *c, const Saved3 *saved)
{
    const char *const fault = fault_of_header(&saved->header, magic_3, token_3, sizeof(Saved3));
    if (fault)
        return fault;
    if ((saved->exchange != 0) != (KIND(c->inside) == fmi2ModelExchange))
        return OTHER_KIND;
    if ((saved->events != 0) != c->events)
        return "it was saved with another value of eventModeUsed";
    return NULL;
}

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    ENTER_3("GetFMUState", ANY_3)
    REQUIRE_3(state, "was called with a null pointer")
    Saved3 *const saved = *state ? (Saved3 *)*state : (Saved3 *)calloc(1, sizeof(Saved3));
    REQUIRE_3(saved, "has no memory")
    const fmi2Status status = fmi2GetFMUstate(c->inside, &saved->inside);
    if (status > fmi2Warning) {
        if (!*state)
            free(saved);
        return (fmi3Status)status;
    }
    if (!*state)
        write_header(&saved->header, magic_3, token_3, sizeof(Saved3));
    saved->mode = c->mode;
    saved->exchange = KIND(c->inside) == fmi2ModelExchange;
    saved->events = c->events;
    saved->ticking = c->ticking;
    *state = saved;
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state)
{
    ENTER_3("SetFMUState", ANY_3)
    REQUIRE_3(state, "was called with a null pointer")
    const Saved3 *const saved = (const Saved3 *)state;
    const char *const fault = fault_of_3(c, saved);
    REQUIRE_3(!fault, "cannot use the state: %s", fault)
    const fmi2Status status = fmi2SetFMUstate(c->inside, saved->inside);
    if (status > fmi2Warning)
        return (fmi3Status)status;
    c->mode = saved->mode;
    c->ticking = saved->ticking != 0;
    c->told = false;
    return fmi3OK;
}

static void free_state_3(Shell *c, Saved3 *saved)
{
    if (saved)
        (void)fmi2FreeFMUstate(c->inside, &saved->inside);
    free(saved);
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    ENTER_3("FreeFMUState", ANY_3)
    if (state) {
        free_state_3(c, (Saved3 *)*state);
        *state = NULL;
    }
    return fmi3OK;
}

/* Return the size of a serialized state; 0 after a message. */
static size_t serialized_size_3(Shell *c, const Saved3 *saved)
{
    size_t size = 0;
    return fmi2SerializedFMUstateSize(c->inside, saved->inside, &size) > fmi2Warning ? 0 : STORED_3 + size;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size)
{
    ENTER_3("SerializedFMUStateSize", ANY_3)
    REQUIRE_3(state && size, "was called with a null pointer")
    const size_t needed = serialized_size_3(c, (const Saved3 *)state);
    if (needed == 0)
        return fmi3Error;
    *size = needed;
    return fmi3OK;
}

/* Return the checksum of serialized bytes. */
static uint64_t checksum_of_3(const fmi3Byte *bytes, size_t size)
{
    return checksum_of_bytes(bytes + CHECKED_3, size - CHECKED_3);
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    ENTER_3("SerializeFMUState", ANY_3)
    REQUIRE_3(state && bytes, "was called with a null pointer")
    const Saved3 *const saved = (const Saved3 *)state;
    const size_t needed = serialized_size_3(c, saved);
    if (needed == 0)
        return fmi3Error;
    REQUIRE_3(size >= needed, "was called with %u bytes, too few for a state of %u", (unsigned)size, (unsigned)needed)
    const fmi2Status status =
        fmi2SerializeFMUstate(c->inside, saved->inside, (fmi2Byte *)bytes + STORED_3, needed - STORED_3);
    if (status > fmi2Warning)
        return (fmi3Status)status;
    memcpy(bytes, saved, STORED_3);
    const uint64_t checksum = checksum_of_3(bytes, needed);
    memcpy(bytes + offsetof(Saved3, header.checksum), &checksum, sizeof checksum);
    return fmi3OK;
}

/* Return whether a run can reach this state. */
static bool plausible_3(const Saved3 *saved)
{
    const int modes = modes_inside(saved->mode, saved->exchange != 0);
    const bool ticks = saved->ticking == 0 || (saved->ticking == 1 && HAS_EVENT_MODE && saved->mode == EVENTS_3);
    const bool events = saved->exchange != 0 || saved->events != 0 || saved->mode != EVENTS_3;
    return ticks && events && (saved->events == 0 || saved->events == 1) &&
           (saved->exchange == 0 || saved->exchange == 1) && (MODE_IN(saved->inside) & modes) != 0;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    ENTER_3("DeserializeFMUState", ANY_3)
    REQUIRE_3(bytes && state, "was called with a null pointer")
    REQUIRE_3(size >= STORED_3, "was called with %u bytes, too few for a state", (unsigned)size)
    Saved3 *const read = (Saved3 *)calloc(1, sizeof(Saved3));
    REQUIRE_3(read, "has no memory")
    memcpy(read, bytes, STORED_3);
    const char *fault = fault_of_3(c, read);
    if (!fault && read->header.checksum != checksum_of_3(bytes, size))
        fault = "they are damaged";
    fmi2Status status = fmi2Error;
    if (!fault)
        status = fmi2DeSerializeFMUstate(c->inside, (const fmi2Byte *)bytes + STORED_3, size - STORED_3, &read->inside);
    if (status <= fmi2Warning && !plausible_3(read))
        fault = "no run can reach such values";
    if (fault || status > fmi2Warning) {
        free_state_3(c, read);
        return fault ? fail_3(c, "cannot use the bytes: %s", fault) : (fmi3Status)status;
    }
    *state = read;
    return fmi3OK;
}

/* ---- Partial derivatives, and time derivatives of outputs, element by element from those of FMI 2.0. */

/* Return the number of elements of variables of type Float64; 0 after a message if one is unknown. */
static size_t elements_in_3(const Shell *c, const fmi3ValueReference references[], size_t n)
{
    size_t count = 0;
    for (size_t i = 0; i < n; i++) {
        if (references[i] >= INDICATORS_REFERENCE || variables_3[references[i]].type != IS_FLOAT64) {
            (void)fail_3(c, "was called with value reference %u: it has no derivatives", references[i]);
            return 0;
        }
        count += size_of_3(c, references[i]);
    }
    return count;
}

/* A product of a row and the derivatives: sensitivity[j] = sum over i of seed[i] d unknown[i] / d known[j]. */
static fmi3Status adjoint_3(Shell *c, const fmi2ValueReference unknowns[], size_t n_unknowns,
                            const fmi2ValueReference knowns[], size_t n_knowns, const double seed[],
                            double sensitivity[])
{
    const double one = 1.0;
    for (size_t i = 0; i < n_unknowns; i++)
        REQUIRE_3(isfinite(seed[i]), "was called with a seed that is not finite")
    for (size_t j = 0; j < n_knowns; j++) {
        const fmi2Status status =
            fmi2GetDirectionalDerivative(c->inside, unknowns, n_unknowns, &knowns[j], 1, &one, c->numbers);
        if (status > fmi2Warning)
            return (fmi3Status)status;
        double sum = 0.0;
        for (size_t i = 0; i < n_unknowns; i++)
            sum += seed[i] * c->numbers[i];
        sensitivity[j] = sum;
    }
    return fmi3OK;
}

/* A derivative of each kind needs the elements of unknowns and knowns at the same time. */
static fmi3Status differentiate_3(Shell *c, bool is_adjoint, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                  const fmi3ValueReference knowns[], size_t n_knowns, const double seed[],
                                  size_t n_seed, double sensitivity[], size_t n_sensitivity)
{
    REQUIRE_3((n_unknowns == 0 || unknowns) && (n_knowns == 0 || knowns) && (n_seed == 0 || seed) &&
                  (n_sensitivity == 0 || sensitivity),
              "was called with a null pointer")
    const size_t above = elements_in_3(c, unknowns, n_unknowns), below = elements_in_3(c, knowns, n_knowns);
    if ((n_unknowns > 0 && above == 0) || (n_knowns > 0 && below == 0))
        return fmi3Error;
    const size_t given = is_adjoint ? above : below, asked = is_adjoint ? below : above;
    REQUIRE_3(n_seed == given && n_sensitivity == asked,
              "was called with %u seeds and %u sensitivities, but the variables have %u and %u elements",
              (unsigned)n_seed, (unsigned)n_sensitivity, (unsigned)given, (unsigned)asked)
    REQUIRE_3(above + below <= REFERENCES, "was called with a variable more than once")
    fmi2ValueReference *const lower = list_elements_3(c, unknowns, n_unknowns, c->listed);
    (void)list_elements_3(c, knowns, n_knowns, lower);
    if (!is_adjoint)
        return (fmi3Status)fmi2GetDirectionalDerivative(c->inside, c->listed, above, lower, below, seed, sensitivity);
    return adjoint_3(c, c->listed, above, lower, below, seed, sensitivity);
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                        const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[],
                                        size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity)
{
    ENTER_3("GetDirectionalDerivative", MAY3_GetDerivative)
    return differentiate_3(c, false, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed, sensitivity, n_sensitivity);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[],
                                    size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity)
{
    ENTER_3("GetAdjointDerivative", MAY3_GetDerivative)
    return differentiate_3(c, true, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed, sensitivity, n_sensitivity);
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                                    const fmi3Int32 orders[], fmi3Float64 values[], size_t count)
{
    ENTER_3_AS(fmi2CoSimulation, "GetOutputDerivatives", MAY3_GetOutputDerivatives)
    const fmi3Status status = check_variables_3(c, references, n, values, count, IS_FLOAT64);
    if (status != fmi3OK)
        return status;
    REQUIRE_3(n == 0 || orders, "was called with a null pointer")
    for (size_t i = 0; i < n; i++)
        REQUIRE_3(orders[i] == 1, "was called with order %d, but only order 1 is available", orders[i])
    for (size_t i = 0; i < n; i++)
        REQUIRE_3(!is_indicator_3(references[i]), "was called for the event indicators, which are no outputs")
    REQUIRE_ELEMENTS(list, references, n, count)
    for (size_t i = 0; i < count; i++)
        c->whole[i] = 1;
    return (fmi3Status)fmi2GetRealOutputDerivatives(c->inside, list, count, c->whole, values);
}

/* ---- Model exchange: the states of FMI 2.0, of which a resized array has the first elements. */

#if HAS_MODEL_EXCHANGE
#define ENTER_EXCHANGE(name, allowed) ENTER_3_AS(fmi2ModelExchange, name, allowed)
#define EXCHANGE(call)                return call;
#else
#define ENTER_EXCHANGE(name, allowed)                                                                                  \
    ENTER_3(name, allowed)                                                                                             \
    return fail_3(c, "is not allowed in co-simulation");
#define EXCHANGE(call)
#endif

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance)
{
    ENTER_EXCHANGE("EnterContinuousTimeMode", MAY3_EnterContinuousTimeMode);
    EXCHANGE(entered_3(c, fmi2EnterContinuousTimeMode(c->inside), CONTINUOUS_3));
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean keeps_no_state, fmi3Boolean *event,
                                       fmi3Boolean *terminate)
{
    (void)keeps_no_state;
    ENTER_EXCHANGE("CompletedIntegratorStep", MAY3_InContinuousTime)
    REQUIRE_3(event && terminate, "was called with a null pointer")
#if HAS_MODEL_EXCHANGE
    fmi2Boolean enter = fmi2False, end = fmi2False;
    const fmi2Status status = fmi2CompletedIntegratorStep(c->inside, keeps_no_state ? 1 : 0, &enter, &end);
    *event = enter != fmi2False;
    *terminate = end != fmi2False;
    return (fmi3Status)status;
#endif
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 t)
{
    (void)t;
    ENTER_EXCHANGE("SetTime", MAY3_SetTime)
    EXCHANGE((fmi3Status)fmi2SetTime(c->inside, t))
}

#if HAS_MODEL_EXCHANGE
/* Return the number of states, or of all elements of their arrays. */
static size_t state_count_3(const Shell *c, bool all)
{
    size_t count = 0;
    for (int i = 0; i < STATE_VARIABLES; i++)
        count += all ? variables_3[state_variables[i]].length : size_of_3(c, state_variables[i]);
    return count;
}

typedef fmi2Status states_getter(fmi2Component component, fmi2Real values[], size_t n);

/* Get one number for each state. */
static fmi3Status get_of_states(Shell *c, states_getter *get, double *values, size_t n)
{
    const size_t all = state_count_3(c, true);
    REQUIRE_3(n == state_count_3(c, false), "was called with %u values, but %s has %u continuous states", (unsigned)n,
              QUOTE(MODEL), (unsigned)state_count_3(c, false))
    REQUIRE_3(n == 0 || values, "was called with a null pointer")
    const fmi2Status status = get(c->inside, n == all ? values : c->numbers, all);
    if (status > fmi2Warning || n == all)
        return (fmi3Status)status;
    const double *from = c->numbers;
    for (int i = 0; i < STATE_VARIABLES; i++) {
        const size_t size = size_of_3(c, state_variables[i]);
        memcpy(values, from, size * sizeof *values);
        values += size;
        from += variables_3[state_variables[i]].length;
    }
    return (fmi3Status)status;
}

static fmi3Status set_of_states(Shell *c, const double *values, size_t n)
{
    const size_t all = state_count_3(c, true);
    REQUIRE_3(n == state_count_3(c, false), "was called with %u values, but %s has %u continuous states", (unsigned)n,
              QUOTE(MODEL), (unsigned)state_count_3(c, false))
    if (n == all)
        return (fmi3Status)fmi2SetContinuousStates(c->inside, values, n);
    REQUIRE_3(values, "was called with a null pointer")
#ifdef STRUCTURAL
    double *to = c->numbers;
    for (int i = 0; i < STATE_VARIABLES; i++) {
        const Variable3 *const v = &variables_3[state_variables[i]];
        const size_t size = size_of_3(c, state_variables[i]);
        memcpy(to, value_of(&c->inside->model, v->inner), v->length * sizeof *to); /* the rest is kept */
        memcpy(to, values, size * sizeof *to);
        to += v->length;
        values += size;
    }
#endif
    return (fmi3Status)fmi2SetContinuousStates(c->inside, c->numbers, all);
}
#endif

/* A function that gets or sets a vector of model exchange. */
#define VECTOR_3(name, element, allowed, call)                                                                         \
    fmi3Status fmi3##name(fmi3Instance instance, element values[], size_t n)                                           \
    {                                                                                                                  \
        (void)values, (void)n;                                                                                         \
        ENTER_EXCHANGE(#name, allowed)                                                                                 \
        EXCHANGE(call)                                                                                                 \
    }
VECTOR_3(GetContinuousStates, fmi3Float64, MAY3_GetContinuousStates,
         get_of_states(c, fmi2GetContinuousStates, values, n))
VECTOR_3(SetContinuousStates, const fmi3Float64, MAY3_InContinuousTime, set_of_states(c, values, n))
VECTOR_3(GetContinuousStateDerivatives, fmi3Float64, MAY3_GetContinuousStates,
         get_of_states(c, fmi2GetDerivatives, values, n))
VECTOR_3(GetNominalsOfContinuousStates, fmi3Float64, MAY3_GetContinuousStates,
         get_of_states(c, fmi2GetNominalsOfContinuousStates, values, n))
VECTOR_3(GetEventIndicators, fmi3Float64, MAY3_GetContinuousStates,
         (fmi3Status)fmi2GetEventIndicators(c->inside, values, n))

#define LENGTH_3(name, length)                                                                                         \
    fmi3Status fmi3##name(fmi3Instance instance, size_t *n)                                                            \
    {                                                                                                                  \
        ENTER_EXCHANGE(#name, ANY_3)                                                                                   \
        REQUIRE_3(n, "was called with a null pointer")                                                                 \
        EXCHANGE((*n = length, fmi3OK))                                                                                \
    }
LENGTH_3(GetNumberOfContinuousStates, state_count_3(c, false))
LENGTH_3(GetNumberOfEventIndicators, INDICATOR_COUNT)

#endif
