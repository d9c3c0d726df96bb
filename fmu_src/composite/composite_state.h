/* Saved states: the memory of the engine and the states of all parts. */

#ifndef COMPOSITE_STATE_H
#define COMPOSITE_STATE_H

#include "fmi2_saved.h"

static const char magic_text[MAGIC_SIZE] = "compose";
static const char guid_text[GUID_SIZE] = GUID;

typedef struct {
    SavedHeader header; /* with the checksum of everything that follows */
    Memory memory;
    void *parts[2 * PARTS]; /* states of the parts, and those at the start of a tick that is divided */
} Saved;

/* Return whether the state of a part is saved at this place. */
static bool is_saved(const Memory *m, int64_t i)
{
    return i < PARTS ? is_fmu(i) : m->inside && moves_inside(i - PARTS);
}

/* A serialized state: these bytes, then the size and the bytes of each part's state. */
enum { SAVED_SIZE = offsetof(Saved, parts), AFTER_CHECKSUM = offsetof(Saved, memory) };

static uint64_t checksum_of(const char *bytes, size_t size)
{
    return checksum_of_bytes(bytes + AFTER_CHECKSUM, size - AFTER_CHECKSUM);
}

static const char *fault_of(const Instance *c, const Saved *saved)
{
    const char *const fault = fault_of_header(&saved->header, magic_text, guid_text, sizeof(Saved));
    return !fault && saved->memory.exchange != c->memory.exchange ? OTHER_KIND : fault;
}

static void free_saved(Instance *c, Saved *saved)
{
    for (int64_t i = 0; saved && i < 2 * PARTS; i++)
        if (saved->parts[i])
            part_data[i % PARTS].functions->free_state(c->parts[i % PARTS].component, &saved->parts[i]);
    free(saved);
}

/* Copy a state of a part that is in the state `now`. */
static bool copied(Instance *c, int64_t part, void *from, void **to, void *now)
{
    EnginePart *const p = &c->parts[part];
    return p->set_state(p->component, from) <= 1 && p->get_state(p->component, to) <= 1 &&
           p->set_state(p->component, now) <= 1;
}

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    ENTER("GetFMUstate", MAY_FMUstate)
    REQUIRE(state, "fmi2GetFMUstate: the pointer to the state is null")
    if (!*state)
        *state = calloc(1, sizeof(Saved));
    Saved *const saved = (Saved *)*state;
    REQUIRE(saved, "fmi2GetFMUstate: out of memory")
    write_header(&saved->header, magic_text, guid_text, sizeof(Saved));
    memcpy(&saved->memory, &c->memory, sizeof c->memory);
    for (int64_t i = 0; i < PARTS; i++)
        REQUIRE(!is_fmu(i) || c->parts[i].get_state(c->parts[i].component, &saved->parts[i]) <= 1,
                "fmi2GetFMUstate: %s cannot save its state: %s", part_data[i].name, c->said)
    for (int64_t i = 0; i < PARTS; i++)
        REQUIRE(!is_saved(&c->memory, PARTS + i) ||
                    copied(c, i, c->ticks[c->memory.side][i], &saved->parts[PARTS + i], saved->parts[i]),
                "fmi2GetFMUstate: %s cannot save its state: %s", part_data[i].name, c->said)
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state)
{
    ENTER("SetFMUstate", MAY_FMUstate)
    REQUIRE(state, "fmi2SetFMUstate: the state is a null pointer")
    const Saved *const saved = (const Saved *)state;
    const char *const fault = fault_of(c, saved);
    REQUIRE(!fault, "fmi2SetFMUstate: the state cannot be used: %s", fault)
    for (int64_t i = 0; i < PARTS; i++) {
        const bool divided = is_saved(&saved->memory, PARTS + i);
        REQUIRE(!divided || copied(c, i, saved->parts[PARTS + i], &c->ticks[saved->memory.side][i], saved->parts[i]),
                "fmi2SetFMUstate: %s rejects its state: %s", part_data[i].name, c->said)
        REQUIRE(divided || !is_fmu(i) || c->parts[i].set_state(c->parts[i].component, saved->parts[i]) <= 1,
                "fmi2SetFMUstate: %s rejects its state: %s", part_data[i].name, c->said)
    }
    c->memory = saved->memory;
    c->refreshed = false;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    ENTER("FreeFMUstate", MAY_FMUstate)
    if (state) {
        free_saved(c, (Saved *)*state);
        *state = NULL;
    }
    return fmi2OK;
}

