/* What `blocks.py` times: an FMU driven through its fmi2 functions, and the same laws as plain C loops.

   A plain law is what an engineer would write by hand: a function of the state x, the parameters p and a velocity that
   is held for h, which moves x and returns the force. No checks, no outputs but the force, no states to save. */

#include <dlfcn.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2Functions.h"

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* ---- an FMU -------------------------------------------------------------------------------------------------- */

#define FUNCTION(name) name##TYPE *const call_##name = (name##TYPE *)dlsym(library, #name)

/* Times the steps alone: total[0] with setting v and reading F, total[1] fmi2DoStep only [s]; false if it fails. */
bool run_fmu(const char *path, const char *guid, unsigned v_reference, unsigned F_reference, const double *v, long n,
             double h, double total[2])
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
    double F = 0.0, sum = 0.0;
    double begin = seconds();
    for (long i = 0; i < n; i++) {
        call_fmi2SetReal(c, &v_reference, 1, &v[i]);
        ok &= call_fmi2DoStep(c, (double)i * h, h, fmi2True) <= fmi2Warning;
        call_fmi2GetReal(c, &F_reference, 1, &F);
        sum += F;
    }
    total[0] = seconds() - begin;

    /* what reading and setting cost by themselves */
    begin = seconds();
    for (long i = 0; i < n; i++) {
        call_fmi2GetReal(c, &F_reference, 1, &F);
        sum += F;
    }
    for (long i = 0; i < n; i++)
        call_fmi2SetReal(c, &v_reference, 1, &v[i]);
    total[1] = total[0] - (seconds() - begin);
    call_fmi2FreeInstance(c);
    dlclose(library);
    return ok && isfinite(sum);
}

/* ---- plain laws ---------------------------------------------------------------------------------------------- */

typedef double Law(double *x, const double *p, double v, double h);

static double sign(double a) { return (double)((a > 0.0) - (a < 0.0)); }
static double clip(double a, double low, double high) { return a < low ? low : a > high ? high : a; }
static double stribeck(const double *p, double v) { return p[0] + (p[1] - p[0]) * exp(-pow(fabs(v) / p[2], p[3])); }

/* p: Fc */
static double Coulomb(double *x, const double *p, double v, double h)
{
    (void)x;
    (void)h;
    return p[0] * sign(v);
}

/* p: Fc, Fs, vs, delta, Fv */
static double Stribeck(double *x, const double *p, double v, double h)
{
    (void)x;
    (void)h;
    return stribeck(p, v) * sign(v) + p[4] * v;
}

/* p: sigma, Fc, n; x: F */
static double Dahl(double *x, const double *p, double v, double h)
{
    const double target = p[1] * sign(v), path = p[0] * fabs(v) * h / p[1];
    if (p[2] == 1.0)
        return x[0] = target + (x[0] - target) * exp(-path);
    const double gap = fabs(target - x[0]) / p[1], q = 1.0 + (p[2] - 1.0) * path * pow(gap, p[2] - 1.0);
    return x[0] = q > 0.0 ? target + (x[0] - target) * pow(q, -1.0 / (p[2] - 1.0)) : target;
}

/* p: Fc, Fs, vs, delta, sigma0, sigma1, sigma2; x: z */
static double LuGre(double *x, const double *p, double v, double h)
{
    const double g = stribeck(p, v), rate = p[4] * fabs(v) / g, target = sign(v) * g / p[4];
    x[0] = target + (x[0] - target) * exp(-rate * h);
    return p[4] * x[0] + p[5] * (v - rate * x[0]) + p[6] * v;
}

/* p: sigma0, z0, a, beta; x: z */
static double ResetIntegrator(double *x, const double *p, double v, double h)
{
    x[0] = clip(x[0] + v * h, -p[1], p[1]);
    const bool held = fabs(x[0]) < p[1];
    return (held ? 1.0 + p[2] : 1.0) * p[0] * x[0] + p[3] * (held ? v : 0.0);
}

/* p: N, k[10], W[10]; x: the forces */
static double MaxwellSlip(double *x, const double *p, double v, double h)
{
    double F = 0.0;
    for (int j = 0; j < (int)p[0]; j++) {
        x[j] = clip(x[j] + p[1 + j] * v * h, -p[11 + j], p[11 + j]);
        F += x[j];
    }
    return F;
}

/* p: f1, f2, eta, eps; x: the two forces of the second order */
static double BlimanSorine(double *x, const double *p, double v, double h)
{
    const double path = fabs(v) * h, s = sign(v);
    x[0] = s * p[0] + (x[0] - s * p[0]) * exp(-path / (p[2] * p[3]));
    x[1] = -s * p[1] + (x[1] + s * p[1]) * exp(-path / p[3]);
    return x[0] + x[1];
}

/* p: Fc, Fs, vs, delta, C, sigma2, N, k[10], alpha[10]; x: the forces, whether they slip, the last direction */
static double GMS(double *x, const double *p, double v, double h)
{
    const double s = sign(v), level = stribeck(p, v), fade = exp(-p[4] * h / level);
    double F = p[5] * v, *const slips = x + 10, *const before = x + 20;
    for (int j = 0; j < (int)p[6]; j++) {
        const double target = s * p[17 + j] * level;
        if (s != *before)
            slips[j] = 0.0;
        if (slips[j] != 0.0)
            x[j] = target + (x[j] - target) * fade;
        else {
            x[j] += p[7 + j] * v * h;
            if (s != 0.0 && s * x[j] >= s * target) {
                x[j] = target;
                slips[j] = 1.0;
            }
        }
        F += x[j];
    }
    *before = s;
    return F;
}

static const struct {
    const char *name;
    Law *law;
} entries[] = {
    {"Coulomb", Coulomb},
    {"Stribeck", Stribeck},
    {"Dahl", Dahl},
    {"LuGre", LuGre},
    {"BlimanSorine", BlimanSorine},
    {"ResetIntegrator", ResetIntegrator},
    {"MaxwellSlip", MaxwellSlip},
    {"GMS", GMS},
};

/* Seconds that the plain law of that name takes for the velocities v[0..n-1], or a negative number if there is none;
   the sum of the forces keeps the compiler from leaving it out. */
double run_plain(const char *name, const double *p, const double *v, long n, double h, double *sum)
{
    for (size_t i = 0; i < sizeof entries / sizeof entries[0]; i++)
        if (strcmp(entries[i].name, name) == 0) {
            double x[64] = {0.0};
            *sum = 0.0;
            const double begin = seconds();
            for (long k = 0; k < n; k++)
                *sum += entries[i].law(x, p, v[k], h);
            return seconds() - begin;
        }
    return -1.0;
}
