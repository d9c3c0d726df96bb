/* FMUs for model exchange as other tools export them, several in one library: the guid says which one, and
   "states" in it that the state can be saved. Every call in a mode in which FMI 2.0 does not allow it is an error. */

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum mode { START = 1, INITIALISATION = 2, EVENT = 4, CONTINUOUS = 8, TERMINATED = 16 };

typedef struct {
    const struct kind *kind;
    int mode;
    double time, r[16]; /* Real variables by value reference; the states come first, then their derivatives */
    int whole[4];       /* Integers and Booleans by value reference */
    double next;        /* time event */
    bool memory;        /* discrete state */
    double limit;
} Model;

typedef struct {
    Model model;
    const fmi2CallbackFunctions *callbacks;
    char name[64];
    bool saves;
} Instance;

typedef struct kind {
    const char *name;
    int states, indicators;
    double start[16];
    void (*equations)(Model *);
    void (*indicate)(const Model *, double *z);
    void (*event)(Model *, fmi2EventInfo *);
    void (*step)(Model *, fmi2Boolean *enter, fmi2Boolean *end);
} Kind;

static void plan(fmi2EventInfo *info, double next)
{
    info->nextEventTimeDefined = fmi2True;
    info->nextEventTime = next;
}

/* x, v, der(x), der(v), F, omega, mass */
static void oscillator(Model *m)
{
    double *const r = m->r;
    r[2] = r[1];
    r[3] = r[4] / r[6] - r[5] * r[5] * r[0];
}

/* h, v, der(h), der(v), g, restitution; whole: bounces */
static void ball(Model *m)
{
    m->r[2] = m->r[1];
    m->r[3] = -m->r[4];
}

static void height(const Model *m, double *z) { z[0] = m->r[0]; }

static void bounce(Model *m, fmi2EventInfo *info)
{
    if (m->r[0] <= 0.0 && m->r[1] < 0.0) {
        m->r[1] *= -m->r[5];
        m->r[0] = 0.0;
        m->whole[0]++;
        info->valuesOfContinuousStatesChanged = fmi2True;
    }
}

/* period; whole: level */
static void nothing(Model *m) { (void)m; }

static void climb(Model *m, fmi2EventInfo *info)
{
    if (m->next > 0.0 && m->time >= m->next)
        m->whole[0]++;
    m->next = (m->whole[0] + 1) * m->r[0];
    plan(info, m->next);
}

/* u, y, period */
static void sample(Model *m, fmi2EventInfo *info)
{
    if (m->time >= m->next) {
        m->r[1] = 2.0 * m->r[0];
        m->next = ++m->whole[0] * m->r[2];
    }
    plan(info, m->next);
}

/* x, v, der(x), der(v), mu */
static void van_der_pol(Model *m)
{
    double *const r = m->r;
    r[2] = r[1];
    r[3] = r[4] * (1.0 - r[0] * r[0]) * r[1] - r[0];
}

/* x, v, der(x), der(v), mass, k, V, Fs, Fc; whole: slipping */
static void belt(Model *m)
{
    double *const r = m->r;
    r[2] = r[1];
    r[3] = m->whole[0] ? (r[8] - r[5] * r[0]) / r[4] : 0.0;
}

static void contact(const Model *m, double *z)
{
    const double *const r = m->r;
    z[0] = m->whole[0] ? r[6] - r[1] : r[7] - r[5] * r[0];
}

static void stick_or_slip(Model *m, fmi2EventInfo *info)
{
    double *const r = m->r;
    const double load = r[5] * r[0];
    if (!m->whole[0] && load >= r[7])
        m->whole[0] = 1;
    else if (m->whole[0] && r[1] >= r[6] && load < r[7]) {
        m->whole[0] = 0;
        r[1] = r[6];
        info->valuesOfContinuousStatesChanged = fmi2True;
    }
}

/* u, y = k u, k, sum; whole: above = u > 0, heat (Boolean input) */
static void gain(Model *m) { m->r[1] = m->r[2] * m->r[0]; }

static void sign_of_input(const Model *m, double *z) { z[0] = m->r[0]; }

static void compare(Model *m, fmi2EventInfo *info)
{
    (void)info;
    m->whole[0] = m->r[0] > 0.0;
    m->r[3] = m->time; /* of the last event */
}

