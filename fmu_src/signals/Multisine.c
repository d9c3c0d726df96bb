/* Multisine with many lines: a periodic signal with power only at selected harmonics of a base frequency.

   Pintelon, Schoukens: System Identification, 2nd ed., Wiley 2012. The phases are random or follow Schroeder: Synthesis
   of low-peak-factor signals, IEEE Transactions on Information Theory 16(1), 1970, which keeps the peak low for any
   amplitudes.

       r(t) = offset + peak / P s(t)
       s(t) = sum_k A_k cos(2 pi h_k f0 t + phi_k),   k = 1 ... lines
       h_k = first + (k - 1) spacing,   A_k = (h_k / h_1)^-tilt
       Schroeder: phi_k = -2 pi sum_(l<k) (k - l) p_l
                  p_l = A_l^2 / sum_j A_j^2
       random:    phi_k uniform in [0, 2 pi), the same for the same seed

   P is the largest |s| over a period, found by Newton's method from a fine grid; r stays within offset -+ peak and
   reaches one of these limits. crest = P / rms of s: 1.41 for a single sine; for equal amplitudes 1.9 for ten lines and
   1.7 for a hundred with Schroeder phases, 2.5 or more with random phases. tilt = 0 gives equal amplitudes of the
   position, 1 of the velocity, 2 of the acceleration. spacing = 2 with an odd `first` omits the even harmonics, which
   then reveal an even nonlinearity.

   Use it to excite a friction plant at many frequencies at once: frequency responses from whole periods, nested
   presliding loops, and inputs with equal spectra but different seeds.

   Limits: at t = 0 of the simulation, r is in general neither at rest nor at offset. The crest factor is computed for
   the position; velocity and acceleration have other crest factors. The phase is computed from f0 t modulo 1, which at
   late times has a rounding error of 1e-16 f0 t periods. */

#define MODEL   Multisine
#define SUMMARY "Sum of many harmonics with Schroeder or random phases"
#define SOURCE  "Pintelon, Schoukens: System Identification, 2nd ed., 2012; Schroeder, IEEE TIT 16(1), 1970"
#define CITES   "PintelonSchoukens2012, Schroeder1970"

/* clang-format off */
#define VARIABLES                                                                                                \
    OUTPUT   (r,       LENGTH,                            "position")                                            \
    OUTPUT   (rd,      VELOCITY,                          "velocity")                                            \
    OUTPUT   (rdd,     ACCELERATION,                      "acceleration")                                        \
    LOCAL    (crest,   NO_UNIT,                           "crest factor of the position: peak over rms")         \
    PARAMETER(offset,  LENGTH,    0.0,   -INF,   INF,     "mean position")                                       \
    PARAMETER(peak,    LENGTH,    1e-3,  0.0,    INF,     "largest distance from offset")                        \
    PARAMETER(f0,      FREQUENCY, 0.5,   0.0,    INF,     "base frequency, the inverse of the period")           \
    COUNT    (lines,   20,               1,      LONGEST, "number of sines")                                     \
    COUNT    (first,   1,                1,      HIGHEST, "lowest harmonic")                                     \
    COUNT    (spacing, 1,                1,      HIGHEST, "distance between harmonics; 2: every other harmonic") \
    FIXED    (tilt,    NO_UNIT,   0.0,   -4.0,   4.0,     "amplitudes fall with this power of the frequency")    \
    COUNT    (seed,    0,                0,      COUNTS,  "seed of random phases; 0: Schroeder phases")
/* clang-format on */

enum { LONGEST = 256, HIGHEST = 100 };

/* Computed from the fixed parameters once. */
#define DECIDES_BY transition
#define MEMORY     struct plan
#define STEPS_BY   keep_plan
#define VALID_BY   is_plan

struct plan {
    double lines, first, spacing, tilt, seed; /* the parameters it was made for; lines = 0: none yet */
    double crest;                             /* largest |s| / its rms     */
    double A[LONGEST], phi[LONGEST];          /* amplitudes for P = 1, phases [rad] */
};

#include "block.h"
#include "constants.h"
#include "random.h"

typedef struct {
    double s, ds, dds; /* a sum of sines and its derivatives with respect to the phase of the base frequency */
} Sum;

static double harmonic(const struct plan *by, int k) { return by->first + k * by->spacing; }

