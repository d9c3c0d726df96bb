/* More of the laws as plain C loops, in the form of `loops.c`: what an engineer would write for one known input. Each
   gets the velocities v[0..n-1], each held for h, and returns the sum of the forces. F_ext is 0, Fn is Fn0.

   Where a law has no closed form in use, the loop takes Runge-Kutta substeps that are short enough for some 1e-6. */

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <time.h>

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double sign(double a) { return (double)((a > 0.0) - (a < 0.0)); }
static double clip(double a, double low, double high) { return a < low ? low : a > high ? high : a; }
static double stribeck(const double *p, double v) { return p[0] + (p[1] - p[0]) * exp(-pow(fabs(v) / p[2], p[3])); }

/* p: Fv, delta_v */
static double Viscous(const double *p, const double *v, long n, double h)
{
    double sum = 0.0;
    (void)h;
    for (long i = 0; i < n; i++)
        sum += p[0] * sign(v[i]) * pow(fabs(v[i]), p[1]);
    return sum;
}

/* p: Fc, Fs, Fv */
static double Stiction(const double *p, const double *v, long n, double h)
{
    const double F_ext = 0.0;
    double sum = 0.0;
    (void)h;
    for (long i = 0; i < n; i++)
        sum += v[i] == 0.0 ? clip(F_ext, -p[1], p[1]) : p[0] * sign(v[i]) + p[2] * v[i];
    return sum;
}

/* p: Fc, Fs, vs, Fv */
static double Tustin(const double *p, const double *v, long n, double h)
{
    const double F_ext = 0.0;
    double sum = 0.0;
    (void)h;
    for (long i = 0; i < n; i++)
        sum += v[i] == 0.0 ? clip(F_ext, -p[1], p[1])
                           : sign(v[i]) * (p[0] + (p[1] - p[0]) * exp(-fabs(v[i]) / p[2])) + p[3] * v[i];
    return sum;
}

/* p: Fc, Fs, Fv, DV */
static double Karnopp(const double *p, const double *v, long n, double h)
{
    const double F_ext = 0.0;
    double sum = 0.0;
    (void)h;
    for (long i = 0; i < n; i++)
        sum += v[i] == 0.0 || fabs(v[i]) < p[3] ? clip(F_ext, -p[1], p[1]) : p[0] * sign(v[i]) + p[2] * v[i];
    return sum;
}

/* p: Fc, T_dz, Fv, DV */
static double DeadZoneTorque(const double *p, const double *v, long n, double h)
{
    const double F_ext = 0.0;
    double sum = 0.0;
    (void)h;
    for (long i = 0; i < n; i++) {
        const bool held = (v[i] == 0.0 || fabs(v[i]) < p[3]) && fabs(F_ext) <= p[1];
        sum += held ? F_ext : p[0] * sign(v[i] == 0.0 ? F_ext : v[i]) + p[2] * v[i];
    }
    return sum;
}

/* p: Fc, Fs, vs, delta, sigma0, sigma1, sigma2, z_ba */
static double blend(double y, double z_max, double z_ba)
{
    const double alpha = y <= z_ba ? 0.0 : y >= z_max ? 1.0 : 0.5 - 0.5 * cos(M_PI * (y - z_ba) / (z_max - z_ba));
    return 1.0 - alpha * y / z_max;
}
static double ElastoPlastic(const double *p, const double *v, long n, double h)
{
    const double z_ba = p[7];
    double z = 0.0, sum = 0.0;
    for (long i = 0; i < n; i++) {
        const double s = sign(v[i]), z_max = stribeck(p, v[i]) / p[4];
        double y = s * z, path = fabs(v[i]) * h;
        const double elastic = fmin(path, fmax(z_ba - y, 0.0));
        y += elastic;
        path = fmin(path - elastic, 60.0 * z_max);
        if (path > 0.0 && y < z_max) {
            const int parts = (int)ceil(path / (0.1 * (z_max - z_ba)));
            const double d = path / parts;
            for (int j = 0; j < parts; j++) {
                const double a = blend(y, z_max, z_ba), b = blend(y + 0.5 * d * a, z_max, z_ba),
                             c = blend(y + 0.5 * d * b, z_max, z_ba), e = blend(y + d * c, z_max, z_ba);
                y += d / 6.0 * (a + 2.0 * b + 2.0 * c + e);
            }
        } else if (path > 0.0) {
            y = z_max + (y - z_max) * exp(-path / z_max);
        }
        z = s == 0.0 ? z : s * y;
        sum += p[4] * z + p[5] * v[i] * (s * z > 0.0 ? blend(s * z, z_max, z_ba) : 1.0) + p[6] * v[i];
    }
    return sum;
}

