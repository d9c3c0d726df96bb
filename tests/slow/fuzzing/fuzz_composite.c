/* libFuzzer target for composites: any sequence of calls with any values, and forged states with a correct checksum.

   No crash, no sanitizer report; a status that the standard has; a refused call changes nothing (a failed step but for
   the mode); what is handed out with fmi2OK is finite; a state that is taken bears any use. */

#include "fuzz.h"

enum { FUZZ_MOST = 4, FUZZ_BYTES = 1 << 16 };

typedef struct {
    size_t size;
    char bytes[FUZZ_BYTES];
} FuzzState;

typedef struct {
    fmi2ValueReference references[FUZZ_MOST];
    fmi2Real reals[FUZZ_MOST];
    fmi2Integer integers[FUZZ_MOST];
    size_t count;
} FuzzValues;

static FuzzValues fuzz_values(Fuzz *in, int type)
{
    FuzzValues v = {.count = fuzz_choice(in, FUZZ_MOST + 1)};
    for (size_t i = 0; i < v.count; i++) {
        for (int tries = 0; tries < 8; tries++) {
            v.references[i] = fuzz_choice(in, 256) % (VARIABLES + 1);
            if (v.references[i] < VARIABLES && variables[v.references[i]].type == type)
                break;
        }
        v.reals[i] = fuzz_number(in);
        v.integers[i] = (fmi2Integer)fmin(fmax(v.reals[i], -1e9), 1e9);
    }
    return v;
}

/* What comes out of a part is finite; an input may be what was set. */
static void fuzz_finite(const FuzzValues *v, const fmi2Real *results)
{
    for (size_t i = 0; i < v->count; i++)
        HOLDS(variables[v->references[i]].is_input || isfinite(results[i]), variables[v->references[i]].name);
}

static bool fuzz_forged; /* a forged state was set: what follows from it may be a state that no run reaches */

/* A state of a run that can be written can be read. */
static void fuzz_write(Instance *c, FuzzState *to)
{
    fmi2FMUstate state = NULL, read = NULL;
    HOLDS(fmi2GetFMUstate(c, &state) == fmi2OK, "a state cannot be had");
    HOLDS(fmi2SerializedFMUstateSize(c, state, &to->size) == fmi2OK && to->size <= sizeof to->bytes, "a size is wrong");
    HOLDS(fmi2SerializeFMUstate(c, state, to->bytes, to->size) == fmi2OK, "a state cannot be written");
    HOLDS(fmi2DeSerializeFMUstate(c, to->bytes, to->size, &read) == fmi2OK || fuzz_forged,
          "a state of a run is refused");
    fmi2FreeFMUstate(c, &state);
    fmi2FreeFMUstate(c, &read);
}

/* Write a number into the engine's memory, correct the checksum, and use the state. */
static void fuzz_forge(Fuzz *in, Instance *c)
{
    static FuzzState forged;
    fmi2FMUstate state = NULL;
    fuzz_write(c, &forged);
    for (unsigned k = fuzz_choice(in, 3); k < 3; k++) {
        const size_t place = ((size_t)fuzz_choice(in, 256) << 8 | fuzz_choice(in, 256)) % (sizeof(Memory) - 8);
        const double value = fuzz_number(in);
        const int64_t whole = (int64_t)fuzz_choice(in, 256) - 128;
        memcpy(forged.bytes + AFTER_CHECKSUM + place / 8 * 8, fuzz_choice(in, 2) ? (const void *)&value : &whole, 8);
    }
    const uint64_t checksum = checksum_of(forged.bytes, forged.size);
    memcpy(forged.bytes + offsetof(Saved, header.checksum), &checksum, sizeof checksum);
    const fmi2Status status = fmi2DeSerializeFMUstate(c, forged.bytes, forged.size, &state);
    HOLDS(status == fmi2OK || (status == fmi2Error && !state), "a refused state is handed out");
    if (state) {
        HOLDS(fmi2SetFMUstate(c, state) == fmi2OK, "a state that was read is refused");
        fuzz_forged = true;
    }
    fmi2FreeFMUstate(c, &state);
}

static fmi2Status fuzz_step(Fuzz *in, Instance *c)
{
    static const double steps[] = {1e-3, 5e-4, 1e-4, 7e-3, 0.02, 1e-9, 1e-3 / 3.0};
    const unsigned kind = fuzz_choice(in, 16);
    double h = kind < 7 ? steps[kind] : kind < 14 ? 1e-3 : fuzz_number(in);
    if (h > 0.1 && h < 1e6) /* legal work, but too much of it */
        h = 0.1;
    return fmi2DoStep(c, fuzz_choice(in, 16) ? NOW(c) : fuzz_number(in), h, fuzz_choice(in, 2));
}

