/* Partial derivatives, and time derivatives of outputs, element by element from those of FMI 2.0. */

#ifndef FMI3_DERIVATIVES_H
#define FMI3_DERIVATIVES_H

/* Return the number of elements of variables of type Float64; 0 after a message if one is unknown. */
static size_t elements_in_3(const Shell *c, const fmi3ValueReference references[], size_t n)
{
    size_t count = 0;
    for (size_t i = 0; i < n; i++) {
        if (references[i] >= INDICATORS_REFERENCE || variables_3[references[i]].type != IS_FLOAT64) {
            (void)fail_3(c, "was called with value reference %u: it has no derivatives", references[i]);
            return 0;
        }
        count += size_of_3(c, references[i]);
    }
    return count;
}

/* A product of a row and the derivatives: sensitivity[j] = sum over i of seed[i] d unknown[i] / d known[j]. */
static fmi3Status adjoint_3(Shell *c, const fmi2ValueReference unknowns[], size_t n_unknowns,
                            const fmi2ValueReference knowns[], size_t n_knowns, const double seed[],
                            double sensitivity[])
{
    const double one = 1.0;
    for (size_t i = 0; i < n_unknowns; i++)
        REQUIRE_3(isfinite(seed[i]), "was called with a seed that is not finite")
    for (size_t j = 0; j < n_knowns; j++) {
        const fmi2Status status =
            fmi2GetDirectionalDerivative(c->inside, unknowns, n_unknowns, &knowns[j], 1, &one, c->numbers);
        if (status > fmi2Warning)
            return (fmi3Status)status;
        double sum = 0.0;
        for (size_t i = 0; i < n_unknowns; i++)
            sum += seed[i] * c->numbers[i];
        sensitivity[j] = sum;
    }
    return fmi3OK;
}

/* A derivative of each kind needs the elements of unknowns and knowns at the same time. */
static fmi3Status differentiate_3(Shell *c, bool is_adjoint, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                  const fmi3ValueReference knowns[], size_t n_knowns, const double seed[],
                                  size_t n_seed, double sensitivity[], size_t n_sensitivity)
{
    REQUIRE_3((n_unknowns == 0 || unknowns) && (n_knowns == 0 || knowns) && (n_seed == 0 || seed) &&
                  (n_sensitivity == 0 || sensitivity),
              "was called with a null pointer")
    const size_t above = elements_in_3(c, unknowns, n_unknowns), below = elements_in_3(c, knowns, n_knowns);
    if ((n_unknowns > 0 && above == 0) || (n_knowns > 0 && below == 0))
        return fmi3Error;
    const size_t given = is_adjoint ? above : below, asked = is_adjoint ? below : above;
    REQUIRE_3(n_seed == given && n_sensitivity == asked,
              "was called with %u seeds and %u sensitivities, but the variables have %u and %u elements",
              (unsigned)n_seed, (unsigned)n_sensitivity, (unsigned)given, (unsigned)asked)
    REQUIRE_3(above + below <= REFERENCES, "was called with a variable more than once")
    fmi2ValueReference *const lower = c->listed + above;
    fmi2ValueReference *to = c->listed;
    for (size_t i = 0; i < n_unknowns + n_knowns; i++) {
        const fmi3ValueReference reference = i < n_unknowns ? unknowns[i] : knowns[i - n_unknowns];
        for (size_t k = 0, size = size_of_3(c, reference); k < size; k++)
            *to++ = variables_3[reference].inner + (fmi2ValueReference)k;
    }
    if (!is_adjoint)
        return (fmi3Status)fmi2GetDirectionalDerivative(c->inside, c->listed, above, lower, below, seed, sensitivity);
    return adjoint_3(c, c->listed, above, lower, below, seed, sensitivity);
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                        const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[],
                                        size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity)
{
    ENTER_3("GetDirectionalDerivative", MAY3_GetDerivative)
    return differentiate_3(c, false, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed, sensitivity, n_sensitivity);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[],
                                    size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity)
{
    ENTER_3("GetAdjointDerivative", MAY3_GetDerivative)
    return differentiate_3(c, true, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed, sensitivity, n_sensitivity);
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                                    const fmi3Int32 orders[], fmi3Float64 values[], size_t count)
{
    ENTER_3_AS(fmi2CoSimulation, "GetOutputDerivatives", MAY3_GetOutputDerivatives)
    const fmi3Status status = check_variables_3(c, references, n, values, count, IS_FLOAT64);
    if (status != fmi3OK)
        return status;
    REQUIRE_3(n == 0 || orders, "was called with a null pointer")
    for (size_t i = 0; i < n; i++)
        REQUIRE_3(orders[i] == 1, "was called with order %d, but only order 1 is available", orders[i])
    REQUIRE_3(count <= REFERENCES, "was called with a variable more than once")
    for (size_t i = 0; i < n; i++)
        REQUIRE_3(!is_indicator_3(references[i]), "was called for the event indicators, which are no outputs")
    REQUIRE_ELEMENTS(list, references, n, count)
    for (size_t i = 0; i < count; i++)
        c->whole[i] = 1;
    return (fmi3Status)fmi2GetRealOutputDerivatives(c->inside, list, count, c->whole, values);
}

#endif
