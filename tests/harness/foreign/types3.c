/* An FMI 3.0 FMU as another tool would export it: variables of all types, arrays, a clock, events. Each output is
   its input plus one step after another; `fault` makes it misbehave. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"

enum { MOST = 8, ROWS = 2, COLUMNS = 3 };

typedef struct {
    double u, y, matrix[ROWS * COLUMNS], sum, vector[MOST], weighted, next, time;
    float single, single_y;
    fmi3Int8 i8, i8y;
    fmi3UInt8 u8, u8y;
    fmi3Int16 i16, i16y;
    fmi3UInt16 u16, u16y;
    fmi3Int32 i32, i32y, ticks, events;
    fmi3UInt32 u32, u32y;
    fmi3Int64 i64, i64y, gear, gear_y;
    fmi3UInt64 u64, u64y, n;
    fmi3Boolean flags[2], any;
    fmi3Int32 fault;
} Data;

typedef struct {
    Data data;
    int event_mode, used, in_events, configuring;
    char text[64];
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Fmu;

static const fmi3Int64 large = (fmi3Int64)1 << 60;

static void start(Fmu *f)
{
    memset(&f->data, 0, sizeof f->data);
    f->data.n = 3;
    f->data.gear = 1;
    f->data.next = 0.025;
    for (int k = 0; k < MOST; k++)
        f->data.vector[k] = k + 1.0;
}

static fmi3Status complain(const Fmu *f, const char *text)
{
    if (f->log)
        f->log(f->environment, fmi3Error, "logStatusError", text);
    return fmi3Error;
}

const char *fmi3GetVersion(void) { return "3.0"; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference references[], size_t n,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)early, (void)references, (void)n, (void)update;
    if (strcmp(token, "types") != 0)
        return NULL;
    Fmu *const f = calloc(1, sizeof *f);
    f->environment = environment;
    f->log = log;
    f->used = events;
    start(f);
    return f;
}

void fmi3FreeInstance(fmi3Instance f) { free(f); }

#define EASY(name, ...) fmi3Status fmi3##name(fmi3Instance f, ##__VA_ARGS__)
#define F               ((Fmu *)f)

EASY(SetDebugLogging, fmi3Boolean on, size_t n, const fmi3String names[])
{
    (void)f, (void)on, (void)n, (void)names;
    return fmi3OK;
}
EASY(EnterInitializationMode, fmi3Boolean a, fmi3Float64 b, fmi3Float64 t, fmi3Boolean c, fmi3Float64 d)
{
    (void)a, (void)b, (void)c, (void)d;
    F->data.time = t;
    return fmi3OK;
}
EASY(ExitInitializationMode)
{
    F->in_events = F->used;
    return fmi3OK;
}
EASY(EnterEventMode)
{
    F->in_events = 1;
    return F->used ? fmi3OK : complain(F, "event mode is not used");
}
EASY(EnterStepMode)
{
    F->in_events = 0;
    return fmi3OK;
}
EASY(Terminate)
{
    (void)f;
    return fmi3OK;
}
EASY(Reset)
{
    start(F);
    return fmi3OK;
}
EASY(EnterConfigurationMode)
{
    F->configuring = 1;
    return fmi3OK;
}
EASY(ExitConfigurationMode)
{
    F->configuring = 0;
    return fmi3OK;
}

/* ---- values ---- */

