/* One instance: the instance of FMI 2.0 inside, modes, and messages. */

#ifndef FMI3_INSTANCE_H
#define FMI3_INSTANCE_H

#ifndef FMI3_FUNCTION_PREFIX /* an importer that compiles may choose another one */
#define FMI3_FUNCTION_PREFIX PASTE(MODEL, _)
#endif
#include "fmi3Functions.h"

/* Modes, and the modes in which each function may be called (FMI 3.0.2, tables in sections 2.3, 3.2 and 4.2). */
/* clang-format off */
enum {
    NEW_3 = 1, CONFIGURATION_3 = 2, INITIALIZATION_3 = 4, EVENTS_3 = 8, STEPS_3 = 16, CONTINUOUS_3 = 32, TERMINATED_3 = 64,
    INTERMEDIATE_3 = 128 /* in the callback of fmi3DoStep */
};
enum {
    RUNNING_3                         = EVENTS_3 | STEPS_3 | CONTINUOUS_3,
    ANY_3                             = NEW_3 | CONFIGURATION_3 | INITIALIZATION_3 | RUNNING_3 | TERMINATED_3,
    MAY3_EnterConfigurationMode      = NEW_3,
    MAY3_ExitConfigurationMode       = CONFIGURATION_3,
    MAY3_EnterInitializationMode   = NEW_3,
    MAY3_ExitInitializationMode    = INITIALIZATION_3,
    MAY3_EnterEventMode            = STEPS_3 | CONTINUOUS_3,
    MAY3_EnterStepMode               = EVENTS_3,
    MAY3_EnterContinuousTimeMode   = EVENTS_3,
    MAY3_Terminate                 = RUNNING_3,
    MAY3_Get                       = INITIALIZATION_3 | RUNNING_3 | TERMINATED_3 | INTERMEDIATE_3,
    MAY3_Set                       = NEW_3 | INITIALIZATION_3 | RUNNING_3,
    MAY3_SetStructural               = CONFIGURATION_3,
    MAY3_GetStructural               = MAY3_Get | CONFIGURATION_3,
    MAY3_SetClock                    = EVENTS_3,
    MAY3_GetInterval                 = INITIALIZATION_3 | EVENTS_3 | STEPS_3,
    MAY3_UpdateDiscreteStates        = EVENTS_3,
    MAY3_DoStep                    = STEPS_3,
    MAY3_GetDerivative               = INITIALIZATION_3 | RUNNING_3 | TERMINATED_3,
    MAY3_GetOutputDerivatives        = STEPS_3 | TERMINATED_3 | INTERMEDIATE_3,
    MAY3_GetContinuousStates         = INITIALIZATION_3 | EVENTS_3 | CONTINUOUS_3 | TERMINATED_3,
    MAY3_InContinuousTime            = CONTINUOUS_3,
    MAY3_SetTime                   = EVENTS_3 | CONTINUOUS_3
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

#endif
