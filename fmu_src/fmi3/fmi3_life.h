/* Life of an instance, from instantiation to termination. */

#ifndef FMI3_LIFE_H
#define FMI3_LIFE_H

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean on, size_t n, const fmi3String categories_wanted[])
{
    ENTER_3("SetDebugLogging", ANY_3)
    return (fmi3Status)fmi2SetDebugLogging(c->inside, on, n, categories_wanted);
}

/* Return a new instance, or NULL after a message. `fault` is a reason known before. */
static Shell *instantiated_3(fmi3String name, fmi3String token, fmi2Type kind, fmi3Boolean visible, fmi3Boolean logging,
                             fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger, const char *fault)
{
    Shell *const c = (Shell *)calloc(1, sizeof(Shell));
    if (!c)
        return NULL;
    const fmi2CallbackFunctions callbacks = {forward_3, calloc, free, NULL, c};
    memcpy(&c->callbacks, &callbacks, sizeof callbacks); /* its members are const */
    c->function = kind == fmi2ModelExchange ? "fmi3InstantiateModelExchange" : "fmi3InstantiateCoSimulation";
    c->environment = environment;
    c->logger = logger;
    c->mode = NEW_3;
    for (fmi2ValueReference i = 0; i < REFERENCES; i++)
        c->elements[i] = i;
    if (!fault && (!token || strcmp(token, TOKEN) != 0))
        fault = "the instantiation token differs from that of this binary: modelDescription.xml and library do not "
                "match";
    if (fault && logger) {
        char text[400];
        snprintf(text, sizeof text, "%s of %s: %s", c->function, QUOTE(MODEL), fault);
        logger(environment, fmi3Error, categories[2], text);
    }
    c->inside = fault ? NULL
                      : (Instance *)fmi2Instantiate(name, kind, GUID_INSIDE, "", &c->callbacks, visible ? 1 : 0,
                                                    logging ? 1 : 0);
    if (!c->inside) {
        free(c);
        return NULL;
    }
    return c;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback logger)
{
    (void)resources;
    const char *const fault = HAS_MODEL_EXCHANGE ? NULL : "this FMU is for co-simulation only";
    return instantiated_3(name, token, fmi2ModelExchange, visible, logging, environment, logger, fault);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean returns,
                                         const fmi3ValueReference intermediate[], size_t intermediates,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                         fmi3IntermediateUpdateCallback update)
{
    (void)resources;
    const char *fault = NULL;
    if (events && !HAS_EVENT_MODE)
        fault = "it has no event mode; instantiate it with eventModeUsed = false";
    for (size_t i = 0; i < intermediates; i++)
        if (!intermediate || intermediate[i] >= ALL_REFERENCES || !variables_3[intermediate[i]].intermediate)
            fault = "a required intermediate variable is not marked with intermediateUpdate in modelDescription.xml";
    Shell *const c = instantiated_3(name, token, fmi2CoSimulation, visible, logging, environment, logger, fault);
    if (c) {
        c->events = events;
        c->returns = returns;
        c->update = update;
    }
    return c;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                               fmi3ClockUpdateCallback tick, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)tick, (void)lock, (void)unlock;
    if (logger)
        logger(environment, fmi3Error, categories[2],
               "fmi3InstantiateScheduledExecution of " QUOTE(MODEL) ": this FMU is not for scheduled execution");
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance)
{
    Shell *const c = (Shell *)instance;
    if (c) {
        (void)fmi2FreeFMUstate(c->inside, &c->begin);
        fmi2FreeInstance(c->inside);
    }
    free(c);
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance)
{
    ENTER_3("EnterConfigurationMode", MAY3_EnterConfigurationMode)
#ifdef STRUCTURAL
    c->mode = CONFIGURATION_3;
    return fmi3OK;
#else
    return fail_3(c, "is not allowed: %s has no structural parameters", QUOTE(MODEL));
#endif
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance)
{
    ENTER_3("ExitConfigurationMode", MAY3_ExitConfigurationMode)
    c->mode = NEW_3;
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean tolerance_given, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_given, fmi3Float64 stop)
{
    ENTER_3("EnterInitializationMode", MAY3_EnterInitializationMode)
    const fmi2Status status = fmi2SetupExperiment(c->inside, tolerance_given, tolerance, start, stop_given, stop);
    return status > fmi2Warning ? (fmi3Status)status
                                : entered_3(c, fmi2EnterInitializationMode(c->inside), INITIALIZATION_3);
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    ENTER_3("ExitInitializationMode", MAY3_ExitInitializationMode)
    const bool in_event_mode = c->events || KIND(c->inside) == fmi2ModelExchange;
    return entered_3(c, fmi2ExitInitializationMode(c->inside), in_event_mode ? EVENTS_3 : STEPS_3);
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    ENTER_3("Terminate", MAY3_Terminate)
    return entered_3(c, fmi2Terminate(c->inside), TERMINATED_3);
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    ENTER_3("Reset", ANY_3)
    c->ticking = c->told = false;
    return entered_3(c, fmi2Reset(c->inside), NEW_3);
}

#endif
