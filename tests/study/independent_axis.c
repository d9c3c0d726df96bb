/* An axis with its servo and encoder, independent of the FMUs, the harness and the laws of this project.

       m1 a1 = u - T - R1(v1) - ripple sin(2 pi x1/pitch) - P1
       m2 a2 =     T - R2(v2)                             - P2
       T     = k s + c (v1 - v2) in contact, 0 in the gap;   s = x1 - x2 beyond +-gap/2
       P     = weight + swing sin(x) + push load, on the load side, or on the motor if m2 = 0

   The encoder is on the motor. Step h: half a drift, a kick, half a drift (Stormer-Verlet). The kick uses the mean of
   both velocities (three fixed-point iterations), and Coulomb friction is a force within its limits that is chosen so
   that the velocity at the end of the step is zero if possible: Moreau, Unilateral contact and dry friction, 1988. A
   mass sticks as long as the other forces are below the break-away force, without a velocity threshold.

   Friction R(v), all forces times warm(t) = 1 + drift exp(-t/tau), for v < 0 also times `back`; grip = mu |load|:

       kind 1   sgn(v) g(v) + Fv v,   g(v) = Fc + grip + (Fs - Fc) exp(-(v/vs)^2)
       kind 2   sigma0 z + sigma1 dz/dt + Fv v,   dz/dt = v - sigma0 |v| z/g(v)                        (LuGre)
       kind 3   four elements with shares of sigma0 and g, each slips at its share of g; + Fv v        (Maxwell slip)

   The structs have only doubles, so that the Python side can read their members from this file. */

#include <math.h>
#include <stddef.h>
#include <string.h>

#define PI 3.14159265358979323846

struct axis {
    double m1, m2;         /* kg; m2 = 0: one mass */
    double k, c, gap;      /* N/m, N.s/m, m */
    double ripple, pitch;  /* N, m */
    double weight, swing;  /* N; swing sin(x) with x in rad */
    double push;           /* force against the axis per unit of the load */
    double drift, tau;     /* share of the friction that fades with this time constant [s] */
    double kind1, Fc1, Fs1, vs1, Fv1, back1, sigma01, sigma11, mu1;
    double kind2, Fc2, Fs2, vs2, Fv2, back2, sigma02, sigma12, mu2;
    double x1, v1, x2, v2; /* start */
};

struct servo {
    double pid;               /* 0: cascade of P and PI, 1: PID */
    double kp, kv, ki;        /* cascade 1/s, N.s/m, N/m; PID: Kp N/m, Kd N.s/m, Ki N/(m.s) */
    double Ts, window;        /* s, samples */
    double limit, windup;     /* N; windup 1: the integral also runs in saturation */
    double quantum;           /* m */
    double delay;             /* samples from the command to the force */
    double lag;               /* time constant of the current loop [s] */
    double order, corner;     /* low-pass filter of the velocity: order 0 to 2, Hz */
    double notch, width;      /* notch filter of the command: Hz, damping of the poles; 0 Hz: none */
    double law_notched;       /* whether the notch filter also acts on the force of an external law */
    double fed_velocity;      /* share of the reference velocity */
    double fed_mass, fed_viscous, fed_coulomb, fed_offset; /* feedforward: kg, N.s/m, N, N */
};

struct log {
    double *x1, *x2, *measured, *command, *force; /* at each sample, the force after delay and current loop */
    double work, heat, energy;                    /* J: of the drive, lost, and gained by masses and spring */
};

typedef double (*law_function)(double r, double rd, double rdd, double x);

/* Direct form II transposed */
struct filter {
    double b0, b1, b2, a1, a2, s1, s2;
};

static double filtered(struct filter *f, double x)
{
    const double y = f->b0 * x + f->s1;
    f->s1 = f->b1 * x - f->a1 * y + f->s2;
    f->s2 = f->b2 * x - f->a2 * y;
    return y;
}

/* (n2 s^2 + n1 s + n0)/(s^2 + d1 s + 1), s in units of the frequency, bilinear and prewarped there */
static struct filter bilinear(double n2, double n1, double n0, double d1, double frequency, double Ts)
{
    const double q = 1.0 / tan(PI * frequency * Ts), a = q * q + d1 * q + 1.0;
    const struct filter f = {
        (n2 * q * q + n1 * q + n0) / a, 2.0 * (n0 - n2 * q * q) / a, (n2 * q * q - n1 * q + n0) / a,
        2.0 * (1.0 - q * q) / a, (q * q - d1 * q + 1.0) / a, 0.0, 0.0,
    };
    return f;
}

static double clip(double value, double limit) { return value > limit ? limit : value < -limit ? -limit : value; }
static double sign(double value) { return (value > 0.0) - (value < 0.0); }

/* ------------------------------------------------------------------------------------------------ friction */

enum { SLIPS = 4 };
static const double STIFF[SLIPS] = {0.4, 0.3, 0.2, 0.1}, STRONG[SLIPS] = {0.1, 0.2, 0.3, 0.4};

