/* Model exchange: the states of FMI 2.0, of which a resized array has the first elements. */

#ifndef FMI3_EXCHANGE_H
#define FMI3_EXCHANGE_H

#if HAS_MODEL_EXCHANGE
#define ENTER_EXCHANGE(name, allowed) ENTER_3_AS(fmi2ModelExchange, name, allowed)
#define EXCHANGE(call)                return call;
#else
#define ENTER_EXCHANGE(name, allowed)                                                                                  \
    ENTER_3(name, allowed)                                                                                             \
    return fail_3(c, "is not allowed in co-simulation");
#define EXCHANGE(call)
#endif

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance){
    ENTER_EXCHANGE("EnterContinuousTimeMode", MAY3_EnterContinuousTimeMode)
        EXCHANGE(entered_3(c, fmi2EnterContinuousTimeMode(c -> inside), CONTINUOUS_3))}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean keeps_no_state, fmi3Boolean *event,
                                       fmi3Boolean *terminate)
{
    (void)keeps_no_state;
    ENTER_EXCHANGE("CompletedIntegratorStep", MAY3_InContinuousTime)
    REQUIRE_3(event && terminate, "was called with a null pointer")
#if HAS_MODEL_EXCHANGE
    fmi2Boolean enter = fmi2False, end = fmi2False;
    const fmi2Status status = fmi2CompletedIntegratorStep(c->inside, keeps_no_state ? 1 : 0, &enter, &end);
    *event = enter != fmi2False;
    *terminate = end != fmi2False;
    return (fmi3Status)status;
#endif
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 t)
{
    (void)t;
    ENTER_EXCHANGE("SetTime", MAY3_SetTime)
    EXCHANGE((fmi3Status)fmi2SetTime(c->inside, t))
}

#if HAS_MODEL_EXCHANGE
/* Return the number of states, or of all elements of their arrays. */
static size_t state_count_3(const Shell *c, bool all)
{
    size_t count = 0;
    for (int i = 0; i < STATE_VARIABLES; i++)
        count += all ? variables_3[state_variables[i]].length : size_of_3(c, state_variables[i]);
    return count;
}

typedef fmi2Status states_getter(fmi2Component component, fmi2Real values[], size_t n);

/* Get one number for each state. */
static fmi3Status get_of_states(Shell *c, states_getter *get, double *values, size_t n)
{
    const size_t all = state_count_3(c, true);
    REQUIRE_3(n == state_count_3(c, false), "was called with %u values, but %s has %u continuous states", (unsigned)n,
              QUOTE(MODEL), (unsigned)state_count_3(c, false))
    REQUIRE_3(n == 0 || values, "was called with a null pointer")
    const fmi2Status status = get(c->inside, n == all ? values : c->numbers, all);
    if (status > fmi2Warning || n == all)
        return (fmi3Status)status;
    const double *from = c->numbers;
    for (int i = 0; i < STATE_VARIABLES; i++) {
        const size_t size = size_of_3(c, state_variables[i]);
        memcpy(values, from, size * sizeof *values);
        values += size;
        from += variables_3[state_variables[i]].length;
    }
    return (fmi3Status)status;
}

static fmi3Status set_of_states(Shell *c, const double *values, size_t n)
{
    const size_t all = state_count_3(c, true);
    REQUIRE_3(n == state_count_3(c, false), "was called with %u values, but %s has %u continuous states", (unsigned)n,
              QUOTE(MODEL), (unsigned)state_count_3(c, false))
    if (n == all)
        return (fmi3Status)fmi2SetContinuousStates(c->inside, values, n);
    REQUIRE_3(values, "was called with a null pointer")
#ifdef STRUCTURAL
    double *to = c->numbers;
    for (int i = 0; i < STATE_VARIABLES; i++) {
        const Variable3 *const v = &variables_3[state_variables[i]];
        const size_t size = size_of_3(c, state_variables[i]);
        memcpy(to, value_of(&c->inside->model, v->inner), v->length * sizeof *to); /* the rest is kept */
        memcpy(to, values, size * sizeof *to);
        to += v->length;
        values += size;
    }
#endif
    return (fmi3Status)fmi2SetContinuousStates(c->inside, c->numbers, all);
}
#endif

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 states[], size_t n)
{
    (void)states, (void)n;
    ENTER_EXCHANGE("GetContinuousStates", MAY3_GetContinuousStates)
    EXCHANGE(get_of_states(c, fmi2GetContinuousStates, states, n))
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 states[], size_t n)
{
    (void)states, (void)n;
    ENTER_EXCHANGE("SetContinuousStates", MAY3_InContinuousTime)
    EXCHANGE(set_of_states(c, states, n))
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[], size_t n)
{
    (void)derivatives, (void)n;
    ENTER_EXCHANGE("GetContinuousStateDerivatives", MAY3_GetContinuousStates)
    EXCHANGE(get_of_states(c, fmi2GetDerivatives, derivatives, n))
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[], size_t n)
{
    (void)nominals, (void)n;
    ENTER_EXCHANGE("GetNominalsOfContinuousStates", MAY3_GetContinuousStates)
    EXCHANGE(get_of_states(c, fmi2GetNominalsOfContinuousStates, nominals, n))
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 values[], size_t n)
{
    (void)values, (void)n;
    ENTER_EXCHANGE("GetEventIndicators", MAY3_GetContinuousStates)
    EXCHANGE((fmi3Status)fmi2GetEventIndicators(c->inside, values, n))
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *n)
{
    ENTER_EXCHANGE("GetNumberOfContinuousStates", ANY_3)
    REQUIRE_3(n, "was called with a null pointer")
#if HAS_MODEL_EXCHANGE
    *n = state_count_3(c, false);
    return fmi3OK;
#endif
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *n)
{
    ENTER_EXCHANGE("GetNumberOfEventIndicators", ANY_3)
    REQUIRE_3(n, "was called with a null pointer")
#if HAS_MODEL_EXCHANGE
    *n = INDICATOR_COUNT;
    return fmi3OK;
#endif
}

#endif
