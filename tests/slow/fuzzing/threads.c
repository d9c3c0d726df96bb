/* Threads with an instance each do what each of them does alone, bit by bit. BLOCK is the C file of the block or
   composite. */

#include BLOCK

#include <pthread.h>

#ifndef INSIDE /* facade.c defines it */
#define INSIDE(c) (c)
#endif

enum { THREADS = 4, CALLS = 300 };

#ifdef COMPOSITE /* the time is its first variable, the inputs follow */
#define NO_EXCHANGE
#define REFERENCE(i)    ((fmi2ValueReference)(i) + 1)
#define IS_REAL(c, i)   (variables[i].type == REAL)
#define HASHED(c)       INSIDE(c)->memory.signals, sizeof INSIDE(c)->memory.signals
#define MAKE_GUID(guid) const char *const guid = GUID
#else
#define REFERENCE(i)  inputs[i]
#define IS_REAL(c, i) (INSIDE(c)->row_of[i]->type == TYPE_REAL)
#define HASHED(c)     &INSIDE(c)->model, VALUES * sizeof(double)
#define MAKE_GUID(guid)                                                                                                \
    char guid[GUID_LENGTH + 2];                                                                                        \
    write_guid(guid)
#endif

typedef struct {
    fmi2Type kind;
    unsigned seed;
    uint64_t hash; /* of all values after each step */
} Trial;

static double drawn(uint64_t *seed) /* -1 to 1 */
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(int64_t)(*seed >> 11) / (double)((int64_t)1 << 52) - 1.0;
}

/* A step: in model exchange one of Euler's method, with an event at its end. */
static void advance_instance(Instance *c, double h)
{
#ifndef NO_EXCHANGE
    if (KIND(INSIDE(c)) == fmi2ModelExchange) {
        fmi2Real states[ALL_STATES + 1], rates[ALL_STATES + 1], left[INDICATORS + 1];
        fmi2EventInfo info;
        fmi2NewDiscreteStates(c, &info);
        fmi2EnterContinuousTimeMode(c);
        fmi2GetContinuousStates(c, states, ALL_STATES);
        fmi2GetDerivatives(c, rates, ALL_STATES);
        for (int i = 0; i < ALL_STATES; i++)
            states[i] += h * rates[i];
        fmi2SetTime(c, INSIDE(c)->model.time + h);
        fmi2SetContinuousStates(c, states, ALL_STATES);
        fmi2GetEventIndicators(c, left, INDICATORS);
        fmi2EnterEventMode(c);
        return;
    }
#endif
    fmi2DoStep(c, NOW(INSIDE(c)), h, fmi2True);
}

static void *trial(void *given)
{
    static const fmi2CallbackFunctions callbacks = {0};
    Trial *const t = (Trial *)given;
    uint64_t seed = t->seed;
    MAKE_GUID(guid);
    Instance *const c = (Instance *)fmi2Instantiate("one", t->kind, guid, "", &callbacks, 0, 0);
    if (!c)
        abort();
    fmi2FMUstate state = NULL;
    t->hash = UINT64_C(14695981039346656037);
    fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    fmi2EnterInitializationMode(c);
    fmi2ExitInitializationMode(c);
    for (int k = 0; k < CALLS; k++) {
        for (int i = 0; i < INPUTS; i++) {
            const fmi2ValueReference reference = REFERENCE(i);
            const fmi2Real value = 1e-2 * drawn(&seed), slope = drawn(&seed);
            const fmi2Integer order = 1;
            if (!IS_REAL(c, reference))
                continue;
            fmi2SetReal(c, &reference, 1, &value);
            if (k % 2)
                fmi2SetRealInputDerivatives(c, &reference, 1, &order, &slope);
        }
        advance_instance(c, 1e-3);
        t->hash = mix(t->hash, HASHED(c));
        if (k == CALLS / 3)
            fmi2GetFMUstate(c, &state);
        if (k == 2 * CALLS / 3)
            fmi2SetFMUstate(c, state);
    }
    fmi2FreeFMUstate(c, &state);
    fmi2Terminate(c);
    fmi2FreeInstance(c);
    return NULL;
}

/* Return how many threads compute other values than alone. */
static int differences(fmi2Type kind)
{
    Trial alone[THREADS], together[THREADS];
    pthread_t threads[THREADS];
    for (unsigned k = 0; k < THREADS; k++) {
        alone[k].kind = together[k].kind = kind;
        alone[k].seed = together[k].seed = k + 1;
        trial(&alone[k]);
    }
    for (int k = 0; k < THREADS; k++)
        if (pthread_create(&threads[k], NULL, trial, &together[k]) != 0)
            abort();
    for (int k = 0; k < THREADS; k++)
        pthread_join(threads[k], NULL);
    int found = 0;
    for (int k = 0; k < THREADS; k++)
        found += alone[k].hash != together[k].hash;
    return found;
}

int main(void)
{
    int found = differences(fmi2CoSimulation);
#ifndef NO_EXCHANGE
    found += differences(fmi2ModelExchange);
#endif
    if (found)
        printf("%s: %d threads compute other values than alone\n", QUOTE(MODEL), found);
    return found != 0;
}