/* p: kt, Fc, Fv, Fs_a, Fs_inf, vs, tauL, gamma; tauL a multiple of h */
static double SevenParameter(const double *p, const double *v, long n, double h)
{
    const double kt = p[0], Fc = p[1], Fs_inf = p[4], vs = p[5], gamma = p[7];
    const long delay = lround(p[6] / h) > 0 ? lround(p[6] / h) : 1;
    double *const ring = (double *)calloc((size_t)delay, sizeof(double));
    double d = 0.0, t2 = 0.0, last = p[3], slip = 0.0, sum = 0.0;
    for (long i = 0, now = 0; i < n; i++) {
        const double s = sign(v[i]);
        if (slip != 0.0 && s != slip) {
            const double ratio = ring[now] / vs;
            last = (last + (Fs_inf - last) * t2 / (t2 + gamma)) / (1.0 + ratio * ratio);
            d = slip * (Fc + last) / kt;
            t2 = slip = 0.0;
        }
        ring[now] = v[i];
        now = now + 1 < delay ? now + 1 : 0;
        if (slip == 0.0) { /* (kt s d - Fc - last) (t2 + gamma) = (Fs_inf - last) t2 is quadratic in time */
            const double over = kt * s * d - Fc - last, rise = Fs_inf - last, pull = kt * fabs(v[i]), t = t2 + gamma;
            const double c = over * t - rise * t2, b = over + pull * t - rise;
            double wait = h;
            if (s != 0.0 && c + h * (b + h * pull) > 0.0) {
                wait = c >= 0.0 ? 0.0 : 2.0 * -c / (b + sqrt(b * b - 4.0 * pull * c));
                slip = s;
            }
            d += v[i] * wait;
            t2 += wait;
        }
        if (slip != 0.0) {
            const double ratio = ring[now] / vs, Fs = last + (Fs_inf - last) * t2 / (t2 + gamma);
            sum += slip * (Fc + Fs / (1.0 + ratio * ratio)) + p[2] * v[i];
        } else {
            sum += kt * d;
        }
    }
    free(ring);
    return sum;
}

/* p: A, zc, n, sigma1, sigma2 after Fc, Fs, vs, delta */
static double leuven_curve(const double *p, double y) { return copysign(p[4] * (1.0 - exp(-fabs(y) / p[5])), y); }
static double leuven_inverse(const double *p, double force)
{
    return copysign(-p[5] * log(1.0 - fabs(force) / p[4]), force);
}
static double leuven_rate(const double *p, double y, double room)
{
    const double r = leuven_curve(p, y) / room;
    return 1.0 - copysign(pow(fabs(r), p[6]), r);
}
static double leuven_slip(const double *p, double y, double room, double d)
{
    const double a = leuven_rate(p, y, room), b = leuven_rate(p, y + 0.5 * d * a, room),
                 c = leuven_rate(p, y + 0.5 * d * b, room), e = leuven_rate(p, y + d * c, room);
    return y + d / 6.0 * (a + 2.0 * b + 2.0 * c + e);
}
static double Leuven(const double *p, const double *v, long n, double h)
{
    enum { DEEPEST = 64 };
    double stack[DEEPEST], base = 0.0, z = 0.0, before = 0.0, sum = 0.0;
    int depth = 0;
    for (long i = 0; i < n; i++) {
        const double s = sign(v[i]), S = stribeck(p, v[i]);
        if (s != 0.0 && s == -before) {
            base += leuven_curve(p, z);
            if (depth == DEEPEST)
                depth -= 2;
            stack[depth++] = base;
            z = 0.0;
        }
        if (s != 0.0)
            before = s;
        double y = s * z, path = fabs(v[i]) * h;
        for (;;) {
            const double force = s * base + leuven_curve(p, y), room = S - s * base;
            const double closing = depth >= 2 ? s * stack[depth - 2] : HUGE_VAL;
            const bool slides = depth > 0 && force - s * base >= 0.999 * room - 1e-12;
            if (s != 0.0 && (slides || force >= closing - 1e-12)) {
                depth = slides ? 0 : depth - 2;
                base = depth > 0 ? stack[depth - 1] : 0.0;
                y = leuven_inverse(p, force - s * base);
                continue;
            }
            if (path <= 0.0)
                break;
            const double target = fmin(depth > 0 ? leuven_inverse(p, 0.999 * room) : HUGE_VAL,
                                       depth >= 2 ? leuven_inverse(p, closing - s * base) : HUGE_VAL);
            const double d = fmin(path, 0.1 / fmax(p[6], 1.0) * p[5] * room / p[4]);
            const double next = leuven_slip(p, y, room, d);
            if (next < target) {
                path -= d;
                y = next;
            } else { /* the path to the target, by Simpson's rule for dx/dy */
                path -= (target - y) / 6.0 *
                        (1.0 / leuven_rate(p, y, room) + 4.0 / leuven_rate(p, 0.5 * (y + target), room) +
                         1.0 / leuven_rate(p, target, room));
                y = target;
            }
        }
        z = s == 0.0 ? z : s * y;
        sum += base + leuven_curve(p, z) + p[7] * v[i] * leuven_rate(p, s * z, S - s * base) + p[8] * v[i];
    }
    return sum;
}

