/* What `blocks.py` times: an FMU driven through its fmi2 functions, and the same laws as plain C loops.

   A plain loop is what an engineer would write for one known input: parameters in local variables, no checks, no
   states to save. It gets the velocities v[0..n-1], each held for h, and returns the sum of the forces, which keeps
   the compiler from leaving it out. */

#include <dlfcn.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
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

/* ---- plain loops --------------------------------------------------------------------------------------------- */

static double sign(double a) { return (double)((a > 0.0) - (a < 0.0)); }
static double clip(double a, double low, double high) { return a < low ? low : a > high ? high : a; }
static double stribeck(const double *p, double v) { return p[0] + (p[1] - p[0]) * exp(-pow(fabs(v) / p[2], p[3])); }

/* p: Fc */
static double Coulomb(const double *p, const double *v, long n, double h)
{
    double sum = 0.0;
    (void)h;
    for (long i = 0; i < n; i++)
        sum += p[0] * sign(v[i]);
    return sum;
}

/* p: Fc, Fs, vs, delta, Fv */
static double Stribeck(const double *p, const double *v, long n, double h)
{
    double sum = 0.0;
    (void)h;
    for (long i = 0; i < n; i++)
        sum += stribeck(p, v[i]) * sign(v[i]) + p[4] * v[i];
    return sum;
}

/* p: sigma, Fc */
static double Dahl(const double *p, const double *v, long n, double h)
{
    double F = 0.0, sum = 0.0;
    for (long i = 0; i < n; i++) {
        const double target = p[1] * sign(v[i]);
        F = target + (F - target) * exp(-p[0] * fabs(v[i]) * h / p[1]);
        sum += F;
    }
    return sum;
}

/* p: Fc, Fs, vs, delta, sigma0, sigma1, sigma2 */
static double LuGre(const double *p, const double *v, long n, double h)
{
    double z = 0.0, sum = 0.0;
    for (long i = 0; i < n; i++) {
        const double g = stribeck(p, v[i]), rate = p[4] * fabs(v[i]) / g, target = sign(v[i]) * g / p[4];
        z = target + (z - target) * exp(-rate * h);
        sum += p[4] * z + p[5] * (v[i] - rate * z) + p[6] * v[i];
    }
    return sum;
}

/* p: sigma0, z0, a, beta */
static double ResetIntegrator(const double *p, const double *v, long n, double h)
{
    double z = 0.0, sum = 0.0;
    for (long i = 0; i < n; i++) {
        z = clip(z + v[i] * h, -p[1], p[1]);
        const bool held = fabs(z) < p[1];
        sum += (held ? 1.0 + p[2] : 1.0) * p[0] * z + p[3] * (held ? v[i] : 0.0);
    }
    return sum;
}

/* p: N, k[10], W[10] */
static double MaxwellSlip(const double *p, const double *v, long n, double h)
{
    const int N = (int)p[0];
    double F[10] = {0.0}, sum = 0.0;
    for (long i = 0; i < n; i++)
        for (int j = 0; j < N; j++) {
            F[j] = clip(F[j] + p[1 + j] * v[i] * h, -p[11 + j], p[11 + j]);
            sum += F[j];
        }
    return sum;
}

/* p: f1, f2, eta, eps; second order */
static double BlimanSorine(const double *p, const double *v, long n, double h)
{
    double fast = 0.0, slow = 0.0, sum = 0.0;
    for (long i = 0; i < n; i++) {
        const double path = fabs(v[i]) * h, s = sign(v[i]);
        fast = s * p[0] + (fast - s * p[0]) * exp(-path / (p[2] * p[3]));
        slow = -s * p[1] + (slow + s * p[1]) * exp(-path / p[3]);
        sum += fast + slow;
    }
    return sum;
}

/* p: Fc, Fs, vs, delta, C, sigma2, N, k[10], alpha[10] */
static double GMS(const double *p, const double *v, long n, double h)
{
    const int N = (int)p[6];
    double F[10] = {0.0}, before = 0.0, sum = 0.0;
    bool slips[10] = {false};
    for (long i = 0; i < n; i++) {
        const double s = sign(v[i]), level = stribeck(p, v[i]), fade = exp(-p[4] * h / level);
        for (int j = 0; j < N; j++) {
            const double target = s * p[17 + j] * level;
            if (s != before)
                slips[j] = false;
            if (slips[j])
                F[j] = target + (F[j] - target) * fade;
            else {
                F[j] += p[7 + j] * v[i] * h;
                if (s * F[j] >= s * target && s != 0.0) {
                    F[j] = target;
                    slips[j] = true;
                }
            }
            sum += F[j];
        }
        sum += p[5] * v[i];
        before = s;
    }
    return sum;
}

typedef double Loop(const double *p, const double *v, long n, double h);
typedef struct {
    const char *name;
    Loop *loop;
} Entry;

static const Entry entries[] = {
    {"Coulomb", Coulomb},
    {"Stribeck", Stribeck},
    {"Dahl", Dahl},
    {"LuGre", LuGre},
    {"BlimanSorine", BlimanSorine},
    {"ResetIntegrator", ResetIntegrator},
    {"MaxwellSlip", MaxwellSlip},
    {"GMS", GMS},
};

static bool same(const char *a, const char *b)
{
    while (*a && *a == *b)
        a++, b++;
    return *a == *b;
}

/* Time of the plain loop of that name [s], or a negative number if there is none. */
double run_plain(const char *name, const double *p, const double *v, long n, double h, double *sum)
{
    for (size_t i = 0; i < sizeof entries / sizeof entries[0]; i++)
        if (same(entries[i].name, name)) {
            const double begin = seconds();
            *sum = entries[i].loop(p, v, n, h);
            return seconds() - begin;
        }
    return -1.0;
}
