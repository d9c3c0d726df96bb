/* Model exchange (FMI 2.0, chapter 3): the states and event indicators of the parts side by side, their connections
   solved, their events merged. */

#ifndef COMPOSITE_EXCHANGE_H
#define COMPOSITE_EXCHANGE_H

enum { MOST_SWEEPS = 2 * PARTS + 8 }; /* of one event */

/* ---- modes -------------------------------------------------------------------------------------------------- */

#define ALL_EXCHANGE(function, call)                                                                                   \
    c->said[0] = '\0';                                                                                                 \
    for (int64_t i = 0; i < PARTS; i++) {                                                                              \
        const ExchangeFunctions *const f = part_data[i].exchange;                                                      \
        const fmi2Component p = c->parts[i].component;                                                                 \
        REQUIRE(!f || (call) <= fmi2Warning, "%s: %s failed: %s", function, part_data[i].name, c->said)                \
    }

fmi2Status fmi2EnterEventMode(fmi2Component component)
{
    ENTER_AS(fmi2ModelExchange, "EnterEventMode", MAY_EnterEventMode)
    ALL_EXCHANGE("fmi2EnterEventMode", f->enter_event(p))
    MODE(c) = EVENT_MODE;
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component component)
{
    ENTER_AS(fmi2ModelExchange, "EnterContinuousTimeMode", MAY_EnterContinuousTimeMode)
    ALL_EXCHANGE("fmi2EnterContinuousTimeMode", f->enter_continuous(p))
    MODE(c) = CONTINUOUS_TIME;
    return fmi2OK;
}

/* Take the row of a record that applies from now on; the next one is an event, and the last one ends the simulation. */
static void choose_row(Instance *c, int64_t part, fmi2EventInfo *info)
{
    const Series *const series = part_data[part].series;
    int64_t *const row = &c->memory.rows[c->places[part].source];
    if (!series)
        return;
    *row = row_at(series, NOW(c));
    if (*row < series->rows - 1) {
        info->nextEventTimeDefined = fmi2True;
        info->nextEventTime = series->times[*row + 1];
    } else
        info->terminateSimulation = series->reach < INFINITY ? fmi2True : fmi2False;
}

/* Let all parts act once, in the order in which they step, and merge what they report; return the status. */
static int update_parts(Instance *c, fmi2EventInfo *info)
{
    Engine *const e = &c->engine;
    memset(info, 0, sizeof *info);
    for (int64_t k = 0; k < PARTS; k++) {
        const int64_t part = part_order[k];
        EnginePart *const p = &e->parts[part];
        fmi2EventInfo own = {0};
        e->failed_part = part;
        int status = 0;
        fetch_inputs(e, p);
        if (!is_fmu(part))
            choose_row(c, part, &own);
        else if ((status = hand_over(p, e->signals)) <= 1)
            status = (int)part_data[part].exchange->new_discrete_states(p->component, &own);
        if (status <= 1)
            status = fetch_outputs(p, e->signals);
        if (status > 1)
            return status;
        info->newDiscreteStatesNeeded |= own.newDiscreteStatesNeeded;
        info->terminateSimulation |= own.terminateSimulation;
        info->nominalsOfContinuousStatesChanged |= own.nominalsOfContinuousStatesChanged;
        info->valuesOfContinuousStatesChanged |= own.valuesOfContinuousStatesChanged;
        if (own.nextEventTimeDefined && (!info->nextEventTimeDefined || own.nextEventTime < info->nextEventTime)) {
            info->nextEventTimeDefined = fmi2True;
            info->nextEventTime = own.nextEventTime;
        }
    }
    return 0;
}

