/* Values of variables, and derivatives of inputs and outputs. */

#ifndef COMPOSITE_VALUES_H
#define COMPOSITE_VALUES_H

static const char *const type_names[] = {"Real", "Integer", "Boolean"};

static bool known(fmi2ValueReference reference, int type)
{
    return reference < VARIABLES && variables[reference].type == type;
}

/* Update the outputs that depend directly on an input or a parameter that was set since the last step. The engine keeps
   its values until the next step; outputs in algebraic loops keep theirs until then, as FMI allows. */
static fmi2Status refresh_direct(Instance *c, const char *function)
{
    Engine *const e = &c->engine;
    double *const signals = c->memory.signals;
    if (c->refreshed || !c->memory.stale || MODE(c) != STEP_COMPLETE || START_LOOP)
        return fmi2OK;
    c->said[0] = '\0';
    REQUIRE(keep_all(c), "%s: a part cannot save its state: %s", function, c->said)
    memcpy(c->earlier, signals, sizeof c->memory.signals);
    for (int64_t k = 0; k < SIGNALS; k++)
        if (input_of_signal[k] >= 0)
            signals[k] = c->memory.inputs[input_of_signal[k]];
    int status = 0;
    const bool all = c->memory.stale == PARAMETER_SET;
    for (int64_t k = 0; k < (all ? PARTS : DIRECT) && status <= 1; k++) {
        const int64_t part = all ? start_order[k] : direct_parts[k];
        EnginePart *const p = &c->parts[part];
        if (!is_fmu(part))
            continue;
        if (!p->sampled)
            fetch_inputs(e, p);
        status = hand_over(p, signals);
        if (status <= 1)
            status = fetch_outputs(p, signals);
    }
    memcpy(c->shown, signals, sizeof c->memory.signals);
    memcpy(signals, c->earlier, sizeof c->memory.signals);
    if (status > 1)
        (void)roll_back_all(c);
    REQUIRE(status <= 1, "%s: a part rejects the values that were set: %s", function, c->said)
    c->refreshed = true;
    return fmi2OK;
}

/* Read a variable; *whole gets an Integer or Boolean, *real a Real. */
static fmi2Status read_variable(Instance *c, const Variable *v, double *real, int *whole)
{
    if (v->part >= 0 && v->signal < 0 && !v->is_input) {
        EnginePart *const p = &c->parts[v->part];
        return (fmi2Status)p->get[v->type](p->component, &v->reference, 1,
                                           v->type == REAL ? (void *)real : (void *)whole);
    }
    *real = v->is_input    ? c->memory.inputs[v->reference]
            : v->part < 0  ? NOW(c)
            : c->refreshed ? c->shown[v->signal]
                           : c->memory.signals[v->signal];
    *whole = v->type == REAL ? 0 : (int)*real;
    return fmi2OK;
}

static fmi2Status check_get(Instance *c, const fmi2ValueReference references[], size_t n, const void *values, int type)
{
    REQUIRE(n == 0 || (references && values), "fmi2Get%s: a pointer is null", type_names[type])
    for (size_t i = 0; i < n; i++)
        REQUIRE(known(references[i], type), "fmi2Get%s: there is no %s variable with value reference %u",
                type_names[type], type_names[type], references[i])
    return MODE(c) & (INITIALIZING | EXCHANGING) ? settle_or_return(c, "fmi2Get") : refresh_direct(c, "fmi2Get");
}

