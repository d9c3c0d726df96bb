/* Elasto-plastic friction: LuGre bristles that do not slip up to a break-away deflection z_ba, so that small motions
   are exactly elastic and do not drift.

   Dupont, Armstrong, Hayward: Elasto-plastic friction model: contact compliance and stiction, American Control
   Conference, 2000; Dupont, Hayward, Armstrong, Altpeter: Single state elastoplastic friction models, IEEE TAC 47(5),
   2002; with the exponent i = 1.

       dz/dt = v (1 - alpha z / z_ss(v))
       z_ss  = sgn(v) z_max,   z_max(v) = S(v) / sigma0
       S(v)  = Fc + (Fs - Fc) exp(-|v/vs|^delta)
       sgn(z) /= sgn(v) or |z| <= z_ba:  alpha = 0
       z_ba < |z| < z_max:
            alpha = 1/2 + 1/2 sin(pi (|z| - (z_max + z_ba)/2) / (z_max - z_ba))
       |z| >= z_max:  alpha = 1
       F     = (sigma0 z + sigma1(v) dz/dt) Fn/Fn0 + sigma2 v
       sigma1(v) = sigma1 exp(-(v/v_d)^2) if v_d > 0, else sigma1

   sigma1(v) is from LuGre and not in the papers. Some publications omit |.| in the sine or exchange the two cases of
   sgn(z), which both break the model. z_ba should satisfy 0 < z_ba < z_max(v) for all v. A larger z_ba is replaced by
   z_max, and the contact is then elastic-perfectly plastic.

   In the elastic part of a step, z changes by the displacement. At constant velocity, the rest is a differential
   equation in the path: a Taylor series between z_ba and z_max, an exponential beyond. At linear velocity, the same
   holds where S is constant. Elsewhere, the equation is integrated numerically with error control from z_ba on
   (relaxation.h); beyond z_max, it is linear and solved by quadrature (attraction.h).

   Use it if friction holds a joint under vibration or small loads and the joint must not drift; otherwise like LuGre.
   It has one more parameter than LuGre, z_ba.

   Limits: F jumps with v, as in LuGre; beyond z_ba, reversal points are not remembered. */

#define MODEL    ElastoPlastic
#define SUMMARY  "Elasto-plastic bristle friction without drift below break-away"
#define SOURCE   "Dupont, Hayward, Armstrong, Altpeter, IEEE TAC 47(5), 2002"
#define CITES    "Dupont2002"
#define STATUS   "not checked against the papers"
#define FEATURES "presliding, drift-free, Stribeck, lag, rate dependent"

/* clang-format off */
#define VARIABLES                                                                                                      \
    INPUT    (v,      VELOCITY,  0.0,                "relative sliding velocity")                                      \
    OPTIONAL (Fn,     "N",       1.0,                "normal force")                                                   \
    OUTPUT   (F,      FORCE,                         "friction " FORCE_NOUN ", opposes v")                             \
    STATE    (z,      LENGTH,    0.0,    1e-5,       "mean bristle deflection")                                        \
    FLAG     (elastic,                               "the bristles follow the motion without slip")                    \
    PARAMETER(sigma0, STIFFNESS, 1e5,    1e-9,  INF, "bristle stiffness")                                              \
    PARAMETER(sigma1, DAMPING,   316.22776601683796, 0.0, INF, "bristle damping")                                      \
    PARAMETER(sigma2, DAMPING,   0.4,    0.0,   INF, "viscous coefficient")                                            \
    PARAMETER(Fc,     FORCE,     1.0,    1e-9,  INF, "Coulomb friction")                                               \
    PARAMETER(Fs,     FORCE,     1.5,    1e-9,  INF, "static friction (usually above Fc)")                             \
    PARAMETER(vs,     VELOCITY,  1e-3,   1e-12, INF, "Stribeck velocity")                                              \
    PARAMETER(delta,  NO_UNIT,   2.0,    1e-3,  100.0, "Stribeck exponent")                                            \
    PARAMETER(v_d,    VELOCITY,  0.0,    0.0,   INF, "speed at which the bristle damping decays; 0: constant damping") \
    PARAMETER(z_ba,   LENGTH,    0.7e-5, 0.0,   INF, "break-away deflection, below Fc/sigma0")                         \
    PARAMETER(Fn0,    "N",       1.0,    1e-12, INF, "normal force for which the parameters are valid")