/* The event of one part may cause that of another: repeat until no connection changes. */
static fmi2Status update_all(Instance *c, fmi2EventInfo *info)
{
    Memory *const m = &c->memory;
    fmi2Status status = settle(c, "fmi2NewDiscreteStates");
    bool jumped = false, scaled = false;
    for (int tries = 0; status == fmi2OK && tries < MOST_SWEEPS; tries++) {
        memcpy(c->shown, m->signals, sizeof m->signals);
        REQUIRE(update_parts(c, info) <= 1, "fmi2NewDiscreteStates: %s failed: %s",
                part_data[c->engine.failed_part].name, c->said)
        m->stale = INPUT_SET;
        status = settle(c, "fmi2NewDiscreteStates");
        jumped = jumped || info->valuesOfContinuousStatesChanged;
        scaled = scaled || info->nominalsOfContinuousStatesChanged;
        if (!info->newDiscreteStatesNeeded && memcmp(c->shown, m->signals, sizeof m->signals) == 0) {
            info->valuesOfContinuousStatesChanged = jumped ? fmi2True : fmi2False;
            info->nominalsOfContinuousStatesChanged = scaled ? fmi2True : fmi2False;
            return fmi2OK;
        }
    }
    REQUIRE(status != fmi2OK, "fmi2NewDiscreteStates: at t = %.12g s the parts cause events of each other without end",
            NOW(c))
    return status;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *info)
{
    ENTER_AS(fmi2ModelExchange, "NewDiscreteStates", MAY_NewDiscreteStates)
    REQUIRE(info, "fmi2NewDiscreteStates: the pointer to the event information is null")
    REQUIRE(keep_all(c), "fmi2NewDiscreteStates: a part cannot save its state: %s", c->said)
    c->said[0] = '\0';
    c->warning = false;
    fmi2EventInfo found = {0};
    const fmi2Status status = update_all(c, &found);
    if (status != fmi2OK) {
        (void)roll_back_all(c);
        return status;
    }
    *info = found;
    return c->warning ? fmi2Warning : fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component component, fmi2Boolean keeps_no_state, fmi2Boolean *event,
                                       fmi2Boolean *terminate)
{
    ENTER_AS(fmi2ModelExchange, "CompletedIntegratorStep", MAY_CompletedIntegratorStep)
    REQUIRE(event && terminate, "fmi2CompletedIntegratorStep: a pointer is null")
    const fmi2Status status = settle_or_return(c, "fmi2CompletedIntegratorStep");
    if (status != fmi2OK)
        return status;
    fmi2Boolean events = fmi2False, ends = fmi2False, own_event = fmi2False, own_end = fmi2False;
    ALL_EXCHANGE("fmi2CompletedIntegratorStep",
                 (events |= own_event, ends |= own_end, f->completed(p, keeps_no_state, &own_event, &own_end)))
    *event = events | own_event;
    *terminate = ends | own_end;
    return fmi2OK;
}

/* ---- values ------------------------------------------------------------------------------------------------- */

fmi2Status fmi2SetTime(fmi2Component component, fmi2Real t)
{
    ENTER_AS(fmi2ModelExchange, "SetTime", MAY_SetTime)
    REQUIRE(isfinite(t), "fmi2SetTime: time %g must be finite", t)
    ALL_EXCHANGE("fmi2SetTime", f->set_time(p, t))
    Memory *const m = &c->memory;
    m->time = t;
    for (int i = 0; i <= SOURCES; i++)
        m->sources[i] = t;
    set_stale(m, INPUT_SET);
    return fmi2OK;
}

#define REQUIRE_VECTOR(function, values, n, count, what)                                                               \
    REQUIRE((n) == (size_t)(count), "fmi2" function ": %u values are requested, but %s has %d " what, (unsigned)(n),   \
            QUOTE(MODEL), (int)(count))                                                                                \
    REQUIRE((n) == 0 || (values), "fmi2" function ": the pointer to the values is null")

fmi2Status fmi2SetContinuousStates(fmi2Component component, const fmi2Real states[], size_t n)
{
    ENTER_AS(fmi2ModelExchange, "SetContinuousStates", MAY_SetContinuousStates)
    REQUIRE_VECTOR("SetContinuousStates", states, n, STATES, "states")
    for (size_t i = 0; i < n; i++)
        if (!isfinite(states[i]))
            return report(c, fmi2Discard, LOG_DISCARD, "fmi2SetContinuousStates: state %d = %g is not finite", (int)i,
                          states[i]);
    const fmi2Real *from = states;
    ALL_EXCHANGE("fmi2SetContinuousStates",
                 (from += part_data[i].states, f->set_states(p, from - part_data[i].states, part_data[i].states)))
    set_stale(&c->memory, INPUT_SET);
    return fmi2OK;
}

/* Gather a vector from the parts, whose inputs settle first if it `depends` on them. All of its values are read before
   the first one is returned. */
#define GATHER(function, member, count, total, what, depends)                                                          \
    fmi2Status fmi2##function(fmi2Component component, fmi2Real values[], size_t n)                                    \
    {                                                                                                                  \
        ENTER_AS(fmi2ModelExchange, #function, MAY_##function)                                                         \
        REQUIRE_VECTOR(#function, values, n, total, what)                                                              \
        const fmi2Status status = depends ? settle_or_return(c, "fmi2" #function) : fmi2OK;                            \
        if (status != fmi2OK)                                                                                          \
            return status;                                                                                             \
        double found[(total) + 1], *to = found;                                                                        \
        ALL_EXCHANGE("fmi2" #function,                                                                                 \
                     (to += part_data[i].count, f->member(p, to - part_data[i].count, part_data[i].count)))            \
        if (n > 0)                                                                                                     \
            memcpy(values, found, n * sizeof(double));                                                                 \
        return fmi2OK;                                                                                                 \
    }
enum {
    MAY_GetContinuousStates = MAY_GetContinuous,
    MAY_GetDerivatives = MAY_GetContinuous,
    MAY_GetEventIndicators = MAY_GetContinuous,
    MAY_GetNominalsOfContinuousStates = ANY_MODE
};
GATHER(GetContinuousStates, get_states, states, STATES, "states", true)
GATHER(GetDerivatives, get_derivatives, states, STATES, "states", true)
GATHER(GetNominalsOfContinuousStates, get_nominals, states, STATES, "states", false)
GATHER(GetEventIndicators, get_indicators, indicators, INDICATORS, "event indicators", true)

#endif
