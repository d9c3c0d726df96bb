/* libFuzzer target: any sequence of calls with any values, in co-simulation and, where the block has it, in model
   exchange.

   No crash, no sanitizer report; a status that the standard has; a refused call changes nothing (a failed step but
   for the mode); what is handed out with fmi2OK is finite. */

#include "fuzz.h"

enum { FUZZ_MOST = 4 };

typedef struct {
    fmi2ValueReference references[FUZZ_MOST];
    fmi2Real reals[FUZZ_MOST];
    fmi2Integer integers[FUZZ_MOST];
    size_t count;
} FuzzValues;

/* A value reference: of any row, or none. */
static fmi2ValueReference fuzz_reference(Fuzz *in)
{
    const unsigned k = fuzz_choice(in, 255);
    if (k == 254)
        return (fmi2ValueReference)VALUES + fuzz_choice(in, 256);
    const Row *const row = &rows[k % ROWS];
    return row->index + (row->length ? fuzz_choice(in, 256) % row->length : 0);
}

/* References of one type mostly, as a call with a foreign one is refused whole. */
static FuzzValues fuzz_values(Fuzz *in, const Instance *c, int type)
{
    FuzzValues v = {.count = fuzz_choice(in, FUZZ_MOST + 1)};
    for (size_t i = 0; i < v.count; i++) {
        for (int tries = 0; tries < 8; tries++) {
            v.references[i] = fuzz_reference(in);
            if (v.references[i] < VALUES && INSIDE(c)->row_of[v.references[i]]->type == type)
                break;
        }
        const double value = fuzz_number(in);
        const Row *const row = v.references[i] < VALUES ? INSIDE(c)->row_of[v.references[i]] : &rows[0];
        const double start = row->starts ? row->starts[v.references[i] - row->index] : row->start;
        v.reals[i] = fuzz_choice(in, 2) && row->role != ROLE_INPUT ? start * (1.0 + 0.1 * value) : value;
        const double whole = value * (fuzz_choice(in, 2) ? start : 1.0);
        v.integers[i] = (fmi2Integer)(whole > -COUNTS && whole < COUNTS ? whole : COUNTS);
    }
    return v;
}

static bool fuzz_unchanged(const Model *a, const Model *b, bool but_for_mode)
{
    static Model copy;
    memcpy(&copy, a, sizeof copy);
    if (but_for_mode)
        copy.run.mode = b->run.mode;
    return memcmp(&copy, b, STATE_SIZE) == 0; /* a cache may be another */
}

static void fuzz_finite(const Instance *c, const FuzzValues *v, const fmi2Real *results)
{
    for (size_t i = 0; i < v->count; i++) {
#ifdef GUARDED
        if (INSIDE(c)->row_of[v->references[i]]->role == ROLE_INPUT)
            continue;
#endif
        HOLDS(isfinite(results[i]), INSIDE(c)->row_of[v->references[i]]->name);
    }
}

static fmi2Status call_get(Fuzz *in, Instance *c)
{
    fmi2Real reals[FUZZ_MOST] = {0.0};
    fmi2Integer integers[FUZZ_MOST] = {0};
    const int type = (int)fuzz_choice(in, 3);
    const FuzzValues v = fuzz_values(in, c, type);
    if (type == TYPE_INTEGER)
        return fmi2GetInteger(c, v.references, v.count, integers);
    if (type == TYPE_BOOLEAN)
        return fmi2GetBoolean(c, v.references, v.count, integers);
    const fmi2Status status = fmi2GetReal(c, v.references, v.count, reals);
    if (status == fmi2OK)
        fuzz_finite(c, &v, reals);
    return status;
}

static fmi2Status call_set(Fuzz *in, Instance *c)
{
    const int type = (int)fuzz_choice(in, 6);
    const FuzzValues v = fuzz_values(in, c, type < 3 ? type : TYPE_REAL);
    if (type == TYPE_INTEGER)
        return fmi2SetInteger(c, v.references, v.count, v.integers);
    if (type == TYPE_BOOLEAN)
        return fmi2SetBoolean(c, v.references, v.count, v.integers);
    return fmi2SetReal(c, v.references, v.count, v.reals);
}

