/* One instance: the instance of FMI 2.0 inside, modes, and messages. */

#ifndef FMI3_INSTANCE_H
#define FMI3_INSTANCE_H

#define FMI3_FUNCTION_PREFIX PASTE(MODEL, _)
#include "fmi3Functions.h"

/* Modes, and the modes in which each function may be called (FMI 3.0.2, tables in sections 2.3, 3.2 and 4.2). */
/* clang-format off */
enum {
    NEW = 1, CONFIGURATION = 2, INITIALIZATION = 4, EVENTS_3 = 8, STEPS = 16, CONTINUOUS = 32, TERMINATED_3 = 64,
    INTERMEDIATE = 128 /* in the callback of fmi3DoStep */
};
enum {
    RUNNING                         = EVENTS_3 | STEPS | CONTINUOUS,
    ANY                             = NEW | CONFIGURATION | INITIALIZATION | RUNNING | TERMINATED_3,
    MAY_EnterConfigurationMode      = NEW,
    MAY_ExitConfigurationMode       = CONFIGURATION,
    MAY_3_EnterInitializationMode   = NEW,
    MAY_3_ExitInitializationMode    = INITIALIZATION,
    MAY_3_EnterEventMode            = STEPS | CONTINUOUS,
    MAY_EnterStepMode               = EVENTS_3,
    MAY_3_EnterContinuousTimeMode   = EVENTS_3,
    MAY_3_Terminate                 = RUNNING,
    MAY_3_Get                       = INITIALIZATION | RUNNING | TERMINATED_3 | INTERMEDIATE,
    MAY_3_Set                       = NEW | INITIALIZATION | RUNNING,
    MAY_SetStructural               = CONFIGURATION,
    MAY_GetStructural               = MAY_3_Get | CONFIGURATION,
    MAY_SetClock                    = EVENTS_3,
    MAY_GetInterval                 = INITIALIZATION | EVENTS_3 | STEPS,
    MAY_UpdateDiscreteStates        = EVENTS_3,
    MAY_3_DoStep                    = STEPS,
    MAY_GetDerivative               = INITIALIZATION | RUNNING | TERMINATED_3,
    MAY_GetOutputDerivatives        = STEPS | TERMINATED_3 | INTERMEDIATE,
    MAY_GetContinuousStates         = INITIALIZATION | EVENTS_3 | CONTINUOUS | TERMINATED_3,
    MAY_InContinuousTime            = CONTINUOUS,
    MAY_3_SetTime                   = EVENTS_3 | CONTINUOUS
};
/* clang-format on */

typedef struct {
    Instance *inside;
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
    double numbers[REFERENCES + 1];
    int whole[REFERENCES + 1];
} Shell;

/* Pass on a message from inside; in place of the function of FMI 2.0, the message names the one that was called. */
static void forward(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
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
    case NEW: return "instantiated";
    case CONFIGURATION: return "configuration mode";
    case INITIALIZATION: return "initialization mode";
    case EVENTS_3: return "event mode";
    case STEPS: return "step mode";
    case CONTINUOUS: return "continuous-time mode";
    case INTERMEDIATE: return "intermediate update mode";
    default: return "terminated";
    }
}

static fmi3Status rejected(const Shell *c)
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
        return rejected(c);

/* The same for a function of one kind of FMU, co-simulation or model exchange. */
#define ENTER_3_AS(kind, name, allowed)                                                                                \
    ENTER_3(name, allowed)                                                                                             \
    if (KIND(c->inside) != (kind))                                                                                     \
        return fail(c, "is not allowed in %s",                                                                         \
                    KIND(c->inside) == fmi2ModelExchange ? "model exchange" : "co-simulation");

/* Report an error: the name of the function, then the text. */
static fmi3Status fail(const Shell *c, const char *format, ...)
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
        return fail(c, __VA_ARGS__);

/* Pass on a status, and store the mode that a successful call leads to. */
static fmi3Status entered(Shell *c, fmi2Status status, int mode)
{
    if (status <= fmi2Warning)
        c->mode = mode;
    return (fmi3Status)status;
}

/* Return the number of elements of the variable with this reference. */
static size_t size_of(const Shell *c, fmi3ValueReference reference)
{
    const Variable *const v = &variables[reference];
#ifdef STRUCTURAL
    if (v->resized)
        return (size_t)*value_of(&c->inside->model, STRUCTURAL);
#else
    (void)c;
#endif
    return v->length;
}

#endif