/* x, der(x), nothing; whole: events */
static void clock_of_one(Model *m) { m->r[1] = 1.0; }

static void ask_once(Model *m, fmi2Boolean *enter, fmi2Boolean *end)
{
    (void)end;
    *enter = m->r[0] >= 0.45 && !m->memory;
}

static void jump(Model *m, fmi2EventInfo *info)
{
    if (m->r[0] < 0.45 || m->memory)
        return;
    m->memory = true;
    m->whole[0]++;
    m->r[0] += 10.0;
    info->valuesOfContinuousStatesChanged = fmi2True;
}

static void end_at_time(Model *m, fmi2EventInfo *info)
{
    info->terminateSimulation = m->time >= 0.55;
    plan(info, 0.55);
}

static void end_at_step(Model *m, fmi2Boolean *enter, fmi2Boolean *end)
{
    (void)enter;
    *end = m->r[0] >= 0.55;
}

static void never_settled(Model *m, fmi2EventInfo *info) { info->newDiscreteStatesNeeded = m->time >= 0.5; plan(info, 0.5); }

static void chatter(Model *m, fmi2EventInfo *info)
{
    (void)info;
    m->memory = !m->memory;
}

static void due_now(Model *m, fmi2EventInfo *info) { plan(info, m->time); }

static void flip(const Model *m, double *z) { z[0] = (m->memory ? -1.0 : 1.0) * (m->r[0] - 1e-3); }

static void two_faced(Model *m) { m->r[1] = m->memory ? -1.0 : 1.0; }

static void face(const Model *m, double *z) { z[0] = m->r[0] - 0.5; }

static void turn(Model *m, fmi2EventInfo *info)
{
    (void)info;
    m->memory = m->r[0] > 0.5;
}

/* T, der(T), power, outside; whole: heat (Boolean input) */
static void room(Model *m) { m->r[1] = m->r[3] - m->r[0] + (m->whole[0] ? m->r[2] : 0.0); }

/* x, der(x), status, at, nan */
static void failing(Model *m) { m->r[1] = m->r[0] > m->r[3] && m->r[4] > 0.0 ? NAN : 1.0; }

/* x, der(x): from x = 0.9 on, x nears 1; beyond 1.2, there is no derivative */
static void nearing(Model *m) { m->r[1] = m->r[0] > 1.2 ? NAN : fmin(10.0, 100.0 * (1.0 - m->r[0])); }

/* x, der(x) = u, u, y = u */
static void integrates(Model *m)
{
    m->r[1] = m->r[2];
    m->r[3] = m->r[2];
}

static const Kind kinds[] = {
    {"OSCILLATOR", 2, 0, {1.0, 0.0, 0.0, 0.0, 0.0, 3.0, 1.0}, oscillator, NULL, NULL, NULL},
    {"BALL", 2, 1, {1.0, 0.0, 0.0, 0.0, 9.81, 0.7}, ball, height, bounce, NULL},
    {"STAIR", 0, 0, {0.3}, nothing, NULL, climb, NULL},
    {"SAMPLER", 0, 0, {0.0, 0.0, 0.2}, nothing, NULL, sample, NULL},
    {"VANDERPOL", 2, 0, {2.0, 0.0, 0.0, 0.0, 5.0}, van_der_pol, NULL, NULL, NULL},
    {"BELT", 2, 1, {0.0, 0.1, 0.0, 0.0, 1.0, 100.0, 0.1, 5.0, 3.0}, belt, contact, stick_or_slip, NULL},
    {"GAIN", 0, 1, {0.0, 0.0, 2.0, 0.0}, gain, sign_of_input, compare, NULL},
    {"ASKS", 1, 0, {0.0, 1.0}, clock_of_one, NULL, jump, ask_once},
    {"ENDS", 1, 0, {0.0, 1.0}, clock_of_one, NULL, end_at_time, NULL},
    {"STOPS", 1, 0, {0.0, 1.0}, clock_of_one, NULL, NULL, end_at_step},
    {"UNSETTLED", 1, 0, {0.0, 1.0}, clock_of_one, NULL, never_settled, NULL},
    {"CHATTERS", 1, 1, {0.0, 1.0}, clock_of_one, flip, chatter, NULL},
    {"TWOFACED", 1, 1, {0.0, 1.0}, two_faced, face, turn, NULL},
    {"DUE", 1, 0, {0.0, 1.0}, clock_of_one, NULL, due_now, NULL},
    {"ROOM", 1, 0, {20.0, 0.0, 10.0, 15.0}, room, NULL, NULL, NULL},
    {"FAILS", 1, 0, {0.0, 1.0, 2.0, 0.5, 0.0}, failing, NULL, NULL, NULL},
    {"NEARS", 1, 0, {0.0, 10.0}, nearing, NULL, NULL, NULL},
    {"INTEGRATOR", 1, 0, {0.0, 0.0, 0.0, 0.0}, integrates, NULL, NULL, NULL},
};

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

