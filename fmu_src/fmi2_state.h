/* Further parts of FMI 2.0: identity, saved states, and functions for the packager. */

#ifndef BLOCK_FMI2_STATE_H
#define BLOCK_FMI2_STATE_H

#include "fmi2_saved.h"

/* ---- identity ----------------------------------------------------------------------------------------------- */

static uint64_t mix_text(uint64_t hash, const char *text) { return mix(hash, text, strlen(text) + 1); }

static uint64_t fingerprint(uint64_t hash)
{
    hash = mix_text(hash, QUOTE(MODEL));
    for (size_t i = 0; i < ROWS; i++) {
        const Row *const row = &rows[i];
        const double numbers[] = {row->start,  row->min,  row->max,  row->nominal, row->index,
                                  row->length, row->from, row->role, row->type};
        hash = mix_text(mix_text(mix_text(hash, row->name), row->unit), row->text);
        for (size_t k = 0; k < sizeof numbers / sizeof numbers[0]; k++)
            hash = isnan(numbers[k]) ? mix_text(hash, "none") : mix(hash, &numbers[k], sizeof numbers[k]);
        if (row->starts)
            hash = mix(hash, row->starts, row->length * sizeof(double));
    }
#ifdef IDENTITY
    hash = mix_text(hash, IDENTITY);
#endif
    return hash;
}

/* {8-4-4-4-12}: hash of all rows and, if the packager has defined IDENTITY in the block, of all sources, so that XML,
   code and saved states always match. */
static void write_guid(char *text)
{
    char digits[33];
    snprintf(digits, sizeof digits, "%016llx%016llx", (unsigned long long)fingerprint(UINT64_C(14695981039346656037)),
             (unsigned long long)fingerprint(UINT64_C(88172645463325252)));
    snprintf(text, GUID_LENGTH + 1, "{%.8s-%.4s-%.4s-%.4s-%.12s}", digits, digits + 8, digits + 12, digits + 16,
             digits + 20);
}

/* ---- saved states ------------------------------------------------------------------------------------------- */

static const char magic_text[MAGIC_SIZE] = "block";

typedef struct {
    SavedHeader header; /* with the checksum of the model */
    Model model;        /* its cache is not used */
} Saved;

/* The model without its cache. */
enum { STATE_SIZE = offsetof(Model, cache), SAVED_SIZE = offsetof(Saved, model) + STATE_SIZE };

static uint64_t checksum_of(const Saved *saved) { return checksum_of_bytes(&saved->model, STATE_SIZE); }

static void restore(Instance *c, const Saved *saved)
{
    memcpy(&c->model, &saved->model, STATE_SIZE);
    c->follows = false;
}

static void save(const Instance *c, Saved *saved)
{
    write_header(&saved->header, magic_text, c->guid, SAVED_SIZE);
    memcpy(&saved->model, &c->model, STATE_SIZE); /* including padding, for equal bytes */
}

static const char *fault_of(const Instance *c, const Saved *saved)
{
    const char *const fault = fault_of_header(&saved->header, magic_text, c->guid, SAVED_SIZE);
    return !fault && saved->model.run.exchange != c->model.run.exchange ? OTHER_KIND : fault;
}

/* Return whether the row can have this value. */
static bool plausible_value(const Row *row, double v)
{
    const bool parameter = row->role == ROLE_PARAMETER || row->role == ROLE_FIXED;
    if (row->type != TYPE_REAL)
        return v >= row->min && v <= row->max && v == floor(v);
#ifdef GUARDED
    if (row->role == ROLE_INPUT)
        return true;
#endif
    return isfinite(v) && (!parameter || (v >= row->min && v <= row->max));
}

/* Return whether a run can produce this memory, which is empty before the first step. */
static bool plausible_memory(const Model *m)
{
    const char *const byte = (const char *)&m->memory;
    if (before_stepping(m)) {
        for (size_t i = 0; i < sizeof m->memory; i++)
            if (byte[i] != 0)
                return false;
        return m->run.tick == 0 && m->run.inner_step == 0.0 && m->run.last_step == 0.0 && m->run.rest == 0.0 &&
               m->run.drift == 0.0;
    }
#ifdef VALID_BY
    return VALID_BY(m);
#else
    return true;
#endif
}

