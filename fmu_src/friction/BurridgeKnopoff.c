/* Burridge-Knopoff model: a train of blocks that stick and slip on a rough surface, coupled by springs and pulled by a
   driver. It models friction on the scale of tectonic plates, where the slip of a single block can grow into an
   avalanche.

   Burridge, Knopoff: Model and theoretical seismicity, Bulletin of the Seismological Society of America 57, 1967, in
   the scaling and with the friction law of Carlson, Langer: Physical Review A 40, 1989, and Carlson, Langer, Shaw,
   Tang: Physical Review A 44, 1991. All quantities are dimensionless; the unit of time is one second of simulation, the
   unit of force is the static friction.

       u_j'' = f_j - phi,   dX/dt = nu + v
       f_j   = l^2 (u_j+1 - 2 u_j + u_j-1) + X - u_j
       stuck:    phi = f_j <= 1, unlimited against backward motion (no back-slip)
       slipping: phi = (1 - sigma) / (1 + 2 alpha w / (1 - sigma)),  w = u_j' > 0
       F     = mean of X - u_j

   F is the force per block on the driver; it opposes the driver. A block starts to slip when f_j reaches 1 and sticks
   when w decreases to 0; it never slips backwards. These events are located to rounding; while no block moves, the time
   to the next event is found in closed form. Blocks at the ends have one neighbour, or in a ring (periodic = 1) also
   the block at the other end. The initial positions are uniformly distributed between -spread and spread; u shows the
   first ten.

   An avalanche lasts from the first slip until no block moves. `avalanches` counts the completed ones, and `moment` is
   the sum of all slip in the last one; its logarithm is the magnitude.

   Between events the equations are smooth and solved by extrapolation to 1e-12 per inner step, independent of the
   communication step; the cost is proportional to N per inner step and to the number of starts and stops.

   Use it to study how avalanches of all sizes arise from blocks that stick and slip, as in earthquake faults: how often
   slips of a given size occur, and what precedes a large one. It needs long runs, as only statistics are reproducible.
   For friction in machines, use a contact model.

   Limits: the motion is chaotic for alpha > 0, so only averages are meaningful after many avalanches. Friction acts
   against positive slip only, so the model is not symmetric: a driver that moves backwards unloads the blocks and then
   pushes against blocks that never move. Start values are taken from the papers, except for the number of blocks. */

#define MODEL       BurridgeKnopoff
#define SUMMARY     "Burridge-Knopoff train of stick-slip blocks pulled by a driver"
#define SOURCE      "Burridge, Knopoff, BSSA 57, 1967; Carlson, Langer, Physical Review A 40, 1989"
#define CITES       "CarlsonLanger1989, BurridgeKnopoff1967"
#define STATUS      "not checked against the papers"
#define FEATURES    "presliding, drift-free, Stribeck, rate dependent, mass inside, random"
#define NO_EXCHANGE "its blocks are integrated inside, and each start and stop would be an event"

