/* Steps of co-simulation. A step is cut at the samples of a sampled block, and at the grid of a composite, where the
   importer wants to take part: in event mode with early return, or by intermediate updates. */

#ifndef FMI3_STEP_H
#define FMI3_STEP_H

/* Return the end of the next piece of a step that ends at `end`. */
static double next_stop_3(const Shell *c, double now, double end)
{
    double stop = INFINITY;
    if (!c->update && !(c->events && c->returns))
        return end;
#if HAS_EVENT_MODE
    const Model *const m = &c->inside->model;
    const double slack = sample_slack(m);
    stop = now + to_next_event_3(m);
#elif defined COMPOSITE_H
    const double slack = tick_slack(&c->inside->memory), rest = STEP_SIZE - c->inside->memory.spent;
    stop = now + (rest <= slack ? rest + STEP_SIZE : rest);
#else
    const double slack = 0.0;
    (void)now;
#endif
    return stop < end - slack ? stop : end;
}

/* Return whether a sample is due, which the importer takes in event mode. */
static bool event_due_3(const Shell *c)
{
#if HAS_EVENT_MODE
    const Model *const m = &c->inside->model;
    return c->events && m->run.rest <= sample_slack(m);
#else
    (void)c;
    return false;
#endif
}

/* Let the importer read values at the end of a piece; return whether it ends the step here. `end` is moved to the time
   at which it wants to. */
static bool ended_by_importer(Shell *c, double now, double *end)
{
    fmi3Boolean wanted = false;
    fmi3Float64 when = now;
    if (!c->update)
        return false;
    c->mode = INTERMEDIATE_3;
    c->update(c->environment, now, false, true, true, c->returns, &wanted, &when);
    c->mode = STEPS_3;
    c->function = "fmi3DoStep";
    if (!wanted || !c->returns)
        return false;
    *end = when < *end ? when : *end;
    return when <= now;
}

/* FMI 3.0 has no time derivatives of inputs. This function offers those of FMI 2.0 to an importer that knows it. */
#define friction_fmus_SetInputDerivatives fmi3FullName(friction_fmus_SetInputDerivatives)

FMI3_Export fmi3Status friction_fmus_SetInputDerivatives(fmi3Instance instance, const fmi3ValueReference references[],
                                                         size_t n, const fmi3Int32 orders[],
                                                         const fmi3Float64 values[]);

fmi3Status friction_fmus_SetInputDerivatives(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                                             const fmi3Int32 orders[], const fmi3Float64 values[])
{
    ENTER_3_AS(fmi2CoSimulation, "SetInputDerivatives", NEW_3 | INITIALIZATION_3 | STEPS_3)
    const fmi3Status status = check_variables_3(c, references, n, values, n, IS_FLOAT64);
    if (status != fmi3OK)
        return status;
    REQUIRE_ELEMENTS(list, references, n, n)
    return (fmi3Status)fmi2SetRealInputDerivatives(c->inside, list, n, orders, values);
}

/* Step in pieces. */
static APART fmi3Status pieces_3(Shell *c, double t, double h, bool keeps_no_state, bool *event, bool *early,
                                 double *last)
{
    const double whole_end = t + h;
    double end = whole_end;
    fmi2Status worst = fmi2OK;
    for (double now = t;;) {
        const double stop = next_stop_3(c, now, end);
        const bool whole = now == t && stop == whole_end;
        if (now == t && !whole && fmi2GetFMUstate(c->inside, &c->begin) > fmi2Warning)
            return fmi3Error;
        if (now > t) /* the input derivatives are of the whole step */
            SLOPES_USED(c->inside) = false;
        const fmi2Status status = fmi2DoStep(c->inside, now, whole ? h : stop - now, keeps_no_state ? 1 : 0);
        if (status == fmi2Discard && now > t && fmi2SetFMUstate(c->inside, c->begin) > fmi2Warning)
            return fmi3Error;
        if (status > fmi2Warning)
            return (fmi3Status)status;
        worst = status > worst ? status : worst;
        *last = now = stop;
        *event = event_due_3(c);
        if (ended_by_importer(c, now, &end) || !(now < end) || (*event && c->returns)) {
            *early = now < whole_end;
            return (fmi3Status)worst;
        }
    }
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 t, fmi3Float64 h, fmi3Boolean keeps_no_state,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last)
{
    ENTER_3("DoStep", MAY3_DoStep) /* no mode of model exchange is among them */
    REQUIRE_3(event && terminate && early && last, "was called with a null pointer")
    *event = *terminate = *early = false;
    *last = t + h;
    const fmi3Status status = c->update || c->events ? pieces_3(c, t, h, keeps_no_state, event, early, last)
                                                     : (fmi3Status)fmi2DoStep(c->inside, t, h, keeps_no_state ? 1 : 0);
    if (status > fmi3Warning) {
        *event = *early = false;
        *last = t;
    }
    if (status != fmi3Discard)
        return status;
    MODE(c->inside) = STEP_COMPLETE; /* all is as before the call: a shorter step may follow */
    *terminate = *early = ENDED(c->inside);
    return *terminate ? fmi3OK : fmi3Discard;
}

#endif