/* Return the number of bytes of a serialized state; 0 if a part cannot tell. */
static size_t serialized_size(Instance *c, const Saved *saved)
{
    size_t size = SAVED_SIZE;
    for (int64_t i = 0; i < 2 * PARTS; i++) {
        size_t inner = 0;
        if (!is_saved(&saved->memory, i))
            continue;
        if (part_data[i % PARTS].functions->size_of_state(c->parts[i % PARTS].component, saved->parts[i], &inner) >
            fmi2Warning)
            return 0;
        size += sizeof(uint64_t) + inner;
    }
    return size;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate state, size_t *size)
{
    ENTER("SerializedFMUstateSize", MAY_FMUstate)
    REQUIRE(state && size, "fmi2SerializedFMUstateSize: a pointer is null")
    *size = serialized_size(c, (const Saved *)state);
    REQUIRE(*size > 0, "fmi2SerializedFMUstateSize: a part cannot serialize its state: %s", c->said)
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    ENTER("SerializeFMUstate", MAY_FMUstate)
    REQUIRE(state && bytes, "fmi2SerializeFMUstate: a pointer is null")
    const Saved *const saved = (const Saved *)state;
    const size_t needed = serialized_size(c, saved);
    REQUIRE(needed > 0 && size >= needed, "fmi2SerializeFMUstate: %u bytes are too few for a state with %u bytes",
            (unsigned)size, (unsigned)needed)
    memcpy(bytes, saved, SAVED_SIZE);
    size_t end = SAVED_SIZE;
    for (int64_t i = 0; i < 2 * PARTS; i++) {
        if (!is_saved(&saved->memory, i))
            continue;
        const char *const name = part_data[i % PARTS].name;
        const PartFunctions *const f = part_data[i % PARTS].functions;
        const fmi2Component part = c->parts[i % PARTS].component;
        size_t inner = 0;
        REQUIRE(f->size_of_state(part, saved->parts[i], &inner) <= fmi2Warning,
                "fmi2SerializeFMUstate: %s cannot serialize its state: %s", name, c->said)
        const uint64_t stored = inner;
        memcpy(bytes + end, &stored, sizeof stored);
        end += sizeof stored;
        REQUIRE(f->serialize(part, saved->parts[i], bytes + end, inner) <= fmi2Warning,
                "fmi2SerializeFMUstate: %s cannot serialize its state: %s", name, c->said)
        end += inner;
    }
    const uint64_t checksum = checksum_of(bytes, needed);
    memcpy(bytes + offsetof(Saved, header.checksum), &checksum, sizeof checksum);
    return fmi2OK;
}

static bool is_bit(int64_t flag) { return flag == 0 || flag == 1; }
static bool in_range(int64_t value, int64_t first, int64_t last) { return value >= first && value <= last; }

static bool plausible_guard(const StepCheck *g)
{
    const int64_t most = INT64_C(1) << 53;
    return in_range(g->line, 0, LINES) && in_range(g->contact, 0, LINES) && in_range(g->alarm, 0, ALARM) &&
           in_range(g->patience, 0, 2 * MOST_PATIENCE) && in_range(g->next, 0, most) &&
           in_range(g->last, -most, most) && in_range(g->recurrences, 0, MOST_RECURRENCES) &&
           in_range(g->calm, 0, most) && in_range(g->checks, 0, most) && is_bit(g->hopeless) && is_bit(g->jumped);
}

/* Return whether a variable can have the value in this memory; a law may accept an input that is not finite. */
static bool plausible_value(const Memory *m, const Variable *v)
{
    const double value = v->is_input ? m->inputs[v->reference] : v->signal >= 0 ? m->signals[v->signal] : 0.0;
    return v->type == REAL ? v->is_input || isfinite(value) : value == floor(value) && fabs(value) <= 2147483648.0;
}

