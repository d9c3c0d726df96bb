/* A small FMI 2.0 co-simulation FMU for the tests of the harness: ports of all types, and failures on request.
 *
 * Real:    u (input), y = gain u (output, direct), x with x' = u (output), gain (parameter, refused if negative),
 *          fail_time (parameter)
 * Integer: n (input), twice_n (output), fail_status (parameter)
 * Boolean: b (input), not_b (output)
 * String:  label (parameter), part of the log message
 *
 * An instance called WHAT_WHEN changes what belongs to the whole process: rounding, tiny (flush to zero), x87,
 * directory, locale, or calls exit(0) (exit), at its birth, start (initialisation), step (beyond fail_time) or end. When
 * the library is loaded and unloaded it does what the environment variables AT_LOAD and AT_UNLOAD say.
 */
#include <fenv.h>
#include <locale.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fmi2Functions.h"

#define EXPORT __attribute__((visibility("default")))

typedef struct {
    fmi2Real real[5];
    fmi2Integer integer[3];
    fmi2Boolean boolean[2];
    char label[32], name[32];
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
} Probe;

enum { U, Y, X, GAIN, FAIL_TIME };
enum { N, TWICE_N, FAIL_STATUS };
enum { B, NOT_B };

static void meddle(const char *what)
{
    if (strncmp(what, "rounding", 8) == 0) fesetround(FE_UPWARD);
    if (strncmp(what, "directory", 9) == 0 && chdir("/") != 0) abort();
    if (strncmp(what, "locale", 6) == 0) setlocale(LC_ALL, "C");
    if (strncmp(what, "exit", 4) == 0) exit(0);
#ifdef __x86_64__
    if (strncmp(what, "tiny", 4) == 0) __builtin_ia32_ldmxcsr(__builtin_ia32_stmxcsr() | 0x8040);
    if (strncmp(what, "x87", 3) == 0) {
        const uint16_t single = 0x007f;
        __asm__ volatile("fldcw %0" : : "m"(single));
    }
#endif
}

static int meddle_when(const Probe *p, const char *when)
{
    const char *const at = strchr(p->name, '_');
    const int now = at != NULL && strcmp(at + 1, when) == 0;
    if (now) meddle(p->name);
    return now;
}

__attribute__((constructor)) static void load(void) { meddle(getenv("AT_LOAD") ? getenv("AT_LOAD") : ""); }
__attribute__((destructor)) static void unload(void) { meddle(getenv("AT_UNLOAD") ? getenv("AT_UNLOAD") : ""); }

static void outputs(Probe *p)
{
    p->real[Y] = p->real[GAIN] * p->real[U];
    p->integer[TWICE_N] = 2 * p->integer[N];
    p->boolean[NOT_B] = !p->boolean[B];
}

EXPORT const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
EXPORT const char *fmi2GetVersion(void) { return fmi2Version; }

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    if (strcmp(guid, "probe") != 0) {
        functions->logger(functions->componentEnvironment, name, fmi2Error, "logStatusError", "wrong guid %s", guid);
        return NULL;
    }
    Probe *p = calloc(1, sizeof(Probe));
    strncpy(p->name, name, 31);
    p->real[GAIN] = 1.0;
    p->real[FAIL_TIME] = 1e300;
    p->integer[FAIL_STATUS] = fmi2Error;
    p->logger = functions->logger;
    p->environment = functions->componentEnvironment;
    (void)type, (void)resources, (void)visible, (void)logging;
    meddle_when(p, "birth");
    return p;
}

EXPORT void fmi2FreeInstance(fmi2Component c)
{
    meddle_when(c, "end");
    free(c);
}

#define ALWAYS_OK(name, ...) \
    EXPORT fmi2Status name(fmi2Component c, ##__VA_ARGS__) { (void)c; return fmi2OK; }

ALWAYS_OK(fmi2SetDebugLogging, fmi2Boolean on, size_t n, const fmi2String *categories)
ALWAYS_OK(fmi2SetupExperiment, fmi2Boolean td, fmi2Real t, fmi2Real start, fmi2Boolean sd, fmi2Real stop)
ALWAYS_OK(fmi2ExitInitializationMode)
ALWAYS_OK(fmi2Terminate)
ALWAYS_OK(fmi2Reset)
ALWAYS_OK(fmi2CancelStep)

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    meddle_when(c, "start");
    return fmi2OK;
}

