/* Model exchange (FMI 2.0, chapter 3): the importer integrates the states. What jumps is decided at events and fixed
   between them; a sampled block takes its samples at time events. */

#ifndef BLOCK_FMI2_EXCHANGE_H
#define BLOCK_FMI2_EXCHANGE_H

/* ---- modes -------------------------------------------------------------------------------------------------- */

fmi2Status fmi2EnterEventMode(fmi2Component component)
{
    ENTER_AS(fmi2ModelExchange, "EnterEventMode", MAY_EnterEventMode)
    MODE(c) = EVENT_MODE;
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component component)
{
    ENTER_AS(fmi2ModelExchange, "EnterContinuousTimeMode", MAY_EnterContinuousTimeMode)
    MODE(c) = CONTINUOUS_TIME;
    return fmi2OK;
}

#ifdef SAMPLED
/* Take the samples that are due; a solver that steps over time events gets them all at once. */
static bool discrete_states(Model *m)
{
    const double now = m->time, slack = sample_slack(m);
    if (-to_next_sample(m) / m->Ts > MOST_TRIES)
        return false;
    for (int tries = 0; to_next_sample(m) <= slack; tries++) {
        if (tries > MOST_TRIES) /* a time so late that Ts is lost in it */
            return false;
        m->time = next_sample(m);
        take_sample(m);
        m->time = now;
        m->run.tick++;
        m->run.rest += m->Ts;
    }
    return true;
}
#else
static bool discrete_states(Model *m)
{
    decide(m);
    equations(m);
    return true;
}
#endif

/* Take what is due at an event; also for events in the co-simulation of FMI 3.0. */
static fmi2Status new_discrete_states(Instance *c, fmi2EventInfo *info)
{
    REQUIRE(info, "fmi2NewDiscreteStates: the pointer to the event information is null")
    Model *const m = &c->model;
    const char *const relation = violated(m);
    REQUIRE(!relation, "fmi2NewDiscreteStates: the parameters of \"%s\" must satisfy %s", c->name, relation)
    keep(c);
    if (!discrete_states(m) || !results_finite(m)) {
        roll_back(c);
        return report(c, fmi2Error, LOG_ERROR,
                      "fmi2NewDiscreteStates: the event at t = %.17g s leads to a value that is not finite; nothing "
                      "is changed",
                      m->time);
    }
    m->run.stale = false;
    bool jumped = false;
    for (int r = 0; r < STATE_ROWS; r++)
        for (uint32_t k = 0; k < state_rows[r].count; k++)
            jumped = jumped || *value_of(m, state_rows[r].index + k) != *value_of(&c->backup, state_rows[r].index + k);
    memset(info, 0, sizeof *info);
    info->valuesOfContinuousStatesChanged = jumped ? fmi2True : fmi2False;
#ifdef SAMPLED
    info->nextEventTimeDefined = fmi2True;
    info->nextEventTime = m->run.exchange ? next_sample(m) : m->time + m->run.rest;
#endif
    return warned(c, m->time);
}

fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *info)
{
    ENTER_AS(fmi2ModelExchange, "NewDiscreteStates", MAY_NewDiscreteStates)
    return new_discrete_states(c, info);
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component component, fmi2Boolean keeps_no_state, fmi2Boolean *event,
                                       fmi2Boolean *terminate)
{
    (void)keeps_no_state;
    ENTER_AS(fmi2ModelExchange, "CompletedIntegratorStep", MAY_CompletedIntegratorStep)
    REQUIRE(event && terminate, "fmi2CompletedIntegratorStep: a pointer is null")
    *event = *terminate = fmi2False;
    return fmi2OK;
}

/* ---- values ------------------------------------------------------------------------------------------------- */

fmi2Status fmi2SetTime(fmi2Component component, fmi2Real t)
{
    ENTER_AS(fmi2ModelExchange, "SetTime", MAY_SetTime)
    REQUIRE(isfinite(t), "fmi2SetTime: time %g must be finite", t)
    c->model.time = t;
    c->model.run.stale = true;
    return fmi2OK;
}

fmi2Status fmi2SetContinuousStates(fmi2Component component, const fmi2Real states[], size_t n)
{
    ENTER_AS(fmi2ModelExchange, "SetContinuousStates", MAY_SetContinuousStates)
    REQUIRE_STATES(states, n, ALL_STATES)
    const double *from = states;
    for (int r = 0; r < STATE_ROWS; r++)
        for (uint32_t k = 0; k < state_rows[r].count; k++)
            *value_of(&c->model, state_rows[r].index + k) = *from++;
    c->model.run.stale = true;
    return fmi2OK;
}

/* A function that returns a value for each state, the element k of `row`. */
#define GET_OF_STATES(what, allowed, needs_results, value)                                                             \
    fmi2Status fmi2Get##what(fmi2Component component, fmi2Real values[], size_t n)                                     \
    {                                                                                                                  \
        ENTER_AS(fmi2ModelExchange, "Get" #what, allowed)                                                              \
        REQUIRE_VECTOR("Get" #what, values, n, ALL_STATES, "states")                                                   \
        const fmi2Status status = needs_results ? check_outputs(c, #what) : fmi2OK;                                    \
        if (status != fmi2OK)                                                                                          \
            return status;                                                                                             \
        for (const StateRow *row = state_rows; row < state_rows + STATE_ROWS; row++)                                   \
            for (uint32_t k = 0; k < row->count; k++)                                                                  \
                *values++ = value;                                                                                     \
        return fmi2OK;                                                                                                 \
    }
GET_OF_STATES(ContinuousStates, MAY_GetContinuous, true,
              *value_of(&c->model, row->index + k)) /* may follow parameters */
GET_OF_STATES(NominalsOfContinuousStates, ANY_MODE, false, row->nominal)
GET_OF_STATES(Derivatives, MAY_GetContinuous, true, *value_of(&c->model, row->derivative + k))

fmi2Status fmi2GetEventIndicators(fmi2Component component, fmi2Real values[], size_t n)
{
    ENTER_AS(fmi2ModelExchange, "GetEventIndicators", MAY_GetContinuous)
    REQUIRE_VECTOR("GetEventIndicators", values, n, INDICATORS, "event indicators")
#ifdef EVENTS
    double left[INDICATORS], before[VALUES];
    const bool stale = c->model.run.stale;
    memcpy(before, &c->model, sizeof before);
    const fmi2Status status = check_outputs(c, "EventIndicators");
    if (status != fmi2OK)
        return status;
    indicators(&c->model, left);
    if (!all_finite(left, INDICATORS)) {
        memcpy(&c->model, before, sizeof before);
        c->model.run.stale = stale;
        return not_finite(c, "EventIndicators", "an event indicator");
    }
    memcpy(values, left, sizeof left);
#endif
    return fmi2OK;
}

#endif