/* Return whether a run can reach this state. */
static bool plausible(const Model *m)
{
    const int64_t most_samples = INT64_C(1) << 53; /* the largest exact count in a double */
    const Run *const run = &m->run;
    const double *const value = (const double *)(const void *)m;
    const int mode = run->mode;
    const bool before = mode == INSTANTIATED || mode == INITIALIZING, after = mode == TERMINATED;
    const bool between = run->exchange != 0 ? mode == EVENT_MODE || mode == CONTINUOUS_TIME
                                            : mode == STEP_COMPLETE || mode == STEP_FAILED;
    bool good = (before || between || after) && is_flag(&run->frozen) &&
                run->frozen == (DECIDES && run->exchange != 0 && !before) && is_flag(&run->stale) &&
                is_flag(&run->slopes_used) && is_flag(&run->sloped) && is_flag(&run->outputs_done) &&
                is_flag(&run->warning) && is_flag(&run->warned) && is_flag(&run->too_much) && run->tick >= 0 &&
                run->tick <= most_samples && run->inner_step >= 0.0 && run->inner_step < INF && run->last_step >= 0.0 &&
                run->last_step < INF && isfinite(run->rest) && run->drift >= 0.0 && run->drift < INF &&
                isfinite(run->start) && run->stop >= run->start && run->tolerance >= 0.0 && run->tolerance < INF;
    for (int i = 0; i <= INPUTS; i++)
        good = good && isfinite(m->slope[i]) && (run->sloped || m->slope[i] == 0.0);
    for (size_t i = 0; i < ROWS; i++)
        for (uint32_t k = 0; k < (rows[i].length ? rows[i].length : 1); k++)
            good = good && plausible_value(&rows[i], value[rows[i].index + k]);
    return good && plausible_memory(m);
}

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    ENTER("GetFMUstate", MAY_FMUstate)
    REQUIRE(state, "fmi2GetFMUstate: the pointer to the state is null")
    if (!*state)
        *state = calloc(1, sizeof(Saved));
    REQUIRE(*state, "fmi2GetFMUstate: out of memory")
    save(c, (Saved *)*state);
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state)
{
    ENTER("SetFMUstate", MAY_FMUstate)
    REQUIRE(state, "fmi2SetFMUstate: the state is a null pointer")
    const char *const fault = fault_of(c, (const Saved *)state);
    REQUIRE(!fault, "fmi2SetFMUstate: the state cannot be used: %s", fault)
    restore(c, (const Saved *)state);
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    ENTER("FreeFMUstate", MAY_FMUstate)
    if (state) {
        free(*state);
        *state = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate state, size_t *size)
{
    ENTER("SerializedFMUstateSize", MAY_FMUstate)
    REQUIRE(state && size, "fmi2SerializedFMUstateSize: a pointer is null")
    *size = SAVED_SIZE;
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    ENTER("SerializeFMUstate", MAY_FMUstate)
    REQUIRE(state && bytes, "fmi2SerializeFMUstate: a pointer is null")
    REQUIRE(size >= SAVED_SIZE, "fmi2SerializeFMUstate: %u bytes are too few for a state with %u bytes", (unsigned)size,
            (unsigned)SAVED_SIZE)
    const uint64_t checksum = checksum_of((const Saved *)state);
    memcpy(bytes, state, SAVED_SIZE);
    memcpy(bytes + offsetof(Saved, header.checksum), &checksum, sizeof checksum);
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    ENTER("DeSerializeFMUstate", MAY_FMUstate)
    REQUIRE(bytes && state, "fmi2DeSerializeFMUstate: a pointer is null")
    REQUIRE(size == SAVED_SIZE, "fmi2DeSerializeFMUstate: %u bytes were given, but a state of this FMU has %u",
            (unsigned)size, (unsigned)SAVED_SIZE)
    Saved *const read = (Saved *)calloc(1, sizeof(Saved));
    REQUIRE(read, "fmi2DeSerializeFMUstate: out of memory")
    memcpy(read, bytes, SAVED_SIZE);
    const char *fault = fault_of(c, read);
    if (!fault && read->header.checksum != checksum_of(read))
        fault = "they are damaged";
    if (!fault && !plausible(&read->model))
        fault = "no run can reach such values";
    if (fault) {
        free(read);
        return report(c, fmi2Error, LOG_ERROR, "fmi2DeSerializeFMUstate: the bytes cannot be used: %s", fault);
    }
    *state = read;
    return fmi2OK;
}

/* ---- for the packager: only in the shared library ----------------------------------------------------------- */

#ifdef FMI2_OVERRIDE_FUNCTION_PREFIX
#if defined _WIN32
#define PACKAGER_EXPORT __declspec(dllexport)
#else
#define PACKAGER_EXPORT __attribute__((visibility("default")))
#endif

PACKAGER_EXPORT const Row *block_rows(size_t *count, size_t *values, int *traits, char *guid);
PACKAGER_EXPORT void block_evaluate(double *values, int initializing);
PACKAGER_EXPORT const char *block_violated(const double *values);

PACKAGER_EXPORT const Row *block_rows(size_t *count, size_t *values, int *traits, char *guid)
{
    *count = ROWS;
    *values = VALUES;
#ifdef SAMPLED
    traits[0] = 1;
#else
    traits[0] = 0;
#endif
    traits[1] = EXCHANGES;
    traits[2] = INDICATORS;
    write_guid(guid);
    return rows;
}

/* Evaluate the block at `values`, indexed by value reference, for the dependency probe; a sampled block in its first
   sample (initializing) or in a later one. */
PACKAGER_EXPORT void block_evaluate(double *values, int initializing)
{
    Model m;
    memset(&m, 0, sizeof m);
    memcpy(&m, values, VALUES * sizeof(double));
    m.run.mode = initializing ? INITIALIZING : STEP_COMPLETE;
    m.run.tick = initializing ? 0 : 1;
#ifdef GUARDED
    initialise_states(&m);
    sample(&m); /* even with NaN, which reveals the dependencies; `fault` depends on each input */
    m.fault = bad_input(&m) < INPUTS;
#else
    evaluate(&m);
#endif
    memcpy(values, &m, VALUES * sizeof(double));
}

/* Return the relation of parameters that `values` violate, or NULL. */
PACKAGER_EXPORT const char *block_violated(const double *values)
{
    Model m;
    memset(&m, 0, sizeof m);
    memcpy(&m, values, VALUES * sizeof(double));
    return violated(&m);
}
#endif

#endif
