/* libFuzzer target: any bytes as a serialised state.

   The first byte decides: the bytes as they are, or laid over those of a good state whose header and checksum are
   made to fit again, so that what lies behind them is reached, but for what the block remembers: that has the checksum
   only. A state that is taken must then bear any use. */

#include "fuzz.h"

static void fuzz_use(Instance *c)
{
    double t = c->model.time;
    fmi2EnterInitializationMode(c);
    fmi2ExitInitializationMode(c);
    for (int k = 0; k < 4; k++) {
        fmi2DoStep(c, t, 1e-3, fmi2True);
        t = c->model.time;
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

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count)
{
    static Saved bent;
    static Model before;
    Instance *const c = fuzz_instance();
    fmi2FMUstate state = NULL;
    const char *data = (const char *)bytes;
    size_t size = count;
    if (count && bytes[0] % 2) {
        fmi2EnterInitializationMode(c);
        fmi2ExitInitializationMode(c);
        fmi2DoStep(c, 0.0, 1e-3, fmi2True);
        save(c, &bent);
        /* pieces of an input: place, length, new bytes */
        for (const uint8_t *at = bytes + 1, *const end = bytes + count; end - at > 3;) {
            const size_t place = ((size_t)at[0] << 16 | (size_t)at[1] << 8 | at[2]) % offsetof(Model, memory);
            size_t length = (size_t)at[3] % 16 + 1;
            at += 4;
            length = length < (size_t)(end - at) ? length : (size_t)(end - at);
            length = length < offsetof(Model, memory) - place ? length : offsetof(Model, memory) - place;
            memcpy((char *)&bent.model + place, at, length);
            at += length;
        }
        bent.checksum = checksum_of(&bent);
        data = (const char *)&bent;
        size = sizeof bent;
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
    return 0;
}