#define ACCESS(Type, type)                                                                                  \
    EXPORT fmi2Status fmi2Get##Type(fmi2Component c, const fmi2ValueReference *vr, size_t n, fmi2##Type *v) \
    {                                                                                                       \
        Probe *p = c;                                                                                       \
        outputs(p);                                                                                         \
        for (size_t i = 0; i < n; i++) v[i] = p->type[vr[i]];                                               \
        return fmi2OK;                                                                                      \
    }

ACCESS(Real, real)
ACCESS(Integer, integer)
ACCESS(Boolean, boolean)

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference *vr, size_t n, const fmi2Real *v)
{
    Probe *p = c;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == GAIN && v[i] < 0) {
            p->logger(p->environment, "probe", fmi2Discard, "logStatusDiscard", "gain = %g is below %d", v[i], 0);
            return fmi2Discard;
        }
        p->real[vr[i]] = v[i];
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference *vr, size_t n, const fmi2Integer *v)
{
    for (size_t i = 0; i < n; i++) ((Probe *)c)->integer[vr[i]] = v[i];
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference *vr, size_t n, const fmi2Boolean *v)
{
    for (size_t i = 0; i < n; i++) ((Probe *)c)->boolean[vr[i]] = v[i];
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference *vr, size_t n, const fmi2String *v)
{
    (void)vr;
    if (n) strncpy(((Probe *)c)->label, v[0], 31);
    return fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean prior)
{
    Probe *p = c;
    (void)prior;
    if (t + h > p->real[FAIL_TIME] && !meddle_when(p, "step")) {
        p->logger(p->environment, "probe", p->integer[FAIL_STATUS], "logStatusError", "%s seized", p->label);
        return p->integer[FAIL_STATUS];
    }
    p->real[X] += h * p->real[U];
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *s)
{
    if (!*s) *s = malloc(sizeof(Probe));
    memcpy(*s, c, sizeof(Probe));
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s)
{
    memcpy(c, s, sizeof(Probe));
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *s)
{
    (void)c;
    free(*s);
    *s = NULL;
    return fmi2OK;
}

/* Required to be there, never called by the harness. */
#define NOT_OFFERED(name, ...) \
    EXPORT fmi2Status name(fmi2Component c, ##__VA_ARGS__) { (void)c; return fmi2Error; }

NOT_OFFERED(fmi2GetString, const fmi2ValueReference *vr, size_t n, fmi2String *v)
NOT_OFFERED(fmi2SerializedFMUstateSize, fmi2FMUstate s, size_t *n)
NOT_OFFERED(fmi2SerializeFMUstate, fmi2FMUstate s, fmi2Byte *bytes, size_t n)
NOT_OFFERED(fmi2DeSerializeFMUstate, const fmi2Byte *bytes, size_t n, fmi2FMUstate *s)
NOT_OFFERED(fmi2GetDirectionalDerivative, const fmi2ValueReference *u, size_t nu, const fmi2ValueReference *k, size_t nk,
            const fmi2Real *dk, fmi2Real *du)
NOT_OFFERED(fmi2SetRealInputDerivatives, const fmi2ValueReference *vr, size_t n, const fmi2Integer *o, const fmi2Real *v)
NOT_OFFERED(fmi2GetRealOutputDerivatives, const fmi2ValueReference *vr, size_t n, const fmi2Integer *o, fmi2Real *v)
NOT_OFFERED(fmi2GetStatus, const fmi2StatusKind k, fmi2Status *v)
NOT_OFFERED(fmi2GetRealStatus, const fmi2StatusKind k, fmi2Real *v)
NOT_OFFERED(fmi2GetIntegerStatus, const fmi2StatusKind k, fmi2Integer *v)
NOT_OFFERED(fmi2GetBooleanStatus, const fmi2StatusKind k, fmi2Boolean *v)
NOT_OFFERED(fmi2GetStringStatus, const fmi2StatusKind k, fmi2String *v)
