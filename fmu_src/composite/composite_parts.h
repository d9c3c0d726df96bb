/* The tables of a composite FMU. The generated file defines MODEL, includes this header, defines tables of these types
   and includes composite.h. A composite contains the FMUs of its parts, each with its own function prefix, and the
   engine of the harness, which solves the loop. */

#ifndef COMPOSITE_PARTS_H
#define COMPOSITE_PARTS_H

#define COMPOSITE /* the engine exports nothing */
#include "fmi2_modes.h"
#include "newton.h"
#include "tick.h"

/* The functions of a part's FMU. */
typedef struct {
    const char *guid;
    fmi2InstantiateTYPE *instantiate;
    fmi2FreeInstanceTYPE *free_instance;
    fmi2SetupExperimentTYPE *setup;
    fmi2EnterInitializationModeTYPE *enter;
    fmi2ExitInitializationModeTYPE *leave;
    fmi2TerminateTYPE *terminate;
    fmi2ResetTYPE *reset;
    fmi2FreeFMUstateTYPE *free_state;
    fmi2SerializedFMUstateSizeTYPE *size_of_state;
    fmi2SerializeFMUstateTYPE *serialize;
    fmi2DeSerializeFMUstateTYPE *deserialize;
    fmi2GetRealOutputDerivativesTYPE *get_derivatives;
    fmi2GetDirectionalDerivativeTYPE *get_directional;
    fmi2GetBooleanStatusTYPE *get_status;
    Exchange *set[TYPES], *get[TYPES];
    DoStep *do_step;
    GetState *get_state;
    SetState *set_state;
    SetSlopes *set_slopes;
} PartFunctions;

/* Its functions for model exchange. */
typedef struct {
    fmi2EnterEventModeTYPE *enter_event;
    fmi2NewDiscreteStatesTYPE *new_discrete_states;
    fmi2EnterContinuousTimeModeTYPE *enter_continuous;
    fmi2CompletedIntegratorStepTYPE *completed;
    fmi2SetTimeTYPE *set_time;
    fmi2SetContinuousStatesTYPE *set_states;
    fmi2GetContinuousStatesTYPE *get_states;
    fmi2GetDerivativesTYPE *get_derivatives;
    fmi2GetEventIndicatorsTYPE *get_indicators;
    fmi2GetNominalsOfContinuousStatesTYPE *get_nominals;
} ExchangeFunctions;

/* Declare the functions of an FMU, and those with the types of the engine. */
#define PART_FUNCTIONS(prefix)                                                                                         \
    fmi2InstantiateTYPE prefix##fmi2Instantiate;                                                                       \
    fmi2FreeInstanceTYPE prefix##fmi2FreeInstance;                                                                     \
    fmi2SetupExperimentTYPE prefix##fmi2SetupExperiment;                                                               \
    fmi2EnterInitializationModeTYPE prefix##fmi2EnterInitializationMode;                                               \
    fmi2ExitInitializationModeTYPE prefix##fmi2ExitInitializationMode;                                                 \
    fmi2TerminateTYPE prefix##fmi2Terminate;                                                                           \
    fmi2ResetTYPE prefix##fmi2Reset;                                                                                   \
    fmi2FreeFMUstateTYPE prefix##fmi2FreeFMUstate;                                                                     \
    fmi2SerializedFMUstateSizeTYPE prefix##fmi2SerializedFMUstateSize;                                                 \
    fmi2SerializeFMUstateTYPE prefix##fmi2SerializeFMUstate;                                                           \
    fmi2DeSerializeFMUstateTYPE prefix##fmi2DeSerializeFMUstate;                                                       \
    fmi2GetDirectionalDerivativeTYPE prefix##fmi2GetDirectionalDerivative;                                             \
    fmi2GetRealOutputDerivativesTYPE prefix##fmi2GetRealOutputDerivatives;                                             \
    fmi2GetBooleanStatusTYPE prefix##fmi2GetBooleanStatus;                                                             \
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

/* The initializer of PartFunctions. */
#define FUNCTIONS_OF(prefix, guid)                                                                                     \
    {guid,                                                                                                             \
     prefix##fmi2Instantiate,                                                                                          \
     prefix##fmi2FreeInstance,                                                                                         \
     prefix##fmi2SetupExperiment,                                                                                      \
     prefix##fmi2EnterInitializationMode,                                                                              \
     prefix##fmi2ExitInitializationMode,                                                                               \
     prefix##fmi2Terminate,                                                                                            \
     prefix##fmi2Reset,                                                                                                \
     prefix##fmi2FreeFMUstate,                                                                                         \
     prefix##fmi2SerializedFMUstateSize,                                                                               \
     prefix##fmi2SerializeFMUstate,                                                                                    \
     prefix##fmi2DeSerializeFMUstate,                                                                                  \
     prefix##fmi2GetRealOutputDerivatives,                                                                             \
     prefix##fmi2GetDirectionalDerivative,                                                                             \
     prefix##fmi2GetBooleanStatus,                                                                                     \
     {prefix##set_Real, prefix##set_Integer, prefix##set_Boolean},                                                     \
     {prefix##get_Real, prefix##get_Integer, prefix##get_Boolean},                                                     \
     prefix##do_step,                                                                                                  \
     prefix##get_state,                                                                                                \
     prefix##set_state,                                                                                                \
     prefix##set_slopes}

#define EXCHANGE_FUNCTIONS(prefix)                                                                                     \
    fmi2EnterEventModeTYPE prefix##fmi2EnterEventMode;                                                                 \
    fmi2NewDiscreteStatesTYPE prefix##fmi2NewDiscreteStates;                                                           \
    fmi2EnterContinuousTimeModeTYPE prefix##fmi2EnterContinuousTimeMode;                                               \
    fmi2CompletedIntegratorStepTYPE prefix##fmi2CompletedIntegratorStep;                                               \
    fmi2SetTimeTYPE prefix##fmi2SetTime;                                                                               \
    fmi2SetContinuousStatesTYPE prefix##fmi2SetContinuousStates;                                                       \
    fmi2GetContinuousStatesTYPE prefix##fmi2GetContinuousStates;                                                       \
    fmi2GetDerivativesTYPE prefix##fmi2GetDerivatives;                                                                 \
    fmi2GetEventIndicatorsTYPE prefix##fmi2GetEventIndicators;                                                         \
    fmi2GetNominalsOfContinuousStatesTYPE prefix##fmi2GetNominalsOfContinuousStates;

/* The initializer of ExchangeFunctions. */
#define EXCHANGE_OF(prefix)                                                                                            \
    {prefix##fmi2EnterEventMode,                                                                                       \
     prefix##fmi2NewDiscreteStates,                                                                                    \
     prefix##fmi2EnterContinuousTimeMode,                                                                              \
     prefix##fmi2CompletedIntegratorStep,                                                                              \
     prefix##fmi2SetTime,                                                                                              \
     prefix##fmi2SetContinuousStates,                                                                                  \
     prefix##fmi2GetContinuousStates,                                                                                  \
     prefix##fmi2GetDerivatives,                                                                                       \
     prefix##fmi2GetEventIndicators,                                                                                   \
     prefix##fmi2GetNominalsOfContinuousStates}

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
    int64_t inner, unknown, is_force;
} LineData;

#endif
