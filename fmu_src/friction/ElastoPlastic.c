/* Elasto-plastic friction: LuGre bristles that do not slip at all up to a break-away deflection z_ba, so that small
   motions are exactly elastic and do not drift.

   Dupont, Armstrong, Hayward: Elasto-plastic friction model: contact compliance and stiction, American Control
   Conference, 2000; Dupont, Hayward, Armstrong, Altpeter: Single state elastoplastic friction models, IEEE TAC 47(5),
   2002; equations from memory of the papers, with the exponent i = 1.

       dz/dt = v (1 - alpha z / z_ss(v))
       z_ss  = sgn(v) z_max,   z_max(v) = S(v) / sigma0
       S(v)  = Fc + (Fs - Fc) exp(-|v/vs|^delta)
       sgn(z) /= sgn(v) or |z| <= z_ba:  alpha = 0
       z_ba < |z| < z_max:
            alpha = 1/2 + 1/2 sin(pi (|z| - (z_max + z_ba)/2) / (z_max - z_ba))
       |z| >= z_max:  alpha = 1
       F     = (sigma0 z + sigma1(v) dz/dt) Fn/Fn0 + sigma2 v
       sigma1(v) = sigma1 exp(-(v/v_d)^2) if v_d > 0, else sigma1

   sigma1(v) is that of LuGre and not in the papers. Published copies drop |.| in the sine or exchange the two cases of
   sgn(z); both break the model. 0 < z_ba < z_max(v) is meant for all v; where z_ba is larger, z_max takes its place,
   and the contact is elastic-perfectly plastic.

   The elastic part of a step is z + x, the rest, at constant velocity, a differential equation in the path alone: a
   Taylor series between z_ba and z_max, an exponential beyond. At linear velocity the same holds where S is flat;
   where it is not the equation is integrated numerically with error control, from the arrival at z_ba, by the method
   of order 5 of Dormand and Prince, Journal of Computational and Applied Mathematics 6(1), 1980.

   Use it where a joint is held by friction under vibration or small loads and must not creep away, else as LuGre. It
   needs one number more than LuGre, z_ba.

   Limits: F jumps with a jump of v as in LuGre; no memory of reversal points beyond z_ba. */

/* @article{Dupont2002,
     author  = {Dupont, P. and Hayward, V. and Armstrong, B. and Altpeter, F.},
     title   = {Single state elastoplastic friction models},
     journal = {IEEE Transactions on Automatic Control},
     volume  = {47}, number = {5}, pages = {787--792}, year = {2002}} */

#define MODEL    ElastoPlastic
#define SUMMARY  "Elasto-plastic bristle friction, free of drift below break-away"
#define SOURCE   "Dupont, Hayward, Armstrong, Altpeter, IEEE TAC 47(5), 2002"
#define FEATURES "presliding, drift-free, Stribeck, lag, rate dependent"

/* clang-format off */
#define VARIABLES                                                                               \
    INPUT    (v,      VELOCITY,  0.0,                "relative sliding velocity")               \
    OPTIONAL (Fn,     "N",       1.0,                "normal force")                            \
    OUTPUT   (F,      FORCE,                         "friction force, opposes v")               \
    STATE    (z,      LENGTH,    0.0,    1e-5,       "mean bristle deflection")                 \
    FLAG     (elastic,                               "the bristles follow the motion without slip") \
    PARAMETER(sigma0, STIFFNESS, 1e5,    1e-9,  INF, "bristle stiffness")                       \
    PARAMETER(sigma1, DAMPING,   316.22776601683796, 0.0, INF, "bristle damping")               \
    PARAMETER(sigma2, DAMPING,   0.4,    0.0,   INF, "viscous coefficient")                     \
    PARAMETER(Fc,     FORCE,     1.0,    1e-9,  INF, "Coulomb friction")                        \
    PARAMETER(Fs,     FORCE,     1.5,    1e-9,  INF, "static friction, may be below Fc")        \
    PARAMETER(vs,     VELOCITY,  1e-3,   1e-12, INF, "Stribeck velocity")                       \
    PARAMETER(delta,  NO_UNIT,   2.0,    1e-3,  100.0, "Stribeck exponent")                     \
    PARAMETER(v_d,    VELOCITY,  0.0,    0.0,   INF, "speed at which the bristle damping fades, 0: never") \
    PARAMETER(z_ba,   LENGTH,    0.7e-5, 0.0,   INF, "break-away deflection, below Fc/sigma0")  \
    PARAMETER(Fn0,    "N",       1.0,    1e-12, INF, "normal force at which the parameters hold")
