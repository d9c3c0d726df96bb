/* What the shells of a block and of a composite have in common for values. */

#ifndef FMI2_VALUES_H
#define FMI2_VALUES_H

static const char *name_of(const Instance *c, fmi2ValueReference reference);

/* Return whether all derivatives of inputs are finite; log the first one that is not. */
static bool slopes_are_finite(const Instance *c, const fmi2ValueReference references[], size_t n,
                              const fmi2Real values[])
{
    for (size_t i = 0; i < n; i++)
        if (!isfinite(values[i])) {
            (void)report(c, fmi2Discard, LOG_DISCARD,
                         "fmi2SetRealInputDerivatives: the derivative %g of %s is not finite", values[i],
                         name_of(c, references[i]));
            return false;
        }
    return true;
}

fmi2Status fmi2GetString(fmi2Component component, const fmi2ValueReference references[], size_t n, fmi2String values[])
{
    ENTER("GetString", MAY_Get)
    (void)references;
    (void)values;
    REQUIRE(n == 0, "fmi2GetString: %s has no String variables", QUOTE(MODEL))
    return fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component component, const fmi2ValueReference references[], size_t n,
                         const fmi2String values[])
{
    ENTER("SetString", MAY_Set)
    (void)references;
    (void)values;
    REQUIRE(n == 0, "fmi2SetString: %s has no String variables", QUOTE(MODEL))
    return fmi2OK;
}

#endif
