/* The functions of FMI 2.0 over those of FMI 3.0, so that the same tests call both versions. An element of an array is
   set with the present values of the other elements. This file is compiled in place of fmi3_NAME.c, which it includes.
 */

#include FMI_3

#undef fmi2GetTypesPlatform
#undef fmi2GetVersion
#undef fmi2SetDebugLogging
#undef fmi2Instantiate
#undef fmi2FreeInstance
#undef fmi2SetupExperiment
#undef fmi2EnterInitializationMode
#undef fmi2ExitInitializationMode
#undef fmi2Terminate
#undef fmi2Reset
#undef fmi2GetReal
#undef fmi2GetInteger
#undef fmi2GetBoolean
#undef fmi2GetString
#undef fmi2SetReal
#undef fmi2SetInteger
#undef fmi2SetBoolean
#undef fmi2SetString
#undef fmi2GetFMUstate
#undef fmi2SetFMUstate
#undef fmi2FreeFMUstate
#undef fmi2SerializedFMUstateSize
#undef fmi2SerializeFMUstate
#undef fmi2DeSerializeFMUstate
#undef fmi2GetDirectionalDerivative
#undef fmi2EnterEventMode
#undef fmi2NewDiscreteStates
#undef fmi2EnterContinuousTimeMode
#undef fmi2CompletedIntegratorStep
#undef fmi2SetTime
#undef fmi2SetContinuousStates
#undef fmi2GetDerivatives
#undef fmi2GetEventIndicators
#undef fmi2GetContinuousStates
#undef fmi2GetNominalsOfContinuousStates
#undef fmi2SetRealInputDerivatives
#undef fmi2GetRealOutputDerivatives
#undef fmi2DoStep

typedef struct {
    Shell *shell;
    char *name;
    fmi2CallbackFunctions callbacks;
    const char *function; /* the function that is called */
    struct {
        bool tolerance_given, stop_given;
        double tolerance, start, stop;
    } experiment;
    uint32_t base[REFERENCES + 1]; /* the variable of each element; an unknown one where there is none */
} Facade;

typedef fmi2Component C2;
typedef const fmi2ValueReference R2;

#ifdef _WIN32
#define SHOWN __declspec(dllexport)
#else
#define SHOWN __attribute__((visibility("default")))
#endif
#define CALL(NAME, ...)                                                                                                \
    SHOWN fmi2Status fmi2##NAME(C2 component, ##__VA_ARGS__);                                                          \
    SHOWN fmi2Status fmi2##NAME(C2 component, ##__VA_ARGS__)
#define BEGIN(NAME)                                                                                                    \
    Facade *const f = (Facade *)component;                                                                             \
    if (!f)                                                                                                            \
        return fmi2Error;                                                                                              \
    f->function = "fmi2" NAME;

/* Pass on a message with the name of the function of FMI 2.0, escaped for a logger in the style of printf. */
static void say(void *environment, fmi3Status status, const char *category, const char *message)
{
    const Facade *const f = (const Facade *)environment;
    char text[2100];
    size_t n = 0;
    const char *from = message;
    if (strncmp(message, "fmi3", 4) == 0) {
        n = (size_t)snprintf(text, sizeof text, "%s", f->function);
        from += strcspn(message, " :");
    }
    for (; *from && n < sizeof text - 3; from++) {
        if (*from == '%')
            text[n++] = '%';
        text[n++] = *from;
    }
    text[n] = '\0';
    f->callbacks.logger(f->callbacks.componentEnvironment, f->name, (fmi2Status)status, category, text);
}

SHOWN const char *fmi2GetTypesPlatform(void);
SHOWN const char *fmi2GetTypesPlatform(void) { return "default"; }

SHOWN const char *fmi2GetVersion(void);
SHOWN const char *fmi2GetVersion(void) { return fmi3GetVersion(); }

SHOWN C2 fmi2Instantiate(fmi2String name, fmi2Type kind, fmi2String guid, fmi2String resources,
                         const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging);

