/* The start of a run: initialisation mode of all parts, with consistent values in all connections. */

#ifndef COMPOSITE_START_H
#define COMPOSITE_START_H

#define SOLVED_START 1e-10 /* largest residual of an algebraic loop, relative to its values */

/* Note that values were set. */
static void set_stale(Memory *m, int what)
{
    if (m->stale != PARAMETER_SET)
        m->stale = what;
}

/* Return whether the outputs of parts are finite; a law may accept an input that is not. The exponents are compared, as
   a sum of doubles takes four times as long. */
static bool outputs_finite(const Instance *c)
{
    uint64_t bits[CHECKED + 1], none = 0;
    memcpy(bits, c->memory.signals, CHECKED * sizeof(double));
    for (int64_t k = 0; k < CHECKED; k++)
        none |= (uint64_t)((bits[k] << 1) >= UINT64_C(0xffe0000000000000));
    return none == 0;
}

/* Update the outputs of all parts. */
static bool fetch_all(Instance *c)
{
    Engine *const e = &c->engine;
    for (int64_t i = 0; i < PARTS; i++) {
        const int status = fetch_outputs(&e->parts[i], e->signals);
        if (status > 1)
            return failed(e, i, GET, status, NOW(c));
    }
    return true;
}

/* Between two events, a sampled part keeps its inputs too. */
static bool hand_over_to(Instance *c, int64_t part)
{
    Engine *const e = &c->engine;
    const bool takes = is_fmu(part) && !(MODE(c) == CONTINUOUS_TIME && e->parts[part].sampled);
    const int status = takes ? hand_over(&e->parts[part], e->signals) : 0;
    return status <= 1 || failed(e, part, SET, status, NOW(c));
}

/* Set and read all parts once, in the order in which start values spread. */
static bool spread(Instance *c)
{
    Engine *const e = &c->engine;
    for (int64_t k = 0; k < PARTS; k++) {
        EnginePart *const p = &e->parts[start_order[k]];
        fetch_inputs(e, p);
        if (!hand_over_to(c, start_order[k]))
            return false;
        const int status = fetch_outputs(p, e->signals);
        if (status > 1)
            return failed(e, start_order[k], GET, status, NOW(c));
    }
    return true;
}

/* G(w) - w of the outputs on which the algebraic loops depend. */
static bool start_residual(void *context, const double *w, double *r)
{
    Instance *const c = (Instance *)context;
    for (int64_t i = 0; i < ROOTS; i++)
        c->memory.signals[root_signals[i]] = w[i];
    if (!spread(c))
        return false;
    for (int64_t i = 0; i < ROOTS; i++)
        r[i] = c->memory.signals[root_signals[i]] - w[i];
    return true;
}

static bool solve_start(Instance *c, double *norm)
{
    double *const r = c->start_work;
    for (int64_t i = 0; i < ROOTS; i++)
        c->start_values[i] = c->memory.signals[root_signals[i]];
    return find_fixed_point(start_residual, c, c->start_values, ROOTS, c->start_work, norm) &&
           start_residual(c, c->start_values, r) && spread(c);
}

/* Begin with the inputs that the parts have by themselves, so that the result does not depend on earlier calls. */
static bool begin_spreading(Instance *c)
{
    Engine *const e = &c->engine;
    memset(c->memory.signals, 0, sizeof c->memory.signals);
    for (int64_t k = 0; k < MAPPED; k++) {
        c->memory.gains[k] = wire_gains[k];
        c->memory.offsets[k] = wire_offsets[k];
    }
    for (const DelayData *d = delay_data; d < delay_data + DELAYS; d++)
        if (d->given) {
            c->memory.gains[d->input] = 0.0;
            c->memory.offsets[d->input] = map_of(wire_gains[d->input], wire_offsets[d->input], d->initial);
        }
    for (int64_t i = 0; i < PARTS; i++)
        if (!is_fmu(i))
            (void)fetch_outputs(&e->parts[i], e->signals);
    for (int64_t i = 0; i < PARTS; i++) {
        const EnginePart *const p = &e->parts[i];
        for (int64_t k = p->inputs[REAL]; k < p->inputs[TYPES]; k++)
            e->signals[k] = from_outside[k] ? arriving(e, k) : own_starts[k];
        if (!hand_over_to(c, i))
            return false;
    }
    return fetch_all(c);
}

/* Report why values cannot be computed; the solver of an importer then tries others. */
static fmi2Status no_values(const Instance *c, const char *function)
{
    const bool trial = MODE(c) == CONTINUOUS_TIME;
    return report(c, trial ? fmi2Discard : fmi2Error, trial ? LOG_DISCARD : LOG_ERROR, "%s: %s rejected its %s: %s",
                  function, part_data[c->engine.failed_part].name, MODE(c) & EXCHANGING ? "inputs" : "start values",
                  c->said);
}

