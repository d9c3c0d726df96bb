/* A module's run as a program: the request on standard input, the rows of the outputs on standard output. */

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

#undef FMI2_OVERRIDE_FUNCTION_PREFIX
#include "fmi2Functions.h"

fmi2Component wasm_instantiate(fmi2String name, fmi2String guid);
char *wasm_messages(void);
int wasm_run(fmi2Component c, double begin, double h, int rows, bool linear, const int counts[6],
             const fmi2ValueReference references[], const double inputs[], double outputs[]);

static double number(void)
{
    double value = 0.0;
    if (scanf("%la", &value) != 1)
        exit(3);
    return value;
}

static int whole(void) { return (int)number(); }

int main(int count, char *texts[])
{
    fmi2Component c = count == 3 ? wasm_instantiate(texts[1], texts[2]) : NULL;
    if (!c)
        return 2;
    for (int left = whole(); left > 0; left--) {
        const int type = whole();
        const fmi2ValueReference reference = (fmi2ValueReference)whole();
        const double value = number();
        const int integer = (int)value;
        if ((type == 0   ? fmi2SetReal(c, &reference, 1, &value)
             : type == 1 ? fmi2SetInteger(c, &reference, 1, &integer)
                         : fmi2SetBoolean(c, &reference, 1, &integer)) > fmi2Warning)
            return 4;
    }
    fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0);
    fmi2EnterInitializationMode(c);
    fmi2ExitInitializationMode(c);
    const double step = number();
    const int rows = whole(), linear = whole();
    int counts[6], inputs = 0, outputs = 0;
    for (int k = 0; k < 6; k++) {
        counts[k] = whole();
        *(k < 3 ? &inputs : &outputs) += counts[k];
    }
    fmi2ValueReference *const references = calloc((size_t)(inputs + outputs) + 1, sizeof *references);
    double *const given = calloc((size_t)(inputs * rows) + 1, sizeof *given);
    double *const found = calloc((size_t)(outputs * rows) + 1, sizeof *found);
    for (int k = 0; k < inputs + outputs; k++)
        references[k] = (fmi2ValueReference)whole();
    for (int k = 0; k < inputs * rows; k++)
        given[k] = number();
    if (wasm_run(c, 0.0, step, rows, linear, counts, references, given, found) < rows) {
        fputs(wasm_messages(), stderr);
        return 5;
    }
    for (int k = 0; k < outputs * rows; k++)
        printf("%a\n", found[k]);
    return 0;
}
