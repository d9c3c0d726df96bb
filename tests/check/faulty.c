/* An FMU that is in order unless its guid names a fault, as "fault:crash"; one library for most faults. WRONG_VERSION,
 * ANY_GUID, FEW_FUNCTIONS, FREE_NULL and UNLOADABLE make faults of the library itself.
 *
 * Real: time, u (input), y = gain u (output, direct), x with x' = u (output), gain (parameter), der(x).
 * String: label (parameter).
 */
#include <locale.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fmi2Functions.h"

#define EXPORT __attribute__((visibility("default")))

enum { TIME, U, Y, X, GAIN, DER_X, REALS };
enum { INSTANTIATED = 1, INITIALIZING = 2, STEPPING = 4, TERMINATED = 8, ANY = 15 };

typedef struct {
    double real[REALS];
    int mode;
    int steps;
    const fmi2CallbackFunctions *callbacks;
    char fault[32];
} Instance;

static const char *const faults[] = {
    "none", "start", "unreadable", "unsettable", "crash", "loop", "quit", "refuse_step", "refuse_rounded",
    "drift", "own_grid", "rounded_time", "static", "single", "random", "reset", "state", "pointer", "serial", "nan",
    "order", "refuse_reset", "misuse", "no_instance", "leak_instance", "leak_step", "category", "print",
    "locale", "directional", "no_init"};

static double shared_gain;
static int living, runs;
static void *volatile leaked;

#ifdef UNLOADABLE
extern int nowhere_defined(void);
int use_it(void) { return nowhere_defined(); }
#endif

static int has(const Instance *i, const char *fault) { return strcmp(i->fault, fault) == 0; }

static void touch_nothing(void) { *(volatile int *)(uintptr_t)4096 = 1; }

static fmi2Status report(const Instance *i, const char *category, const char *text)
{
    i->callbacks->logger(i->callbacks->componentEnvironment, "faulty", fmi2Error, category, text);
    return fmi2Error;
}

static void restart(Instance *i)
{
    memset(i->real, 0, sizeof i->real);
    i->real[GAIN] = has(i, "start") ? 3.0 : 2.0;
    i->mode = INSTANTIATED;
    i->steps = 0;
}

#ifdef WRONG_VERSION
EXPORT const char *fmi2GetVersion(void) { return "2.0.5"; }
#else
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
#endif
EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    static char first[32];
    const char *fault = strncmp(guid, "fault:", 6) == 0 ? guid + 6 : NULL;
    int known = 0;
    for (size_t k = 0; fault && k < sizeof faults / sizeof *faults; k++) known |= strcmp(fault, faults[k]) == 0;
    if (known && strlen(first) == 0) strcpy(first, fault);
#ifdef ANY_GUID
    if (!known) fault = "none", known = 1;
#endif
    if (!known || strcmp(fault, "no_instance") == 0 || (strcmp(fault, "single") == 0 && living)) {
        if (callbacks->logger || strcmp(first, "misuse") == 0)
            callbacks->logger(NULL, name, fmi2Error, "logStatusError", "no instance");
        return NULL;
    }
    Instance *i = calloc(1, sizeof *i);
    if (strcmp(fault, "leak_instance") == 0) leaked = memset(malloc(1000), 1, 1000);
    strcpy(i->fault, fault);
    i->callbacks = callbacks;
    living++, runs++;
    restart(i);
    if (has(i, "print")) printf("hello\n"), fflush(stdout);
    if (has(i, "category")) report(i, "logSecrets", "hello");
    (void)type, (void)resources, (void)visible, (void)logging;
    return i;
}

EXPORT void fmi2FreeInstance(fmi2Component c)
{
    Instance *i = c;
#ifndef FREE_NULL
    if (!i) return;
#endif
    *(volatile int *)&i->mode = 0;
    living--;
    free(i);
}