/* Return the sum at the fraction u of the period. */
static Sum sum_at(const struct plan *by, double u)
{
    Sum sum = {0.0, 0.0, 0.0};
    for (int k = 0; k < (int)by->lines; k++) {
        const double n = harmonic(by, k), turns = n * u;
        const double angle = TWO_PI * (turns - floor(turns)) + by->phi[k];
        const double s = by->A[k] * cos(angle);
        sum.s += s;
        sum.ds -= n * by->A[k] * sin(angle);
        sum.dds -= n * n * s;
    }
    return sum;
}

/* Return the largest |s|. With POINTS per period of the highest harmonic, the grid reaches at least cos(pi / POINTS) =
   0.99 of it (Bernstein); Newton's method starts there. */
static double largest(const struct plan *by)
{
    enum { POINTS = 24 };
    const int lines = (int)by->lines, n = POINTS * (int)harmonic(by, lines - 1);
    double c[LONGEST], s[LONGEST], turn_c[LONGEST], turn_s[LONGEST]; /* phasors and their rotation to the next point */
    for (int k = 0; k < lines; k++) {
        const double turn = TWO_PI * harmonic(by, k) / n;
        c[k] = by->A[k] * cos(by->phi[k]);
        s[k] = by->A[k] * sin(by->phi[k]);
        turn_c[k] = cos(turn);
        turn_s[k] = sin(turn);
    }
    double best = 0.0;
    for (int i = 0; i < n; i++) {
        double sum = 0.0;
        for (int k = 0; k < lines; k++) {
            const double c_next = c[k] * turn_c[k] - s[k] * turn_s[k];
            sum += c[k];
            s[k] = s[k] * turn_c[k] + c[k] * turn_s[k];
            c[k] = c_next;
        }
        if (fabs(sum) < 0.98 * best)
            continue;
        double u = (double)i / n;
        Sum at = sum_at(by, u);
        for (int tries = 0; tries < 8 && at.s * at.dds < 0.0; tries++) {
            u += clip(-at.ds / at.dds / TWO_PI, -1.0 / n, 1.0 / n);
            const Sum next = sum_at(by, u);
            if (fabs(next.s) <= fabs(at.s))
                break;
            at = next;
        }
        best = fmax(best, fabs(at.s));
    }
    return best;
}

static void make_plan(struct plan *by, int lines)
{
    Random random;
    seed_random(&random, (uint64_t)by->seed);
    double power = 0.0;
    for (int k = 0; k < lines; k++) {
        by->A[k] = pow(harmonic(by, k) / by->first, -by->tilt);
        power += square(by->A[k]);
    }
    double phase = 0.0, slope = 0.0; /* slope = sum of p_l */
    for (int k = 0; k < lines; k++) {
        by->phi[k] = by->seed > 0.0 ? TWO_PI * uniform(&random) : TWO_PI * (ceil(phase) - phase);
        slope += square(by->A[k]) / power;
        phase += slope;
    }
    by->lines = lines;
    const double P = largest(by);
    for (int k = 0; k < lines; k++)
        by->A[k] /= P;
    by->crest = P / sqrt(0.5 * power);
}

/* Return whether the plan matches the parameters. */
static bool is_asked_for(const Model *m, const struct plan *by)
{
    GIVEN(m)
    return by->lines == lines && by->first == first && by->spacing == spacing && by->tilt == tilt && by->seed == seed;
}

static bool is_plan(const Model *m)
{
    const struct plan *const kept = &m->memory;
    return kept->lines == 0.0 || (is_asked_for(m, kept) && isfinite(kept->crest) &&
                                  all_finite(kept->A, (size_t)m->lines) && all_finite(kept->phi, (size_t)m->lines));
}

/* Return the plan for the parameters: the stored one, or a new one in `own`. */
static const struct plan *plan_of(const Model *m, struct plan *own)
{
    GIVEN(m)
    const struct plan *const kept = &m->memory;
    if (is_asked_for(m, kept))
        return kept;
    *own = (struct plan){.first = first, .spacing = spacing, .tilt = tilt, .seed = seed};
    make_plan(own, lines);
    return own;
}

static bool keep_plan(Model *m, double h)
{
    struct plan own;
    (void)h;
    if (plan_of(m, &own) == &own)
        m->memory = own;
    return true;
}

static void transition(Model *m) { (void)keep_plan(m, 0.0); }

static void equations(Model *m)
{
    GIVEN(m)
    struct plan own;
    const struct plan *const by = plan_of(m, &own);
    const double turns = f0 * m->time, w = TWO_PI * f0;
    const Sum now = sum_at(by, turns - floor(turns));
    m->r = offset + peak * now.s;
    m->rd = peak * w * now.ds;
    m->rdd = peak * w * w * now.dds;
    m->crest = by->crest;
}