/* Compute the values of all connections, if something was set. One sweep gives the start values of a loop through a
   sampled part or a delay, which has no fixed point. */
static fmi2Status settle(Instance *c, const char *function)
{
    Memory *const m = &c->memory;
    double norm = 0.0;
    if (!m->stale)
        return fmi2OK;
    c->said[0] = '\0';
    const bool exchanging = (MODE(c) & EXCHANGING) != 0;
    if (!exchanging && !begin_spreading(c))
        return no_values(c, function);
    if (START_LOOP) {
        if (!solve_start(c, &norm))
            return no_values(c, function);
        REQUIRE(norm <= SOLVED_START,
                "%s: no values satisfy the algebraic loop through %s: the best ones have an error of %.2g of "
                "their size; set other start values",
                function, start_loop_name, norm)
    } else
        for (int64_t sweep = 0; sweep < (LATE_LOOP && !exchanging ? 1 : PARTS + 1); sweep++) {
            memcpy(c->earlier, m->signals, sizeof m->signals);
            if (!spread(c))
                return no_values(c, function);
            if (memcmp(c->earlier, m->signals, sizeof m->signals) == 0)
                break;
        }
    if (exchanging && !outputs_finite(c)) {
        snprintf(c->said, sizeof c->said, "an output is not finite");
        return no_values(c, function);
    }
    m->stale = false;
    return fmi2OK;
}

/* The same for a call that may be refused: then nothing changes. */
static fmi2Status settle_or_return(Instance *c, const char *function)
{
    if (!c->memory.stale)
        return fmi2OK;
    REQUIRE(keep_all(c), "%s: a part cannot save its state: %s", function, c->said)
    const fmi2Status status = settle(c, function);
    if (status != fmi2OK)
        (void)roll_back_all(c);
    return status;
}

/* Perform a call of every FMU; the reason for a failure is its last message. */
#define ALL_PARTS(function, call)                                                                                      \
    c->said[0] = '\0';                                                                                                 \
    for (int64_t i = 0; i < PARTS; i++) {                                                                              \
        const PartFunctions *const f = part_data[i].functions;                                                         \
        const fmi2Component p = c->parts[i].component;                                                                 \
        REQUIRE(!f || (call) <= fmi2Warning, "%s: %s failed: %s", function, part_data[i].name, c->said)                \
    }

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean tolerance_given, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_given, fmi2Real stop)
{
    ENTER("SetupExperiment", MAY_SetupExperiment)
    if (check_experiment(c, tolerance_given, tolerance, start, stop_given, stop) != fmi2OK)
        return fmi2Error;
    /* not the stop time: a sampled part may end its last step after it */
    ALL_PARTS("fmi2SetupExperiment", f->setup(p, tolerance_given, tolerance, start, fmi2False, 0.0))
    Memory *const m = &c->memory;
    m->tolerance = tolerance_given ? tolerance : 0.0;
    m->start = m->time = m->begun = start;
    for (int i = 0; i <= SOURCES; i++)
        m->sources[i] = start;
    m->stop = stop_given ? stop : INFINITY;
    m->stale = PARAMETER_SET;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component)
{
    ENTER("EnterInitializationMode", MAY_EnterInitializationMode)
    ALL_PARTS("fmi2EnterInitializationMode", f->enter(p))
    MODE(c) = INITIALIZING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component)
{
    ENTER("ExitInitializationMode", MAY_ExitInitializationMode)
    Memory *const m = &c->memory;
    REQUIRE(keep_all(c), "fmi2ExitInitializationMode: a part cannot save its state: %s", c->said)
    const fmi2Status status = settle(c, "fmi2ExitInitializationMode");
    bool good = true;
    for (int64_t i = 0; i < PARTS && good && status == fmi2OK; i++)
        good = !is_fmu(i) || part_data[i].functions->leave(c->parts[i].component) <= fmi2Warning;
    good = good && (status != fmi2OK || fetch_all(c));
    if (!good || status != fmi2OK)
        (void)roll_back_all(c);
    if (status != fmi2OK)
        return status;
    REQUIRE(good, "fmi2ExitInitializationMode: %s", c->said)
    m->stale = false;
    if (m->exchange) {
        MODE(c) = EVENT_MODE;
        return fmi2OK;
    }
    newton_begin(&c->engine, &c->newton);
    for (int64_t k = 0; k < DELAYS; k++)
        for (int64_t i = 0; i < c->delays[k].length; i++)
            c->delays[k].past[i] =
                delay_data[k].given ? delay_data[k].initial : m->signals[source_of[delay_data[k].input]];
    MODE(c) = STEP_COMPLETE;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component)
{
    ENTER("Reset", MAY_Reset)
    ALL_PARTS("fmi2Reset", f->reset(p))
    REQUIRE(set_start_values(c), "fmi2Reset: a part rejects its start value: %s", c->said)
    return fmi2OK;
}

#endif
