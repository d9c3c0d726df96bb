/* An FMU of FMI 3.0 for co-simulation behind the functions of FMI 2.0 that the engine calls. Each element of each
   variable has a number, which is its value reference here; all values are doubles. An array is always set as a whole,
   with the last values of the elements that are not set. */

#ifndef FMI3_ADAPTER_H
#define FMI3_ADAPTER_H

#include "fmi3_numbers.h"
#include "part.h"

#include <stdlib.h>
#include <string.h>

enum { LARGEST_SIZE_3 = 8, MOST_EVENTS_3 = 10000, MOST_UPDATES_3 = 100 };

/* Why a call failed that the FMU itself accepted; the texts are in fmi3.py. */
enum { NOT_WHOLE_3 = 1, TOO_LARGE_3, UPDATES_3, EVENTS_3 };

typedef struct {
    uint32_t reference; /* value reference in the FMU */
    int32_t type;
    int64_t first, count; /* its elements */
} Variable3;

typedef int Transfer3(void *instance, const uint32_t *references, size_t n, void *values, size_t count);

typedef struct {
    uint32_t reference;
    double interval, shift; /* [s] */
} Clock3;

typedef struct {
    void *instance;
    Transfer3 *set[TYPES_3], *get[TYPES_3];
    DoStep3 *do_step;
    int (*enter_event_mode)(void *instance);
    int (*enter_step_mode)(void *instance);
    int (*set_clock)(void *instance, const uint32_t *references, size_t n, const bool *values);
    int (*update)(void *instance, bool *again, bool *terminate, bool *nominals, bool *states, bool *next_defined,
                  double *next);
    int (*get_state)(void *instance, void **state);
    int (*set_state)(void *instance, void *state);
    int (*free_state)(void *instance, void **state);
    SetSlopes *set_slopes; /* of FMUs of this project; NULL for others */
    const Variable3 *variables;
    const int64_t *variable_of; /* by element */
    double *values;             /* last set values by element */
    double *numbers;            /* work space for each element */
    unsigned char *packed;      /* work space of LARGEST_SIZE_3 bytes for each element */
    int64_t *places;            /* work space for each variable */
    uint32_t *references;       /* work space for each element */
    int64_t elements;
    const Clock3 *clocks;
    int64_t clock_count;
    int64_t uses_events;
    double start, next; /* [s]; next: time of the next event of the FMU, or INFINITY */
    double ended;       /* [s] of the last step or event */
    int64_t pending;    /* the last step ended at an event */
    int64_t failure;    /* one of the reasons above, or 0 */
    int64_t failed;     /* the element */
} Fmi3;

/* A saved state, with the time of the next event. */
typedef struct {
    void *state;
    double next;
    int64_t pending;
} State3;

static int fails_3(Fmi3 *a, int failure, int64_t element)
{
    a->failure = failure;
    a->failed = element;
    return 3;
}

static inline const Variable3 *variable_at(const Fmi3 *a, uint32_t element)
{
    return &a->variables[a->variable_of[element]];
}

/* Return the end of the elements from i on whose variables have the same type; list these variables once each, with
   their places among the values. */
static size_t run_of(Fmi3 *a, const uint32_t *elements, size_t n, size_t i, size_t *listed, size_t *count)
{
    const int type = variable_at(a, elements[i])->type;
    int64_t last = -1;
    *listed = *count = 0;
    for (; i < n && variable_at(a, elements[i])->type == type; i++) {
        const int64_t which = a->variable_of[elements[i]];
        if (which == last)
            continue;
        if (*count + (size_t)a->variables[which].count > (size_t)a->elements)
            break;
        last = which;
        a->references[(*listed)++] = a->variables[which].reference;
        a->places[which] = (int64_t)*count;
        *count += (size_t)a->variables[which].count;
    }
    return i;
}

static int set_3(Fmi3 *a, const uint32_t *elements, size_t n, const double *values)
{
    a->failure = 0;
    for (size_t i = 0; i < n; i++) {
        const int type = variable_at(a, elements[i])->type;
        const bool whole = type > FLOAT_32 && type < BOOLEAN_8;
        if (whole && !(values[i] == floor(values[i]) && values[i] >= least_3[type] && values[i] <= most_3[type]))
            return fails_3(a, NOT_WHOLE_3, elements[i]);
        a->values[elements[i]] = values[i];
    }
    int worst = 0;
    for (size_t i = 0; i < n;) {
        size_t listed, count;
        const size_t end = run_of(a, elements, n, i, &listed, &count);
        const int type = variable_at(a, elements[i])->type;
        for (; i < end; i++) {
            const Variable3 *const v = variable_at(a, elements[i]);
            unsigned char *const to = a->packed + (size_t)a->places[a->variable_of[elements[i]]] * sizes_3[type];
            for (int64_t k = 0; k < v->count; k++)
                store(to + (size_t)k * sizes_3[type], type, a->values[v->first + k]);
        }
        const int status = a->set[type](a->instance, a->references, listed, a->packed, count);
        if (status > 1)
            return status;
        worst = status > worst ? status : worst;
    }
    return worst;
}