static fmi2Status complain(const Instance *c, fmi2Status status, const char *message)
{
    c->callbacks->logger(c->callbacks->componentEnvironment, c->name, status, "logStatusError", "%s", message);
    return status;
}

#define ALLOW(modes)                                                                                                   \
    Instance *const c = component;                                                                                     \
    Model *const m = &c->model;                                                                                        \
    if (!(m->mode & (modes)))                                                                                          \
        return complain(c, fmi2Error, "not allowed in this mode");

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)resources, (void)visible, (void)logging;
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        const size_t length = strlen(kinds[k].name);
        if (type != fmi2ModelExchange || strncmp(guid, kinds[k].name, length) != 0)
            continue;
        Instance *const c = calloc(1, sizeof *c);
        c->callbacks = callbacks;
        c->saves = strstr(guid, "states") != NULL;
        snprintf(c->name, sizeof c->name, "%s", name);
        c->model.kind = &kinds[k];
        c->model.mode = START;
        memcpy(c->model.r, kinds[k].start, sizeof c->model.r);
        return c;
    }
    return NULL;
}

void fmi2FreeInstance(fmi2Component component) { free(component); }

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    (void)component, (void)on, (void)n, (void)categories;
    return fmi2OK;
}

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean tolerant, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean ends, fmi2Real stop)
{
    (void)tolerant, (void)tolerance, (void)ends, (void)stop;
    ALLOW(START)
    m->time = start;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component)
{
    ALLOW(START)
    m->mode = INITIALISATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component)
{
    ALLOW(INITIALISATION)
    m->mode = EVENT;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component component)
{
    ALLOW(EVENT | CONTINUOUS)
    m->mode = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component)
{
    Instance *const c = component;
    const Kind *const kind = c->model.kind;
    memset(&c->model, 0, sizeof c->model);
    c->model.kind = kind;
    c->model.mode = START;
    memcpy(c->model.r, kind->start, sizeof c->model.r);
    return fmi2OK;
}

fmi2Status fmi2EnterEventMode(fmi2Component component)
{
    ALLOW(CONTINUOUS)
    m->mode = EVENT;
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component component)
{
    ALLOW(EVENT)
    m->mode = CONTINUOUS;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *info)
{
    ALLOW(EVENT)
    memset(info, 0, sizeof *info);
    if (m->kind->event)
        m->kind->event(m, info);
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component component, fmi2Boolean final, fmi2Boolean *enter, fmi2Boolean *end)
{
    (void)final;
    ALLOW(CONTINUOUS)
    if (m->time < m->limit)
        return complain(c, fmi2Error, "completed steps must not go back in time");
    m->limit = m->time;
    *enter = *end = fmi2False;
    if (m->kind->step)
        m->kind->step(m, enter, end);
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component component, fmi2Real time)
{
    ALLOW(CONTINUOUS)
    m->time = time;
    return fmi2OK;
}

#define COUNTED(count)                                                                                                 \
    if (n != (size_t)(count))                                                                                          \
        return complain(c, fmi2Error, "another number of values");

fmi2Status fmi2SetContinuousStates(fmi2Component component, const fmi2Real x[], size_t n)
{
    ALLOW(CONTINUOUS)
    COUNTED(m->kind->states)
    memcpy(m->r, x, n * sizeof *x);
    return fmi2OK;
}