#define ENTER(modes)                                                        \
    Instance *i = c;                                                        \
    if (!(i->mode & (modes)) && !has(i, "order") && !has(i, "random"))      \
        return report(i, "logStatusError", "called in the wrong state");

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

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    ENTER(INSTANTIATED)
    if (has(i, "no_init")) return report(i, "logStatusError", "not today");
    if (has(i, "locale") && chdir("/")) return fmi2Error;
    i->mode = INITIALIZING;
    return fmi2OK;
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    ENTER(INITIALIZING)
    i->mode = STEPPING;
    shared_gain = i->real[GAIN];
    return fmi2OK;
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c)
{
    ENTER(STEPPING)
    i->mode = TERMINATED;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Reset(fmi2Component c)
{
    Instance *i = c;
    if (has(i, "refuse_reset")) return report(i, "logStatusError", "no way back");
    const double x = i->real[X];
    restart(i);
    if (has(i, "reset")) i->real[X] = x;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real v[])
{
    ENTER(ANY ^ INSTANTIATED)
    i->real[Y] = (has(i, "static") ? shared_gain : i->real[GAIN]) * i->real[U];
    if (has(i, "random")) i->real[Y] += runs;
    i->real[DER_X] = i->real[U];
    for (size_t k = 0; k < n; k++) {
        if (has(i, "unreadable") && r[k] == DER_X) return report(i, "logStatusError", "this is secret");
        v[k] = has(i, "nan") && r[k] == Y ? NAN : i->real[r[k]];
        if (has(i, "rounded_time") && r[k] == TIME) v[k] = nextafter(v[k], 1e9);
        if (has(i, "drift") && r[k] == TIME) v[k] *= 1.001;
        if (has(i, "own_grid") && r[k] == TIME) v[k] = floor(v[k] / 0.01) * 0.01;
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real v[])
{
    ENTER(ANY ^ TERMINATED)
    for (size_t k = 0; k < n; k++) {
        if (has(i, "unsettable") && r[k] == GAIN) return report(i, "logStatusError", "gain is what it is");
        i->real[r[k]] = v[k];
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2String v[])
{
    for (size_t k = 0; k < n; k++) v[k] = "plain";
    (void)c, (void)r;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2String v[])
{
    (void)c, (void)r, (void)n, (void)v;
    return fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean keeps)
{
    ENTER(STEPPING)
    if (has(i, "crash")) touch_nothing();
    if (has(i, "quit")) exit(3);
    while (has(i, "loop")) usleep(1000);
    if (has(i, "refuse_step") && fabs(h - 0.01) > 1e-9) return report(i, "logStatusError", "odd step");
    if (has(i, "refuse_rounded") && i->steps && fabs(h - 0.01) < 1e-9 && t != i->real[TIME])
        return report(i, "logStatusError", "not where I am");
    if (has(i, "leak_step")) leaked = memset(malloc(100), 1, 100);
    i->real[X] += h * i->real[U];
    i->real[TIME] = t + h;
    i->steps++;
    (void)keeps;
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
    const double x = i->real[X];
    memcpy(c, s, sizeof(Instance));
    if (has(i, "state")) i->real[X] = x;
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *s)
{
    free(*s);
    if (!has(c, "pointer")) *s = NULL;
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
    memcpy(bytes, s, n);
    if (has(c, "serial")) ((Instance *)(void *)bytes)->real[X] = 0.0;
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
    if (has(i, "directional")) return report(i, "logStatusError", "not done yet");
    for (size_t k = 0; k < nz; k++) dz[k] = z[k] == Y && nv && v[0] == U ? i->real[GAIN] * dv[0] : 0.0;
    return fmi2OK;
}

/* Not offered, but there. */
#define NOT_OFFERED(name, ...) \
    EXPORT fmi2Status name(fmi2Component c, __VA_ARGS__) { return report(c, "logStatusError", "not offered"); }

NOT_OFFERED(fmi2GetInteger, const fmi2ValueReference r[], size_t n, fmi2Integer v[])
NOT_OFFERED(fmi2GetBoolean, const fmi2ValueReference r[], size_t n, fmi2Boolean v[])
NOT_OFFERED(fmi2SetInteger, const fmi2ValueReference r[], size_t n, const fmi2Integer v[])
NOT_OFFERED(fmi2SetBoolean, const fmi2ValueReference r[], size_t n, const fmi2Boolean v[])
NOT_OFFERED(fmi2SetRealInputDerivatives, const fmi2ValueReference r[], size_t n, const fmi2Integer o[],
            const fmi2Real v[])
NOT_OFFERED(fmi2GetRealOutputDerivatives, const fmi2ValueReference r[], size_t n, const fmi2Integer o[], fmi2Real v[])
#ifndef FEW_FUNCTIONS
EXPORT fmi2Status fmi2CancelStep(fmi2Component c) { return report(c, "logStatusError", "never pending"); }
NOT_OFFERED(fmi2GetStatus, const fmi2StatusKind k, fmi2Status *v)
#endif
NOT_OFFERED(fmi2GetRealStatus, const fmi2StatusKind k, fmi2Real *v)
NOT_OFFERED(fmi2GetIntegerStatus, const fmi2StatusKind k, fmi2Integer *v)
NOT_OFFERED(fmi2GetBooleanStatus, const fmi2StatusKind k, fmi2Boolean *v)
NOT_OFFERED(fmi2GetStringStatus, const fmi2StatusKind k, fmi2String *v)
