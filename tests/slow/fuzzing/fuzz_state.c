/* libFuzzer target: any bytes as a serialised state, in co-simulation and, where the block has it, in model exchange.

   The first byte decides: the bytes as they are, or laid over those of a good state whose header and checksum are
   made to fit again, so that what lies behind them is reached: values, position in the simulation, memory. A state
   that is taken must then bear any use. */

#include "fuzz.h"

#ifdef NO_EXCHANGE
static void fuzz_integrate(Instance *c) { (void)c; }
#else
/* A step of Euler's method, with an event at its end. */
static void fuzz_integrate(Instance *c)
{
    fmi2Real states[ALL_STATES + 1], rates[ALL_STATES + 1], left[INDICATORS + 1];
    fmi2EventInfo info;
    fmi2Boolean event, ends;
    bool known = fmi2GetContinuousStates(c, states, ALL_STATES) == fmi2OK;
    known = known && fmi2GetDerivatives(c, rates, ALL_STATES) == fmi2OK;
    for (int i = 0; known && i < ALL_STATES; i++) {
        HOLDS(isfinite(states[i]) && isfinite(rates[i]), "a state or its derivative is not finite");
        states[i] += 1e-3 * rates[i];
    }
    fmi2EnterContinuousTimeMode(c);
    fmi2SetTime(c, c->model.time + 1e-3);
    if (known)
        fmi2SetContinuousStates(c, states, ALL_STATES);
    if (fmi2GetEventIndicators(c, left, INDICATORS) == fmi2OK)
        HOLDS(all_finite(left, INDICATORS), "an event indicator is not finite");
    fmi2CompletedIntegratorStep(c, fmi2True, &event, &ends);
    fmi2EnterEventMode(c);
    fmi2NewDiscreteStates(c, &info);
}
#endif

static void fuzz_advance(Instance *c)
{
    if (KIND(c) == fmi2ModelExchange)
        fuzz_integrate(c);
    else
        fmi2DoStep(c, c->model.time, 1e-3, fmi2True);
}

static void fuzz_use(Instance *c)
{
    fmi2EnterInitializationMode(c);
    fmi2ExitInitializationMode(c);
    for (int k = 0; k < 4; k++) {
        fuzz_advance(c);
        for (size_t i = 0; i < ROWS; i++) {
            const fmi2ValueReference reference = rows[i].index;
            const fmi2Integer order = 1;
            fmi2Real value = 0.0;
            if (rows[i].type != TYPE_REAL || rows[i].role == ROLE_INPUT)
                continue;
            if (fmi2GetReal(c, &reference, 1, &value) == fmi2OK)
                HOLDS(isfinite(value), rows[i].name);
            if (fmi2GetRealOutputDerivatives(c, &reference, 1, &order, &value) == fmi2OK)
                HOLDS(isfinite(value), rows[i].name);
        }
    }
}

/* A place in the model: anywhere before the memory, anywhere in it, or where its counters stand, at either end. */
static size_t fuzz_place(Fuzz *in)
{
    enum { FUZZ_NEAR = 96 };
    const size_t memory = offsetof(Model, memory), size = sizeof(Memory), near = size < FUZZ_NEAR ? size : FUZZ_NEAR;
    const size_t near_end = memory + size - near;
    const unsigned kind = fuzz_choice(in, 4);
    size_t place = (size_t)fuzz_choice(in, 256) << 8;
    place |= fuzz_choice(in, 256);
    return kind == 0   ? place % memory
           : kind == 1 ? memory + place % size
           : kind == 2 ? memory + place % near
                       : near_end + place % near;
}

