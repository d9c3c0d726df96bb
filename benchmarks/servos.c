/* What `systems.py` compares the engine with: whole servo loops as an engineer would write them by hand in C. A
   profile, a PID controller that takes a sample every `per` steps, a mass and a friction law in steps of h; only the
   position is recorded. The formulas are those of the blocks. */

#include <math.h>
#include <stdbool.h>
#include <time.h>

typedef double Law(double *x, const double *p, double v, double h);

#include "laws.h"

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now); /* others may use the machine */
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

typedef struct {
    double r_end, v_max, a_max, j_max, dwell;
} Motion;

typedef struct {
    double r, rd;
} Reference;

/* The phases of a cyclic third-order profile from 0 to r_end and back, with what follows from them. */
typedef struct {
    double t_j, t_a, T, leg, A, V, P;
} Plan;

static Plan plan(const Motion *m)
{
    const double j = m->j_max, L = m->r_end;
    const double t_j = fmin(cbrt(L / (2.0 * j)), fmin(sqrt(m->v_max / j), m->a_max / j)), A = j * t_j;
    const double t_a = fmax(fmin(m->v_max / A, sqrt(L / A + 0.25 * t_j * t_j) - 0.5 * t_j) - t_j, 0.0);
    const double T = 4.0 * t_j + 2.0 * t_a + fmax(L / (A * (t_j + t_a)) - (2.0 * t_j + t_a), 0.0);
    const double V = A * (t_j + t_a);
    return (Plan){t_j, t_a, T, T + m->dwell, A, V, V * (t_j + 0.5 * t_a)};
}

/* The profile at the time t. */
static Reference profile(const Motion *m, const Plan *by, double t)
{
    const double j = m->j_max, L = m->r_end, t_j = by->t_j, t_a = by->t_a, T = by->T, leg = by->leg;
    const double A = by->A, V = by->V, P = by->P;
    double s = fmod(t, 2.0 * leg);
    const bool back = s >= leg;
    s -= back ? leg : 0.0;
    const bool late = s > 0.5 * T;
    const double u = s >= T ? 0.0 : late ? T - s : s;
    double p = 0.0, v = 0.0;
    if (u < t_j) {
        p = j * u * u * u / 6.0;
        v = 0.5 * j * u * u;
    } else if (u < t_j + t_a) {
        const double w = u - t_j;
        p = A * t_j * t_j / 6.0 + 0.5 * A * t_j * w + 0.5 * A * w * w;
        v = 0.5 * A * t_j + A * w;
    } else if (u < 2.0 * t_j + t_a) {
        const double w = 2.0 * t_j + t_a - u;
        p = P - V * w + j * w * w * w / 6.0;
        v = V - 0.5 * j * w * w;
    } else {
        p = 0.5 * L - V * (0.5 * T - u);
        v = V;
    }
    const double way = late ? L - p : p;
    return (Reference){back ? L - way : way, back ? -v : v};
}

/* p: Fc, Fs, vs, delta, sigma0, sigma1, sigma2; x: z. With delta = 2, as pow would take most of the time. */
static double LuGre_of_speed(double *x, const double *p, double v, double h)
{
    const double ratio = v / p[2], g = p[0] + (p[1] - p[0]) * exp(-ratio * ratio);
    const double rate = p[4] * fabs(v) / g, target = sign(v) * g / p[4];
    x[0] -= (target - x[0]) * expm1(-rate * h);
    return p[4] * x[0] + p[5] * (v - rate * x[0]) + p[6] * v;
}

/* Seconds of n steps of a loop with LuGre or GMS friction; rows gets n + 1 positions. */
double run_servo(const Motion *m, const double *pid, const double *contact, bool gms, double mass, long n, double h,
                 int per, double *rows)
{
    double x = 0.0, v = 0.0, F = 0.0, u = 0.0, integral = 0.0, state[64] = {0.0};
    Law *const law = gms ? GMS : LuGre_of_speed;
    const double begin = seconds();
    const Plan by = plan(m); /* once, as the block keeps its plan too */
    Reference at = profile(m, &by, 0.0);
    rows[0] = x;
    for (long k = 0; k < n; k++) {
        if (k % per == 0) {
            const double e = at.r - x, wanted = pid[0] * e + pid[1] * (at.rd - v) + pid[2] * integral;
            u = clip(wanted, -pid[3], pid[3]);
            if ((wanted - u) * e <= 0.0)
                integral += h * per * e;
        }
        const double a = (u - F) / mass;
        x += h * (v + 0.5 * h * a);
        v += h * a;
        F = law(state, contact, v, h);
        at = profile(m, &by, (double)(k + 1) * h);
        rows[k + 1] = x;
    }
    return seconds() - begin;
}