/* clang-format off */
#define VARIABLES                                                                                           \
    OPTIONAL (v,          NO_UNIT, 0.0,                "velocity of the driver in addition to nu")          \
    OUTPUT   (F,          NO_UNIT,                     "friction force per block, opposes the driver")      \
    STATE    (X,          NO_UNIT, 0.0,  1.0,          "position of the driver")                            \
    LOCAL    (x,          NO_UNIT,                     "mean position of the blocks")                       \
    LOCAL    (w,          NO_UNIT,                     "mean velocity of the blocks")                       \
    LOCAL    (acceleration, NO_UNIT,                   "mean acceleration of the blocks")                   \
    OUTPUT   (peak,       NO_UNIT,                     "largest force on a stuck block; the block slips at 1") \
    OUTPUT   (weakened,   NO_UNIT,                     "friction of a block that slips at the mean velocity") \
    LOCAL    (moment,     NO_UNIT,                     "slip in the last avalanche, over all blocks")       \
    TALLY    (avalanches,                              "number of completed avalanches")                    \
    TALLY    (moving,                                  "number of slipping blocks")                         \
    LOCALS   (u, 10,      NO_UNIT,                     "positions of the first ten blocks")                 \
    FLAGS    (slipping, 10,                            "whether the first ten blocks slip")                 \
    PARAMETER(l,          NO_UNIT, 10.0, 0.0,  INF,    "velocity of sound in blocks; l^2 couples neighbours") \
    PARAMETER(nu,         NO_UNIT, 0.01, -INF, INF,    "loading rate, velocity of the driver")              \
    PARAMETER(sigma,      NO_UNIT, 0.01, 0.0,  0.999,  "drop of friction at the onset of slip")             \
    PARAMETER(alpha,      NO_UNIT, 2.5,  0.0,  INF,    "rate at which friction decreases with slip velocity") \
    COUNT    (N,          50,      1,    MASSES,       "number of blocks")                                  \
    COUNT    (periodic,   0,       0,    1,            "1: a ring, 0: free ends")                           \
    FIXED    (spread,     NO_UNIT, 1e-3, 0.0,  1e6,    "half width of the distribution of initial positions") \
    COUNT    (seed,       1,       0,    2147483647,   "seed of the initial positions")
/* clang-format on */

#include "extrapolation.h"

#define MEMORY   struct fault
#define KEEPS_BY keep_fault
#define VALID_BY is_fault
#define STEPS_BY step

#include <stdint.h>

struct fault {
    bool ready;           /* initialised and stepped */
    double time;          /* [s] of y */
    double before;        /* mean position before the avalanche */
    double moment;        /* moment of the last avalanche */
    int32_t avalanches;   /* number of completed avalanches */
    int32_t moving;       /* number of slipping blocks */
    bool slips[MASSES];   /* whether a block slips */
    double y[2 * MASSES]; /* N positions, then N velocities */
};

#include "block.h"
#include "roots.h"
#include "ramp.h"
#include "random.h"

static void keep_fault(Memory *to, const Memory *from, const Model *m, bool follows)
{
    (void)follows;
    memcpy(to, from, offsetof(struct fault, y) + 2 * (size_t)m->N * sizeof(double));
}

static bool is_fault(const Model *m)
{
    const struct fault *const f = &m->memory;
    const int n = (int)m->N;
    int moving = 0;
    bool good = is_flag(&f->ready) && isfinite(f->time) && isfinite(f->before) && isfinite(f->moment) &&
                f->avalanches >= 0 && all_finite(f->y, 2 * (size_t)n);
    for (int j = 0; good && j < n; j++) {
        good = is_flag(&f->slips[j]);
        moving += good && f->slips[j];
    }
    return good && f->moving == moving;
}

#define SAME 1e-13 /* tolerance for forces and velocities that are equal except for rounding */

typedef struct {
    const struct fault *fault;
    int n;
    bool ring;
    double coupling, sigma, alpha;
    double X, X_rate, X_curvature; /* driver: X + X_rate s + X_curvature s^2 / 2 */
} Train;

static Train train_of(const Model *m)
{
    GIVEN(m)
    const Train train = {&m->memory, N, periodic != 0, l * l, sigma, alpha, X, nu + v, SLOPE(v)};
    return train;
}

static double driver(const Train *t, double s) { return t->X + path_after(t->X_rate, t->X_curvature, s); }

static double force(const Train *t, double X, const double *u, int j)
{
    const double left = j > 0 ? u[j - 1] : t->ring ? u[t->n - 1] : u[j];
    const double right = j < t->n - 1 ? u[j + 1] : t->ring ? u[0] : u[j];
    return t->coupling * ((left - u[j]) + (right - u[j])) + (X - u[j]);
}

/* The friction law, continued smoothly for steps that slightly overshoot the stop. */
static double slip_friction(double w, double sigma, double alpha)
{
    const double level = 1.0 - sigma;
    return level / fmax(1.0 + 2.0 * alpha * w / level, 0.5);
}