static size_t place(Fmu *f, fmi3ValueReference r, void **at)
{
    Data *const d = &f->data;
    switch (r) {
    case 1: *at = &d->u; return 1;
    case 2: *at = &d->y; return 1;
    case 3: *at = d->matrix; return ROWS * COLUMNS;
    case 4: *at = &d->sum; return 1;
    case 5: *at = d->vector; return (size_t)d->n;
    case 6: *at = &d->weighted; return 1;
    case 7: *at = &d->n; return 1;
    case 10: *at = &d->single; return 1;
    case 11: *at = &d->single_y; return 1;
    case 12: *at = &d->i8; return 1;
    case 13: *at = &d->i8y; return 1;
    case 14: *at = &d->u8; return 1;
    case 15: *at = &d->u8y; return 1;
    case 16: *at = &d->i16; return 1;
    case 17: *at = &d->i16y; return 1;
    case 18: *at = &d->u16; return 1;
    case 19: *at = &d->u16y; return 1;
    case 20: *at = &d->i32; return 1;
    case 21: *at = &d->i32y; return 1;
    case 22: *at = &d->u32; return 1;
    case 23: *at = &d->u32y; return 1;
    case 24: *at = &d->i64; return 1;
    case 25: *at = &d->i64y; return 1;
    case 26: *at = &d->u64; return 1;
    case 27: *at = &d->u64y; return 1;
    case 28: *at = &d->gear; return 1;
    case 29: *at = &d->gear_y; return 1;
    case 30: *at = d->flags; return 2;
    case 31: *at = &d->any; return 1;
    case 32: *at = &d->ticks; return 1;
    case 33: *at = &d->events; return 1;
    case 34: *at = &d->fault; return 1;
    default: *at = NULL; return 0;
    }
}

static void derive(Fmu *f)
{
    Data *const d = &f->data;
    d->sum = d->weighted = 0.0;
    for (int k = 0; k < ROWS * COLUMNS; k++)
        d->sum += (k + 1) * d->matrix[k];
    for (size_t k = 0; k < d->n; k++)
        d->weighted += d->vector[k];
    d->single_y = d->single + 1;
    d->i8y = (fmi3Int8)(d->i8 + 1);
    d->u8y = (fmi3UInt8)(d->u8 + 1);
    d->i16y = (fmi3Int16)(d->i16 + 1);
    d->u16y = (fmi3UInt16)(d->u16 + 1);
    d->i32y = d->i32 + 1;
    d->u32y = d->u32 + 1;
    d->i64y = d->fault == 1 ? large + 1 : d->i64 + 1;
    d->u64y = d->u64 + 1;
    d->gear_y = d->gear;
    d->any = d->flags[0] || d->flags[1];
}

