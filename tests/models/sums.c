/* An importer that adds its steps: a Differentiator whose position moves by Ts in each of them has the velocity 1 in
   each; another number of samples gives 0 or 2. Prints the number of the first step that is wrong, or of all steps. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "fmi2Functions.h"

static void say(void *environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String message, ...)
{
    (void)environment, (void)name, (void)status, (void)category;
    fprintf(stderr, "%s\n", message);
}

int main(int count, char **arguments)
{
    const fmi2CallbackFunctions callbacks = {say, calloc, free, NULL, NULL};
    const double start = atof(arguments[2]), steps = atof(arguments[3]), Ts = 2e-3, one = 1.0;
    const unsigned x = (unsigned)atoi(arguments[4]), v = (unsigned)atoi(arguments[5]);
    const unsigned period = (unsigned)atoi(arguments[6]), window = (unsigned)atoi(arguments[7]);
    const unsigned v0 = (unsigned)atoi(arguments[8]);
    const int width = 1;
    void *const c = fmi2Instantiate("one", fmi2CoSimulation, arguments[1], "", &callbacks, 0, 1);
    if (count != 9 || !c || fmi2SetupExperiment(c, 0, 0.0, start, 0, 0.0) || fmi2SetReal(c, &period, 1, &Ts) ||
        fmi2SetInteger(c, &window, 1, &width) || fmi2SetReal(c, &v0, 1, &one) || fmi2EnterInitializationMode(c) ||
        fmi2ExitInitializationMode(c))
        return 1;
    double t = start, k = 0.0;
    for (; k < steps; k += 1.0, t += Ts) {
        const double place = Ts * k;
        double found = 0.0;
        if (fmi2SetReal(c, &x, 1, &place) || fmi2DoStep(c, t, Ts, 1) > fmi2Warning || fmi2GetReal(c, &v, 1, &found))
            return 1;
        if (!(fabs(found - 1.0) < 1e-6))
            break;
    }
    printf("%.0f\n", k);
    fmi2FreeInstance(c);
    return 0;
}
