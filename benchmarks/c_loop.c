/* What `harness.py` compares the engine with: two FMUs stepped one after the other, by hand, through their fmi2
   functions, with their outputs recorded in every row. No checks but the status, nothing that is not needed. */

#include <dlfcn.h>
#include <stdbool.h>
#include <stdlib.h>
#include <time.h>

#include "fmi2Functions.h"

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now); /* others may use the machine */
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* An FMU with one wired input and one output, the first also with a second one that is only recorded; `start` are
   values of `starts`. */
typedef struct {
    const char *path, *guid;
    fmi2ValueReference input, outputs[2];
    size_t output_count;
    const fmi2ValueReference *starts;
    const double *start;
    size_t start_count;
} Description;

typedef struct {
    fmi2Component component;
    fmi2SetRealTYPE *set;
    fmi2DoStepTYPE *step;
    fmi2GetRealTYPE *get;
    fmi2FreeInstanceTYPE *release;
} Fmu;

#define FUNCTION(name) name##TYPE *const call_##name = (name##TYPE *)dlsym(library, #name)

static bool start(const Description *d, Fmu *fmu)
{
    static const fmi2CallbackFunctions callbacks = {NULL, calloc, free, NULL, NULL};
    void *const library = dlopen(d->path, RTLD_NOW | RTLD_LOCAL);
    if (!library)
        return false;
    FUNCTION(fmi2Instantiate);
    FUNCTION(fmi2SetupExperiment);
    FUNCTION(fmi2EnterInitializationMode);
    FUNCTION(fmi2ExitInitializationMode);
    fmu->set = (fmi2SetRealTYPE *)dlsym(library, "fmi2SetReal");
    fmu->step = (fmi2DoStepTYPE *)dlsym(library, "fmi2DoStep");
    fmu->get = (fmi2GetRealTYPE *)dlsym(library, "fmi2GetReal");
    fmu->release = (fmi2FreeInstanceTYPE *)dlsym(library, "fmi2FreeInstance");
    const fmi2Component c = fmu->component =
        call_fmi2Instantiate("timed", fmi2CoSimulation, d->guid, "", &callbacks, fmi2False, fmi2False);
    return c && fmu->set(c, d->starts, d->start_count, d->start) == fmi2OK &&
           call_fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK &&
           call_fmi2EnterInitializationMode(c) == fmi2OK && call_fmi2ExitInitializationMode(c) == fmi2OK;
}

/* Seconds of n steps of h, -1 if one fails. Each of the n + 1 rows gets the outputs of both. In a loop (closed) the
   second FMU drives the first. */
double run_pair(const Description *first, const Description *second, bool closed, long n, double h, double *rows)
{
    Fmu a, b;
    if (!start(first, &a) || !start(second, &b))
        return -1.0;
    const size_t of_a = first->output_count;
    double x[2] = {0.0}, y[1] = {0.0};
    bool ok = a.get(a.component, first->outputs, of_a, x) == fmi2OK &&
              b.set(b.component, &second->input, 1, x) == fmi2OK && b.get(b.component, second->outputs, 1, y) == fmi2OK;
    const double begin = seconds();
    for (long i = 0;; i++) {
        *rows++ = x[0];
        if (of_a > 1)
            *rows++ = x[1];
        *rows++ = y[0];
        if (i == n || !ok)
            break;
        const double t = (double)i * h;
        if (closed)
            ok &= a.set(a.component, &first->input, 1, y) <= fmi2Warning;
        ok &= a.step(a.component, t, h, fmi2True) <= fmi2Warning;
        ok &= a.get(a.component, first->outputs, of_a, x) <= fmi2Warning;
        ok &= b.set(b.component, &second->input, 1, x) <= fmi2Warning;
        ok &= b.step(b.component, t, h, fmi2True) <= fmi2Warning;
        ok &= b.get(b.component, second->outputs, 1, y) <= fmi2Warning;
    }
    const double taken = seconds() - begin;
    a.release(a.component);
    b.release(b.component);
    return ok ? taken : -1.0;
}