fmi2Status fmi2GetContinuousStates(fmi2Component component, fmi2Real x[], size_t n)
{
    ALLOW(EVENT | CONTINUOUS)
    COUNTED(m->kind->states)
    memcpy(x, m->r, n * sizeof *x);
    return fmi2OK;
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component component, fmi2Real nominals[], size_t n)
{
    ALLOW(EVENT | CONTINUOUS)
    COUNTED(m->kind->states)
    for (size_t k = 0; k < n; k++)
        nominals[k] = 1.0;
    return fmi2OK;
}

fmi2Status fmi2GetDerivatives(fmi2Component component, fmi2Real dx[], size_t n)
{
    ALLOW(EVENT | CONTINUOUS)
    COUNTED(m->kind->states)
    if (m->kind->equations == failing && m->r[0] > m->r[3] && m->r[4] == 0.0)
        return complain(c, (fmi2Status)m->r[2], "the spindle has seized");
    m->kind->equations(m);
    memcpy(dx, m->r + n, n * sizeof *dx);
    return fmi2OK;
}

fmi2Status fmi2GetEventIndicators(fmi2Component component, fmi2Real z[], size_t n)
{
    ALLOW(EVENT | CONTINUOUS)
    COUNTED(m->kind->indicators)
    if (n > 0)
        m->kind->indicate(m, z);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference vr[], size_t n, fmi2Real value[])
{
    ALLOW(INITIALISATION | EVENT | CONTINUOUS | TERMINATED)
    m->kind->equations(m);
    for (size_t k = 0; k < n; k++)
        value[k] = m->r[vr[k]];
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference vr[], size_t n, const fmi2Real value[])
{
    ALLOW(START | INITIALISATION | EVENT | CONTINUOUS)
    for (size_t k = 0; k < n; k++) {
        if (m->kind->equations == oscillator && vr[k] == 6 && !(value[k] > 0.0))
            return complain(c, fmi2Error, "the mass must be positive");
        m->r[vr[k]] = value[k];
    }
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t n, fmi2Integer value[])
{
    ALLOW(INITIALISATION | EVENT | CONTINUOUS | TERMINATED)
    for (size_t k = 0; k < n; k++)
        value[k] = m->whole[vr[k]];
    return fmi2OK;
}

/* discrete inputs change in event mode only */
fmi2Status fmi2SetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[])
{
    ALLOW(START | INITIALISATION | EVENT)
    for (size_t k = 0; k < n; k++)
        m->whole[vr[k]] = value[k];
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[])
{
    return fmi2GetInteger(component, vr, n, value);
}

fmi2Status fmi2SetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[])
{
    return fmi2SetInteger(component, vr, n, value);
}

fmi2Status fmi2GetString(fmi2Component component, const fmi2ValueReference vr[], size_t n, fmi2String value[])
{
    (void)component, (void)vr, (void)n, (void)value;
    return fmi2Error;
}

fmi2Status fmi2SetString(fmi2Component component, const fmi2ValueReference vr[], size_t n, const fmi2String value[])
{
    (void)component, (void)vr, (void)n, (void)value;
    return fmi2Error;
}

#define SAVES                                                                                                          \
    Instance *const c = component;                                                                                     \
    if (!c->saves)                                                                                                     \
        return complain(c, fmi2Error, "this FMU cannot save its state");

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    SAVES
    if (*state == NULL)
        *state = malloc(sizeof c->model);
    memcpy(*state, &c->model, sizeof c->model);
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state)
{
    SAVES
    memcpy(&c->model, state, sizeof c->model);
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    (void)component;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate state, size_t *size)
{
    SAVES
    (void)state;
    *size = sizeof c->model;
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate state, fmi2Byte data[], size_t size)
{
    SAVES
    memcpy(data, state, size);
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte data[], size_t size, fmi2FMUstate *state)
{
    SAVES
    const Kind *const kind = c->model.kind; /* another address in another process */
    Model *const model = malloc(sizeof *model);
    memcpy(model, data, size);
    model->kind = kind;
    *state = model;
    return fmi2OK;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component component, const fmi2ValueReference z[], size_t nz,
                                        const fmi2ValueReference v[], size_t nv, const fmi2Real dv[], fmi2Real dz[])
{
    (void)component, (void)z, (void)nz, (void)v, (void)nv, (void)dv, (void)dz;
    return fmi2Error;
}