/* clang-format on */

#define STEPS_BY step

#include "block.h"
#include "presliding.h"
#include "stribeck.h"

static const double pi = 3.14159265358979323846;

/* Plastic part of the motion, alpha z / z_ss, for a deflection in the direction of motion. */
static double plastic(double deflection, double z_max, double z_ba)
{
    if (deflection >= z_max)
        return deflection / z_max;
    if (deflection <= z_ba)
        return 0.0;
    return square(sin(0.5 * pi * (deflection - z_ba) / (z_max - z_ba))) * deflection / z_max;
}

static void contact(Model *m, double S)
{
    GIVEN(m)
    const double part = plastic(sign(v) * z, S / sigma0, z_ba);
    const double damping = fading(sigma1, v, v_d);

    m->der_z = v * (1.0 - part);
    m->F = load_of(Fn, Fn0) * (sigma0 * z + damping * m->der_z) + sigma2 * v;
    m->elastic = part == 0.0 ? 1.0 : 0.0;
}

static void equations(Model *m) { contact(m, stribeck(m->v, m->Fc, m->Fs, m->vs, m->delta)); }

/* Between break-away and z_max, with y = (z_max - z) / (z_max - z_ba) and k = 1 - z_ba / z_max:

       dy/dp = -f(y),   f = sin^2(pi y/2) + k y cos^2(pi y/2),   p = path / (z_max - z_ba)

   y(p), by its Taylor series in steps; near z_max by the solution for f = k y + (pi/2)^2 y^2. */
static double approach(double y, double k, double p)
{
    enum { TERMS = 16 };
    const double accuracy = 1e-13, near = 1e-4;

    while (p > 0.0 && y > near) {
        double a[TERMS + 1], c[TERMS + 1], s[TERMS + 1], f[TERMS];
        double part = fmin(p, 1.0 / y), power = 1.0, term = 1.0, before = 1.0, earlier;
        int n = 0;
        a[0] = y;
        c[0] = cos(pi * y);
        s[0] = sin(pi * y);
        do { /* coefficients of y, cos(pi y), sin(pi y) and f until the terms vanish */
            double y_c = 0.0, s_f = 0.0, c_f = 0.0;
            for (int j = 0; j <= n; j++)
                y_c += a[j] * c[n - j];
            f[n] = 0.5 * ((n == 0 ? 1.0 : 0.0) - c[n] + k * (a[n] + y_c));
            for (int j = 0; j <= n; j++) {
                s_f += s[j] * f[n - j];
                c_f += c[j] * f[n - j];
            }
            n++;
            a[n] = -f[n - 1] / n;
            c[n] = pi * s_f / n;
            s[n] = -pi * c_f / n;
            earlier = before;
            before = term;
            power *= part;
            term = fabs(a[n]) * power;
        } while (n < TERMS && (n < 5 || !(fmax(term, fmax(before, earlier)) < accuracy)));
        while (n == TERMS && fmax(fabs(a[n - 1]), fabs(a[n]) * part) * pow(part, n - 1) > accuracy)
            part *= 0.8;
        double sum = a[n];
        while (n > 0)
            sum = a[--n] + part * sum;
        y = sum;
        p -= part;
    }
    if (p > 0.0) {
        const double spent = k > 0.0 ? -expm1(-k * p) / k : p; /* (1 - exp(-k p)) / k */
        return y * exp(-k * p) / (1.0 + square(0.5 * pi) * y * spent);
    }
    return y;
}

/* Deflection after a path u > 0 in the direction of motion, at constant z_max. */
static double slid(double z, double u, double z_max, double z_ba)
{
    const double start = fmin(z_ba, z_max), width = z_max - start;
    if (z < start) {
        if (u <= start - z)
            return z + u;
        u -= start - z;
        z = start;
    }
    if (z >= z_max)
        return relax(z, z_max, u / z_max);
    return z_max - width * approach((z_max - z) / width, width / z_max, u / width);
}

/* Speed of the deflection at a speed of the contact, both in the direction of motion */
static double stretching(const Model *m, double deflection, double speed)
{
    GIVEN(m)
    return speed * (1.0 - plastic(deflection, stribeck(speed, Fc, Fs, vs, delta) / sigma0, z_ba));
}

