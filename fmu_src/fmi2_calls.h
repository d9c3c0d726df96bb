/* Messages, the check of a call, and the functions of FMI that are the same in every FMU. The shell has defined before:
   Instance with logger, environment, logging and name; MODE(c), its mode; NOW(c), its time; KIND(c), its kind;
   ENDED(c), whether it has ended the simulation; MODEL, its name. */

#ifndef FMI2_CALLS_H
#define FMI2_CALLS_H

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
    case EVENT_MODE: return "event mode";
    case CONTINUOUS_TIME: return "continuous-time mode";
    default: return "terminated";
    }
}

/* Begin a function: get the instance `c` and check that the call is allowed. */
#define ENTER(function, allowed)                                                                                       \
    Instance *const c = (Instance *)component;                                                                         \
    if (!c)                                                                                                            \
        return fmi2Error;                                                                                              \
    if (!(MODE(c) & (allowed)))                                                                                        \
        return report(c, fmi2Error, LOG_ERROR, "fmi2%s is not allowed in the mode \"%s\"", function,                   \
                      mode_name(MODE(c)));

/* The same for a function of one kind of FMU, co-simulation or model exchange. */
#define ENTER_AS(kind, function, allowed)                                                                              \
    ENTER(function, allowed)                                                                                           \
    if (KIND(c) != (kind))                                                                                             \
        return report(c, fmi2Error, LOG_ERROR, "fmi2%s is not allowed in %s", function,                                \
                      KIND(c) == fmi2ModelExchange ? "model exchange" : "co-simulation");

#define REQUIRE(condition, ...)                                                                                        \
    if (!(condition))                                                                                                  \
        return report(c, fmi2Error, LOG_ERROR, __VA_ARGS__);

/* Return a bound of the rounding of a time of the importer. */
static inline double time_rounding(double t, double start) { return 4.0 * DBL_EPSILON * (fabs(t) + fabs(start)); }

/* ---- about the library -------------------------------------------------------------------------------------- */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean on, size_t n, const fmi2String names[])
{
    ENTER("SetDebugLogging", MAY_SetDebugLogging)
    int chosen = n == 0 ? LOG_EVERYTHING : 0;
    for (size_t i = 0; i < n; i++) {
        int which = 0;
        REQUIRE(names && names[i], "fmi2SetDebugLogging: category %d is a null pointer", (int)i)
        while (which < LOG_CATEGORIES && strcmp(names[i], categories[which]) != 0)
            which++;
        REQUIRE(which < LOG_CATEGORIES, "fmi2SetDebugLogging: there is no log category \"%s\"", names[i])
        chosen |= which == LOG_CATEGORIES - 1 ? LOG_EVERYTHING : 1 << which;
    }
    c->logging = on ? chosen : c->logging & ~chosen;
    return fmi2OK;
}

/* ---- status of a step --------------------------------------------------------------------------------------- */

fmi2Status fmi2CancelStep(fmi2Component component)
{
    Instance *const c = (Instance *)component;
    return c ? report(c, fmi2Error, LOG_ERROR, "fmi2CancelStep: steps of %s are never pending", QUOTE(MODEL))
             : fmi2Error;
}

