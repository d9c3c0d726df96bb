/* An FMU for model exchange that is in order unless its guid names a fault, as "fault:count".
 *
 * x' = v, v' = u - sin(x) - gain v |v|; a wall at x = 1 reverses v; a counter rises every 0.02 s.
 * Real: time, u (input), x, v (outputs), der(x), der(v), gain (parameter). Integer: count (output).
 */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

#define EXPORT __attribute__((visibility("default")))

enum { TIME, U, X, V, DER_X, DER_V, GAIN, REALS };
enum { INSTANTIATED = 1, INITIALIZING = 2, EVENT = 4, CONTINUOUS = 8, TERMINATED = 16, ANY = 31 };

typedef struct {
    double real[REALS];
    double next, tried;
    int count, mode;
    const fmi2CallbackFunctions *callbacks;
    char fault[32];
} Instance;

static const char *const faults[] = {
    "none",        "endless",   "late",        "unset",     "unset_step",  "few_states", "many_indicators",
    "few_results", "nan_rate",  "nan_indicator", "nominal", "forgetful",   "swapped",    "memory",
    "tangent",     "no_tangent", "order",      "misuse",    "refuse_event", "refuse_time", "state",
    "leak_step",   "start",     "crash"};

static void *volatile leaked;

static int has(const Instance *i, const char *fault) { return strcmp(i->fault, fault) == 0; }

static fmi2Status report(const Instance *i, const char *text)
{
    i->callbacks->logger(i->callbacks->componentEnvironment, "faulty", fmi2Error, "logStatusError", text);
    return fmi2Error;
}

static void restart(Instance *i)
{
    memset(i->real, 0, sizeof i->real);
    i->real[GAIN] = has(i, "start") ? 3.0 : 2.0;
    i->real[V] = 0.5;
    i->count = 0;
    i->tried = 0.0;
    i->next = 0.02;
    i->mode = INSTANTIATED;
}

EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    const char *fault = strncmp(guid, "fault:", 6) == 0 ? guid + 6 : NULL;
    int known = 0;
    for (size_t k = 0; fault && k < sizeof faults / sizeof *faults; k++) known |= strcmp(fault, faults[k]) == 0;
    if (!known || type != fmi2ModelExchange) return NULL;
    Instance *i = calloc(1, sizeof *i);
    strcpy(i->fault, fault);
    i->callbacks = callbacks;
    restart(i);
    (void)name, (void)resources, (void)visible, (void)logging;
    return i;
}

EXPORT void fmi2FreeInstance(fmi2Component c) { free(c); }

#define ENTER(modes)                                                                      \
    Instance *i = c;                                                                      \
    if (!(i->mode & (modes)) && has(i, "misuse")) *(volatile int *)(uintptr_t)4096 = 1;   \
    if (!(i->mode & (modes)) && !has(i, "order")) return report(i, "called in the wrong mode");

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    (void)c, (void)on, (void)n, (void)categories;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean defined, fmi2Real tolerance, fmi2Real start,
                                      fmi2Boolean ends, fmi2Real stop)
{
    ENTER(INSTANTIATED)
    i->real[TIME] = start;
    (void)defined, (void)tolerance, (void)ends, (void)stop;
    return fmi2OK;
}

#define CHANGE(name, from, to) \
    EXPORT fmi2Status name(fmi2Component c) { ENTER(from) i->mode = to; return fmi2OK; }

CHANGE(fmi2EnterInitializationMode, INSTANTIATED, INITIALIZING)
CHANGE(fmi2ExitInitializationMode, INITIALIZING, EVENT)
CHANGE(fmi2EnterContinuousTimeMode, EVENT, CONTINUOUS)
CHANGE(fmi2Terminate, EVENT | CONTINUOUS, TERMINATED)

EXPORT fmi2Status fmi2EnterEventMode(fmi2Component c)
{
    ENTER(CONTINUOUS)
    if (has(i, "refuse_event")) return report(i, "no events today");
    i->mode = EVENT;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Reset(fmi2Component c)
{
    restart(c);
    return fmi2OK;
}

EXPORT fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info)
{
    ENTER(EVENT)
    double *const r = i->real;
    const int reversed = r[X] >= 1.0 && r[V] > 0.0;
    if (reversed) r[V] = -r[V];
    while (i->next <= r[TIME] && !has(i, "late")) i->count++, i->next = 0.02 * (i->count + 1);
    info->newDiscreteStatesNeeded = has(i, "endless");
    info->terminateSimulation = info->nominalsOfContinuousStatesChanged = fmi2False;
    if (!has(i, "unset")) info->valuesOfContinuousStatesChanged = reversed;
    info->nextEventTimeDefined = fmi2True;
    info->nextEventTime = i->next;
    return fmi2OK;
}