struct side {
    double m, kind, Fc, Fs, vs, Fv, back, sigma0, sigma1, mu;
    double warm, grip; /* now */
    double x, v, z[SLIPS];
};

static double level(const struct side *s, double v)
{
    const double ratio = s->vs > 0.0 ? v / s->vs : 0.0;
    const double g = s->Fc + s->grip + (s->vs > 0.0 ? (s->Fs - s->Fc) * exp(-ratio * ratio) : 0.0);
    return s->warm * g * (v < 0.0 ? s->back : 1.0);
}

static double viscous(const struct side *s, double v) { return s->warm * s->Fv * (v < 0.0 ? s->back : 1.0); }

static void drift(struct side *s, double h)
{
    s->x += h * s->v;
    const double g = level(s, s->v);
    if (s->kind == 2.0) {
        const double rate = s->sigma0 * fabs(s->v) / g, end = sign(s->v) * g / s->sigma0;
        s->z[0] = rate * h > 1e-12 ? end + (s->z[0] - end) * exp(-rate * h) : s->z[0] + h * s->v;
    }
    for (int i = 0; s->kind == 3.0 && i < SLIPS; i++)
        s->z[i] = clip(s->z[i] + h * s->v, STRONG[i] * g / (STIFF[i] * s->sigma0));
}

/* Return the velocity after h under a force, and the mean friction force; `mean` estimates the mean velocity. */
static double kicked(const struct side *s, double force, double mean, double h, double *friction)
{
    const double Fv = viscous(s, mean), a = 0.5 * h * Fv / s->m;
    double dry = 0.0;
    if (s->kind == 2.0)
        dry = s->sigma0 * s->z[0] + s->sigma1 * (mean - s->sigma0 * fabs(mean) * s->z[0] / level(s, mean));
    for (int i = 0; s->kind == 3.0 && i < SLIPS; i++)
        dry += STIFF[i] * s->sigma0 * s->z[i];
    double v = (s->v * (1.0 - a) + h * (force - dry) / s->m) / (1.0 + a);
    if (s->kind == 1.0) {
        const double ahead = h / s->m / (1.0 + a);
        const double forth = ahead * level(s, fmax(mean, 0.0)), back = ahead * level(s, mean < 0.0 ? mean : -1e-300);
        v = v > forth ? v - forth : v < -back ? v + back : 0.0;
    }
    *friction = force - s->m * (v - s->v) / h;
    return v;
}

/* -------------------------------------------------------------------------------------------------- plant */

static double stretched(const struct axis *p, double apart)
{
    return apart > 0.5 * p->gap ? apart - 0.5 * p->gap : apart < -0.5 * p->gap ? apart + 0.5 * p->gap : 0.0;
}

static void step(const struct axis *p, struct side *one, struct side *two, double u, double load, double h, struct log *log)
{
    drift(one, 0.5 * h);
    if (two->m > 0.0)
        drift(two, 0.5 * h);

    /* forces that depend on the positions only */
    const double x = two->m > 0.0 ? two->x : one->x;
    const double outside = p->weight + p->swing * sin(x) + p->push * load;
    const double stretch = two->m > 0.0 ? stretched(p, one->x - two->x) : 0.0;
    const double c = stretch != 0.0 ? p->c : 0.0;
    double first = u - p->k * stretch, second = p->k * stretch;
    if (p->ripple != 0.0)
        first -= p->ripple * sin(2.0 * PI * one->x / p->pitch);
    if (two->m > 0.0)
        second -= outside;
    else
        first -= outside;

    double v1 = one->v, v2 = two->v, R1 = 0.0, R2 = 0.0, damping = 0.0;
    for (int i = 0; i < 3; i++) {
        const double mean1 = 0.5 * (one->v + v1), mean2 = 0.5 * (two->v + v2);
        damping = c * (mean1 - mean2);
        v1 = kicked(one, first - damping, mean1, h, &R1);
        if (two->m > 0.0)
            v2 = kicked(two, second + damping, mean2, h, &R2);
    }
    const double mean1 = 0.5 * (one->v + v1), mean2 = 0.5 * (two->v + v2);
    log->work += h * u * mean1;
    log->heat += h * (R1 * mean1 + R2 * mean2 + c * (mean1 - mean2) * (mean1 - mean2));
    one->v = v1;
    two->v = v2;
    drift(one, 0.5 * h);
    if (two->m > 0.0)
        drift(two, 0.5 * h);
}

static double stored(const struct axis *p, const struct side *one, const struct side *two)
{
    const double x = two->m > 0.0 ? two->x : one->x;
    const double s = two->m > 0.0 ? stretched(p, one->x - two->x) : 0.0;
    const double ripple = p->ripple == 0.0 ? 0.0 : p->ripple * p->pitch / (2.0 * PI) * cos(2.0 * PI * one->x / p->pitch);
    return 0.5 * (one->m * one->v * one->v + two->m * two->v * two->v + p->k * s * s) + p->weight * x
        - p->swing * cos(x) - ripple;
}

