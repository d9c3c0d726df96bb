/* Event mode: in co-simulation, the samples of a sampled block; in model exchange, the events of FMI 2.0. */

#ifndef FMI3_EVENTS_H
#define FMI3_EVENTS_H

#if HAS_EVENT_MODE
/* Return the time to the next sample, after the one that is due, which begins the next step. */
static double to_next_event_3(const Model *m)
{
    return m->run.rest <= sample_slack(m) ? m->run.rest + m->Ts : m->run.rest;
}
#endif

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    ENTER_3("EnterEventMode", MAY3_EnterEventMode)
#if HAS_MODEL_EXCHANGE
    if (KIND(c->inside) == fmi2ModelExchange)
        return entered_3(c, fmi2EnterEventMode(c->inside), EVENTS_3);
#endif
    REQUIRE_3(c->events, "is not allowed: the FMU was instantiated with eventModeUsed = false")
    c->mode = EVENTS_3;
    return fmi3OK;
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    ENTER_3_AS(fmi2CoSimulation, "EnterStepMode", MAY3_EnterStepMode)
    c->ticking = false;
    c->mode = STEPS_3;
    return fmi3OK;
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    ENTER_3("EvaluateDiscreteStates", MAY3_UpdateDiscreteStates)
    return fail_3(c, "is not available: providesEvaluateDiscreteStates is false");
}

/* Take what is due at an event. */
static fmi2Status update_3(Shell *c, fmi2EventInfo *info)
{
    memset(info, 0, sizeof *info);
#if HAS_MODEL_EXCHANGE
    if (KIND(c->inside) == fmi2ModelExchange)
        return fmi2NewDiscreteStates(c->inside, info);
#endif
#if HAS_EVENT_MODE
    if (c->ticking)
        return new_discrete_states(c->inside, info);
    info->nextEventTimeDefined = fmi2True; /* without the clock, the sample is left to fmi3DoStep */
    info->nextEventTime = c->inside->model.time + to_next_event_3(&c->inside->model);
#endif
    (void)c;
    return fmi2OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *again, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals_changed, fmi3Boolean *states_changed,
                                    fmi3Boolean *next_time_defined, fmi3Float64 *next_time)
{
    ENTER_3("UpdateDiscreteStates", MAY3_UpdateDiscreteStates)
    REQUIRE_3(again && terminate && nominals_changed && states_changed && next_time_defined && next_time,
              "was called with a null pointer")
    fmi2EventInfo info;
    const fmi2Status status = update_3(c, &info);
    if (status > fmi2Warning)
        return (fmi3Status)status;
    c->ticking = false;
    *again = info.newDiscreteStatesNeeded != fmi2False;
    *terminate = info.terminateSimulation != fmi2False;
    *nominals_changed = info.nominalsOfContinuousStatesChanged != fmi2False;
    *states_changed = info.valuesOfContinuousStatesChanged != fmi2False;
    *next_time_defined = info.nextEventTimeDefined != fmi2False;
    *next_time = info.nextEventTime;
    return (fmi3Status)status;
}

#endif