static void accelerations(const void *system, double s, const double *y, double *a)
{
    const Train *const t = (const Train *)system;
    const double X = driver(t, s);
    for (int j = 0; j < t->n; j++)
        a[j] = t->fault->slips[j] ? force(t, X, y, j) - slip_friction(y[t->n + j], t->sigma, t->alpha) : 0.0;
}

static double largest_force(const Train *t, double X, const double *u)
{
    double largest = -INF;
    for (int j = 0; j < t->n; j++)
        if (!t->fault->slips[j])
            largest = fmax(largest, force(t, X, u, j));
    return largest;
}

static double mean(const double *values, int n)
{
    double sum = 0.0;
    for (int j = 0; j < n; j++)
        sum += values[j];
    return sum / n;
}

/* Initialise blocks at rest at random positions. */
static void lay(const Model *m, struct fault *f)
{
    GIVEN(m)
    Random random;
    seed_random(&random, (uint64_t)seed);
    f->ready = false;
    f->before = f->moment = 0.0;
    f->avalanches = f->moving = 0;
    for (int j = 0; j < N; j++) {
        f->y[j] = spread * (2.0 * uniform(&random) - 1.0);
        f->y[N + j] = 0.0;
        f->slips[j] = false;
    }
}

static void equations(Model *m)
{
    GIVEN(m)
    struct fault start;
    if (!m->memory.ready)
        lay(m, &start);
    const struct fault *const f = m->memory.ready ? &m->memory : &start;
    Train t = train_of(m);
    t.fault = f;
    const double s = f->ready ? m->time - f->time : 0.0;
    double a[MASSES], moved[2 * MASSES], push = 0.0;
    const double *y = f->y;

    accelerations(&t, 0.0, y, a);
    if (s != 0.0) { /* extrapolate beyond the end of the step, for derivatives with respect to time */
        for (int j = 0; j < N; j++) {
            moved[j] = y[j] + s * (y[N + j] + 0.5 * s * a[j]);
            moved[N + j] = y[N + j] + s * a[j];
        }
        y = moved;
    }
    for (int j = 0; j < N; j++)
        push += a[j] / N;
    m->der_X = nu + v;
    m->x = mean(y, N);
    m->w = mean(y + N, N);
    m->F = X - m->x;
    m->acceleration = push;
    m->peak = f->moving < N ? largest_force(&t, X, y) : 0.0;
    m->weakened = square(1.0 - sigma) / (1.0 - sigma + 2.0 * alpha * fmax(m->w, 0.0));
    m->moment = f->moment;
    m->avalanches = f->avalanches;
    m->moving = f->moving;
    for (int j = 0; j < 10; j++) {
        m->u[j] = j < N ? y[j] : 0.0;
        m->slipping[j] = j < N && f->slips[j] ? 1.0 : 0.0;
    }
}

/* ---- Steps: extrapolation from event to event, and in closed form while no block moves. */

/* While all blocks are stuck, return the time until the force has grown by `gap`, or INF if it never does. */
static double time_at_rest(double gap, double rate, double curvature)
{
    if (gap <= 0.0)
        return 0.0;
    const double discriminant = squared_speed_after(gap, rate, curvature);
    if (discriminant < 0.0)
        return INF;
    const double root = sqrt(discriminant);
    if (rate >= 0.0)
        return rate + root > 0.0 ? time_between(gap, rate, root) : INF;
    return curvature > 0.0 ? (root - rate) / curvature : INF;
}

/* Start blocks that have reached the threshold, and stop blocks that have come to rest. */
static void switch_blocks(struct fault *f, const Train *t)
{
    const int n = t->n;
    for (int j = 0; j < n; j++) {
        if (f->slips[j] && f->y[n + j] <= SAME && force(t, t->X, f->y, j) < 1.0 - t->sigma) {
            f->slips[j] = false;
            f->y[n + j] = 0.0;
            f->moving--;
        } else if (!f->slips[j] && force(t, t->X, f->y, j) >= 1.0 - SAME) {
            if (f->moving == 0)
                f->before = mean(f->y, n);
            f->slips[j] = true;
            f->moving++;
        }
    }
    if (f->moving == 0) {
        f->moment = n * (mean(f->y, n) - f->before);
        f->avalanches += f->avalanches < INT32_MAX;
    }
}

