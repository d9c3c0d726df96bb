/* The tables of a composite FMU. The generated file defines MODEL, includes this header, defines tables of these types
   and includes composite.h. A composite contains the FMUs of its parts, each with its own function prefix, and the
   engine of the harness, which solves the loop. */

#ifndef COMPOSITE_PARTS_H
#define COMPOSITE_PARTS_H

#define COMPOSITE /* the engine exports nothing */
#include "fmi2_modes.h"
#include "newton.h"
#include "tick.h"

/* The functions of a part's FMU: their names in the table, and in FMI. */
#define EVERY_FUNCTION(X, prefix)                                                                                      \
    X(prefix, instantiate, Instantiate)                                                                                \
    X(prefix, free_instance, FreeInstance)                                                                             \
    X(prefix, setup, SetupExperiment)                                                                                  \
    X(prefix, enter, EnterInitializationMode)                                                                          \
    X(prefix, leave, ExitInitializationMode)                                                                           \
    X(prefix, terminate, Terminate)                                                                                    \
    X(prefix, reset, Reset)                                                                                            \
    X(prefix, free_state, FreeFMUstate)                                                                                \
    X(prefix, size_of_state, SerializedFMUstateSize)                                                                   \
    X(prefix, serialize, SerializeFMUstate)                                                                            \
    X(prefix, deserialize, DeSerializeFMUstate)                                                                        \
    X(prefix, get_derivatives, GetRealOutputDerivatives)                                                               \
    X(prefix, get_directional, GetDirectionalDerivative)                                                               \
    X(prefix, get_status, GetBooleanStatus)

/* Its functions for model exchange. */
#define EVERY_EXCHANGE_FUNCTION(X, prefix)                                                                             \
    X(prefix, enter_event, EnterEventMode)                                                                             \
    X(prefix, new_discrete_states, NewDiscreteStates)                                                                  \
    X(prefix, enter_continuous, EnterContinuousTimeMode)                                                               \
    X(prefix, completed, CompletedIntegratorStep)                                                                      \
    X(prefix, set_time, SetTime)                                                                                       \
    X(prefix, set_states, SetContinuousStates)                                                                         \
    X(prefix, get_states, GetContinuousStates)                                                                         \
    X(prefix, get_derivatives, GetDerivatives)                                                                         \
    X(prefix, get_indicators, GetEventIndicators)                                                                      \
    X(prefix, get_nominals, GetNominalsOfContinuousStates)

#define MEMBER(prefix, member, Function)      fmi2##Function##TYPE *member;
#define DECLARATION(prefix, member, Function) fmi2##Function##TYPE prefix##fmi2##Function;
#define ADDRESS(prefix, member, Function)     .member = prefix##fmi2##Function,

typedef struct {
    const char *guid;
    EVERY_FUNCTION(MEMBER, )
    Exchange *set[TYPES], *get[TYPES];
    DoStep *do_step;
    GetState *get_state;
    SetState *set_state;
    SetSlopes *set_slopes;
    DirectCalls *direct; /* NULL: a part of another tool */
} PartFunctions;

typedef struct {
    EVERY_EXCHANGE_FUNCTION(MEMBER, )
} ExchangeFunctions;

/* Declare the functions of an FMU, and those with the types of the engine. */
#define PART_FUNCTIONS(prefix)                                                                                         \
    EVERY_FUNCTION(DECLARATION, prefix)                                                                                \
    DirectCalls prefix##blockDirect;                                                                                   \
    EXCHANGES(prefix, Real)                                                                                            \
    EXCHANGES(prefix, Integer)                                                                                         \
    EXCHANGES(prefix, Boolean)                                                                                         \
    fmi2DoStepTYPE prefix##fmi2DoStep;                                                                                 \
    fmi2GetFMUstateTYPE prefix##fmi2GetFMUstate;                                                                       \
    fmi2SetFMUstateTYPE prefix##fmi2SetFMUstate;                                                                       \
    fmi2SetRealInputDerivativesTYPE prefix##fmi2SetRealInputDerivatives;                                               \
    static int prefix##do_step(void *component, double t, double h, int keeps_no_state)                                \
    {                                                                                                                  \
        return (int)prefix##fmi2DoStep(component, t, h, keeps_no_state);                                               \
    }                                                                                                                  \
    static int prefix##get_state(void *component, void **state)                                                        \
    {                                                                                                                  \
        return (int)prefix##fmi2GetFMUstate(component, state);                                                         \
    }                                                                                                                  \
    static int prefix##set_state(void *component, void *state)                                                         \
    {                                                                                                                  \
        return (int)prefix##fmi2SetFMUstate(component, state);                                                         \
    }                                                                                                                  \
    static int prefix##set_slopes(void *component, const uint32_t *references, size_t n, const int *orders,            \
                                  const double *slopes)                                                                \
    {                                                                                                                  \
        return (int)prefix##fmi2SetRealInputDerivatives(component, references, n, orders, slopes);                     \
    }