static fmi2Status call_slopes(Fuzz *in, Instance *c)
{
    const FuzzValues v = fuzz_values(in, c, TYPE_REAL);
    fmi2Integer orders[FUZZ_MOST];
    for (size_t i = 0; i < FUZZ_MOST; i++)
        orders[i] = fuzz_choice(in, 32) ? 1 : v.integers[i];
    return fmi2SetRealInputDerivatives(c, v.references, v.count, orders, v.reals);
}

static fmi2Status call_rates(Fuzz *in, Instance *c)
{
    const FuzzValues v = fuzz_values(in, c, TYPE_REAL);
    const fmi2Integer orders[FUZZ_MOST] = {1, 1, 1, fuzz_choice(in, 2) ? 1 : 2};
    fmi2Real results[FUZZ_MOST] = {0.0};
    const fmi2Status status = fmi2GetRealOutputDerivatives(c, v.references, v.count, orders, results);
    if (status == fmi2OK)
        fuzz_finite(c, &v, results);
    return status;
}

static fmi2Status call_along(Fuzz *in, Instance *c)
{
    const FuzzValues unknowns = fuzz_values(in, c, TYPE_REAL), knowns = fuzz_values(in, c, TYPE_REAL);
    fmi2Real results[FUZZ_MOST] = {0.0};
    const fmi2Status status = fmi2GetDirectionalDerivative(c, unknowns.references, unknowns.count, knowns.references,
                                                           knowns.count, knowns.reals, results);
    if (status == fmi2OK)
        fuzz_finite(c, &unknowns, results);
    return status;
}

static fmi2Status call_step(Fuzz *in, Instance *c)
{
    static const double steps[] = {1e-3, 1e-2, 1e-4, 0.1, 1.0, 1e-9, 1e-3 / 3.0};
    const unsigned kind = fuzz_choice(in, 16);
    const double h = kind < 7 ? steps[kind] : kind < 14 ? 1e-3 : fuzz_number(in);
    const double t = fuzz_choice(in, 16) ? INSIDE(c)->model.time : fuzz_number(in);
    return fmi2DoStep(c, t, h, fuzz_choice(in, 2));
}

static fmi2Status call_setup(Fuzz *in, Instance *c)
{
    const fmi2Boolean tolerance = fuzz_choice(in, 4) == 1, stop = fuzz_choice(in, 4) == 1;
    return fmi2SetupExperiment(c, tolerance, fuzz_number(in), fuzz_choice(in, 4) ? 0.0 : fuzz_number(in), stop,
                               fuzz_number(in));
}

#ifdef FMI_3
static fmi2Status call_status_of(Fuzz *in, Instance *c) { return call_get(in, c); }
static fmi2Status call_cancel(Fuzz *in, Instance *c) { return call_get(in, c); }
#else
static fmi2Status call_cancel(Fuzz *in, Instance *c)
{
    (void)in;
    return fmi2CancelStep(c);
}

static fmi2Status call_status_of(Fuzz *in, Instance *c)
{
    const fmi2StatusKind kind = (fmi2StatusKind)fuzz_choice(in, 4);
    fmi2Status status;
    fmi2Integer whole;
    fmi2Real value;
    fmi2String text;
    switch (fuzz_choice(in, 5)) {
    case 0: return fmi2GetStatus(c, kind, &status);
    case 1: return fmi2GetRealStatus(c, kind, &value);
    case 2: return fmi2GetIntegerStatus(c, kind, &whole);
    case 3: return fmi2GetBooleanStatus(c, kind, &whole);
    default: return fmi2GetStringStatus(c, kind, &text);
    }
}
#endif