/* Return a positive value if a stuck block has exceeded the threshold or a slipping block has reversed. */
static double excess(const Train *t, double s, const double *y)
{
    const double X = driver(t, s);
    double worst = -INF;
    for (int j = 0; j < t->n; j++)
        worst = fmax(worst, t->fault->slips[j] ? -y[t->n + j] : force(t, X, y, j) - 1.0);
    return worst;
}

/* Shorten a step over H, in which an event has occurred, to the first zero of `excess`: bisection until values of both
   signs bracket it, then false position (Illinois). */
static double locate(const Dynamics *d, const Train *t, double H, double *y_end)
{
    Bracket b = {0.0, H, excess(t, 0.0, t->fault->y), excess(t, H, y_end), 0};
    double y[2 * MASSES];

    for (int tries = 0; tries < 100 && b.f_high > 0.1 * SAME && b.high - b.low > 1e-15 / d->rate; tries++) {
        const bool usable = b.f_low < -SAME;
        const double trial = usable ? secant(b.high, b.f_high, b.low, b.f_low) : 0.5 * (b.low + b.high);
        const double middle = kept_inside(trial, b.low, b.high);
        if (extrapolate(d, 0.0, t->fault->y, middle, y) == 0)
            return 0.0;
        const double value = excess(t, middle, y);
        narrow(&b, middle, value, value > 0.0);
        if (value > 0.0)
            for (int i = 0; i < 2 * d->n; i++)
                y_end[i] = y[i];
    }
    return b.high;
}

static void pass(Train *t, double s)
{
    t->X = driver(t, s);
    t->X_rate += t->X_curvature * s;
}

static bool step(Model *m, double h)
{
    struct fault *const f = &m->memory;
    if (!f->ready)
        lay(m, f);
    f->ready = true;
    Train t = train_of(m);
    const double rate = 1.0 + sqrt(1.0 + 4.0 * t.coupling) + 2.0 * t.alpha;
    const double tolerance = m->run.tolerance > 0.0 ? m->run.tolerance : CHAIN_TOLERANCE;
    double y[2 * MASSES], H = m->run.inner_step > 0.0 ? m->run.inner_step : 0.1 / rate, left = 10.0 * MOST_WORK;
    const Dynamics d = {accelerations, &t, t.n, rate, tolerance, &left};

    double s = 0.0;
    while (s < h) {
        left -= t.n; /* forces between the steps; each takes 4 ns */
        if (f->moving == 0) {
            const double largest = largest_force(&t, t.X, f->y),
                         rest = time_at_rest(1.0 - largest, t.X_rate, t.X_curvature);
            if (!(rest < h - s)) {
                pass(&t, h - s);
                break;
            }
            pass(&t, rest);
            s += rest;
            t.X += fmax(1.0 - largest_force(&t, t.X, f->y), 0.0); /* rounding */
            switch_blocks(f, &t);
            H = fmin(H, 0.1 / rate);
        }
        const double taken = fmin(fmin(H, 1.0 / rate), h - s);
        const int columns = extrapolate(&d, 0.0, f->y, taken, y);
        double done = columns > 0 ? taken : 0.0;
        const bool event = columns > 0 && excess(&t, taken, y) > SAME;
        if (event)
            done = locate(&d, &t, taken, y);
        if (done > 0.0) {
            for (int i = 0; i < 2 * t.n; i++)
                f->y[i] = y[i];
            pass(&t, done);
            s = done < h - s ? s + done : h;
        }
        if (event && done > 0.0)
            switch_blocks(f, &t);
        else {
            const double next = next_step(taken, columns);
            H = taken < H && columns > 0 ? fmax(H, next) : next;
        }
        if (!goes_on(&d, H))
            return left < 0.0 ? too_much(m) : false;
    }
    m->run.inner_step = H;
    m->X = t.X;
    f->time = m->time + h;
    return true;
}