SHOWN C2 fmi2Instantiate(fmi2String name, fmi2Type kind, fmi2String guid, fmi2String resources,
                         const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    Facade *const f = (Facade *)calloc(1, sizeof(Facade));
    if (!f)
        return NULL;
    if (callbacks)
        memcpy(&f->callbacks, callbacks, sizeof *callbacks);
    f->name = (char *)calloc(1, name ? strlen(name) + 1 : 1);
    if (name && f->name)
        strcpy(f->name, name);
    f->function = "fmi2Instantiate";
    for (uint32_t i = 0; i < REFERENCES; i++)
        f->base[i] = ALL_REFERENCES + i;
    for (uint32_t v = 1; v < INDICATORS_REFERENCE; v++)
        for (uint32_t k = 0; k < variables_3[v].length; k++)
            f->base[variables_3[v].inner + k] = v;
    const char *const token = guid && strcmp(guid, GUID_INSIDE) == 0 ? TOKEN : guid;
    const fmi3LogMessageCallback logger = f->callbacks.logger ? say : NULL;
    const bool shown = visible != 0, logs = logging != 0;
    if (kind == fmi2ModelExchange)
        f->shell = (Shell *)fmi3InstantiateModelExchange(name, token, resources, shown, logs, f, logger);
    else if (kind == fmi2CoSimulation)
        f->shell = (Shell *)fmi3InstantiateCoSimulation(name, token, resources, shown, logs, false, false, NULL, 0, f,
                                                        logger, NULL);
    else
        f->shell = (Shell *)fmi3InstantiateScheduledExecution(name, token, resources, shown, logs, f, logger, NULL,
                                                              NULL, NULL);
    if (f->shell)
        return f;
    free(f->name);
    free(f);
    return NULL;
}

SHOWN void fmi2FreeInstance(C2 component);
SHOWN void fmi2FreeInstance(C2 component)
{
    Facade *const f = (Facade *)component;
    if (!f)
        return;
    fmi3FreeInstance(f->shell);
    free(f->name);
    free(f);
}

CALL(SetDebugLogging, fmi2Boolean on, size_t n, const fmi2String categories_wanted[])
{
    BEGIN("SetDebugLogging")
    return (fmi2Status)fmi3SetDebugLogging(f->shell, on != 0, n, categories_wanted);
}

/* ---- life --------------------------------------------------------------------------------------------------- */

/* FMI 3.0 has the experiment in fmi3EnterInitializationMode: it is tried there, and undone. */
CALL(SetupExperiment, fmi2Boolean tolerance_given, fmi2Real tolerance, fmi2Real start, fmi2Boolean stop_given,
     fmi2Real stop)
{
    BEGIN("SetupExperiment")
    fmi3FMUState state = NULL;
    if (fmi3GetFMUState(f->shell, &state) != fmi3OK)
        return fmi2Error;
    fmi3Status status =
        fmi3EnterInitializationMode(f->shell, tolerance_given != 0, tolerance, start, stop_given != 0, stop);
    if (status == fmi3OK) {
        f->experiment.tolerance_given = tolerance_given != 0;
        f->experiment.stop_given = stop_given != 0;
        f->experiment.tolerance = tolerance;
        f->experiment.start = start;
        f->experiment.stop = stop;
        status = fmi3SetFMUState(f->shell, state);
    }
    const fmi3Status freed = fmi3FreeFMUState(f->shell, &state);
    return (fmi2Status)(freed > status ? freed : status);
}

CALL(EnterInitializationMode)
{
    BEGIN("EnterInitializationMode")
    return (fmi2Status)fmi3EnterInitializationMode(f->shell, f->experiment.tolerance_given, f->experiment.tolerance,
                                                   f->experiment.start, f->experiment.stop_given, f->experiment.stop);
}

CALL(Reset)
{
    BEGIN("Reset")
    memset(&f->experiment, 0, sizeof f->experiment);
    return (fmi2Status)fmi3Reset(f->shell);
}