/* Return whether a run can reach this memory: whatever is used as an index, a count or a time is in range. */
static bool plausible(const Memory *m)
{
    const int modes =
        BEFORE_STEPPING | TERMINATED | (m->exchange ? (int)EXCHANGING : (int)STEP_COMPLETE | (int)STEP_FAILED);
    const double now = m->start + (double)m->tick * STEP_SIZE + m->spent;
    const double slack = 1e-3 * STEP_SIZE + 1e-9 * fabs(now) + m->drift;
    bool good = is_bit(m->exchange) && (MODEL_EXCHANGE || !m->exchange) && (m->mode & modes) == m->mode &&
                m->mode > 0 && (m->mode & (m->mode - 1)) == 0 && in_range(m->stale, 0, PARAMETER_SET) &&
                is_bit(m->slopes_used) && is_bit(m->inside) && in_range(m->tick, 0, INT64_C(1) << 53) &&
                is_bit(m->side) && isfinite(m->start) && isfinite(m->time) && fabs(m->spent) <= 1.001 * STEP_SIZE &&
                m->drift >= 0.0 && m->drift < INFINITY && (m->exchange || fabs(m->time - now) <= slack) &&
                m->stop >= m->start && m->tolerance >= 0.0 && m->tolerance < INFINITY && isfinite(m->begun);
    for (int64_t i = 0, source = 0; i < PARTS; i++) {
        const Series *const series = part_data[i].series;
        good = good && (is_fmu(i) || in_range(m->rows[source], -1, series ? series->rows - 1 : 0));
        source += !is_fmu(i);
    }
    for (int64_t k = 0; k < LINES; k++)
        good = good && m->moving[k].inner == line_data[k].inner && m->moving[k].unknown == line_data[k].unknown &&
               is_bit(m->moving[k].from_rest) && in_range(m->moving[k].role, FREE, CHANGING) &&
               in_range(m->moving[k].rests, FREE, IN_JUMP) && in_range(m->moving[k].rigid, -1, 1);
    for (int64_t g = 0; g < GROUPS; g++)
        good = good && plausible_guard(&m->guards[g]);
    for (int i = 0; i < INPUTS; i++)
        good = good && isfinite(m->slopes[i]) && isfinite(m->rate[i]);
    for (size_t i = 0; i < VARIABLES; i++)
        good = good && plausible_value(m, &variables[i]);
    return good;
}

/* Read the states of the parts; return the reason why the bytes cannot be used, or NULL. */
static const char *read_parts(Instance *c, Saved *saved, const fmi2Byte bytes[], size_t size)
{
    size_t end = SAVED_SIZE;
    for (int64_t i = 0; i < 2 * PARTS; i++) {
        uint64_t inner = 0;
        if (!is_saved(&saved->memory, i))
            continue;
        if (size - end < sizeof inner)
            return "they are too few";
        memcpy(&inner, bytes + end, sizeof inner);
        end += sizeof inner;
        if (inner > size - end)
            return "they are too few";
        if (part_data[i % PARTS].functions->deserialize(c->parts[i % PARTS].component, bytes + end, (size_t)inner,
                                                        &saved->parts[i]) > fmi2Warning)
            return c->said;
        end += (size_t)inner;
    }
    return end == size ? NULL : "they are too many";
}

static const char *fault_of_bytes(const Instance *c, const Saved *read, const fmi2Byte bytes[], size_t size)
{
    const char *const fault = fault_of(c, read);
    if (fault)
        return fault;
    if (read->header.checksum != checksum_of(bytes, size))
        return "they are damaged";
    return plausible(&read->memory) ? NULL : "no run can reach such values";
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    ENTER("DeSerializeFMUstate", MAY_FMUstate)
    REQUIRE(bytes && state, "fmi2DeSerializeFMUstate: a pointer is null")
    REQUIRE(size >= SAVED_SIZE, "fmi2DeSerializeFMUstate: %u bytes were given, but a state of this FMU has more",
            (unsigned)size)
    Saved *const read = (Saved *)calloc(1, sizeof(Saved));
    REQUIRE(read, "fmi2DeSerializeFMUstate: out of memory")
    memcpy(read, bytes, SAVED_SIZE);
    const char *fault = fault_of_bytes(c, read, bytes, size);
    read->header.checksum = 0;
    if (!fault)
        fault = read_parts(c, read, bytes, size);
    if (fault) {
        report(c, fmi2Error, LOG_ERROR, "fmi2DeSerializeFMUstate: the bytes cannot be used: %s", fault);
        free_saved(c, read);
        return fmi2Error;
    }
    *state = read;
    return fmi2OK;
}

#endif