#define GET(TYPE, type, value_type, from)                                                                              \
    fmi2Status fmi2Get##TYPE(fmi2Component component, const fmi2ValueReference references[], size_t n,                 \
                             fmi2##TYPE values[])                                                                      \
    {                                                                                                                  \
        ENTER("Get" #TYPE, MAY_Get)                                                                                    \
        const fmi2Status status = check_get(c, references, n, values, type);                                           \
        if (status != fmi2OK)                                                                                          \
            return status;                                                                                             \
        c->said[0] = '\0';                                                                                             \
        for (size_t i = 0; i < n; i++) {                                                                               \
            double real = 0.0;                                                                                         \
            int whole = 0;                                                                                             \
            REQUIRE(read_variable(c, &variables[references[i]], &real, &whole) <= fmi2Warning, "fmi2Get" #TYPE ": %s", \
                    c->said)                                                                                           \
            values[i] = (value_type)from;                                                                              \
        }                                                                                                              \
        return fmi2OK;                                                                                                 \
    }
GET(Real, REAL, fmi2Real, real)
GET(Integer, INTEGER, fmi2Integer, whole)
GET(Boolean, BOOLEAN, fmi2Boolean, (whole ? fmi2True : fmi2False))

static fmi2Status check_set(Instance *c, fmi2ValueReference reference, double value, int type)
{
    REQUIRE(known(reference, type), "fmi2Set%s: there is no %s variable with value reference %u", type_names[type],
            type_names[type], reference)
    const Variable *const v = &variables[reference];
    const bool always = MODE(c) != CONTINUOUS_TIME || (v->is_input && type == REAL);
    REQUIRE((v->setting == SET_ALWAYS && always) || (v->setting == SET_EARLY && (MODE(c) & BEFORE_STEPPING)) ||
                (v->is_state && (MODE(c) & EXCHANGING)),
            "fmi2Set%s: %s cannot be set in the mode \"%s\"", type_names[type], v->name, mode_name(MODE(c)))
    if (v->finite && !isfinite(value))
        return report(c, fmi2Discard, LOG_DISCARD, "fmi2Set%s: %s = %g is not finite", type_names[type], v->name,
                      value);
    if (value < v->min || value > v->max)
        return report(c, fmi2Discard, LOG_DISCARD, "fmi2Set%s: %s = %g is outside [%g, %g]", type_names[type], v->name,
                      value, v->min, v->max);
    return fmi2OK;
}

/* Set a variable of a part or an input. */
static fmi2Status write_variable(Instance *c, const Variable *v, double real, int whole)
{
    if (v->is_input) {
        c->memory.inputs[v->reference] = real;
        return fmi2OK;
    }
    EnginePart *const p = &c->parts[v->part];
    return (fmi2Status)p->set[v->type](p->component, &v->reference, 1,
                                       v->type == REAL ? (void *)&real : (void *)&whole);
}

/* Set a variable of a part also in its state at the start of a tick that is divided. */
static bool write_at_tick(Instance *c, const Variable *v, double real, int whole)
{
    if (v->is_input || !c->memory.inside || !moves_inside(v->part))
        return true;
    EnginePart *const p = &c->parts[v->part];
    void **const tick = &c->ticks[c->memory.side][v->part], **const now = &c->backups[v->part];
    return p->get_state(p->component, now) <= 1 && p->set_state(p->component, *tick) <= 1 &&
           write_variable(c, v, real, whole) <= fmi2Warning && p->get_state(p->component, tick) <= 1 &&
           p->set_state(p->component, *now) <= 1;
}

/* All values are checked before the first one is written; if a part rejects one, all parts return to their state. */
#define SET(TYPE, type, as_double, as_whole)                                                                           \
    fmi2Status fmi2Set##TYPE(fmi2Component component, const fmi2ValueReference references[], size_t n,                 \
                             const fmi2##TYPE values[])                                                                \
    {                                                                                                                  \
        ENTER("Set" #TYPE, MAY_Set)                                                                                    \
        bool inner = false;                                                                                            \
        REQUIRE(n == 0 || (references && values), "fmi2Set" #TYPE ": a pointer is null")                               \
        for (size_t i = 0; i < n; i++) {                                                                               \
            const fmi2Status status = check_set(c, references[i], as_double, type);                                    \
            if (status != fmi2OK)                                                                                      \
                return status;                                                                                         \
            inner = inner || !variables[references[i]].is_input;                                                       \
        }                                                                                                              \
        c->said[0] = '\0';                                                                                             \
        REQUIRE(!inner || n == 1 || keep_all(c), "fmi2Set" #TYPE ": a part cannot save its state: %s", c->said)        \
        for (size_t i = 0; i < n; i++) {                                                                               \
            const Variable *const v = &variables[references[i]];                                                       \
            const fmi2Status status = write_variable(c, v, as_double, as_whole);                                       \
            if (status <= fmi2Warning)                                                                                 \
                continue;                                                                                              \
            REQUIRE(n == 1 || roll_back_all(c), "fmi2Set" #TYPE ": a part cannot return to its state: %s", c->said)    \
            return report(c, status, status == fmi2Discard ? LOG_DISCARD : LOG_ERROR, "fmi2Set" #TYPE ": %s: %s",      \
                          v->name, c->said);                                                                           \
        }                                                                                                              \
        for (size_t i = 0; i < n; i++)                                                                                 \
            REQUIRE(write_at_tick(c, &variables[references[i]], as_double, as_whole), "fmi2Set" #TYPE ": %s", c->said) \
        c->refreshed = false;                                                                                          \
        if (n > 0)                                                                                                     \
            set_stale(&c->memory, inner ? PARAMETER_SET : INPUT_SET);                                                  \
        return fmi2OK;                                                                                                 \
    }
SET(Real, REAL, values[i], 0)
SET(Integer, INTEGER, (double)values[i], values[i])
SET(Boolean, BOOLEAN, (double)(values[i] != fmi2False), values[i])

/* ---- derivatives -------------------------------------------------------------------------------------------- */

static const char *name_of(const Instance *c, fmi2ValueReference reference)
{
    (void)c;
    return variables[reference].name;
}

static fmi2Status check_derivatives(const Instance *c, const char *function, bool of_inputs,
                                    const fmi2ValueReference references[], size_t n, const fmi2Integer orders[],
                                    const fmi2Real values[])
{
    REQUIRE(n == 0 || (references && orders && values), "%s: a pointer is null", function)
    for (size_t i = 0; i < n; i++) {
        const Variable *const v = references[i] < VARIABLES ? &variables[references[i]] : NULL;
        REQUIRE(v && v->type == REAL && (of_inputs ? v->is_input : v->is_output),
                "%s: value reference %u is not a Real %s", function, references[i], of_inputs ? "input" : "output")
        REQUIRE(orders[i] == 1, "%s: order %d of %s is not supported, only order 1", function, orders[i], v->name)
    }
    return fmi2OK;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t n,
                                       const fmi2Integer orders[], const fmi2Real values[])
{
    ENTER_AS(fmi2CoSimulation, "SetRealInputDerivatives", MAY_SetRealInputDerivatives)
    if (check_derivatives(c, "fmi2SetRealInputDerivatives", true, references, n, orders, values) != fmi2OK)
        return fmi2Error;
    if (!slopes_are_finite(c, references, n, values))
        return fmi2Discard;
    Memory *const m = &c->memory;
    if (m->slopes_used)
        memset(m->slopes, 0, sizeof m->slopes);
    m->slopes_used = false;
    for (size_t i = 0; i < n; i++)
        m->slopes[variables[references[i]].reference] = values[i];
    return fmi2OK;
}

/* Each part computes the time derivatives of its outputs; those of a recorded table are 0. */
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t n,
                                        const fmi2Integer orders[], fmi2Real values[])
{
    ENTER_AS(fmi2CoSimulation, "GetRealOutputDerivatives", MAY_GetRealOutputDerivatives)
    const fmi2Status status =
        check_derivatives(c, "fmi2GetRealOutputDerivatives", false, references, n, orders, values);
    if (status != fmi2OK)
        return status;
    c->said[0] = '\0';
    for (int pass = 0; pass < 2; pass++) /* the second one writes, as a refused call must not */
        for (size_t i = 0; i < n; i++) {
            const Variable *const v = &variables[references[i]];
            const PartFunctions *const f = part_data[v->part].functions;
            fmi2Real value = 0.0;
            REQUIRE(!f || f->get_derivatives(c->parts[v->part].component, &v->reference, 1, &orders[i], &value) <=
                              fmi2Warning,
                    "fmi2GetRealOutputDerivatives: %s: %s", v->name, c->said)
            if (pass == 1)
                values[i] = value;
        }
    return fmi2OK;
}

#endif