/* -------------------------------------------------------------------------------------------------- servo */

struct drive {
    struct filter velocity, notch;
    double integral, slow;
};

static double commanded(const struct servo *s, struct drive *d, double r, double rd, double rdd, double x, double v)
{
    if (s->order == 1.0)
        v = d->slow += (1.0 - exp(-2.0 * PI * s->corner * s->Ts)) * (v - d->slow);
    else if (s->order == 2.0)
        v = filtered(&d->velocity, v);
    const double e = r - x, de = s->fed_velocity * rd - v;
    const double w = s->pid != 0.0 ? e : s->kp * e + de; /* input of the integral */
    double u = s->pid != 0.0 ? s->kp * e + s->kv * de : s->kv * w;
    u += s->ki * d->integral + s->fed_mass * rdd + s->fed_viscous * rd + s->fed_coulomb * sign(rd) + s->fed_offset;
    if (s->notch > 0.0)
        u = filtered(&d->notch, u);
    const double limited = clip(u, s->limit);
    if (s->windup != 0.0 || (u - limited) * w <= 0.0)
        d->integral += s->Ts * w;
    return limited;
}

enum { LONGEST = 256 };

/* Simulate n samples, each of `inner` steps. `noise`, `load` and `extra` (a force added to the command) may be NULL;
   with a law, its force replaces that of the servo. Return 0, or 1 if the motion is not finite. */
int simulate(const struct axis *p, const struct servo *s, long n, long inner, const double *r, const double *rd,
    const double *rdd, const double *noise, const double *load, const double *extra, law_function law, struct log *log)
{
    struct side one = {p->m1, p->kind1, p->Fc1, p->Fs1, p->vs1, p->Fv1, p->back1, p->sigma01, p->sigma11, p->mu1,
        1.0, 0.0, p->x1, p->v1, {0.0}};
    struct side two = {p->m2, p->kind2, p->Fc2, p->Fs2, p->vs2, p->Fv2, p->back2, p->sigma02, p->sigma12, p->mu2,
        1.0, 0.0, p->x2, p->v2, {0.0}};
    struct drive d = {.integral = 0.0};
    if (s->order == 2.0)
        d.velocity = bilinear(0.0, 0.0, 1.0, sqrt(2.0), s->corner, s->Ts);
    if (s->notch > 0.0)
        d.notch = bilinear(1.0, 0.1 * s->width, 1.0, 2.0 * s->width, s->notch, s->Ts);
    double past[LONGEST], commands[LONGEST] = {0.0}; /* sample k at k modulo LONGEST */
    double force = 0.0;
    const double h = s->Ts / (double)inner, follows = s->lag > 0.0 ? 1.0 - exp(-h / s->lag) : 0.0;
    const size_t window = (size_t)s->window, delay = (size_t)s->delay;
    log->work = log->heat = 0.0;
    log->energy = -stored(p, &one, &two);

    for (long k = 0; k < n; k++) {
        const double exact = one.x + (noise ? noise[k] : 0.0);
        const double x = s->quantum > 0.0 ? s->quantum * round(exact / s->quantum) : exact;
        for (size_t i = 0; k == 0 && i < LONGEST; i++)
            past[i] = x;
        past[(size_t)k % LONGEST] = x;
        const double before = past[((size_t)k + LONGEST - window) % LONGEST];
        double u;
        if (law) {
            u = law(r[k], rd[k], rdd[k], x);
            if (s->law_notched != 0.0 && s->notch > 0.0)
                u = filtered(&d.notch, u);
            u = clip(u, s->limit);
        } else {
            u = commanded(s, &d, r[k], rd[k], rdd[k], x, (x - before) / (s->window * s->Ts));
        }
        commands[(size_t)k % LONGEST] = u + (extra ? extra[k] : 0.0);
        const double held = commands[((size_t)k + LONGEST - delay) % LONGEST];
        if (s->lag == 0.0)
            force = held;
        log->x1[k] = one.x;
        log->x2[k] = two.m > 0.0 ? two.x : one.x;
        log->measured[k] = x;
        log->command[k] = u;
        log->force[k] = force;
        const double now = load ? load[k] : 0.0;
        one.grip = p->mu1 * fabs(now);
        two.grip = p->mu2 * fabs(now);
        for (long i = 0; i < inner; i++) {
            if (s->lag > 0.0)
                force += follows * (held - force);
            if (p->drift != 0.0)
                one.warm = two.warm = 1.0 + p->drift * exp(-h * (double)(k * inner + i) / p->tau);
            step(p, &one, &two, force, now, h, log);
        }
        if (!isfinite(one.x + one.v + two.x + two.v) || fabs(one.x) > 1e6)
            return 1;
    }
    log->energy += stored(p, &one, &two);
    return 0;
}