EXPORT fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean final, fmi2Boolean *enter, fmi2Boolean *end)
{
    ENTER(CONTINUOUS)
    if (has(i, "leak_step")) leaked = memset(malloc(100), 1, 100);
    *enter = fmi2False;
    if (!has(i, "unset_step")) *end = fmi2False;
    (void)final;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetTime(fmi2Component c, fmi2Real t)
{
    ENTER(CONTINUOUS)
    if (has(i, "refuse_time")) return report(i, "time stands still");
    i->real[TIME] = t;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n)
{
    ENTER(CONTINUOUS)
    for (size_t k = 0; k < n; k++) i->real[X + k] = has(i, "forgetful") && k == 1 ? 0.5 : x[k];
    if (i->real[X] > i->tried) i->tried = i->real[X];
    return fmi2OK;
}

static void evaluate(Instance *i)
{
    double *const r = i->real;
    r[DER_X] = r[V];
    r[DER_V] = r[U] - sin(r[X]) - r[GAIN] * r[V] * fabs(r[V]);
    if (has(i, "memory")) r[DER_V] -= i->tried;
}

EXPORT fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n)
{
    ENTER(ANY ^ INSTANTIATED)
    if (has(i, "few_states") && n != 1) return report(i, "one state only");
    for (size_t k = 0; k < n; k++) x[k] = i->real[has(i, "swapped") ? V - k : X + k];
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x[], size_t n)
{
    ENTER(ANY ^ INSTANTIATED)
    for (size_t k = 0; k < n; k++) x[k] = has(i, "nominal") ? 0.0 : 1.0;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real x[], size_t n)
{
    ENTER(ANY ^ INSTANTIATED)
    if (has(i, "crash")) *(volatile int *)(uintptr_t)4096 = 1;
    evaluate(i);
    for (size_t k = 0; k < n - has(i, "few_results"); k++) x[k] = i->real[DER_X + k];
    if (has(i, "nan_rate")) x[0] = NAN;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t n)
{
    ENTER(ANY ^ INSTANTIATED)
    for (size_t k = 0; k < n + has(i, "many_indicators"); k++) z[k] = has(i, "nan_indicator") ? NAN : i->real[X] - 1.0;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real v[])
{
    ENTER(ANY ^ INSTANTIATED)
    if (!has(i, "nan_rate")) evaluate(i);
    for (size_t k = 0; k < n; k++) v[k] = i->real[r[k]];
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real v[])
{
    ENTER(ANY ^ TERMINATED)
    for (size_t k = 0; k < n; k++) i->real[r[k]] = v[k];
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Integer v[])
{
    ENTER(ANY ^ INSTANTIATED)
    for (size_t k = 0; k < n; k++) v[k] = i->count;
    (void)r;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *s)
{
    if (!*s) *s = malloc(sizeof(Instance));
    memcpy(*s, c, sizeof(Instance));
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s)
{
    Instance *i = c;
    const int count = i->count;
    memcpy(c, s, sizeof(Instance));
    if (has(i, "state")) i->count = count;
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *s)
{
    free(*s);
    *s = NULL;
    (void)c;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate s, size_t *n)
{
    (void)c, (void)s;
    *n = sizeof(Instance);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate s, fmi2Byte bytes[], size_t n)
{
    (void)c;
    memcpy(bytes, s, n);
    return fmi2OK;
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t n, fmi2FMUstate *s)
{
    (void)c;
    *s = malloc(n);
    memcpy(*s, bytes, n);
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference z[], size_t nz,
                                               const fmi2ValueReference v[], size_t nv, const fmi2Real dv[],
                                               fmi2Real dz[])
{
    Instance *i = c;
    if (has(i, "no_tangent")) return report(i, "not done yet");
    double d[REALS] = {0.0};
    for (size_t k = 0; k < nv; k++) d[v[k]] = dv[k];
    const double slope = (has(i, "tangent") ? 1.0 : 2.0) * i->real[GAIN] * fabs(i->real[V]);
    d[DER_X] = d[V];
    d[DER_V] = d[U] - cos(i->real[X]) * d[X] - slope * d[V];
    for (size_t k = 0; k < nz; k++) dz[k] = d[z[k]];
    return fmi2OK;
}

/* Not offered, but there. */
#define NOT_OFFERED(name, ...) \
    EXPORT fmi2Status name(fmi2Component c, __VA_ARGS__) { return report(c, "not offered"); }

NOT_OFFERED(fmi2GetBoolean, const fmi2ValueReference r[], size_t n, fmi2Boolean v[])
NOT_OFFERED(fmi2GetString, const fmi2ValueReference r[], size_t n, fmi2String v[])
NOT_OFFERED(fmi2SetInteger, const fmi2ValueReference r[], size_t n, const fmi2Integer v[])
NOT_OFFERED(fmi2SetBoolean, const fmi2ValueReference r[], size_t n, const fmi2Boolean v[])
NOT_OFFERED(fmi2SetString, const fmi2ValueReference r[], size_t n, const fmi2String v[])