/* Dormand and Prince: the last row is the solution, and where the next step begins. */
/* clang-format off */
enum { STAGES_5 = 7 };
static const double node[STAGES_5] = {0.0, 1.0/5, 3.0/10, 4.0/5, 8.0/9, 1.0, 1.0};
static const double weight[STAGES_5][STAGES_5 - 1] = {
    {0.0},
    {1.0/5},
    {3.0/40,       9.0/40},
    {44.0/45,      -56.0/15,      32.0/9},
    {19372.0/6561, -25360.0/2187, 64448.0/6561, -212.0/729},
    {9017.0/3168,  -355.0/33,     46732.0/5247, 49.0/176,  -5103.0/18656},
    {35.0/384,     0.0,           500.0/1113,   125.0/192, -2187.0/6784,  11.0/84}};
static const double error_weight[STAGES_5] = {71.0/57600, 0.0, -71.0/16695, 71.0/1920, -17253.0/339200, 22.0/525, -1.0/40};
/* clang-format on */

/* The deflection after a time dt in which the speed grows by `rise`; `error` over the steady deflection. */
static double dormand_prince(const Model *m, double deflection, double speed, double rise, double dt, double *error)
{
    double rate[STAGES_5], moved = deflection, sum = 0.0;
    for (int i = 0; i < STAGES_5; i++) {
        moved = deflection;
        for (int j = 0; j < i; j++)
            moved += dt * weight[i][j] * rate[j];
        rate[i] = stretching(m, moved, fmax(speed + node[i] * rise, 0.0));
        sum += error_weight[i] * rate[i];
    }
    *error = fabs(dt * sum) * m->sigma0 / fmin(m->Fc, m->Fs);
    return moved;
}

/* Pieces of a ramp: up to the arrival at z_ba exactly, over the flat part of S exactly, elsewhere numerically. */
static bool ramp(Model *m, double h)
{
    GIVEN(m)
    const double tolerance = m->run.tolerance > 0.0 ? m->run.tolerance : DEFAULT_TOLERANCE;
    const double direction = sign(slide(m, h)), growth = direction * SLOPE(v);
    const double v_start = direction * v, v_end = fmax(v_start + growth * h, 0.0);
    const double S_end = stribeck(v_end, Fc, Fs, vs, delta);
    double now = direction * z, dt = h;

    /* Of a long path only the end counts, as the distance between any two deflections shrinks as exp(-path/z_max). */
    const double S_most = fmax(S_end, stribeck(v_start, Fc, Fs, vs, delta));
    const double memory = fabs(z) + fmax(z_ba, 0.0) + 45.0 * S_most / sigma0;
    double t = 0.5 * h * (v_start + v_end) > memory ? h - fmin(h, time_back(memory, v_end, growth)) : 0.0;

    for (int tries = 0; t < h; tries++) {
        const double speed = fmax(v_start + growth * t, 0.0), rest = h - t, path = 0.5 * rest * (speed + v_end);
        const double S = stribeck(speed, Fc, Fs, vs, delta);
        if (tries > 100000)
            return false;
        if (S == S_end) {
            now = slid(now, path, S / sigma0, z_ba);
            break;
        }
        dt = fmin(dt, fmin(rest, time_in_sight(speed, growth, vs)));
        if (sigma0 * z_ba >= fmin(S, S_end)) { /* not meant by the model: S is held over short pieces */
            dt = fmin(rest, time_in_sight(speed, growth, vs) / 64.0);
            const double middle = stribeck(speed + 0.5 * dt * growth, Fc, Fs, vs, delta);
            now = slid(now, dt * (speed + 0.5 * dt * growth), middle / sigma0, z_ba);
            t = dt < rest ? t + dt : h;
        } else if (now < z_ba) {
            const double arrival = time_to_slide(z_ba - now, speed, growth);
            now = arrival < rest ? z_ba : now + path;
            t = arrival < rest ? t + arrival : h;
        } else {
            double error;
            const bool last = dt >= rest;
            const double next = dormand_prince(m, now, speed, growth * dt, dt, &error);
            if (error <= tolerance) {
                now = next;
                t = last ? h : t + dt;
            }
            if (!last || error > tolerance)
                dt *= clip(0.9 * pow(error / tolerance + 1e-9, -0.2), 0.1, error <= tolerance ? 5.0 : 0.9);
        }
    }
    m->z = direction * now;
    return true;
}

static bool step(Model *m, double h)
{
    GIVEN(m)
    if (SLOPE(v) != 0.0)
        return slide(m, h) == 0.0 || ramp(m, h);
    const double S = stribeck(v, Fc, Fs, vs, delta);
    if (v != 0.0)
        m->z = sign(v) * slid(sign(v) * z, fabs(v) * h, S / sigma0, z_ba);
    contact(m, S);
    m->run.outputs_done = true;
    return true;
}
