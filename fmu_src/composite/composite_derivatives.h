/* Directional derivatives, by the chain rule through the connections: each part gives its own. In an algebraic loop,
   the derivatives dw of its root values solve dw = G_w dw + G_u du. */

#ifndef COMPOSITE_DERIVATIVES_H
#define COMPOSITE_DERIVATIVES_H

/* A request, with room for the knowns of one part. */
typedef struct {
    const fmi2ValueReference *knowns;
    const fmi2Real *seed;
    size_t n_knowns;
    double *d; /* derivatives of all signals */
    fmi2ValueReference *references;
    double *seeds;
} Direction;

/* Compute derivatives of Real outputs of a part for the derivatives of its inputs and for its own seeded variables. */
static bool differentiate_part(Instance *c, const Direction *q, int64_t part, const fmi2ValueReference *unknowns,
                               size_t n, double *result)
{
    const EnginePart *const p = &c->parts[part];
    size_t count = 0;
    memset(result, 0, n * sizeof(double));
    for (int64_t k = p->inputs[REAL]; k < p->inputs[INTEGER]; k++) {
        const double gain = MAPPED > 0 ? c->memory.gains[k] : 1.0; /* 0 for a delayed value */
        const double seed = gain * q->d[source_of[k]];
        if (seed == 0.0)
            continue;
        q->references[count] = p->input_references[k - p->inputs[REAL]];
        q->seeds[count++] = seed;
    }
    for (size_t i = 0; i < q->n_knowns; i++) {
        const Variable *const v = &variables[q->knowns[i]];
        if (v->is_input || v->part != part || q->seed[i] == 0.0)
            continue;
        q->references[count] = v->reference;
        q->seeds[count++] = q->seed[i];
    }
    return count == 0 || n == 0 ||
           part_data[part].functions->get_directional(p->component, unknowns, n, q->references, count, q->seeds,
                                                      result) <= fmi2Warning;
}

/* Pass the derivatives through all parts until they stay; after the start, a sampled part holds its outputs. A loop
   needs one sweep, as the values that close it are given. */
static bool sweep_derivatives(Instance *c, const Direction *q)
{
    for (int64_t sweep = 0; sweep < (START_LOOP ? 1 : PARTS + 1); sweep++) {
        memcpy(c->earlier, q->d, SIGNALS * sizeof(double));
        for (int64_t k = 0; k < PARTS; k++) {
            const int64_t part = start_order[k];
            const EnginePart *const p = &c->parts[part];
            if (is_fmu(part) && (!p->sampled || MODE(c) == INITIALIZING) &&
                !differentiate_part(c, q, part, p->output_references, (size_t)count_of(p->outputs, REAL),
                                    q->d + p->outputs[REAL]))
                return false;
        }
        if (memcmp(c->earlier, q->d, SIGNALS * sizeof(double)) == 0)
            break;
    }
    return true;
}

