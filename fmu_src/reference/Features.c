/* An FMU of the reference set for features that the blocks lack: Integers, enumerations and strings, partial steps, an
   end before the stop time, an event with iterations, and messages. modelDescription.xml is Features.xml.

       dy/dt = rate count mode (1 if flag, else -1) + u; y jumps by 1 in each of the three iterations at event_time,
       which is a time event if announced, or else the end of an integrator step after it

   It trusts its importer, as many FMUs do: it does not check the order of calls, nor that there is a logger. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

#pragma GCC diagnostic ignored "-Wunused-parameter" /* the standard states the arguments */

enum { LARGEST_STEP, EVENT_TIME, U, END, Y, DER_Y, RATE, REALS };
enum { LENGTH, COUNT_OUT, MODE, MODE_OUT, COUNT, MESSAGES, INTEGERS };
enum { FLAG_OUT, FLAG, ANNOUNCED, BOOLEANS, LONGEST = 100 /* text */ };

typedef struct {
    fmi2Real real[REALS], time;
    fmi2Integer integer[INTEGERS], boolean[BOOLEANS], iterations; /* that the event still needs */
    char string[LONGEST], name[LONGEST];
    fmi2CallbackFunctions functions;
} Instance;

static void set_start_values(Instance *c)
{
    static const fmi2Real reals[REALS] = {1e9, 1e9, 0.0, 1e9, 0.0, 0.0, 1.0};
    static const fmi2Integer integers[INTEGERS] = {0, 0, 1, 0, 1, 0};
    memcpy(c->real, reals, sizeof reals);
    memcpy(c->integer, integers, sizeof integers);
    strcpy(c->string, "none");
    c->boolean[FLAG] = c->boolean[ANNOUNCED] = fmi2True;
    c->iterations = 3;
}

/* Return the instance with its outputs computed. */
static Instance *updated(fmi2Component component)
{
    Instance *const c = (Instance *)component;
    c->integer[COUNT_OUT] = c->integer[COUNT];
    c->integer[MODE_OUT] = c->integer[MODE];
    c->integer[LENGTH] = (fmi2Integer)strlen(c->string);
    c->boolean[FLAG_OUT] = c->boolean[FLAG];
    c->real[DER_Y] =
        c->real[RATE] * c->integer[COUNT] * c->integer[MODE] * (c->boolean[FLAG] ? 1.0 : -1.0) + c->real[U];
    return c;
}

static int due(const Instance *c) { return c->iterations > 0 && c->time >= c->real[EVENT_TIME] - 1e-12; }
static int unannounced(const Instance *c) { return due(c) && !c->boolean[ANNOUNCED]; }

fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *info)
{
    Instance *const c = (Instance *)component;
    memset(info, 0, sizeof *info);
    if (due(c)) {
        c->real[Y] += 1.0;
        c->iterations--;
        info->newDiscreteStatesNeeded = c->iterations > 0;
        info->valuesOfContinuousStatesChanged = fmi2True;
    }
    info->terminateSimulation = c->time >= c->real[END] - 1e-12;
    info->nextEventTime = c->real[END];
    if (c->boolean[ANNOUNCED] && c->time < c->real[EVENT_TIME] - 1e-12)
        info->nextEventTime = fmin(c->real[EVENT_TIME], c->real[END]);
    info->nextEventTimeDefined = info->nextEventTime < 1e9;
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real t, fmi2Real h, fmi2Boolean keeps_no_state)
{
    Instance *const c = updated(component);
    const double done = fmin(fmin(h, c->real[LARGEST_STEP]), c->real[END] - t);
    fmi2EventInfo info;
    c->real[Y] += done * c->real[DER_Y];
    c->time = t + done;
    do
        fmi2NewDiscreteStates(c, &info);
    while (info.newDiscreteStatesNeeded);
    for (int i = 1; i <= c->integer[MESSAGES]; i++)
        c->functions.logger(c->functions.componentEnvironment, c->name, fmi2Warning, "logStatusWarning",
                            "message %d at %.3f s: 100 %% of \"%s\"", i, c->time, c->string);
    return done < h ? fmi2Discard : c->integer[MESSAGES] > 0 ? fmi2Warning : fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    Instance *const c = strcmp(guid, "{features}") == 0 ? (Instance *)calloc(1, sizeof(Instance)) : NULL;
    if (c) {
        snprintf(c->name, LONGEST, "%s", name);
        memcpy(&c->functions, functions, sizeof c->functions); /* its members are const */
        set_start_values(c);
    }
    return c;
}

#define REFERENCES const fmi2ValueReference vr[], size_t n
#define ACCESS(action, Type, values, code)                                                                             \
    fmi2Status fmi2##action##Type(fmi2Component component, REFERENCES, values[])                                       \
    {                                                                                                                  \
        Instance *const c = updated(component);                                                                        \
        for (size_t i = 0; i < n; i++)                                                                                 \
            code;                                                                                                      \
        return fmi2OK;                                                                                                 \
    }