#define VALUES(TYPE)                                                                                                   \
    EASY(Set##TYPE, const fmi3ValueReference r[], size_t n, const fmi3##TYPE values[], size_t count)                   \
    {                                                                                                                  \
        size_t used = 0;                                                                                               \
        for (size_t i = 0; i < n; i++) {                                                                               \
            void *at;                                                                                                  \
            const size_t size = place(F, r[i], &at);                                                                   \
            if (size == 0 || used + size > count)                                                                      \
                return complain(F, "wrong number of values of type " #TYPE);                                           \
            memcpy(at, values + used, size * sizeof *values);                                                          \
            used += size;                                                                                              \
        }                                                                                                              \
        return used == count ? fmi3OK : complain(F, "too many values of type " #TYPE);                                 \
    }                                                                                                                  \
    EASY(Get##TYPE, const fmi3ValueReference r[], size_t n, fmi3##TYPE values[], size_t count)                         \
    {                                                                                                                  \
        size_t used = 0;                                                                                               \
        derive(F);                                                                                                     \
        for (size_t i = 0; i < n; i++) {                                                                               \
            void *at;                                                                                                  \
            const size_t size = place(F, r[i], &at);                                                                   \
            if (size == 0 || used + size > count)                                                                      \
                return complain(F, "wrong number of values of type " #TYPE);                                           \
            memcpy(values + used, at, size * sizeof *values);                                                          \
            used += size;                                                                                              \
        }                                                                                                              \
        return used == count ? fmi3OK : complain(F, "too many values of type " #TYPE);                                 \
    }
VALUES(Float64)
VALUES(Float32)
VALUES(Int8)
VALUES(UInt8)
VALUES(Int16)
VALUES(UInt16)
VALUES(Int32)
VALUES(UInt32)
VALUES(Int64)
VALUES(Boolean)

EASY(SetUInt64, const fmi3ValueReference r[], size_t n, const fmi3UInt64 values[], size_t count)
{
    (void)count;
    for (size_t i = 0; i < n; i++) {
        void *at;
        if (r[i] == 7 && !F->configuring)
            return complain(F, "n is set in configuration mode only");
        if (place(F, r[i], &at) == 1)
            memcpy(at, &values[i], sizeof *values);
    }
    return fmi3OK;
}
EASY(GetUInt64, const fmi3ValueReference r[], size_t n, fmi3UInt64 values[], size_t count)
{
    (void)count;
    derive(F);
    for (size_t i = 0; i < n; i++) {
        void *at;
        if (place(F, r[i], &at) == 1)
            memcpy(&values[i], at, sizeof *values);
    }
    return fmi3OK;
}
EASY(SetString, const fmi3ValueReference r[], size_t n, const fmi3String values[], size_t count)
{
    (void)r, (void)n, (void)count;
    strncpy(F->text, values[0], sizeof F->text - 1);
    return strcmp(values[0], "bad") == 0 ? complain(F, "the text is bad") : fmi3OK;
}

/* ---- steps, events, states ---- */

EASY(SetClock, const fmi3ValueReference r[], size_t n, const fmi3Clock values[])
{
    for (size_t i = 0; i < n; i++)
        if (r[i] == 40 && values[i] && F->in_events)
            F->data.ticks++;
    return fmi3OK;
}
EASY(GetIntervalDecimal, const fmi3ValueReference r[], size_t n, fmi3Float64 intervals[], fmi3IntervalQualifier q[])
{
    (void)f, (void)r;
    for (size_t i = 0; i < n; i++) {
        intervals[i] = 0.01;
        q[i] = fmi3IntervalChanged;
    }
    return fmi3OK;
}
EASY(GetShiftDecimal, const fmi3ValueReference r[], size_t n, fmi3Float64 shifts[])
{
    (void)f, (void)r;
    for (size_t i = 0; i < n; i++)
        shifts[i] = 0.003;
    return fmi3OK;
}
EASY(UpdateDiscreteStates, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *a, fmi3Boolean *b,
     fmi3Boolean *defined, fmi3Float64 *next)
{
    *again = F->data.fault == 2;
    *terminate = *a = *b = false;
    if (F->data.time >= F->data.next - 1e-12) {
        F->data.events++;
        F->data.next += 0.025;
    }
    *defined = true;
    *next = F->data.next;
    return fmi3OK;
}
EASY(DoStep, fmi3Float64 t, fmi3Float64 h, fmi3Boolean prior, fmi3Boolean *event, fmi3Boolean *terminate,
     fmi3Boolean *early, fmi3Float64 *last)
{
    (void)prior;
    Data *const d = &F->data;
    *event = false;
    *terminate = d->fault == 3 || d->fault == 8;
    *early = d->fault == 4 || d->fault >= 6;
    *last = d->fault == 6 ? NAN : d->fault == 7 ? t + 2.0 * h : *early ? t + 0.5 * h : t + h;
    if (d->fault == 5)
        return complain(F, "the step fails on request");
    d->y += d->u * (d->fault == 8 ? *last - t : h);
    d->time = t + h;
    return fmi3OK;
}
EASY(GetFMUState, fmi3FMUState *state)
{
    if (!*state)
        *state = malloc(sizeof(Data));
    memcpy(*state, &F->data, sizeof(Data));
    return fmi3OK;
}
EASY(SetFMUState, fmi3FMUState state)
{
    memcpy(&F->data, state, sizeof(Data));
    return fmi3OK;
}
EASY(FreeFMUState, fmi3FMUState *state)
{
    (void)f;
    free(*state);
    *state = NULL;
    return fmi3OK;
}
EASY(SerializedFMUStateSize, fmi3FMUState state, size_t *size)
{
    (void)f, (void)state;
    *size = sizeof(Data);
    return fmi3OK;
}
EASY(SerializeFMUState, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    (void)f;
    memcpy(bytes, state, size);
    return fmi3OK;
}
EASY(DeserializeFMUState, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    (void)f;
    *state = malloc(sizeof(Data));
    memcpy(*state, bytes, size);
    return fmi3OK;
}