#define CONTACT               \
    COULOMB  (Fc)             \
    STATIC   (Fs)             \
    STRIBECK (vs, delta)      \
    VISCOUS  (sigma2)         \
    STIFFNESS(sigma0)         \
    DAMPING  (sigma1, sigma2)

#define IDENTIFIED                       \
    FIT    (z_ba, 0.5 * distance, loops) \
    HELD   (v_d, 0, small_fast)          \
    SLIDING(z, Fc / sigma0)
/* clang-format on */

#define STEPS_BY   step
#define EVENTS     1
#define DECIDES_BY transition
#define MEMORY     struct stage
#define VALID_BY   is_stage
#define KEEPS_BY   keep_decisions

struct stage {
    double elastic; /* in model exchange: the flag */
};

#include "block.h"
#include "attraction.h"
#include "relaxation.h"
#include "constants.h"
#include "presliding.h"
#include "stribeck.h"
#include "until_change.h"

/* Return the plastic part of the motion, alpha z / z_ss, for a deflection in the direction of motion. For z_ba > z_max
   it jumps at z_max, where bristles slip that a rounding error is below it. */
static double plastic(double deflection, double z_max, double z_ba)
{
    if (deflection >= z_max * (1.0 - 4.0 * DBL_EPSILON))
        return deflection / z_max;
    if (deflection <= z_ba)
        return 0.0;
    return square(sin(HALF_PI * (deflection - z_ba) / (z_max - z_ba))) * deflection / z_max;
}

static bool is_stage(const Model *m) { return is_count(m->memory.elastic, 1.0); }

static void contact(Model *m, double S)
{
    GIVEN(m)
    const double part = plastic(sign(v) * z, S / sigma0, z_ba);
    const double damping = fading(sigma1, v, v_d);

    m->der_z = v * (1.0 - part);
    m->F = load_of(Fn, Fn0) * (sigma0 * z + damping * m->der_z) + sigma2 * v;
    m->elastic = m->run.frozen ? m->memory.elastic : part == 0.0 ? 1.0 : 0.0;
}

static void equations(Model *m) { contact(m, stribeck(m->v, m->Fc, m->Fs, m->vs, m->delta)); }

/* Return the deflection that is left until the bristles slip, for model exchange. */
static double margin(const Model *m)
{
    GIVEN(m)
    const double direction = fabs(v) < 1e-7 * vs ? 0.0 : sign(v); /* noise of a solver around v = 0 is not motion */
    return fmin(z_ba, stribeck(v, Fc, Fs, vs, delta) / sigma0) - direction * z;
}

static void indicators(const Model *m, double *left) { left[0] = until_change(m->memory.elastic, margin(m), m->z_ba); }

static void transition(Model *m) { m->memory.elastic = margin(m) >= 0.0 ? 1.0 : 0.0; }

/* ---- Steps: exact at constant velocity and where S is constant, with error control elsewhere. */

/* Between break-away and z_max, with y = (z_max - z) / (z_max - z_ba) and k = 1 - z_ba / z_max:

       dy/dp = -f(y),   f = sin^2(pi y/2) + k y cos^2(pi y/2),   p = path / (z_max - z_ba)

   Compute y(p) by its Taylor series in steps; near z_max by the solution for f = k y + (pi/2)^2 y^2. */
