/* What `blocks.py` times: an FMU driven through its fmi2 functions, and the same laws as plain C loops.

   A plain law stands in laws.h; it is called in a loop, through a pointer, as a simulation would call it. */

#include <dlfcn.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2Functions.h"

/* Of the processor, so that other programs count less. */
static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* ---- an FMU -------------------------------------------------------------------------------------------------- */

#define FUNCTION(name) name##TYPE *const call_##name = (name##TYPE *)dlsym(library, #name)

/* Times the steps: total[0] with setting v and reading F, total[1] setting and reading only [s]; false if it fails. */
bool run_fmu(const char *path, const char *guid, unsigned v_reference, unsigned F_reference, const double *v, double *F,
             long n, double h, double total[2])
{
    void *const library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library)
        return false;
    FUNCTION(fmi2Instantiate);
    FUNCTION(fmi2SetupExperiment);
    FUNCTION(fmi2EnterInitializationMode);
    FUNCTION(fmi2ExitInitializationMode);
    FUNCTION(fmi2SetReal);
    FUNCTION(fmi2DoStep);
    FUNCTION(fmi2GetReal);
    FUNCTION(fmi2FreeInstance);
    const fmi2CallbackFunctions callbacks = {NULL, calloc, free, NULL, NULL};
    const fmi2Component c = call_fmi2Instantiate("timed", fmi2CoSimulation, guid, "", &callbacks, fmi2False, fmi2False);
    if (!c)
        return false;
    call_fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    call_fmi2EnterInitializationMode(c);
    call_fmi2ExitInitializationMode(c);

    bool ok = true;
    double again = 0.0;
    double begin = seconds();
    for (long i = 0; i < n; i++) {
        call_fmi2SetReal(c, &v_reference, 1, &v[i]);
        ok &= call_fmi2DoStep(c, (double)i * h, h, fmi2True) <= fmi2Warning;
        call_fmi2GetReal(c, &F_reference, 1, &F[i]);
    }
    total[0] = seconds() - begin;

    /* what reading and setting cost by themselves */
    begin = seconds();
    for (long i = 0; i < n; i++) {
        call_fmi2GetReal(c, &F_reference, 1, &again);
    }
    for (long i = 0; i < n; i++)
        call_fmi2SetReal(c, &v_reference, 1, &v[i]);
    total[1] = seconds() - begin;
    call_fmi2FreeInstance(c);
    dlclose(library);
    return ok && isfinite(again);
}

/* ---- plain laws ---------------------------------------------------------------------------------------------- */

typedef double Law(double *x, const double *p, double v, double h);

#include "laws.h"
#include "laws_with_memory.h"

#define TEN(name)                                                                                                      \
    #name "[1] " #name "[2] " #name "[3] " #name "[4] " #name "[5] " #name "[6] " #name "[7] " #name "[8] " #name      \
          "[9] " #name "[10]"

/* Name, law, names of its parameters in their order. */
static const struct {
    const char *name;
    Law *law;
    const char *parameters;
} entries[] = {
    {"Coulomb", Coulomb, "Fc"},
    {"Viscous", Viscous, "Fv delta_v"},
    {"Stiction", Stiction, "Fc Fs Fv"},
    {"Stribeck", Stribeck, "Fc Fs vs delta Fv"},
    {"Tustin", Tustin, "Fc Fs vs Fv"},
    {"Karnopp", Karnopp, "Fc Fs Fv DV"},
    {"DeadZoneTorque", DeadZoneTorque, "Fc T_dz Fv DV"},
    {"Dahl", Dahl, "sigma Fc n"},
    {"LuGre", LuGre, "Fc Fs vs delta sigma0 sigma1 sigma2"},
    {"ElastoPlastic", ElastoPlastic, "Fc Fs vs delta sigma0 sigma1 sigma2 z_ba"},
    {"BlimanSorine", BlimanSorine, "f1 f2 eta eps"},
    {"ResetIntegrator", ResetIntegrator, "sigma0 z0 a beta"},
    {"RateAndState", RateAndState, "mu0 a b Dc V0 sigma_n"},
    {"SevenParameter", SevenParameter, "kt Fc Fv Fs_a Fs_inf vs tauL gamma"},
    {"MaxwellSlip", MaxwellSlip, "N " TEN(k) " " TEN(W)},
    {"GMS", GMS, "Fc Fs vs delta C sigma2 N " TEN(k) " " TEN(alpha)},
    {"Leuven", Leuven, "Fc Fs vs delta A zc n sigma1 sigma2"},
    {"ModifiedLeuven", ModifiedLeuven, "Fc Fs vs delta n sigma1 sigma2 N " TEN(k) " " TEN(W)},
    {"Bristle", Bristle, "N sigma0 delta_s Delta"},
};

static size_t find(const char *name)
{
    size_t i = 0;
    while (i < sizeof entries / sizeof entries[0] && strcmp(entries[i].name, name) != 0)
        i++;
    return i;
}

/* Names of the parameters of a law, NULL if there is none of that name. */
const char *parameters_of(const char *name)
{
    const size_t i = find(name);
    return i < sizeof entries / sizeof entries[0] ? entries[i].parameters : NULL;
}

/* Seconds that the plain law of that name takes for the velocities v[0..n-1]; the forces go to F[0..n-1]. */
double run_plain(const char *name, const double *p, const double *v, double *F, long n, double h)
{
    Law *const law = entries[find(name)].law;
    double x[1100] = {0.0};
    const double begin = seconds();
    for (long i = 0; i < n; i++)
        F[i] = law(x, p, v[i], h);
    return seconds() - begin;
}