static int get_3(Fmi3 *a, const uint32_t *elements, size_t n, double *values)
{
    for (size_t i = 0; i < n;) {
        size_t listed, count;
        const size_t end = run_of(a, elements, n, i, &listed, &count);
        const int type = variable_at(a, elements[i])->type;
        const int status = a->get[type](a->instance, a->references, listed, a->packed, count);
        if (status > 1)
            return status;
        for (; i < end; i++) {
            const int64_t place =
                a->places[a->variable_of[elements[i]]] + elements[i] - variable_at(a, elements[i])->first;
            values[i] = load(a->packed + (size_t)place * sizes_3[type], type);
            if ((type == INT_64 || type == UINT_64) && fabs(values[i]) > most_3[INT_64])
                return fails_3(a, TOO_LARGE_3, elements[i]);
        }
    }
    return 0;
}

/* Exchanges of scalars of type Float64 only, with the references of the FMU. */
EXPORT int fmi3_set_plain(void *self, const uint32_t *references, size_t n, void *values);

EXPORT int fmi3_set_plain(void *self, const uint32_t *references, size_t n, void *values)
{
    Fmi3 *const a = (Fmi3 *)self;
    return a->set[FLOAT_64](a->instance, references, n, values, n);
}

EXPORT int fmi3_get_plain(void *self, const uint32_t *references, size_t n, void *values);

EXPORT int fmi3_get_plain(void *self, const uint32_t *references, size_t n, void *values)
{
    Fmi3 *const a = (Fmi3 *)self;
    return a->get[FLOAT_64](a->instance, references, n, values, n);
}

EXPORT int fmi3_set_slopes(void *self, const uint32_t *references, size_t n, const int *orders, const double *slopes);

/* Only with fmi3_set_plain. */
EXPORT int fmi3_set_slopes(void *self, const uint32_t *references, size_t n, const int *orders, const double *slopes)
{
    Fmi3 *const a = (Fmi3 *)self;
    return a->set_slopes(a->instance, references, n, orders, slopes);
}

EXPORT int fmi3_set_real(void *self, const uint32_t *elements, size_t n, void *values);

EXPORT int fmi3_set_real(void *self, const uint32_t *elements, size_t n, void *values)
{
    return set_3((Fmi3 *)self, elements, n, (const double *)values);
}

EXPORT int fmi3_get_real(void *self, const uint32_t *elements, size_t n, void *values);

EXPORT int fmi3_get_real(void *self, const uint32_t *elements, size_t n, void *values)
{
    return get_3((Fmi3 *)self, elements, n, (double *)values);
}

EXPORT int fmi3_set_whole(void *self, const uint32_t *elements, size_t n, void *values);

/* For Integer and Boolean. */
EXPORT int fmi3_set_whole(void *self, const uint32_t *elements, size_t n, void *values)
{
    Fmi3 *const a = (Fmi3 *)self;
    for (size_t i = 0; i < n; i++)
        a->numbers[i] = ((const int *)values)[i];
    return set_3(a, elements, n, a->numbers);
}

EXPORT int fmi3_get_whole(void *self, const uint32_t *elements, size_t n, void *values);

EXPORT int fmi3_get_whole(void *self, const uint32_t *elements, size_t n, void *values)
{
    Fmi3 *const a = (Fmi3 *)self;
    const int status = get_3(a, elements, n, a->numbers);
    for (size_t i = 0; status <= 1 && i < n; i++) {
        if (fabs(a->numbers[i]) > most_3[INT_32])
            return fails_3(a, TOO_LARGE_3, elements[i]);
        ((int *)values)[i] = (int)a->numbers[i];
    }
    return status;
}

#include "fmi3_steps.h"

/* ---- states ------------------------------------------------------------------------------------------------- */

EXPORT int fmi3_get_state(void *self, void **saved);

EXPORT int fmi3_get_state(void *self, void **saved)
{
    Fmi3 *const a = (Fmi3 *)self;
    if (*saved == NULL)
        *saved = calloc(1, sizeof(State3));
    State3 *const s = (State3 *)*saved;
    if (s == NULL)
        return 3;
    s->next = a->next;
    s->pending = a->pending;
    return a->get_state(a->instance, &s->state);
}

EXPORT int fmi3_set_state(void *self, void *saved);

EXPORT int fmi3_set_state(void *self, void *saved)
{
    Fmi3 *const a = (Fmi3 *)self;
    const State3 *const s = (const State3 *)saved;
    a->next = s->next;
    a->pending = s->pending;
    return a->set_state(a->instance, s->state);
}

EXPORT int fmi3_free_state(void *self, void **saved);

EXPORT int fmi3_free_state(void *self, void **saved)
{
    Fmi3 *const a = (Fmi3 *)self;
    State3 *const s = (State3 *)*saved;
    *saved = NULL;
    const int status = s && s->state ? a->free_state(a->instance, &s->state) : 0;
    free(s);
    return status;
}

#endif