static double approach(double y, double k, double p)
{
    enum { TERMS = 16 };
    const double accuracy = 1e-13, near = 1e-4;

    while (p > 0.0 && y > near) {
        double a[TERMS + 1], c[TERMS + 1], s[TERMS + 1], f[TERMS];
        double part = fmin(p, 1.0 / y), power = 1.0, term = 1.0, before = 1.0, earlier;
        int n = 0;
        a[0] = y;
        c[0] = cos(PI * y);
        s[0] = sin(PI * y);
        do { /* coefficients of y, cos(pi y), sin(pi y) and f until the terms are negligible */
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
            c[n] = PI * s_f / n;
            s[n] = -PI * c_f / n;
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
        return y * exp(-k * p) / (1.0 + square(HALF_PI) * y * spent);
    }
    return y;
}

/* Return the deflection after a path u > 0 in the direction of motion, at constant z_max. */
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

/* A ramp of the velocity and the current position in it, in the direction of motion. */
typedef struct {
    const Model *m;
    double speed, growth; /* at the start of the ramp */
    double h, S_end;
    double sensitivity; /* of F to sigma0 z at the end of the ramp */
    double t, deflection;
    int budget; /* number of inner steps left */
} Ramp;

static double speed_at(const Ramp *r, double s) { return fmax(r->speed + r->growth * s, 0.0); }

static double level_at(const Ramp *r, double s)
{
    GIVEN(r->m)
    return stribeck(speed_at(r, s), Fc, Fs, vs, delta);
}

static double path_between(const Ramp *r, double s, double end)
{
    return 0.5 * (end - s) * (speed_at(r, s) + speed_at(r, end));
}

/* Functions for relaxation.h: dz/dt in general, for z < z_ba and for z > z_max; z_max; and the point at which z reaches
   z_max from below or from above. */
static double deflection_rate(double s, double z, const void *law)
{
    const Ramp *const r = (const Ramp *)law;
    return speed_at(r, s) * (1.0 - plastic(z, level_at(r, s) / r->m->sigma0, r->m->z_ba));
}

static double steady(double s, double z, const void *law)
{
    (void)z;
    return speed_at((const Ramp *)law, s);
}

static double z_max_at(double s, double z, const void *law)
{
    const Ramp *const r = (const Ramp *)law;
    (void)z;
    return level_at(r, s) / r->m->sigma0;
}

static double slipping(double s, double z, const void *law)
{
    return speed_at((const Ramp *)law, s) * (1.0 - z / z_max_at(s, z, law));
}

static double over_z_max(double s, double z, const void *law) { return z - z_max_at(s, z, law); }
static double below_z_max(double s, double z, const void *law) { return z_max_at(s, z, law) - z; }

/* Integrate the rate to `end` or to the goal. */
static bool integrate_ramp(Ramp *r, double end, Curve *rate, Curve *goal)
{
    GIVEN(r->m)
    const double z_max = z_max_at(end, 0.0, r), smallest = fmin(fmin(Fs, Fc), r->S_end) / sigma0;
    /* below a hundredth, rounding dominates; the law is smooth enough for any tolerance of the experiment */
    const double coarser = fmax(quadrature_tolerance(r->m) / relaxation_tolerance(r->m), 1.0);
    const double size = coarser * fmax(smallest / r->sensitivity, 0.01 * z_max);
    const Law law = {rate, goal,  rate != steady && r->deflection > 0.9 * z_max_at(r->t, 0.0, r) ? z_max_at : NULL,
                     r,    false, &r->budget};
    const double detail = fmax(0.25 * fabs(z_max - z_ba), 1e-6 * z_max);
    return follow(r->m, &law, &r->t, &r->deflection, end, size, detail) != FAILED;
}

/* For z_ba > z_max and increasing z_max: z follows the motion, limited to z_max. This is exact in intervals in which
   z_max always increases faster, or always more slowly, than z can. */
static void follow_limit(Ramp *r, double end)
{
    enum { PARTS = 16 };
    const double begin = r->t;
    for (int i = 1; i <= PARTS; i++) {
        const double next = i == PARTS ? end : begin + (end - begin) * i / (double)PARTS;
        const double tiny = 1e-5 * (next - r->t);
        double low = r->t, high = next; /* bracket of the time at which one overtakes the other */
        const bool slower = z_max_at(low + tiny, 0.0, r) - z_max_at(low, 0.0, r) < path_between(r, low, low + tiny);
        for (int halvings = 0; halvings < 20; halvings++) {
            const double s = 0.5 * (low + high);
            if ((z_max_at(s + tiny, 0.0, r) - z_max_at(s, 0.0, r) < path_between(r, s, s + tiny)) == slower)
                low = s;
            else
                high = s;
        }
        const double stops[] = {high, next};
        for (int k = 0; k < 2; k++) {
            r->deflection = fmin(r->deflection + path_between(r, r->t, stops[k]), z_max_at(stops[k], 0.0, r));
            r->t = stops[k];
        }
    }
}

/* For z >= z_max and z_max not increasing: alpha = 1 for the whole ramp, and sigma0 z is attracted to S. */
static bool slip(Ramp *r)
{
    GIVEN(r->m)
    const Attraction law = {sigma0, true, Fc, Fs, vs, delta, quadrature_tolerance(r->m)};
    const double y = sigma0 * r->deflection;
    double kept, gained;
    if (!attract(&law, speed_at(r, r->t), r->growth, r->h - r->t, y, r->sensitivity, &kept, &gained))
        return false;
    r->deflection = (kept * y + gained) / sigma0;
    r->t = r->h;
    return true;
}

/* Return the time at which z_max passes z_ba, or INF if it does not. */
static double time_of_z_ba(const Ramp *r)
{
    GIVEN(r->m)
    const double part = (sigma0 * z_ba - Fc) / (Fs - Fc);
    return part > 0.0 && part < 1.0 ? (vs * pow(-log(part), 1.0 / delta) - r->speed) / r->growth : INF;
}

/* Advance by one interval of the ramp, at most to `end`. */
static bool piece_of(Ramp *r, double end)
{
    GIVEN(r->m)
    const double S = level_at(r, r->t), z_max = S / sigma0;
    const bool falls = r->S_end < S, yields = sigma0 * z_ba >= level_at(r, 0.5 * (r->t + end));
    if (r->deflection >= z_max && falls)
        return slip(r);
    if (r->deflection > z_max)
        return integrate_ramp(r, end, slipping, below_z_max);
    if (yields && falls)
        return integrate_ramp(r, end, steady, over_z_max);
    if (yields)
        follow_limit(r, end);
    else if (r->deflection < z_ba) {
        const double arrival = r->t + time_to_slide(z_ba - r->deflection, speed_at(r, r->t), r->growth);
        r->deflection = arrival < end ? z_ba : r->deflection + path_between(r, r->t, end);
        r->t = arrival < end ? arrival : end;
    } else
        return integrate_ramp(r, end, deflection_rate, falls ? over_z_max : NULL);
    return true;
}

static bool ramp(Model *m, double h)
{
    GIVEN(m)
    const double direction = sign(slide(m, h)), growth = direction * SLOPE(v);
    const double v_start = direction * v, v_end = fmax(v_start + growth * h, 0.0);
    const double S_start = stribeck(v_start, Fc, Fs, vs, delta), S_end = stribeck(v_end, Fc, Fs, vs, delta);
    Ramp r = {m,   v_start,       growth, h, S_end, 1.0 + fading(sigma1, v_end, v_d) * v_end / S_end,
              0.0, direction * z, BUDGET};

    /* only the end of a long path matters, as the distance between any two deflections decreases like
       exp(-path/z_max) */
    const double memory = fabs(z) + fmax(z_ba, 0.0) + 45.0 * fmax(S_start, S_end) / sigma0;
    if (0.5 * h * (v_start + v_end) > memory)
        r.t = h - fmin(h, time_back(memory, v_end, growth));
    const double passes = time_of_z_ba(&r);

    for (int pieces = 0; r.t < h; pieces++) {
        if (pieces > 1000)
            return false;
        if (level_at(&r, r.t) == S_end) {
            r.deflection = slid(r.deflection, path_between(&r, r.t, h), S_end / sigma0, z_ba);
            break;
        }
        double end = r.t + stribeck_piece(speed_at(&r, r.t), growth, Fc, Fs, vs, delta);
        end = end < h && end > r.t ? end : h;
        if (!piece_of(&r, passes > r.t && passes < end ? passes : end))
            return failed(m, r.budget);
    }
    m->z = direction * r.deflection;
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
