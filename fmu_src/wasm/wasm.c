/* What a WebAssembly module adds to the FMI 2.0 functions of an FMU: callbacks, whose addresses JavaScript cannot
   provide; the messages as text; and a run of many steps as one call. */

#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#undef FMI2_OVERRIDE_FUNCTION_PREFIX
#include "fmi2Functions.h"

#define EXPORTED(name) __attribute__((export_name(#name)))

EXPORTED(wasm_instantiate) fmi2Component wasm_instantiate(fmi2String name, fmi2String guid);
EXPORTED(wasm_messages) char *wasm_messages(void);
EXPORTED(wasm_run)
int wasm_run(fmi2Component c, double begin, double h, int rows, bool linear, const int counts[6],
             const fmi2ValueReference references[], const double inputs[], double outputs[]);

/* ---- messages ------------------------------------------------------------------------------------------------ */

enum { LONGEST = 1024, ROOM = 8 * LONGEST };
static char messages[ROOM]; /* each is the digit of its status, the text, and a line feed */

/* Return the messages; the caller empties them by writing a zero to the first byte. */
char *wasm_messages(void) { return messages; }

static void listen(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...)
{
    (void)environment;
    (void)name;
    (void)category;
    size_t used = strlen(messages);
    if (used + LONGEST + 3 > ROOM)
        used = 0; /* the latest message tells why a call failed */
    messages[used++] = (char)('0' + (int)status);
    va_list arguments;
    va_start(arguments, message);
    vsnprintf(messages + used, LONGEST, message, arguments);
    va_end(arguments);
    strcat(messages + used, "\n");
}

static const fmi2CallbackFunctions callbacks = {listen, calloc, free, NULL, NULL};

fmi2Component wasm_instantiate(fmi2String name, fmi2String guid)
{
    return fmi2Instantiate(name, fmi2CoSimulation, guid, "", &callbacks, fmi2False, fmi2True);
}

/* ---- runs ---------------------------------------------------------------------------------------------------- */

enum { REAL, INTEGER, BOOLEAN, TYPES };

/* Work space of a run: the values of one row. */
typedef struct {
    double *values, *slopes;
    int *whole, *orders;
} Work;

/* Set the inputs to their values in a row and, if `h` is positive, the rates of Real inputs to the next row. */
static fmi2Status set_inputs(fmi2Component c, const Work *w, const int counts[], const fmi2ValueReference *references,
                             const double *column, int rows, double h)
{
    const size_t reals = (size_t)counts[REAL];
    for (size_t k = 0; k < reals; k++, column += rows) {
        w->values[k] = *column;
        w->slopes[k] = h > 0.0 ? (column[1] - *column) / h : 0.0;
    }
    fmi2Status status = reals ? fmi2SetReal(c, references, reals, w->values) : fmi2OK;
    if (reals && h > 0.0 && status <= fmi2Warning)
        status = fmi2SetRealInputDerivatives(c, references, reals, w->orders, w->slopes);
    references += reals;
    for (int type = INTEGER; type < TYPES && status <= fmi2Warning; type++) {
        const size_t count = (size_t)counts[type];
        for (size_t k = 0; k < count; k++, column += rows)
            w->whole[k] = (int)*column;
        if (count)
            status = (type == INTEGER ? fmi2SetInteger : fmi2SetBoolean)(c, references, count, w->whole);
        references += count;
    }
    return status;
}

static fmi2Status get_outputs(fmi2Component c, const Work *w, const int counts[], const fmi2ValueReference *references,
                              double *column, int rows)
{
    const size_t reals = (size_t)counts[REAL];
    fmi2Status status = reals ? fmi2GetReal(c, references, reals, w->values) : fmi2OK;
    for (size_t k = 0; k < reals; k++, column += rows)
        *column = w->values[k];
    references += reals;
    for (int type = INTEGER; type < TYPES && status <= fmi2Warning; type++) {
        const size_t count = (size_t)counts[type];
        if (count)
            status = (type == INTEGER ? fmi2GetInteger : fmi2GetBoolean)(c, references, count, w->whole);
        for (size_t k = 0; k < count; k++, column += rows)
            *column = w->whole[k];
        references += count;
    }
    return status;
}

static int run(fmi2Component c, const Work *w, double begin, double h, int rows, bool linear, const int counts[6],
               const fmi2ValueReference references[], const double inputs[], double outputs[])
{
    const int *const read = counts + TYPES;
    const fmi2ValueReference *const shown = references + counts[REAL] + counts[INTEGER] + counts[BOOLEAN];
    for (int i = 0; i < rows; i++) {
        /* the first row shows the outputs before the first step, with the inputs of this row */
        if (i == 0 && set_inputs(c, w, counts, references, inputs, rows, 0.0) > fmi2Warning)
            return i;
        if (i > 0 && (set_inputs(c, w, counts, references, inputs + i - 1, rows, linear ? h : 0.0) > fmi2Warning ||
                      fmi2DoStep(c, begin + (i - 1) * h, h, fmi2True) > fmi2Warning))
            return i;
        if (get_outputs(c, w, read, shown, outputs + i, rows) > fmi2Warning)
            return i;
    }
    return rows;
}

/* Make rows - 1 steps of length h from time `begin`, and return the number of rows of `outputs` that were computed. If
   a call fails, the instance returns to its state at `begin`. `counts`: numbers of Real, Integer and Boolean inputs,
   then of outputs; `references` are in this order. The inputs are given, and the outputs are written, one column of
   `rows` values after the other. `linear`: Real inputs vary linearly from row to row; otherwise, they are held. */
int wasm_run(fmi2Component c, double begin, double h, int rows, bool linear, const int counts[6],
             const fmi2ValueReference references[], const double inputs[], double outputs[])
{
    int most = 1, done = 0;
    for (int k = 0; k < 2 * TYPES; k++)
        most = counts[k] > most ? counts[k] : most;
    const size_t room = (size_t)most;
    Work w = {calloc(room, sizeof(double)), calloc(room, sizeof(double)), calloc(room, sizeof(int)),
              calloc(room, sizeof(int))};
    fmi2FMUstate before = NULL;
    if (w.values && w.slopes && w.whole && w.orders && fmi2GetFMUstate(c, &before) <= fmi2Warning) {
        for (size_t k = 0; k < room; k++)
            w.orders[k] = 1;
        done = run(c, &w, begin, h, rows, linear, counts, references, inputs, outputs);
        if (done < rows)
            fmi2SetFMUstate(c, before);
    }
    fmi2FreeFMUstate(c, &before);
    free(w.values);
    free(w.slopes);
    free(w.whole);
    free(w.orders);
    return done;
}