static fmi2Status fuzz_exchange(Fuzz *in, Instance *c, bool sets)
{
    fmi2Real reals[FUZZ_MOST] = {0.0};
    fmi2Integer integers[FUZZ_MOST] = {0};
    const int kind = (int)fuzz_choice(in, 6), type = kind < 3 ? kind : REAL;
    const FuzzValues v = fuzz_values(in, type);
    if (type == INTEGER)
        return sets ? fmi2SetInteger(c, v.references, v.count, v.integers)
                    : fmi2GetInteger(c, v.references, v.count, integers);
    if (type == BOOLEAN)
        return sets ? fmi2SetBoolean(c, v.references, v.count, v.integers)
                    : fmi2GetBoolean(c, v.references, v.count, integers);
    const fmi2Status status =
        sets ? fmi2SetReal(c, v.references, v.count, v.reals) : fmi2GetReal(c, v.references, v.count, reals);
    if (status == fmi2OK && !sets)
        fuzz_finite(&v, reals);
    return status;
}

static fmi2Status fuzz_derivatives(Fuzz *in, Instance *c)
{
    static const fmi2Integer orders[FUZZ_MOST] = {1, 1, 1, 1};
    fmi2Real results[FUZZ_MOST] = {0.0};
    const unsigned kind = fuzz_choice(in, 3);
    const FuzzValues v = fuzz_values(in, REAL), knowns = fuzz_values(in, REAL);
    if (kind == 0)
        return fmi2SetRealInputDerivatives(c, v.references, v.count, orders, v.reals);
    const fmi2Status status = kind == 1 ? fmi2GetRealOutputDerivatives(c, v.references, v.count, orders, results)
                                        : fmi2GetDirectionalDerivative(c, v.references, v.count, knowns.references,
                                                                       knowns.count, knowns.reals, results);
    if (status == fmi2OK)
        fuzz_finite(&v, results);
    return status;
}

/* Compare two states but for the checksum and, after a failed step, the mode. */
static bool fuzz_unchanged(const FuzzState *a, FuzzState *b, bool but_for_mode)
{
    const size_t mode = AFTER_CHECKSUM + offsetof(Memory, mode);
    memcpy(b->bytes + offsetof(Saved, header.checksum), a->bytes + offsetof(Saved, header.checksum), sizeof(uint64_t));
    if (but_for_mode)
        memcpy(b->bytes + mode, a->bytes + mode, sizeof(int));
    return a->size == b->size && memcmp(a->bytes, b->bytes, a->size) == 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count)
{
    static FuzzState before, after;
    Fuzz in = {bytes, bytes + count};
    Instance *const c = fuzz_instance(fmi2CoSimulation);
    fmi2FMUstate state = NULL;
    fuzz_forged = false;
    if (fuzz_choice(&in, 4)) {
        fmi2EnterInitializationMode(c);
        fmi2ExitInitializationMode(c);
    }
    for (int calls = 0; calls < 32 && in.at < in.end; calls++) {
        fmi2Status status;
        const unsigned kind = fuzz_choice(&in, 16);
        fuzz_write(c, &before);
        switch (kind) {
        case 0: status = fmi2SetupExperiment(c, fuzz_choice(&in, 2), fuzz_number(&in), 0.0, 0, 0.0); break;
        case 1: status = fmi2EnterInitializationMode(c); break;
        case 2: status = fmi2ExitInitializationMode(c); break;
        case 3:
        case 4: status = fuzz_exchange(&in, c, true); break;
        case 5:
        case 6: status = fuzz_exchange(&in, c, false); break;
        case 7: status = fuzz_derivatives(&in, c); break;
        case 8: status = fmi2GetFMUstate(c, &state); break;
        case 9: status = state ? fmi2SetFMUstate(c, state) : fmi2OK; break;
        case 10: status = fuzz_choice(&in, 4) ? fmi2OK : fmi2Terminate(c); break;
        case 11: status = fuzz_choice(&in, 4) ? fmi2OK : fmi2Reset(c); break;
        case 12:
            fuzz_forge(&in, c);
            status = fmi2OK;
            break;
        default: status = fuzz_step(&in, c);
        }
        HOLDS(status == fmi2OK || status == fmi2Warning || status == fmi2Discard || status == fmi2Error,
              "a status that is never due");
        if (status >= fmi2Discard) {
            fuzz_write(c, &after);
            HOLDS(fuzz_unchanged(&before, &after, kind > 12 && status == fmi2Discard),
                  "a refused call changes something");
        }
    }
    fmi2FreeFMUstate(c, &state);
    fmi2FreeInstance(c);
    return 0;
}
