/* Derivatives in FMI 2.0: directional derivatives, and time derivatives of inputs and outputs. */

#ifndef BLOCK_FMI2_DERIVATIVES_H
#define BLOCK_FMI2_DERIVATIVES_H

/* Return `unknown` at the current values plus e times `direction`. */
static double moved_value(Instance *c, uint32_t unknown, const double *direction, double e)
{
    Model *const work = spare(c);
    for (uint32_t i = 0; i < VALUES; i++)
        if (direction[i] != 0.0)
            *value_of(work, i) += e * direction[i];
    evaluate(work);
    return *value_of(work, unknown);
}

/* Return d unknown / d e at e = 0: central differences over successively halved distances, extrapolated to zero; the
   result with the smallest error estimate is used. Ridders, Adv. Eng. Software 4(2), 1982. */
static double derivative_within(Instance *c, uint32_t unknown, const double *direction, double distance, double *off)
{
    enum { LEVELS = 28 };
    double grain = 0.0; /* rounding error of the moved values in terms of e */
    for (uint32_t i = 0; i < VALUES; i++)
        if (direction[i] != 0.0)
            grain = fmax(grain, DBL_EPSILON * fabs(*value_of(&c->model, i) / direction[i]));
    double previous[LEVELS], current[LEVELS], best = NAN, smallest = INF;
    for (int level = 0; level < LEVELS; level++, distance *= 0.5) {
        const double above = moved_value(c, unknown, direction, distance);
        const double below = moved_value(c, unknown, direction, -distance);
        current[0] = (above - below) / (2.0 * distance);
        const double rounding = (DBL_EPSILON * fmax(fabs(above), fabs(below)) + grain * fabs(current[0])) / distance;
        double weight = 4.0;
        for (int j = 1; j <= level; j++, weight *= 4.0) {
            current[j] = (weight * current[j - 1] - previous[j - 1]) / (weight - 1.0);
            const double error =
                fmax(rounding, fmax(fabs(current[j] - current[j - 1]), fabs(current[j] - previous[j - 1])));
            if (error < smallest) {
                smallest = error;
                best = current[j];
            }
        }
        memcpy(previous, current, sizeof current);
    }
    *off = smallest;
    return best;
}

/* Return d unknown / d e at e = 0. Nothing changes its sign within `near`, so that no kink at zero is met; differences
   over `far` are used if they only make the result more precise. */
static double derivative_along(Instance *c, uint32_t unknown, const double *direction, double near, double far)
{
    double off, off_far;
    const double value = derivative_within(c, unknown, direction, near, &off);
    if (near == far)
        return value;
    const double other = derivative_within(c, unknown, direction, far, &off_far);
    return isfinite(other) && off_far < off && !(fabs(other - value) > off) ? other : value;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component component, const fmi2ValueReference unknowns[], size_t n_unknowns,
                                        const fmi2ValueReference knowns[], size_t n_knowns, const fmi2Real seed[],
                                        fmi2Real result[])
{
    ENTER("GetDirectionalDerivative", MAY_GetDirectionalDerivative)
    double direction[VALUES] = {0.0}, near = INF, far = INF;
    REQUIRE((n_unknowns == 0 || (unknowns && result)) && (n_knowns == 0 || (knowns && seed)),
            "fmi2GetDirectionalDerivative: a pointer is null")
    for (size_t i = 0; i < n_unknowns; i++) {
        const int role = unknowns[i] < VALUES ? c->row_of[unknowns[i]]->role : ROLE_TIME;
        REQUIRE((role == ROLE_OUTPUT || role == ROLE_LOCAL || role == ROLE_STATE_OUTPUT || role == ROLE_DERIVATIVE) &&
                    c->row_of[unknowns[i]]->type == TYPE_REAL,
                "fmi2GetDirectionalDerivative: value reference %u is not an output or derivative", unknowns[i])
    }
    for (size_t i = 0; i < n_knowns; i++) {
        const Row *const row = knowns[i] < VALUES ? c->row_of[knowns[i]] : &rows[0];
        const bool exact = row->role == ROLE_PARAMETER || row->role == ROLE_FIXED;
        REQUIRE(row->type == TYPE_REAL && (row->role == ROLE_INPUT || row->role == ROLE_STATE ||
                                           row->role == ROLE_STATE_OUTPUT || (exact && MODE(c) == INITIALIZING)),
                "fmi2GetDirectionalDerivative: value reference %u is not an input, state or, in initialization mode, "
                "parameter",
                knowns[i])
        REQUIRE(isfinite(seed[i]), "fmi2GetDirectionalDerivative: seed %d is not finite", (int)i)
        direction[knowns[i]] += seed[i];
    }
    for (uint32_t i = 0; i < VALUES; i++)
        if (direction[i] != 0.0) {
            const double value = fabs(*value_of(&c->model, i)), nominal = c->row_of[i]->nominal;
            near = fmin(near, 0.05 * (value > 1e-30 * nominal ? value : nominal) / fabs(direction[i]));
            far = fmin(far, 0.05 * (value > 1e-5 * nominal ? value : nominal) / fabs(direction[i]));
        }
#ifdef SAMPLED
    const bool held = c->model.run.tick > 0; /* until the next sample, which is another value */
#else
    const bool held = false;
#endif
    double found[VALUES];
    for (size_t i = 0; i < n_unknowns; i++) {
        const double value = held        ? direction[unknowns[i]]
                             : far < INF ? derivative_along(c, unknowns[i], direction, near, far)
                                         : 0.0;
        REQUIRE(isfinite(value), "fmi2GetDirectionalDerivative: the derivative of %s is not finite",
                c->row_of[unknowns[i]]->name)
        found[unknowns[i]] = value;
    }
    for (size_t i = 0; i < n_unknowns; i++)
        result[i] = found[unknowns[i]];
    return fmi2OK;
}

