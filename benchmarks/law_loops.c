/* A law's FMU, driven through its fmi2 functions: what laws.py times, and tests compare with exported C. */

#include <dlfcn.h>
#include <stdbool.h>
#include <stdlib.h>
#include <time.h>

#include "fmi2Functions.h"

#define FUNCTION(name) name##TYPE *const call_##name = (name##TYPE *)dlsym(library, #name)

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now); /* others may use the machine */
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Steps of size h with all inputs set before and all outputs read after each. `reals` has n_reals columns, `booleans`
   n_booleans, `results` n_results; seconds of everything, -1 if a call fails. */
double run_law(const char *path, const char *guid, const unsigned *real, size_t n_reals, const double *reals,
               const unsigned *boolean, size_t n_booleans, const int *booleans, const unsigned *result,
               size_t n_results, double *results, long n, double h)
{
    void *const library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library)
        return -1.0;
    FUNCTION(fmi2Instantiate);
    FUNCTION(fmi2SetupExperiment);
    FUNCTION(fmi2EnterInitializationMode);
    FUNCTION(fmi2ExitInitializationMode);
    FUNCTION(fmi2SetReal);
    FUNCTION(fmi2SetBoolean);
    FUNCTION(fmi2DoStep);
    FUNCTION(fmi2GetReal);
    FUNCTION(fmi2FreeInstance);
    const fmi2CallbackFunctions callbacks = {NULL, calloc, free, NULL, NULL};
    const fmi2Component c = call_fmi2Instantiate("law", fmi2CoSimulation, guid, "", &callbacks, fmi2False, fmi2False);
    if (!c)
        return -1.0;
    call_fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    call_fmi2EnterInitializationMode(c);
    bool ok = call_fmi2ExitInitializationMode(c) == fmi2OK;

    const double begin = seconds();
    for (long i = 0; i < n; i++) {
        ok &= call_fmi2SetReal(c, real, n_reals, reals + (size_t)i * n_reals) == fmi2OK;
        ok &= call_fmi2SetBoolean(c, boolean, n_booleans, booleans + (size_t)i * n_booleans) == fmi2OK;
        ok &= call_fmi2DoStep(c, (double)i * h, h, fmi2True) == fmi2OK;
        ok &= call_fmi2GetReal(c, result, n_results, results + (size_t)i * n_results) == fmi2OK;
    }
    const double total = seconds() - begin;
    call_fmi2FreeInstance(c);
    dlclose(library);
    return ok ? total : -1.0;
}

/* A casadi function through its buffer interface, called from here: seconds. `rows` has the inputs, which go to their
   places among the arguments; the states, at the end of the results, go back to theirs. */
double run_buffer(void (*evaluate)(void *), void *buffer, double *arguments, const double *results, const long *input,
                  long n_inputs, const long *state, long n_states, long first_state, const double *rows, long n)
{
    const double begin = seconds();
    for (long i = 0; i < n; i++, rows += n_inputs) {
        for (long j = 0; j < n_inputs; j++)
            arguments[input[j]] = rows[j];
        evaluate(buffer);
        for (long j = 0; j < n_states; j++)
            arguments[state[j]] = results[first_state + j];
    }
    return seconds() - begin;
}
