/* FMI 2.0 co-simulation FMUs as simple exporters write them: the description, which `foreign_fmus.py` writes, declares no
 * dependencies. The GUID says which one this is, as "PREY" or "PREY states stale"; each solves its own equation exactly
 * for inputs that are held.
 *
 * With "states" the state can be saved, with a warning, else the functions for it fail. With "stale" outputs cannot be
 * read between an input and the next step, which FMI 2.0 allows an FMU to refuse. With "ends" it ends the simulation
 * after 0.55 s.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

#define EXPORT __attribute__((visibility("default")))

enum kind { PREY, PREDATOR, CONTROLLER, PLANT, GAIN, PRODUCT, THERMOSTAT, ROOM, NOT, TEXTS, KINDS };

static const char *const NAMES[KINDS] = {"PREY",    "PREDATOR",   "CONTROLLER", "PLANT", "GAIN",
                                         "PRODUCT", "THERMOSTAT", "ROOM",       "NOT",   "TEXTS"};

typedef struct {
    fmi2Real real[8], last;
    fmi2Integer integer[1];
    fmi2Boolean boolean[2];
    char text[2][32];
    enum kind kind;
    int saves, refuses, ends, running, stale;
} Model;

static const fmi2Real STARTS[KINDS][8] = {
    [PREY] = {2.0, 1.0, 1.1, 0.4},                 /* x, y, birth, eaten                      */
    [PREDATOR] = {1.0, 1.0, 0.4, 0.1},             /* y, x, death, growth                     */
    [CONTROLLER] = {0.0, 0.0, 0.0, 2.0, 1.0, 1.0}, /* u, m, integral, Kp, Ki, reference       */
    [PLANT] = {0.0, 0.0, 0.5},                     /* x, u, T                                 */
    [GAIN] = {0.0, 0.0, 1.0, 0.0},                 /* y, u, k, c                              */
    [PRODUCT] = {0.0, 0.0, 0.0},                   /* y, u, w                                 */
    [THERMOSTAT] = {20.0, 19.0, 21.0},             /* T, low, high                            */
    [ROOM] = {18.0, 30.0, 5.0, 100.0},             /* T, power, outside, tau                  */
    [NOT] = {0.0},
    [TEXTS] = {0.0},                               /* length                                  */
};

static void outputs(Model *p)
{
    fmi2Real *const r = p->real;
    fmi2Boolean *const b = p->boolean;
    if (p->kind == CONTROLLER) r[0] = r[3] * (r[5] - r[1]) + r[4] * r[2];
    if (p->kind == GAIN) r[0] = r[2] * r[1] + r[3];
    if (p->kind == PRODUCT) r[0] = r[1] * r[2];
    if (p->kind == THERMOSTAT) b[0] = r[0] < r[1] || (r[0] <= r[2] && b[0]);
    if (p->kind == NOT) b[0] = !b[1];
    if (p->kind == TEXTS) r[0] = 100.0 * (double)strlen(p->text[0]) + (double)strlen(p->text[1]);
}

static void advance(Model *p, double h)
{
    fmi2Real *const r = p->real;
    const double limit = r[2] + r[1] * p->boolean[0];
    if (p->kind == PREY) r[0] *= exp(h * (r[2] - r[3] * r[1]));
    if (p->kind == PREDATOR) r[0] *= exp(h * (r[3] * r[1] - r[2]));
    if (p->kind == CONTROLLER) r[2] += h * (r[5] - r[1]);
    if (p->kind == PLANT) r[0] = r[1] + (r[0] - r[1]) * exp(-h / r[2]);
    if (p->kind == ROOM) r[0] = limit + (r[0] - limit) * exp(-h / r[3]);
}

EXPORT const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
EXPORT const char *fmi2GetVersion(void) { return fmi2Version; }

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    Model *p = calloc(1, sizeof(Model));
    const size_t length = strcspn(guid, " ");
    while (strlen(NAMES[p->kind]) != length || strncmp(NAMES[p->kind], guid, length) != 0) p->kind++;
    p->saves = strstr(guid, " states") != NULL;
    p->refuses = strstr(guid, " stale") != NULL;
    p->ends = strstr(guid, " ends") != NULL;
    memcpy(p->real, STARTS[p->kind], sizeof p->real);
    strcpy(p->text[0], "none");
    (void)name, (void)type, (void)resources, (void)functions, (void)visible, (void)logging;
    return p;
}

EXPORT void fmi2FreeInstance(fmi2Component c) { free(c); }