/* Writes a whole number, a flag or a number of any kind, each where one may stand, or plain bytes. */
static void fuzz_forge(Fuzz *in, Model *model)
{
    static const int32_t whole[] = {-1, 0, 1, 2, 64, 65, 1023, 1024, 1025, 4096, 4097, INT32_MAX, INT32_MIN};
    enum { FUZZ_WHOLE = sizeof whole / sizeof whole[0] };
    const size_t place = fuzz_place(in);
    char bytes[16];
    size_t length = sizeof(double), grain = sizeof(double);
    const unsigned kind = fuzz_choice(in, 4);
    if (kind == 0) {
        const double value = fuzz_choice(in, 2) ? whole[fuzz_choice(in, FUZZ_WHOLE)] : fuzz_number(in);
        memcpy(bytes, &value, sizeof value);
    } else if (kind == 1) {
        length = grain = sizeof whole[0];
        memcpy(bytes, &whole[fuzz_choice(in, FUZZ_WHOLE)], sizeof whole[0]);
    } else {
        length = kind == 2 ? 1 : fuzz_choice(in, sizeof bytes) + 1;
        grain = 1;
        for (size_t i = 0; i < length; i++)
            bytes[i] = (char)fuzz_choice(in, 256);
    }
    const size_t begin = place - place % grain, room = STATE_SIZE - begin;
    memcpy((char *)model + begin, bytes, length < room ? length : room);
}

/* Serialises a state of this very run, in any mode, after motions to and fro: it must be taken again. */
static void fuzz_good_state(Fuzz *in, Instance *c, Saved *bytes)
{
    fmi2FMUstate state = NULL, read = NULL;
    const unsigned steps = fuzz_choice(in, 40);
    if (steps > 0)
        fmi2EnterInitializationMode(c);
    if (steps > 1)
        fmi2ExitInitializationMode(c);
    for (unsigned k = 2; k < steps; k++) {
        for (int i = 0; i < INPUTS; i++) {
            const fmi2Real value = 5e-3 * sin(0.1 * k * (k + 7.0 * i));
            fmi2SetReal(c, &inputs[i], 1, &value);
        }
        fuzz_advance(c);
    }
    HOLDS(fmi2GetFMUstate(c, &state) == fmi2OK, "a state cannot be had");
    HOLDS(fmi2SerializeFMUstate(c, state, (fmi2Byte *)bytes, SAVED_SIZE) == fmi2OK, "a state cannot be written");
    HOLDS(fmi2DeSerializeFMUstate(c, (const fmi2Byte *)bytes, SAVED_SIZE, &read) == fmi2OK,
          "a state of this run is refused");
    fmi2FreeFMUstate(c, &state);
    fmi2FreeFMUstate(c, &read);
}

static void fuzz_state(fmi2Type kind, const uint8_t *bytes, size_t count)
{
    static Saved bent;
    static Model before;
    Instance *const c = fuzz_instance(kind);
    fmi2FMUstate state = NULL;
    const char *data = (const char *)bytes;
    size_t size = count;
    if (count && bytes[0] % 2) {
        Fuzz in = {bytes + 1, bytes + count};
        fuzz_good_state(&in, c, &bent);
        for (unsigned k = fuzz_choice(&in, 3); k < 3; k++) /* few, as each may be what is refused */
            fuzz_forge(&in, &bent.model);
        bent.header.checksum = checksum_of(&bent);
        data = (const char *)&bent;
        size = SAVED_SIZE;
    }
    memcpy(&before, &c->model, sizeof before);
    const fmi2Status status = fmi2DeSerializeFMUstate(c, data, size, &state);
    HOLDS(status == fmi2OK || (status == fmi2Error && !state), "a refused state is handed out");
    HOLDS(memcmp(&before, &c->model, sizeof before) == 0, "reading a state changes the instance");
    if (state) {
        HOLDS(fmi2SetFMUstate(c, state) == fmi2OK, "a state that was read is refused");
        fuzz_use(c);
        fmi2FreeFMUstate(c, &state);
    }
    fmi2FreeInstance(c);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count)
{
    for (size_t k = 0; k < FUZZ_KIND_COUNT; k++)
        fuzz_state(fuzz_kinds[k], bytes, count);
    return 0;
}