#define FORWARD(NAME)                                                                                                  \
    CALL(NAME)                                                                                                         \
    {                                                                                                                  \
        BEGIN(#NAME)                                                                                                   \
        return (fmi2Status)fmi3##NAME(f->shell);                                                                       \
    }
FORWARD(ExitInitializationMode)
FORWARD(Terminate)
FORWARD(EnterEventMode)
FORWARD(EnterContinuousTimeMode)

CALL(DoStep, fmi2Real t, fmi2Real h, fmi2Boolean keeps_no_state)
{
    BEGIN("DoStep")
    bool event, terminate, early;
    double last;
    return (fmi2Status)fmi3DoStep(f->shell, t, h, keeps_no_state != 0, &event, &terminate, &early, &last);
}

/* ---- values ------------------------------------------------------------------------------------------------- */

/* The variables of a call, each once, and the place of each element among their values. */
typedef struct {
    size_t variables, elements;
    uint32_t reference[REFERENCES + 1], first[REFERENCES + 1];
} Chosen;

static uint32_t base_of(const Facade *f, uint32_t reference)
{
    return reference < REFERENCES ? f->base[reference] : reference < ALL_REFERENCES ? ALL_REFERENCES : reference;
}

/* The variables of scalars, in memory that the caller frees. */
static uint32_t *variables_of(const Facade *f, R2 references[], size_t n)
{
    uint32_t *const found = (uint32_t *)calloc(n + 1, sizeof *found);
    for (size_t i = 0; references && i < n; i++)
        found[i] = base_of(f, references[i]);
    return found;
}

static Chosen chosen(const Facade *f, R2 references[], size_t n)
{
    Chosen found = {0};
    for (size_t i = 0; references && i < n; i++) {
        const uint32_t base = base_of(f, references[i]);
        bool known = false;
        for (size_t k = 0; k < found.variables; k++)
            known = known || found.reference[k] == base;
        if (known || found.variables == REFERENCES)
            continue;
        found.reference[found.variables] = base;
        found.first[found.variables++] = (uint32_t)found.elements;
        found.elements += base < ALL_REFERENCES ? size_of_3(f->shell, base) : 1;
    }
    return found;
}

static size_t place_in(const Facade *f, const Chosen *in, uint32_t reference)
{
    const uint32_t base = base_of(f, reference);
    for (size_t k = 0; k < in->variables; k++)
        if (in->reference[k] == base)
            return in->first[k] + (base < ALL_REFERENCES ? reference - variables_3[base].inner : 0);
    return 0;
}

/* Whether all are scalars: these may be given more than once. */
static bool scalars(const Facade *f, R2 references[], size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (base_of(f, references[i]) < ALL_REFERENCES && variables_3[base_of(f, references[i])].length != 1)
            return false;
    return true;
}

static double present(const Facade *f, uint32_t reference)
{
#ifdef COMPOSITE_H
    (void)f, (void)reference;
    return 0.0; /* a composite has scalars only */
#else
    return *value_of(&f->shell->inside->model, reference);
#endif
}

static bool resized_away(const Facade *f, uint32_t reference)
{
    const uint32_t base = base_of(f, reference);
    return base < ALL_REFERENCES && reference - variables_3[base].inner >= size_of_3(f->shell, base);
}

#define GET_2(NAME, TYPE, KIND_3, TYPE_3)                                                                              \
    CALL(Get##NAME, R2 references[], size_t n, TYPE values[])                                                          \
    {                                                                                                                  \
        BEGIN("Get" #NAME)                                                                                             \
        if (!references || !values || n > REFERENCES)                                                                  \
            return (fmi2Status)fmi3Get##KIND_3(f->shell, references, n, NULL, n);                                      \
        const Chosen all = chosen(f, references, n);                                                                   \
        TYPE_3 *const found = (TYPE_3 *)calloc(all.elements + 1, sizeof *found);                                       \
        const fmi3Status status = fmi3Get##KIND_3(f->shell, all.reference, all.variables, found, all.elements);        \
        for (size_t i = 0; status <= fmi3Warning && i < n; i++)                                                        \
            values[i] = resized_away(f, references[i]) ? (TYPE)present(f, references[i])                               \
                                                       : (TYPE)found[place_in(f, &all, references[i])];                \
        free(found);                                                                                                   \
        return (fmi2Status)status;                                                                                     \
    }

#define SET_2(NAME, TYPE, KIND_3, TYPE_3)                                                                              \
    CALL(Set##NAME, R2 references[], size_t n, const TYPE values[])                                                    \
    {                                                                                                                  \
        BEGIN("Set" #NAME)                                                                                             \
        if (!references || !values || n > REFERENCES)                                                                  \
            return (fmi2Status)fmi3Set##KIND_3(f->shell, references, n, NULL, n);                                      \
        if (scalars(f, references, n)) {                                                                               \
            TYPE_3 *const plain = (TYPE_3 *)calloc(n + 1, sizeof *plain);                                              \
            for (size_t i = 0; i < n; i++)                                                                             \
                plain[i] = (TYPE_3)values[i];                                                                          \
            uint32_t *const list = variables_of(f, references, n);                                                     \
            const fmi3Status set = fmi3Set##KIND_3(f->shell, list, n, plain, n);                                       \
            free(list);                                                                                                \
            free(plain);                                                                                               \
            return (fmi2Status)set;                                                                                    \
        }                                                                                                              \
        const Chosen all = chosen(f, references, n);                                                                   \
        TYPE_3 *const given = (TYPE_3 *)calloc(all.elements + 1, sizeof *given);                                       \
        for (size_t k = 0; k < all.variables; k++)                                                                     \
            for (uint32_t i = 0; all.reference[k] < ALL_REFERENCES && i < size_of_3(f->shell, all.reference[k]); i++)  \
                given[all.first[k] + i] = (TYPE_3)present(f, variables_3[all.reference[k]].inner + i);                 \
        for (size_t i = 0; i < n; i++)                                                                                 \
            if (!resized_away(f, references[i]))                                                                       \
                given[place_in(f, &all, references[i])] = (TYPE_3)values[i];                                           \
        const fmi3Status status = fmi3Set##KIND_3(f->shell, all.reference, all.variables, given, all.elements);        \
        free(given);                                                                                                   \
        return (fmi2Status)status;                                                                                     \
    }

GET_2(Real, fmi2Real, Float64, double)
SET_2(Real, fmi2Real, Float64, double)
GET_2(Boolean, fmi2Boolean, Boolean, bool)
SET_2(Boolean, fmi2Boolean, Boolean, bool)

/* Whether all references are those of the structural parameter, which is an Integer in FMI 2.0. */
static bool structural(const Facade *f, R2 references[], size_t n)
{
    bool all = references && n > 0;
    for (size_t i = 0; all && i < n; i++)
        all = base_of(f, references[i]) < ALL_REFERENCES && variables_3[base_of(f, references[i])].type == IS_UINT64;
    return all;
}

CALL(GetInteger, R2 references[], size_t n, fmi2Integer values[])
{
    BEGIN("GetInteger")
    uint32_t *const list = variables_of(f, references, n);
    fmi3Status status = fmi3OK;
    if (!structural(f, references, n) || !values) {
        status = fmi3GetInt32(f->shell, references ? list : NULL, n, values, n);
        free(list);
        return (fmi2Status)status;
    }
    for (size_t i = 0; status == fmi3OK && i < n; i++) {
        uint64_t size = 0;
        status = fmi3GetUInt64(f->shell, &list[i], 1, &size, 1);
        if (status == fmi3OK)
            values[i] = (fmi2Integer)size;
    }
    free(list);
    return (fmi2Status)status;
}

CALL(SetInteger, R2 references[], size_t n, const fmi2Integer values[])
{
    BEGIN("SetInteger")
    uint32_t *const list = variables_of(f, references, n);
    fmi3Status status = fmi3OK;
    if (!structural(f, references, n) || !values) {
        status = fmi3SetInt32(f->shell, references ? list : NULL, n, values, n);
        free(list);
        return (fmi2Status)status;
    }
    status = fmi3EnterConfigurationMode(f->shell);
    for (size_t i = 0; status == fmi3OK && i < n; i++) {
        const uint64_t size = values[i] < 0 ? UINT64_MAX : (uint64_t)values[i];
        status = fmi3SetUInt64(f->shell, &list[i], 1, &size, 1);
    }
    free(list);
    if (f->shell->mode == CONFIGURATION_3) {
        const fmi3Status left = fmi3ExitConfigurationMode(f->shell);
        status = left > status ? left : status;
    }
    return (fmi2Status)status;
}

CALL(GetString, R2 references[], size_t n, fmi2String values[])
{
    BEGIN("GetString")
    return (fmi2Status)fmi3GetString(f->shell, references, n, values, n);
}

CALL(SetString, R2 references[], size_t n, const fmi2String values[])
{
    BEGIN("SetString")
    return (fmi2Status)fmi3SetString(f->shell, references, n, values, n);
}

/* ---- derivatives -------------------------------------------------------------------------------------------- */

CALL(GetDirectionalDerivative, R2 unknowns[], size_t n_unknowns, R2 knowns[], size_t n_knowns, const fmi2Real seed[],
     fmi2Real sensitivity[])
{
    BEGIN("GetDirectionalDerivative")
    const bool complete = (unknowns && sensitivity) || n_unknowns == 0, given = (knowns && seed) || n_knowns == 0;
    if (!complete || !given)
        return (fmi2Status)fmi3GetDirectionalDerivative(f->shell, unknowns, n_unknowns, knowns, n_knowns, seed,
                                                        n_knowns, sensitivity, n_unknowns);
    const Chosen above = chosen(f, unknowns, n_unknowns), below = chosen(f, knowns, n_knowns);
    double *const seeds = (double *)calloc(below.elements + 1, sizeof *seeds);
    double *const found = (double *)calloc(above.elements + 1, sizeof *found);
    for (size_t j = 0; j < n_knowns; j++)
        seeds[place_in(f, &below, knowns[j])] += seed[j];
    const fmi3Status status =
        fmi3GetDirectionalDerivative(f->shell, above.reference, above.variables, below.reference, below.variables,
                                     seeds, below.elements, found, above.elements);
    for (size_t i = 0; status <= fmi3Warning && i < n_unknowns; i++)
        sensitivity[i] = found[place_in(f, &above, unknowns[i])];
    free(seeds);
    free(found);
    return (fmi2Status)status;
}

CALL(SetRealInputDerivatives, R2 references[], size_t n, const fmi2Integer orders[], const fmi2Real values[])
{
    BEGIN("SetRealInputDerivatives")
    uint32_t *const list = variables_of(f, references, n);
    const fmi3Status status = harness_SetInputDerivatives(f->shell, references ? list : NULL, n, orders, values);
    free(list);
    return (fmi2Status)status;
}

CALL(GetRealOutputDerivatives, R2 references[], size_t n, const fmi2Integer orders[], fmi2Real values[])
{
    BEGIN("GetRealOutputDerivatives")
    uint32_t *const list = variables_of(f, references, n);
    const fmi3Status status = fmi3GetOutputDerivatives(f->shell, references ? list : NULL, n, orders, values, n);
    free(list);
    return (fmi2Status)status;
}

/* ---- states ------------------------------------------------------------------------------------------------- */

CALL(GetFMUstate, fmi2FMUstate *state)
{
    BEGIN("GetFMUstate")
    return (fmi2Status)fmi3GetFMUState(f->shell, state);
}

CALL(SetFMUstate, fmi2FMUstate state)
{
    BEGIN("SetFMUstate")
    return (fmi2Status)fmi3SetFMUState(f->shell, state);
}

CALL(FreeFMUstate, fmi2FMUstate *state)
{
    BEGIN("FreeFMUstate")
    return (fmi2Status)fmi3FreeFMUState(f->shell, state);
}

CALL(SerializedFMUstateSize, fmi2FMUstate state, size_t *size)
{
    BEGIN("SerializedFMUstateSize")
    return (fmi2Status)fmi3SerializedFMUStateSize(f->shell, state, size);
}

CALL(SerializeFMUstate, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    BEGIN("SerializeFMUstate")
    return (fmi2Status)fmi3SerializeFMUState(f->shell, state, (fmi3Byte *)bytes, size);
}

CALL(DeSerializeFMUstate, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    BEGIN("DeSerializeFMUstate")
    return (fmi2Status)fmi3DeserializeFMUState(f->shell, (const fmi3Byte *)bytes, size, state);
}

/* ---- model exchange ----------------------------------------------------------------------------------------- */

CALL(SetTime, fmi2Real t)
{
    BEGIN("SetTime")
    return (fmi2Status)fmi3SetTime(f->shell, t);
}

CALL(NewDiscreteStates, fmi2EventInfo *info)
{
    BEGIN("NewDiscreteStates")
    bool again = false, terminate = false, nominals = false, states = false, defined = false;
    double next = 0.0;
    const fmi3Status status =
        fmi3UpdateDiscreteStates(f->shell, info ? &again : NULL, &terminate, &nominals, &states, &defined, &next);
    if (info && status <= fmi3Warning) {
        const fmi2EventInfo told = {again, terminate, nominals, states, defined, next};
        *info = told;
    }
    return (fmi2Status)status;
}

CALL(CompletedIntegratorStep, fmi2Boolean keeps_no_state, fmi2Boolean *event, fmi2Boolean *terminate)
{
    BEGIN("CompletedIntegratorStep")
    bool enters = false, ends = false;
    const fmi3Status status =
        fmi3CompletedIntegratorStep(f->shell, keeps_no_state != 0, event ? &enters : NULL, terminate ? &ends : NULL);
    if (status <= fmi3Warning && event && terminate) {
        *event = enters;
        *terminate = ends;
    }
    return (fmi2Status)status;
}

#define EACH_STATE(NAME, NAME_3, CONST)                                                                                \
    CALL(NAME, CONST fmi2Real values[], size_t n)                                                                      \
    {                                                                                                                  \
        BEGIN(#NAME)                                                                                                   \
        return (fmi2Status)fmi3##NAME_3(f->shell, values, n);                                                          \
    }
EACH_STATE(SetContinuousStates, SetContinuousStates, const)
EACH_STATE(GetContinuousStates, GetContinuousStates, )
EACH_STATE(GetNominalsOfContinuousStates, GetNominalsOfContinuousStates, )
EACH_STATE(GetDerivatives, GetContinuousStateDerivatives, )
EACH_STATE(GetEventIndicators, GetEventIndicators, )

/* The instance of FMI 2.0 inside, for the tests in C. */
#define INSIDE(c) (((Facade *)(void *)(c))->shell->inside)