/* p: n, sigma1, sigma2, N, k[10], W[10] after Fc, Fs, vs, delta */
static double modified_rate(const double *p, const double *F, double way, double S)
{
    double sum = 0.0;
    for (int j = 0; j < (int)p[7]; j++)
        sum += clip(F[j] + p[8 + j] * way, -p[18 + j], p[18 + j]);
    const double r = sum / S;
    return 1.0 - copysign(pow(fabs(r), p[4]), r);
}
static double ModifiedLeuven(const double *p, const double *v, long n, double h)
{
    const int N = (int)p[7];
    double F[10] = {0.0}, stiffness = 0.0, sum = 0.0;
    for (int j = 0; j < N; j++)
        stiffness += p[8 + j];
    for (long i = 0; i < n; i++) {
        const double s = sign(v[i]), S = s * stribeck(p, v[i]), path = v[i] * h;
        const int parts = (int)ceil(fabs(path * stiffness / S) * fmax(p[4], 1.0) / 0.05);
        for (int part = 0; s != 0.0 && part < parts; part++) {
            const double d = path / parts;
            const double a = modified_rate(p, F, 0.0, S), b = modified_rate(p, F, 0.5 * d * a, S),
                         c = modified_rate(p, F, 0.5 * d * b, S), e = modified_rate(p, F, d * c, S);
            const double way = d / 6.0 * (a + 2.0 * b + 2.0 * c + e);
            for (int j = 0; j < N; j++)
                F[j] = clip(F[j] + p[8 + j] * way, -p[18 + j], p[18 + j]);
        }
        for (int j = 0; j < N; j++)
            sum += F[j];
        sum += s != 0.0 ? p[5] * v[i] * modified_rate(p, F, 0.0, S) + p[6] * v[i] : 0.0;
    }
    return sum;
}

/* p: mu0, a, b, Dc, V0, sigma_n, law, theta */
static double RateAndState(const double *p, const double *v, long n, double h)
{
    const double mu0 = p[0], a = p[1], b = p[2], Dc = p[3], V0 = p[4];
    double theta = p[7], sum = 0.0;
    for (long i = 0; i < n; i++) {
        const double x = fabs(v[i]) * h / Dc;
        if (p[6] != 0.0)
            theta = x > 0.0 ? Dc / fabs(v[i]) * pow(fabs(v[i]) * theta / Dc, exp(-x)) : theta;
        else
            theta = x > 0.0 ? Dc / fabs(v[i]) + (theta - Dc / fabs(v[i])) * exp(-x) : theta + h;
        sum += p[5] * a * asinh(0.5 * v[i] / V0 * exp((mu0 + b * log(V0 * theta / Dc)) / a));
    }
    return sum;
}

/* p: N, seed, sigma0, delta_s, Delta; with the random numbers of the block, so that the force is the same */
static uint64_t scramble(uint64_t a)
{
    a = (a ^ a >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    a = (a ^ a >> 27) * UINT64_C(0x94d049bb133111eb);
    return a ^ a >> 31;
}
static double Bristle(const double *p, const double *v, long n, double h)
{
    enum { MOST = 1000 };
    const uint64_t golden = UINT64_C(0x9e3779b97f4a7c15);
    const int N = (int)p[0];
    uint64_t at[MOST];
    double d[MOST] = {0.0}, sum = 0.0;
    for (int j = 0; j < N; j++)
        at[j] = scramble(scramble(((uint64_t)(uint32_t)p[1] << 32 | (uint32_t)j) + golden) + golden);
    for (long i = 0; i < n; i++)
        for (int j = 0; j < N; j++) {
            d[j] += v[i] * h;
            while (fabs(d[j]) > p[3]) {
                at[j] += golden;
                d[j] -= sign(d[j]) * p[4] * ((double)(scramble(at[j]) >> 12) + 0.5) * 0x1.0p-52;
            }
            sum += p[2] * d[j];
        }
    return sum;
}

typedef double Loop(const double *p, const double *v, long n, double h);
typedef struct {
    const char *name;
    Loop *loop;
} Entry;

static const Entry entries[] = {
    {"Viscous", Viscous},
    {"Stiction", Stiction},
    {"Tustin", Tustin},
    {"Karnopp", Karnopp},
    {"DeadZoneTorque", DeadZoneTorque},
    {"ElastoPlastic", ElastoPlastic},
    {"SevenParameter", SevenParameter},
    {"Leuven", Leuven},
    {"ModifiedLeuven", ModifiedLeuven},
    {"RateAndState", RateAndState},
    {"Bristle", Bristle},
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