static fmi2Status call_rare(Fuzz *in, Instance *c)
{
    static const fmi2String names[] = {"logAll", "logEvents", "nothing"};
    const fmi2ValueReference first = 0;
    fmi2String text = "";
    switch (fuzz_choice(in, 12)) {
    case 0: return call_cancel(in, c);
    case 1: return fmi2SetDebugLogging(c, fuzz_choice(in, 2), fuzz_choice(in, 3), &names[fuzz_choice(in, 2)]);
    case 2: return fmi2GetString(c, &first, fuzz_choice(in, 2), &text);
    case 3: return fmi2SetString(c, &first, fuzz_choice(in, 2), &text);
    case 4: return fmi2GetReal(c, NULL, fuzz_choice(in, 2), NULL);
    case 5: return fmi2SetReal(c, NULL, fuzz_choice(in, 2), NULL);
    case 6: return fmi2GetFMUstate(c, NULL);
    case 7: return fmi2SetFMUstate(c, NULL);
    case 8: return fmi2Terminate(c);
    case 9: return fmi2Reset(c);
    case 10: return fmi2SetRealInputDerivatives(c, NULL, fuzz_choice(in, 2), NULL, NULL);
    default: return fmi2GetDirectionalDerivative(c, NULL, fuzz_choice(in, 2), NULL, fuzz_choice(in, 2), NULL, NULL);
    }
}

#ifdef NO_EXCHANGE
static fmi2Status call_exchange(Fuzz *in, Instance *c) { return call_step(in, c); }
#else
static void fuzz_finite_vector(const fmi2Real *values, size_t count, fmi2Status status)
{
    for (size_t i = 0; i < count; i++)
        HOLDS(status == fmi2OK ? (bool)isfinite(values[i]) : values[i] == 7.0, "a vector that is not right");
}

/* The next time of a solver: a little later mostly. */
static fmi2Status call_set_time(Fuzz *in, Instance *c)
{
    static const double steps[] = {1e-3, 1e-2, 1e-4, 0.1, 1.0, 0.0, -1e-3, 1e-3 / 3.0};
    const unsigned kind = fuzz_choice(in, 12);
    return fmi2SetTime(c, kind < 8    ? INSIDE(c)->model.time + steps[kind]
                          : kind < 11 ? INSIDE(c)->model.time
                                      : fuzz_number(in));
}

static fmi2Status call_set_states(Fuzz *in, Instance *c)
{
    fmi2Real states[ALL_STATES + 2] = {0.0};
    const size_t wrong = fuzz_choice(in, 32) == 1;
    const unsigned sizes = fuzz_choice(in, 4);
    for (int i = 0; i < ALL_STATES; i++)
        states[i] = sizes ? ldexp(1e-5 * fuzz_number(in), (int)sizes) : fuzz_number(in);
    return fmi2SetContinuousStates(c, states, ALL_STATES + wrong);
}

static fmi2Status call_vector(Fuzz *in, Instance *c)
{
    enum { FUZZ_LENGTH = (ALL_STATES > INDICATORS ? ALL_STATES : INDICATORS) + 2 };
    fmi2Real values[FUZZ_LENGTH];
    for (size_t i = 0; i < FUZZ_LENGTH; i++)
        values[i] = 7.0;
    const size_t wrong = fuzz_choice(in, 32) == 1;
    fmi2Status status;
    size_t count = ALL_STATES;
    switch (fuzz_choice(in, 5)) {
    case 0: status = fmi2GetContinuousStates(c, values, count + wrong); break;
    case 1: status = fmi2GetNominalsOfContinuousStates(c, values, count + wrong); break;
    case 2:
    case 3: status = fmi2GetDerivatives(c, values, count + wrong); break;
    default: count = INDICATORS; status = fmi2GetEventIndicators(c, values, count + wrong);
    }
    fuzz_finite_vector(values, count, status);
    return status;
}

static fmi2Status call_event(Instance *c)
{
    fmi2EventInfo info = {.nextEventTime = 7.0};
    const fmi2Status status = fmi2NewDiscreteStates(c, &info);
    HOLDS(isfinite(info.nextEventTime), "the time of the next event is not finite");
    HOLDS(status < fmi2Discard || info.nextEventTime == 7.0, "a refused call writes");
    return status;
}

