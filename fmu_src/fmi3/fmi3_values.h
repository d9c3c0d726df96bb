/* Values: variables of FMI 3.0 are scalars or arrays; the elements of an array follow each other in FMI 2.0. */

#ifndef FMI3_VALUES_H
#define FMI3_VALUES_H

static const char *const types_of_variables[] = {"", "Float64", "Int32", "Boolean", "UInt64", "Clock"};

/* Check the variables of a call: their type, and that they have `count` elements. */
static fmi3Status check_variables_3(const Shell *c, const fmi3ValueReference references[], size_t n, const void *values,
                                    size_t count, int type)
{
    size_t elements = 0;
    REQUIRE_3(n == 0 || (references && values), "was called with a null pointer")
    for (size_t i = 0; i < n; i++) {
        REQUIRE_3(references[i] < ALL_REFERENCES && variables_3[references[i]].type == type,
                  "was called with value reference %u: there is no %s variable with it", references[i],
                  types_of_variables[type])
        elements += size_of_3(c, references[i]);
    }
    REQUIRE_3(elements == count, "was called with %u values, but the variables have %u elements", (unsigned)count,
              (unsigned)elements)
    return fmi3OK;
}

/* Return whether this is a scalar of type Float64. */
static inline bool plain_3(fmi3ValueReference reference)
{
    return reference < ALL_REFERENCES && variables_3[reference].plain;
}

/* Return whether this variable of type Float64 is an event indicator: they are the last ones. */
static inline bool is_indicator_3(fmi3ValueReference reference) { return reference >= INDICATORS_REFERENCE; }

/* Return whether all variables are such scalars, with a value each. */
static bool all_plain_3(const fmi3ValueReference references[], size_t n, const double *values, size_t count)
{
    bool plain = n == count && references && values;
    for (size_t i = 0; plain && i < n; i++)
        plain = plain_3(references[i]);
    return plain;
}

/* The calls at every step, of scalars of a block, are done here at once. They return false if a call is anything else;
   the functions for all cases follow. */
#ifndef COMPOSITE_H
static inline bool got_scalars_3(const Shell *c, const fmi3ValueReference references[], size_t n, double values[])
{
    Model *const m = &c->inside->model;
    size_t i = 0;
    while (i < n && plain_3(references[i])) {
        values[i] = *value_of(m, variables_3[references[i]].inner);
        i++;
    }
    return i == n;
}

/* Return whether this is an input that may be set in every mode, to a value that `check_set` accepts of any block. */
static inline bool settable_input_3(const Instance *c, fmi3ValueReference reference, double value)
{
    const Row *const row = c->row_of[variables_3[reference].inner];
    return row->role == ROLE_INPUT && isfinite(value) && value >= row->min && value <= row->max;
}

/* Each input is checked before the first one is set. */
static inline bool set_scalars_3(const Shell *c, const fmi3ValueReference references[], size_t n, const double values[])
{
    Model *const m = &c->inside->model;
    for (size_t i = 0; i < n; i++)
        if (!plain_3(references[i]) || !settable_input_3(c->inside, references[i], values[i]))
            return false;
    for (size_t i = 0; i < n; i++)
        *value_of(m, variables_3[references[i]].inner) = values[i];
    m->run.stale = m->run.stale || n > 0;
    return true;
}
#endif

/* List the elements of variables, and return the end of the list. */
static fmi2ValueReference *list_elements_3(const Shell *c, const fmi3ValueReference references[], size_t n,
                                           fmi2ValueReference *to)
{
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0, size = size_of_3(c, references[i]); k < size; k++)
            *to++ = variables_3[references[i]].inner + (fmi2ValueReference)k;
    return to;
}

/* Return the elements of all variables, which were checked; NULL if there are too many. */
static const fmi2ValueReference *elements_of_3(Shell *c, const fmi3ValueReference references[], size_t n, size_t count)
{
    if (count > REFERENCES)
        return NULL;
    (void)list_elements_3(c, references, n, c->listed);
    return c->listed;
}

#define REQUIRE_ELEMENTS(list, references, n, count)                                                                   \
    const fmi2ValueReference *const list = elements_of_3(c, references, n, count);                                     \
    REQUIRE_3(list || (count) == 0, "was called with a variable more than once")

