/* The clock of a sampled block: it ticks at start + k Ts. An importer that uses event mode takes each sample in an
   event; one that does not leaves the samples to fmi3DoStep. The numbers are the same. */

#ifndef FMI3_CLOCK_H
#define FMI3_CLOCK_H

/* Check the clocks of a call; the only one is that of the samples. */
static fmi3Status check_clocks_3(const Shell *c, const fmi3ValueReference references[], size_t n, const void *values)
{
    REQUIRE_3(n == 0 || (references && values), "was called with a null pointer")
    for (size_t i = 0; i < n; i++)
        REQUIRE_3(references[i] == CLOCK_REFERENCE && variables_3[CLOCK_REFERENCE].type == IS_CLOCK,
                  "was called with value reference %u: there is no clock with it", references[i])
    return fmi3OK;
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference references[], size_t n, fmi3Clock values[])
{
    ENTER_3("GetClock", MAY3_SetClock)
    const fmi3Status status = check_clocks_3(c, references, n, values);
    for (size_t i = 0; i < n && status == fmi3OK; i++)
        values[i] = c->ticking;
    return status;
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                        const fmi3Clock values[])
{
    ENTER_3("SetClock", MAY3_SetClock)
    const fmi3Status status = check_clocks_3(c, references, n, values);
#if HAS_EVENT_MODE
    const Model *const m = &c->inside->model;
    for (size_t i = 0; i < n && status == fmi3OK; i++) {
        /* in model exchange, an event takes the sample even without the clock */
        const double ahead = to_next_sample(m), taken = m->run.exchange && m->run.tick > 0 ? ahead - m->Ts : ahead;
        REQUIRE_3(!values[i] || fmin(fabs(ahead), fabs(taken)) <= sample_slack(m),
                  "was called at t = %.17g s, but the next tick is at %.17g s", m->time, m->time + ahead)
        c->ticking = values[i];
    }
#endif
    return status;
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                                  fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
{
    ENTER_3("GetIntervalDecimal", MAY3_GetInterval)
    const fmi3Status status = check_clocks_3(c, references, n, intervals);
    REQUIRE_3(n == 0 || qualifiers, "was called with a null pointer")
#if HAS_EVENT_MODE
    for (size_t i = 0; i < n && status == fmi3OK; i++) {
        intervals[i] = c->inside->model.Ts;
        qualifiers[i] = c->told ? fmi3IntervalUnchanged : fmi3IntervalChanged;
        c->told = c->mode != INITIALIZATION_3; /* Ts may still change there */
    }
#endif
    return status;
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                               fmi3Float64 shifts[])
{
    ENTER_3("GetShiftDecimal", MAY3_GetInterval)
    const fmi3Status status = check_clocks_3(c, references, n, shifts);
    for (size_t i = 0; i < n && status == fmi3OK; i++)
        shifts[i] = 0.0;
    return status;
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                                   fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
{
    ENTER_3("GetIntervalFraction", MAY3_GetInterval)
    (void)references, (void)counters, (void)resolutions, (void)qualifiers;
    REQUIRE_3(n == 0, "is not possible: the interval is a decimal number (supportsFraction is false)")
    return fmi3OK;
}

fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                                fmi3UInt64 counters[], fmi3UInt64 resolutions[])
{
    ENTER_3("GetShiftFraction", MAY3_GetInterval)
    (void)references, (void)counters, (void)resolutions;
    REQUIRE_3(n == 0, "is not possible: the shift is a decimal number (supportsFraction is false)")
    return fmi3OK;
}

/* The importer may set the interval of no clock, as modelDescription.xml states none: set the parameter Ts instead. */
#define CANNOT_SET_DECIMAL(name)                                                                                       \
    fmi3Status fmi3Set##name(fmi3Instance instance, const fmi3ValueReference references[], size_t n,                   \
                             const fmi3Float64 values[])                                                               \
    {                                                                                                                  \
        ENTER_3("Set" #name, MAY3_GetInterval)                                                                         \
        (void)references, (void)values;                                                                                \
        REQUIRE_3(n == 0, "is not possible: the interval is the parameter Ts")                                         \
        return fmi3OK;                                                                                                 \
    }
CANNOT_SET_DECIMAL(IntervalDecimal)
CANNOT_SET_DECIMAL(ShiftDecimal)

#define CANNOT_SET_FRACTION(name)                                                                                      \
    fmi3Status fmi3Set##name(fmi3Instance instance, const fmi3ValueReference references[], size_t n,                   \
                             const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])                              \
    {                                                                                                                  \
        ENTER_3("Set" #name, MAY3_GetInterval)                                                                         \
        (void)references, (void)counters, (void)resolutions;                                                           \
        REQUIRE_3(n == 0, "is not possible: the interval is the parameter Ts")                                         \
        return fmi3OK;                                                                                                 \
    }
CANNOT_SET_FRACTION(IntervalFraction)
CANNOT_SET_FRACTION(ShiftFraction)

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 time)
{
    ENTER_3("ActivateModelPartition", ANY_3)
    (void)clock, (void)time;
    return fail_3(c, "is not possible: this FMU is not for scheduled execution");
}

#endif