#define NO_STATUS(TYPE, value_type)                                                                                    \
    fmi2Status fmi2Get##TYPE(fmi2Component component, const fmi2StatusKind kind, value_type *value)                    \
    {                                                                                                                  \
        ENTER_AS(fmi2CoSimulation, "Get" #TYPE, MAY_GetStatus)                                                         \
        (void)value;                                                                                                   \
        return report(c, fmi2Discard, LOG_DISCARD, "fmi2Get" #TYPE ": status kind %d is not available", (int)kind);    \
    }
NO_STATUS(Status, fmi2Status)
NO_STATUS(IntegerStatus, fmi2Integer)
NO_STATUS(StringStatus, fmi2String)

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Real *value)
{
    ENTER_AS(fmi2CoSimulation, "GetRealStatus", MAY_GetStatus)
    if (kind != fmi2LastSuccessfulTime)
        return report(c, fmi2Discard, LOG_DISCARD, "fmi2GetRealStatus: status kind %d is not available", (int)kind);
    REQUIRE(value, "fmi2GetRealStatus: the pointer to the value is null")
    *value = NOW(c);
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Boolean *value)
{
    ENTER_AS(fmi2CoSimulation, "GetBooleanStatus", MAY_GetStatus)
    if (kind != fmi2Terminated)
        return report(c, fmi2Discard, LOG_DISCARD, "fmi2GetBooleanStatus: status kind %d is not available", (int)kind);
    REQUIRE(value, "fmi2GetBooleanStatus: the pointer to the value is null")
    *value = ENDED(c) ? fmi2True : fmi2False;
    return fmi2OK;
}

/* ---- life of an instance ------------------------------------------------------------------------------------ */

/* Allocate an instance with its name and callbacks; NULL: no memory. */
static Instance *allocated(fmi2String name, const fmi2CallbackFunctions *functions)
{
    Instance *const c = (Instance *)calloc(1, sizeof(Instance) + (name ? strlen(name) : 0) + 1);
    if (!c)
        return NULL;
    if (name)
        strcpy(c->name, name);
    c->logger = functions ? functions->logger : NULL;
    c->environment = functions ? functions->componentEnvironment : NULL;
    c->logging = LOG_EVERYTHING;
    return c;
}

/* Return why the arguments of fmi2Instantiate are wrong, or NULL. `exchanges`: the FMU is for model exchange too. */
static const char *instantiation_fault(const Instance *c, fmi2Type kind, bool exchanges, fmi2String guid,
                                       const char *own_guid)
{
    if (c->name[0] == '\0')
        return "the instance name is empty";
    if (kind != fmi2CoSimulation && !(exchanges && kind == fmi2ModelExchange))
        return "this FMU is for co-simulation only";
    if (!guid || strcmp(guid, own_guid) != 0)
        return "the GUID differs from the GUID of this binary: modelDescription.xml and library do not match";
    return NULL;
}

static fmi2Status check_experiment(const Instance *c, fmi2Boolean tolerance_given, fmi2Real tolerance, fmi2Real start,
                                   fmi2Boolean stop_given, fmi2Real stop)
{
    REQUIRE(!tolerance_given || (tolerance > 0.0 && isfinite(tolerance)),
            "fmi2SetupExperiment: tolerance %g must be positive", tolerance)
    REQUIRE(isfinite(start), "fmi2SetupExperiment: start time %g must be finite", start)
    REQUIRE(!stop_given || stop >= start, "fmi2SetupExperiment: stop time %g must not be before start time %g", stop,
            start)
    return fmi2OK;
}

/* ---- values ------------------------------------------------------------------------------------------------- */

/* Return the name of a variable. */
static const char *name_of(const Instance *c, fmi2ValueReference reference);

/* Return whether all derivatives of inputs are finite; log the first one that is not. */
static bool slopes_are_finite(const Instance *c, const fmi2ValueReference references[], size_t n,
                              const fmi2Real values[])
{
    for (size_t i = 0; i < n; i++)
        if (!isfinite(values[i])) {
            (void)report(c, fmi2Discard, LOG_DISCARD,
                         "fmi2SetRealInputDerivatives: the derivative %g of %s is not finite", values[i],
                         name_of(c, references[i]));
            return false;
        }
    return true;
}

#define REQUIRE_VECTOR(function, values, n, count, what)                                                               \
    REQUIRE((n) == (size_t)(count), "fmi2" function ": %u values are requested, but %s has %d " what, (unsigned)(n),   \
            QUOTE(MODEL), (int)(count))                                                                                \
    REQUIRE((n) == 0 || (values), "fmi2" function ": the pointer to the values is null")

/* Begin fmi2SetContinuousStates: check the number of the states and that they are finite. */
#define REQUIRE_STATES(states, n, count)                                                                               \
    REQUIRE_VECTOR("SetContinuousStates", states, n, count, "states")                                                  \
    for (size_t i = 0; i < (n); i++)                                                                                   \
        if (!isfinite((states)[i]))                                                                                    \
            return report(c, fmi2Discard, LOG_DISCARD, "fmi2SetContinuousStates: state %d = %g is not finite", (int)i, \
                          (states)[i]);

fmi2Status fmi2GetString(fmi2Component component, const fmi2ValueReference references[], size_t n, fmi2String values[])
{
    ENTER("GetString", MAY_Get)
    (void)references;
    (void)values;
    REQUIRE(n == 0, "fmi2GetString: %s has no String variables", QUOTE(MODEL))
    return fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component component, const fmi2ValueReference references[], size_t n,
                         const fmi2String values[])
{
    ENTER("SetString", MAY_Set)
    (void)references;
    (void)values;
    REQUIRE(n == 0, "fmi2SetString: %s has no String variables", QUOTE(MODEL))
    return fmi2OK;
}

#endif