#define RETURNS(status, name, ...) \
    EXPORT fmi2Status name(fmi2Component c, ##__VA_ARGS__) { (void)c; return status; }

RETURNS(fmi2OK, fmi2SetDebugLogging, fmi2Boolean on, size_t n, const fmi2String *categories)
RETURNS(fmi2OK, fmi2SetupExperiment, fmi2Boolean td, fmi2Real t, fmi2Real start, fmi2Boolean sd, fmi2Real stop)
RETURNS(fmi2OK, fmi2EnterInitializationMode)
RETURNS(fmi2OK, fmi2Terminate)
RETURNS(fmi2Error, fmi2Reset)
RETURNS(fmi2Error, fmi2CancelStep)

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    Model *p = c;
    p->running = 1;
    p->stale = 0;
    return fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean prior)
{
    Model *p = c;
    if (p->ends && t > 0.55) {
        p->last = t + 0.25 * h;
        advance(p, 0.25 * h);
        return fmi2Discard;
    }
    outputs(p);
    advance(p, h);
    p->stale = 0;
    (void)t, (void)prior;
    return fmi2OK;
}

#define ACCESS(Type, type)                                                                                       \
    EXPORT fmi2Status fmi2Get##Type(fmi2Component c, const fmi2ValueReference *vr, size_t n, fmi2##Type *v)      \
    {                                                                                                            \
        Model *p = c;                                                                                            \
        if (p->refuses && p->running && p->stale) return fmi2Error;                                              \
        outputs(p);                                                                                              \
        for (size_t i = 0; i < n; i++) v[i] = p->type[vr[i]];                                                    \
        return fmi2OK;                                                                                           \
    }                                                                                                            \
    EXPORT fmi2Status fmi2Set##Type(fmi2Component c, const fmi2ValueReference *vr, size_t n, const fmi2##Type *v) \
    {                                                                                                            \
        Model *p = c;                                                                                            \
        p->stale = 1;                                                                                            \
        for (size_t i = 0; i < n; i++) p->type[vr[i]] = v[i];                                                    \
        return fmi2OK;                                                                                           \
    }

ACCESS(Real, real)
ACCESS(Integer, integer)
ACCESS(Boolean, boolean)

RETURNS(fmi2Error, fmi2GetString, const fmi2ValueReference *vr, size_t n, fmi2String *v)

EXPORT fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference *vr, size_t n, const fmi2String *v)
{
    for (size_t i = 0; i < n; i++) snprintf(((Model *)c)->text[vr[i]], 32, "%s", v[i]);
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    if (!((Model *)c)->saves) return fmi2Error;
    if (*state == NULL) *state = malloc(sizeof(Model));
    memcpy(*state, c, sizeof(Model));
    return fmi2Warning;
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    memcpy(c, state, sizeof(Model));
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    free(*state);
    *state = NULL;
    (void)c;
    return fmi2OK;
}

RETURNS(fmi2Error, fmi2SerializedFMUstateSize, fmi2FMUstate state, size_t *n)
RETURNS(fmi2Error, fmi2SerializeFMUstate, fmi2FMUstate state, fmi2Byte b[], size_t n)
RETURNS(fmi2Error, fmi2DeSerializeFMUstate, const fmi2Byte b[], size_t n, fmi2FMUstate *state)
RETURNS(fmi2Error, fmi2GetDirectionalDerivative, const fmi2ValueReference u[], size_t nu, const fmi2ValueReference k[],
        size_t nk, const fmi2Real dk[], fmi2Real du[])
RETURNS(fmi2Error, fmi2SetRealInputDerivatives, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
        const fmi2Real v[])
RETURNS(fmi2Error, fmi2GetRealOutputDerivatives, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
        fmi2Real v[])
RETURNS(fmi2Error, fmi2GetStatus, const fmi2StatusKind k, fmi2Status *v)
RETURNS(fmi2Error, fmi2GetIntegerStatus, const fmi2StatusKind k, fmi2Integer *v)

EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind k, fmi2Real *v)
{
    *v = ((Model *)c)->last;
    return k == fmi2LastSuccessfulTime ? fmi2OK : fmi2Discard;
}

EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind k, fmi2Boolean *v)
{
    *v = k == fmi2Terminated && ((Model *)c)->ends;
    return fmi2OK;
}

RETURNS(fmi2Error, fmi2GetStringStatus, const fmi2StatusKind k, fmi2String *v)