/* Return the derivatives of all signals in q->d. */
static bool differentiate_signals(Instance *c, const Direction *q)
{
    double *const jacobian = c->start_work, *const inverse = jacobian + ROOTS * ROOTS,
                  *const g = inverse + ROOTS * ROOTS;
    const Direction none = {NULL, NULL, 0, q->d, q->references, q->seeds};
    for (int64_t j = 0; START_LOOP && j < ROOTS; j++) { /* columns of 1 - G_w */
        memset(q->d, 0, SIGNALS * sizeof(double));
        q->d[root_signals[j]] = 1.0;
        if (!sweep_derivatives(c, &none))
            return false;
        for (int64_t i = 0; i < ROOTS; i++)
            jacobian[i * ROOTS + j] = (double)(i == j) - q->d[root_signals[i]];
    }
    for (int pass = 0; pass < 2; pass++) { /* G_u du with dw = 0, then with the solution */
        memset(q->d, 0, SIGNALS * sizeof(double));
        for (int64_t k = 0; k < SIGNALS; k++)
            for (size_t i = 0; i < q->n_knowns && input_of_signal[k] >= 0; i++)
                if (variables[q->knowns[i]].is_input &&
                    variables[q->knowns[i]].reference == (uint32_t)input_of_signal[k])
                    q->d[k] += q->seed[i];
        for (int64_t i = 0; START_LOOP && pass == 1 && i < ROOTS; i++)
            for (int64_t j = 0; j < ROOTS; j++)
                q->d[root_signals[i]] += inverse[i * ROOTS + j] * g[j];
        if (!sweep_derivatives(c, q))
            return false;
        if (!START_LOOP)
            break;
        for (int64_t i = 0; pass == 0 && i < ROOTS; i++)
            g[i] = q->d[root_signals[i]];
        if (pass == 0)
            invert(jacobian, inverse, ROOTS);
    }
    return true;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component component, const fmi2ValueReference unknowns[], size_t n_unknowns,
                                        const fmi2ValueReference knowns[], size_t n_knowns, const fmi2Real seed[],
                                        fmi2Real result[])
{
    ENTER("GetDirectionalDerivative", MAY_GetDirectionalDerivative)
    REQUIRE((n_unknowns == 0 || (unknowns && result)) && (n_knowns == 0 || (knowns && seed)),
            "fmi2GetDirectionalDerivative: a pointer is null")
    REQUIRE(PROVIDES_DERIVATIVES, "fmi2GetDirectionalDerivative: a part of %s provides no directional derivatives",
            QUOTE(MODEL))
    for (size_t i = 0; i < n_unknowns; i++) {
        const Variable *const v = unknowns[i] < VARIABLES ? &variables[unknowns[i]] : NULL;
        REQUIRE(v && v->type == REAL && v->part >= 0 && !v->is_input && (v->setting == SET_NEVER || v->is_state),
                "fmi2GetDirectionalDerivative: value reference %u is not an output", unknowns[i])
    }
    for (size_t i = 0; i < n_knowns; i++) {
        const Variable *const v = knowns[i] < VARIABLES ? &variables[knowns[i]] : NULL;
        REQUIRE(v && v->type == REAL &&
                    (v->is_input || v->is_state || (v->setting != SET_NEVER && MODE(c) == INITIALIZING)),
                "fmi2GetDirectionalDerivative: value reference %u is not an input, state or, in initialization mode, a "
                "parameter",
                knowns[i])
        REQUIRE(isfinite(seed[i]), "fmi2GetDirectionalDerivative: seed %d is not finite", (int)i)
    }
    const bool fresh = c->refreshed || !c->memory.stale;
    const fmi2Status status = check_get(c, NULL, 0, NULL, REAL);
    if (status != fmi2OK)
        return status;
    double *const room = (double *)calloc(2 * (SIGNALS + 1) + n_knowns + n_unknowns, sizeof(double));
    fmi2ValueReference *const references = (fmi2ValueReference *)calloc(SIGNALS + 1 + n_knowns, sizeof *references);
    double *const found = room ? room + 2 * (SIGNALS + 1) + n_knowns : NULL;
    const Direction q = {knowns, seed, n_knowns, room, references, room ? room + SIGNALS + 1 : NULL};
    c->said[0] = '\0';
    bool good = room && references && differentiate_signals(c, &q);
    for (size_t i = 0; i < n_unknowns && good; i++) {
        const Variable *const v = &variables[unknowns[i]];
        const bool held = MODE(c) != INITIALIZING && c->parts[v->part].sampled;
        if (v->signal >= 0)
            found[i] = q.d[v->signal];
        else if (is_fmu(v->part) && !held)
            good = differentiate_part(c, &q, v->part, &v->reference, 1, &found[i]);
        good = good && isfinite(found[i]);
    }
    for (size_t i = 0; i < n_unknowns && good; i++)
        result[i] = found[i];
    free(room);
    free(references);
    if (!good && !fresh) { /* as before the values were computed */
        (void)roll_back_all(c);
        c->refreshed = false;
    }
    REQUIRE(good, "fmi2GetDirectionalDerivative: a derivative is not finite: %s", c->said)
    return fmi2OK;
}

#endif
