/* Saved states: the mode of FMI 3.0, and the state of FMI 2.0. */

#ifndef FMI3_STATE_H
#define FMI3_STATE_H

static const char magic_3[MAGIC_SIZE] = "shell 3";
static const char token_3[GUID_SIZE] = TOKEN;

typedef struct {
    SavedHeader header; /* with the checksum of what follows and of the bytes of `inside` */
    int32_t mode, exchange, events, ticking;
    fmi2FMUstate inside;
} Saved3;

enum { STORED_3 = offsetof(Saved3, inside), CHECKED_3 = offsetof(Saved3, mode) };

/* The mode of the instance inside, in its saved state. */
#ifdef COMPOSITE_H
#define MODE_IN(state) (((const Saved *)(state))->memory.mode)
#else
#define MODE_IN(state) (((const Saved *)(state))->model.run.mode)
#endif

/* Return the mode of FMI 2.0 in which the instance inside is, in a mode of FMI 3.0; several may apply. */
static int modes_inside(int mode, bool exchange)
{
    switch (mode) {
    case NEW_3:
    case CONFIGURATION_3: return INSTANTIATED;
    case INITIALIZATION_3: return INITIALIZING;
    case EVENTS_3: return exchange ? EVENT_MODE : STEP_COMPLETE | STEP_FAILED;
    case STEPS_3: return exchange ? 0 : STEP_COMPLETE | STEP_FAILED;
    case CONTINUOUS_3: return exchange ? CONTINUOUS_TIME : 0;
    default: return mode == TERMINATED_3 ? TERMINATED : 0;
    }
}

static const char *fault_of_3(const Shell *c, const Saved3 *saved)
{
    const char *const fault = fault_of_header(&saved->header, magic_3, token_3, sizeof(Saved3));
    if (fault)
        return fault;
    if ((saved->exchange != 0) != (KIND(c->inside) == fmi2ModelExchange))
        return OTHER_KIND;
    if ((saved->events != 0) != c->events)
        return "it was saved with another value of eventModeUsed";
    return NULL;
}

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    ENTER_3("GetFMUState", ANY_3)
    REQUIRE_3(state, "was called with a null pointer")
    Saved3 *const saved = *state ? (Saved3 *)*state : (Saved3 *)calloc(1, sizeof(Saved3));
    REQUIRE_3(saved, "has no memory")
    const fmi2Status status = fmi2GetFMUstate(c->inside, &saved->inside);
    if (status > fmi2Warning) {
        if (!*state)
            free(saved);
        return (fmi3Status)status;
    }
    if (!*state)
        write_header(&saved->header, magic_3, token_3, sizeof(Saved3));
    saved->mode = c->mode;
    saved->exchange = KIND(c->inside) == fmi2ModelExchange;
    saved->events = c->events;
    saved->ticking = c->ticking;
    *state = saved;
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state)
{
    ENTER_3("SetFMUState", ANY_3)
    REQUIRE_3(state, "was called with a null pointer")
    const Saved3 *const saved = (const Saved3 *)state;
    const char *const fault = fault_of_3(c, saved);
    REQUIRE_3(!fault, "cannot use the state: %s", fault)
    const fmi2Status status = fmi2SetFMUstate(c->inside, saved->inside);
    if (status > fmi2Warning)
        return (fmi3Status)status;
    c->mode = saved->mode;
    c->ticking = saved->ticking != 0;
    c->told = false;
    return fmi3OK;
}

static void free_state_3(Shell *c, Saved3 *saved)
{
    if (saved)
        (void)fmi2FreeFMUstate(c->inside, &saved->inside);
    free(saved);
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    ENTER_3("FreeFMUState", ANY_3)
    if (state) {
        free_state_3(c, (Saved3 *)*state);
        *state = NULL;
    }
    return fmi3OK;
}

/* Return the size of a serialized state; 0 after a message. */
static size_t serialized_size_3(Shell *c, const Saved3 *saved)
{
    size_t size = 0;
    return fmi2SerializedFMUstateSize(c->inside, saved->inside, &size) > fmi2Warning ? 0 : STORED_3 + size;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size)
{
    ENTER_3("SerializedFMUStateSize", ANY_3)
    REQUIRE_3(state && size, "was called with a null pointer")
    const size_t needed = serialized_size_3(c, (const Saved3 *)state);
    if (needed == 0)
        return fmi3Error;
    *size = needed;
    return fmi3OK;
}

/* Return the checksum of serialized bytes. */
static uint64_t checksum_of_3(const fmi3Byte *bytes, size_t size)
{
    return checksum_of_bytes(bytes + CHECKED_3, size - CHECKED_3);
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    ENTER_3("SerializeFMUState", ANY_3)
    REQUIRE_3(state && bytes, "was called with a null pointer")
    const Saved3 *const saved = (const Saved3 *)state;
    const size_t needed = serialized_size_3(c, saved);
    if (needed == 0)
        return fmi3Error;
    REQUIRE_3(size >= needed, "was called with %u bytes, too few for a state of %u", (unsigned)size, (unsigned)needed)
    const fmi2Status status =
        fmi2SerializeFMUstate(c->inside, saved->inside, (fmi2Byte *)bytes + STORED_3, needed - STORED_3);
    if (status > fmi2Warning)
        return (fmi3Status)status;
    memcpy(bytes, saved, STORED_3);
    const uint64_t checksum = checksum_of_3(bytes, needed);
    memcpy(bytes + offsetof(Saved3, header.checksum), &checksum, sizeof checksum);
    return fmi3OK;
}

/* Return whether a run can reach this state. */
static bool plausible_3(const Saved3 *saved)
{
    const int modes = modes_inside(saved->mode, saved->exchange != 0);
    const bool ticks = saved->ticking == 0 || (saved->ticking == 1 && HAS_EVENT_MODE && saved->mode == EVENTS_3);
    const bool events = saved->exchange != 0 || saved->events != 0 || saved->mode != EVENTS_3;
    return ticks && events && (saved->events == 0 || saved->events == 1) &&
           (saved->exchange == 0 || saved->exchange == 1) && (MODE_IN(saved->inside) & modes) != 0;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    ENTER_3("DeserializeFMUState", ANY_3)
    REQUIRE_3(bytes && state, "was called with a null pointer")
    REQUIRE_3(size >= STORED_3, "was called with %u bytes, too few for a state", (unsigned)size)
    Saved3 *const read = (Saved3 *)calloc(1, sizeof(Saved3));
    REQUIRE_3(read, "has no memory")
    memcpy(read, bytes, STORED_3);
    const char *fault = fault_of_3(c, read);
    if (!fault && read->header.checksum != checksum_of_3(bytes, size))
        fault = "they are damaged";
    fmi2Status status = fmi2Error;
    if (!fault)
        status = fmi2DeSerializeFMUstate(c->inside, (const fmi2Byte *)bytes + STORED_3, size - STORED_3, &read->inside);
    if (status <= fmi2Warning && !plausible_3(read))
        fault = "no run can reach such values";
    if (fault || status > fmi2Warning) {
        free_state_3(c, read);
        return fault ? fail_3(c, "cannot use the bytes: %s", fault) : (fmi3Status)status;
    }
    *state = read;
    return fmi3OK;
}

#endif