static const char *name_of(const Instance *c, fmi2ValueReference reference) { return c->row_of[reference]->name; }

static fmi2Status check_derivatives(const Instance *c, const char *function, int role,
                                    const fmi2ValueReference references[], size_t n, const fmi2Integer orders[],
                                    const fmi2Real values[])
{
    REQUIRE(n == 0 || (references && orders && values), "%s: a pointer is null", function)
    for (size_t i = 0; i < n; i++) {
        const Row *const row = references[i] < VALUES ? c->row_of[references[i]] : &rows[0];
        const bool fits = row->role == role || (role == ROLE_OUTPUT && row->role == ROLE_STATE_OUTPUT);
        REQUIRE(fits && row->type == TYPE_REAL, "%s: value reference %u is not a Real %s", function, references[i],
                role == ROLE_INPUT ? "input" : "output")
        REQUIRE(orders[i] == 1, "%s: order %d of %s is not supported, only order 1", function, orders[i], row->name)
    }
    return fmi2OK;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t n,
                                       const fmi2Integer orders[], const fmi2Real values[])
{
    ENTER_AS(fmi2CoSimulation, "SetRealInputDerivatives", MAY_SetRealInputDerivatives)
    const fmi2Status status =
        check_derivatives(c, "fmi2SetRealInputDerivatives", ROLE_INPUT, references, n, orders, values);
    if (status != fmi2OK)
        return status;
    if (!slopes_are_finite(c, references, n, values))
        return fmi2Discard;
    if (c->model.run.slopes_used)
        memset(c->model.slope, 0, sizeof c->model.slope);
    c->model.run.slopes_used = false;
    c->model.run.sloped = true;
    for (size_t i = 0; i < n; i++)
        for (int k = 0; k < INPUTS; k++)
            if (inputs[k] == references[i])
                c->model.slope[k] = values[i];
    return fmi2OK;
}

/* Time derivatives of the outputs at the end of the step, with the rates of states and inputs in the step. */
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t n,
                                        const fmi2Integer orders[], fmi2Real values[])
{
    ENTER_AS(fmi2CoSimulation, "GetRealOutputDerivatives", MAY_GetRealOutputDerivatives)
    const fmi2Status status =
        check_derivatives(c, "fmi2GetRealOutputDerivatives", ROLE_OUTPUT, references, n, orders, values);
    if (status != fmi2OK)
        return status;
#ifdef SAMPLED
    for (size_t i = 0; i < n; i++)
        values[i] = 0.0; /* held between samples */
#else
    double direction[VALUES] = {0.0}, found[VALUES];
    Model *const now = spare(c); /* not refreshed in place, as the call may still be rejected */
    if (now->run.stale)
        evaluate(now);
    REQUIRE(results_finite(now), "fmi2GetRealOutputDerivatives: an output of \"%s\" is not finite", c->name)
    direction[AT(time)] = 1.0;
    for (int r = 0; r < STATE_ROWS; r++)
        for (uint32_t k = 0; k < state_rows[r].count; k++)
            direction[state_rows[r].index + k] = *value_of(now, state_rows[r].derivative + k);
    for (int i = 0; i < INPUTS; i++)
        direction[inputs[i]] = c->model.slope[i];
    const double distance = 0.05 * (c->model.run.last_step > 0.0 ? c->model.run.last_step : 1e-3);
    for (size_t i = 0; i < n; i++) {
        const double value = derivative_along(c, references[i], direction, distance, distance);
        REQUIRE(isfinite(value), "fmi2GetRealOutputDerivatives: the derivative of %s is not finite",
                c->row_of[references[i]]->name)
        found[references[i]] = value;
    }
    for (size_t i = 0; i < n; i++)
        values[i] = found[references[i]];
#endif
    return fmi2OK;
}

#endif