#define EXCHANGES(prefix, KIND)                                                                                        \
    fmi2Set##KIND##TYPE prefix##fmi2Set##KIND;                                                                         \
    fmi2Get##KIND##TYPE prefix##fmi2Get##KIND;                                                                         \
    static int prefix##set_##KIND(void *component, const uint32_t *references, size_t n, void *values)                 \
    {                                                                                                                  \
        return (int)prefix##fmi2Set##KIND(component, references, n, values);                                           \
    }                                                                                                                  \
    static int prefix##get_##KIND(void *component, const uint32_t *references, size_t n, void *values)                 \
    {                                                                                                                  \
        return (int)prefix##fmi2Get##KIND(component, references, n, values);                                           \
    }

/* The initializer of PartFunctions; `calls`: the function blockDirect, or NULL. */
#define FUNCTIONS_OF(prefix, guid_text, calls)                                                                         \
    {.guid = guid_text,                                                                                                \
     .set = {prefix##set_Real, prefix##set_Integer, prefix##set_Boolean},                                              \
     .get = {prefix##get_Real, prefix##get_Integer, prefix##get_Boolean},                                              \
     .do_step = prefix##do_step,                                                                                       \
     .get_state = prefix##get_state,                                                                                   \
     .set_state = prefix##set_state,                                                                                   \
     .direct = calls,                                                                                                  \
     .set_slopes = prefix##set_slopes,                                                                                 \
     EVERY_FUNCTION(ADDRESS, prefix)}

#define EXCHANGE_FUNCTIONS(prefix) EVERY_EXCHANGE_FUNCTION(DECLARATION, prefix)

/* The initializer of ExchangeFunctions. */
#define EXCHANGE_OF(prefix) {EVERY_EXCHANGE_FUNCTION(ADDRESS, prefix)}

/* A recorded table: row i applies from times[i] on; its values change by slopes[i] per second. */
typedef struct {
    const double *times, *values, *slopes;
    int64_t rows, columns;
    double slack; /* [s] by which rounding may put a time before its sample */
    double reach; /* [s] end of the record; INFINITY: the last value is held */
} Series;

/* A part: an FMU, a recorded table, or the inputs of the composite (without functions and table). */
typedef struct {
    const char *name;
    const PartFunctions *functions;
    const Series *series;
    const uint32_t *input_references, *output_references; /* of a source: the numbers of its columns */
    int64_t inputs[TYPES + 1], outputs[TYPES + 1];        /* ranges of its signals, see EnginePart */
    int64_t every, phase, sampled;
    bool interpolates; /* accepts input derivatives */
    const ExchangeFunctions *exchange;
    size_t states, indicators;
} PartData;

typedef struct {
    int64_t part;
    int type;
    uint32_t reference;
    double value;
} StartValue;

/* When a variable of the composite may be set. */
enum setting { SET_NEVER, SET_EARLY, SET_ALWAYS };

/* A variable; its value reference is its index. */
typedef struct {
    const char *name;
    int64_t part;       /* -1: the time */
    int64_t signal;     /* where the engine keeps its value; -1: its part is asked */
    uint32_t reference; /* in its part; the number of an input */
    int type, setting;
    double min, max;
    bool is_input, is_output, is_state, finite; /* finite: NaN is refused when it is set */
} Variable;

typedef struct {
    int64_t input, length; /* signal; delay in ticks */
    int64_t every, phase, fresh, given;
    double initial; /* value of the output until then, if `given` */
} DelayData;

typedef struct {
    int64_t inner, unknown, is_force, carries; /* the first numbers of Moving */
} LineData;

#endif