/* In co-simulation, the block decides by itself; what it decided holds then. */
static fmi3Status get_indicator_3(Shell *c, fmi3ValueReference reference, double *value)
{
    *value = 1.0;
#if HAS_MODEL_EXCHANGE
    if (KIND(c->inside) == fmi2ModelExchange) {
        const fmi2Status status = fmi2GetEventIndicators(c->inside, c->numbers, INDICATOR_COUNT);
        *value = c->numbers[reference - INDICATORS_REFERENCE];
        return (fmi3Status)status;
    }
#else
    (void)c, (void)reference;
#endif
    return fmi3OK;
}

/* Get variables of which some may be arrays. */
static APART fmi3Status get_float64_3(Shell *c, const fmi3ValueReference references[], size_t n, double values[],
                                      size_t count)
{
    if (n <= REFERENCES && all_plain_3(references, n, values, count))
        return (fmi3Status)fmi2GetReal(c->inside, elements_of_3(c, references, n, n), n, values);
    fmi3Status status = check_variables_3(c, references, n, values, count, IS_FLOAT64);
    for (size_t i = 0; i < n && status == fmi3OK; i++) {
        const size_t size = size_of_3(c, references[i]);
        status = is_indicator_3(references[i])
                     ? get_indicator_3(c, references[i], values)
                     : (fmi3Status)fmi2GetReal(c->inside, c->elements + variables_3[references[i]].inner, size, values);
        values += size;
    }
    return status;
}

/* Set variables of which some may be arrays. */
static APART fmi3Status set_float64_3(Shell *c, const fmi3ValueReference references[], size_t n, const double values[],
                                      size_t count)
{
    if (n <= REFERENCES && all_plain_3(references, n, values, count))
        return (fmi3Status)fmi2SetReal(c->inside, elements_of_3(c, references, n, n), n, values);
    const fmi3Status status = check_variables_3(c, references, n, values, count, IS_FLOAT64);
    if (status != fmi3OK)
        return status;
    for (size_t i = 0; i < n; i++)
        REQUIRE_3(!is_indicator_3(references[i]), "cannot set event indicators")
    REQUIRE_ELEMENTS(list, references, n, count)
    return (fmi3Status)fmi2SetReal(c->inside, list, count, values);
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t n, fmi3Float64 values[],
                          size_t count)
{
    ENTER_3("GetFloat64", MAY3_Get)
#ifndef COMPOSITE_H
    if (n == count && references && values && !c->inside->model.run.stale && got_scalars_3(c, references, n, values))
        return fmi3OK;
#endif
    return get_float64_3(c, references, n, values, count);
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                          const fmi3Float64 values[], size_t count)
{
    ENTER_3("SetFloat64", MAY3_Set)
#ifndef COMPOSITE_H
    if (n == count && references && values && (MODE(c->inside) & MAY_Set) && set_scalars_3(c, references, n, values))
        return fmi3OK;
#endif
    return set_float64_3(c, references, n, values, count);
}