static fmi2Status call_exchange(Fuzz *in, Instance *c)
{
    fmi2Boolean event = fmi2False, ends = fmi2False;
    switch (fuzz_choice(in, 16)) {
    case 0: return fmi2EnterEventMode(c);
    case 1:
    case 2: return call_event(c);
    case 3:
    case 4: return fmi2EnterContinuousTimeMode(c);
    case 5: return fmi2CompletedIntegratorStep(c, fmi2True, &event, fuzz_choice(in, 8) ? &ends : NULL);
    case 6:
    case 7:
    case 8: return call_set_time(in, c);
    case 9:
    case 10:
    case 11: return call_set_states(in, c);
    case 12: return fuzz_choice(in, 8) ? call_step(in, c) : fmi2NewDiscreteStates(c, NULL);
    default: return call_vector(in, c);
    }
}
#endif

/* What can be written can be read. */
static void fuzz_written_state(Instance *c, fmi2FMUstate state)
{
    static fmi2Byte bytes[sizeof(Saved) + 1000];
    size_t size = 0;
    fmi2FMUstate read = NULL;
    HOLDS(fmi2SerializedFMUstateSize(c, state, &size) == fmi2OK && size <= sizeof bytes, "a state has no size");
    HOLDS(fmi2SerializeFMUstate(c, state, bytes, size) == fmi2OK, "a state cannot be written");
    HOLDS(fmi2DeSerializeFMUstate(c, bytes, size, &read) == fmi2OK, "a state of a run is refused");
    fmi2FreeFMUstate(c, &read);
}

static void fuzz_calls(fmi2Type kind, const uint8_t *bytes, size_t count)
{
    static Model before;
    Fuzz in = {bytes, bytes + count};
    Instance *c = fuzz_instance(kind);
    const bool exchange = kind == fmi2ModelExchange;
    fmi2FMUstate state = NULL;
    if (fuzz_choice(&in, 2)) {
        fmi2EnterInitializationMode(c);
        if (fuzz_choice(&in, 2))
            fmi2ExitInitializationMode(c);
    }
    for (int calls = 0; calls < 64 && in.at < in.end; calls++) {
        fmi2Status status;
        bool stepped = false;
        const unsigned call = fuzz_choice(&in, 16);
        memcpy(&before, &INSIDE(c)->model, sizeof before);
        switch (call) {
        case 0: status = call_setup(&in, c); break;
        case 1: status = fmi2EnterInitializationMode(c); break;
        case 2: status = fmi2ExitInitializationMode(c); break;
        case 3:
        case 4:
        case 5: status = call_set(&in, c); break;
        case 6:
        case 7: status = call_get(&in, c); break;
        case 8: status = exchange ? call_exchange(&in, c) : call_slopes(&in, c); break;
        case 9: status = call_rates(&in, c); break;
        case 10: status = call_along(&in, c); break;
        case 11:
            status = fmi2GetFMUstate(c, &state);
            fuzz_written_state(c, state);
            break;
        case 12: status = state ? fmi2SetFMUstate(c, state) : call_status_of(&in, c); break;
        case 13: status = call_rare(&in, c); break;
        default: status = exchange ? call_exchange(&in, c) : call_step(&in, c); stepped = !exchange;
        }
        HOLDS(status == fmi2OK || status == fmi2Warning || status == fmi2Discard || status == fmi2Error,
              "a status that is never due");
        if (status >= fmi2Discard)
            HOLDS(fuzz_unchanged(&before, &INSIDE(c)->model, stepped && status == fmi2Discard),
                  "a refused call changes something");
    }
    fmi2FreeFMUstate(c, &state);
    fmi2FreeInstance(c);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count)
{
    for (size_t k = 0; k < FUZZ_KIND_COUNT; k++)
        fuzz_calls(fuzz_kinds[k], bytes, count);
    return 0;
}