ACCESS(Get, Real, fmi2Real values, values[i] = c->real[vr[i]])
ACCESS(Set, Real, const fmi2Real values, c->real[vr[i]] = values[i])
ACCESS(Get, Integer, fmi2Integer values, values[i] = c->integer[vr[i]])
ACCESS(Set, Integer, const fmi2Integer values, c->integer[vr[i]] = values[i])
ACCESS(Get, Boolean, fmi2Boolean values, values[i] = c->boolean[vr[i]])
ACCESS(Set, Boolean, const fmi2Boolean values, c->boolean[vr[i]] = values[i])
ACCESS(Get, String, fmi2String values, values[i] = c->string)
ACCESS(Set, String, const fmi2String values, snprintf(c->string, LONGEST, "%s", values[i]))

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
void fmi2FreeInstance(fmi2Component c) { free(c); }

#define THIS ((Instance *)component)
#define FUNCTION(name, arguments, code)                                                                                \
    fmi2Status fmi2##name arguments { return code; }
#define WHO  fmi2Component component
#define KIND WHO, const fmi2StatusKind kind
FUNCTION(SetupExperiment, (WHO, int a, fmi2Real b, fmi2Real t, int d, fmi2Real e), (THIS->time = t, fmi2OK))
FUNCTION(Reset, (WHO), (set_start_values(THIS), fmi2OK))
FUNCTION(SetTime, (WHO, fmi2Real t), (THIS->time = t, fmi2OK))
FUNCTION(SetContinuousStates, (WHO, const fmi2Real y[], size_t n), (THIS->real[Y] = y[0], fmi2OK))
FUNCTION(GetContinuousStates, (WHO, fmi2Real y[], size_t n), (y[0] = THIS->real[Y], fmi2OK))
FUNCTION(GetDerivatives, (WHO, fmi2Real values[], size_t n), (values[0] = updated(component)->real[DER_Y], fmi2OK))
FUNCTION(GetRealStatus, (KIND, fmi2Real *value), (*value = THIS->time, fmi2OK))
FUNCTION(GetBooleanStatus, (KIND, fmi2Boolean *value), (*value = THIS->time >= THIS->real[END] - 1e-12, fmi2OK))
FUNCTION(GetNominalsOfContinuousStates, (WHO, fmi2Real values[], size_t n), (values[0] = 1.0, fmi2OK))
FUNCTION(CompletedIntegratorStep, (WHO, int a, int *event, int *end), (*end = 0, *event = unannounced(THIS), fmi2OK))
FUNCTION(SetDebugLogging, (WHO, fmi2Boolean on, size_t n, const fmi2String categories[]), fmi2OK)
FUNCTION(EnterInitializationMode, (WHO), fmi2OK)
FUNCTION(ExitInitializationMode, (WHO), fmi2OK)
FUNCTION(Terminate, (WHO), fmi2OK)
FUNCTION(EnterEventMode, (WHO), fmi2OK)
FUNCTION(EnterContinuousTimeMode, (WHO), fmi2OK)
FUNCTION(GetEventIndicators, (WHO, fmi2Real values[], size_t n), fmi2OK)
FUNCTION(GetFMUstate, (WHO, fmi2FMUstate *state), fmi2Error)
FUNCTION(SetFMUstate, (WHO, fmi2FMUstate state), fmi2Error)
FUNCTION(FreeFMUstate, (WHO, fmi2FMUstate *state), fmi2Error)
FUNCTION(SerializedFMUstateSize, (WHO, fmi2FMUstate state, size_t *size), fmi2Error)
FUNCTION(SerializeFMUstate, (WHO, fmi2FMUstate state, fmi2Byte bytes[], size_t size), fmi2Error)
FUNCTION(DeSerializeFMUstate, (WHO, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state), fmi2Error)
FUNCTION(GetDirectionalDerivative,
         (WHO, REFERENCES, const fmi2ValueReference known[], size_t m, const fmi2Real seed[], fmi2Real values[]),
         fmi2Error)
FUNCTION(SetRealInputDerivatives, (WHO, REFERENCES, const fmi2Integer orders[], const fmi2Real values[]), fmi2Error)
FUNCTION(GetRealOutputDerivatives, (WHO, REFERENCES, const fmi2Integer orders[], fmi2Real values[]), fmi2Error)
FUNCTION(CancelStep, (WHO), fmi2Error)
FUNCTION(GetStatus, (KIND, fmi2Status *value), fmi2Discard)
FUNCTION(GetIntegerStatus, (KIND, fmi2Integer *value), fmi2Discard)
FUNCTION(GetStringStatus, (KIND, fmi2String *value), fmi2Discard)