#define INT32(VERB, CONST)                                                                                             \
    fmi3Status fmi3##VERB##Int32(fmi3Instance instance, const fmi3ValueReference references[], size_t n,               \
                                 CONST fmi3Int32 values[], size_t count)                                               \
    {                                                                                                                  \
        ENTER_3(#VERB "Int32", MAY3_##VERB)                                                                            \
        const fmi3Status status = check_variables_3(c, references, n, values, count, IS_INT32);                        \
        if (status != fmi3OK)                                                                                          \
            return status;                                                                                             \
        REQUIRE_ELEMENTS(list, references, n, count)                                                                   \
        return (fmi3Status)fmi2##VERB##Integer(c->inside, list, count, values);                                        \
    }
INT32(Get, )
INT32(Set, const)

fmi3Status fmi3GetBoolean(fmi3Instance instance, const fmi3ValueReference references[], size_t n, fmi3Boolean values[],
                          size_t count)
{
    ENTER_3("GetBoolean", MAY3_Get)
    fmi3Status status = check_variables_3(c, references, n, values, count, IS_BOOLEAN);
    for (size_t i = 0; i < n && status == fmi3OK; i++) {
        const size_t size = size_of_3(c, references[i]);
        status = (fmi3Status)fmi2GetBoolean(c->inside, c->elements + variables_3[references[i]].inner, size, c->whole);
        for (size_t k = 0; k < size && status == fmi3OK; k++)
            *values++ = c->whole[k] != fmi2False;
    }
    return status;
}

fmi3Status fmi3SetBoolean(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                          const fmi3Boolean values[], size_t count)
{
    ENTER_3("SetBoolean", MAY3_Set)
    const fmi3Status status = check_variables_3(c, references, n, values, count, IS_BOOLEAN);
    if (status != fmi3OK)
        return status;
    REQUIRE_ELEMENTS(list, references, n, count)
    for (size_t i = 0; i < count; i++)
        c->whole[i] = values[i] ? fmi2True : fmi2False;
    return (fmi3Status)fmi2SetBoolean(c->inside, list, count, c->whole);
}

/* The structural parameter is an Integer in FMI 2.0. */
fmi3Status fmi3GetUInt64(fmi3Instance instance, const fmi3ValueReference references[], size_t n, fmi3UInt64 values[],
                         size_t count)
{
    ENTER_3("GetUInt64", MAY3_GetStructural)
    const fmi3Status status = check_variables_3(c, references, n, values, count, IS_UINT64);
#ifdef STRUCTURAL
    for (size_t i = 0; i < n && status == fmi3OK; i++)
        values[i] = (fmi3UInt64)*value_of(&c->inside->model, STRUCTURAL);
#endif
    return status;
}

fmi3Status fmi3SetUInt64(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                         const fmi3UInt64 values[], size_t count)
{
    ENTER_3("SetUInt64", MAY3_SetStructural)
    const fmi3Status status = check_variables_3(c, references, n, values, count, IS_UINT64);
    for (size_t i = 0; i < n && status == fmi3OK; i++) {
        const int size = values[i] < INT32_MAX ? (int)values[i] : INT32_MAX;
        const fmi2Status set = fmi2SetInteger(c->inside, &variables_3[references[i]].inner, 1, &size);
        if (set > fmi2Warning)
            return (fmi3Status)set;
    }
    return status;
}

/* Types that no variable has; String is one of them in FMI 2.0 too, whose rules on modes hold for all. */
#define ABSENT(TYPE)                                                                                                   \
    fmi3Status fmi3Get##TYPE(fmi3Instance instance, const fmi3ValueReference references[], size_t n,                   \
                             fmi3##TYPE values[], size_t count)                                                        \
    {                                                                                                                  \
        ENTER_3("Get" #TYPE, MAY3_Get)                                                                                 \
        (void)references, (void)values, (void)count;                                                                   \
        REQUIRE_3(n == 0, "is not possible: %s has no " #TYPE " variables", QUOTE(MODEL))                              \
        return (fmi3Status)fmi2GetString(c->inside, NULL, 0, NULL);                                                    \
    }                                                                                                                  \
    fmi3Status fmi3Set##TYPE(fmi3Instance instance, const fmi3ValueReference references[], size_t n,                   \
                             const fmi3##TYPE values[], size_t count)                                                  \
    {                                                                                                                  \
        ENTER_3("Set" #TYPE, MAY3_Set)                                                                                 \
        (void)references, (void)values, (void)count;                                                                   \
        REQUIRE_3(n == 0, "is not possible: %s has no " #TYPE " variables", QUOTE(MODEL))                              \
        return (fmi3Status)fmi2SetString(c->inside, NULL, 0, NULL);                                                    \
    }
ABSENT(Float32)
ABSENT(Int8)
ABSENT(UInt8)
ABSENT(Int16)
ABSENT(UInt16)
ABSENT(UInt32)
ABSENT(Int64)
ABSENT(String)

#define BINARY(VERB, CONST)                                                                                            \
    fmi3Status fmi3##VERB##Binary(fmi3Instance instance, const fmi3ValueReference references[], size_t n,              \
                                  CONST size_t sizes[], CONST fmi3Binary values[], size_t count)                       \
    {                                                                                                                  \
        ENTER_3(#VERB "Binary", MAY3_##VERB)                                                                           \
        (void)references, (void)sizes, (void)values, (void)count;                                                      \
        REQUIRE_3(n == 0, "is not possible: %s has no Binary variables", QUOTE(MODEL))                                 \
        return (fmi3Status)fmi2##VERB##String(c->inside, NULL, 0, NULL);                                               \
    }
BINARY(Get, )
BINARY(Set, const)

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference reference, size_t *number)
{
    ENTER_3("GetNumberOfVariableDependencies", ANY_3)
    (void)reference, (void)number;
    return fail_3(c, "is not available: the dependencies are in modelDescription.xml");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent, size_t elements[],
                                       fmi3ValueReference independents[], size_t independent_elements[],
                                       fmi3DependencyKind kinds[], size_t n)
{
    ENTER_3("GetVariableDependencies", ANY_3)
    (void)dependent, (void)elements, (void)independents, (void)independent_elements, (void)kinds, (void)n;
    return fail_3(c, "is not available: the dependencies are in modelDescription.xml");
}

#endif
