/* Rate-and-state friction: the friction coefficient of rock depends on the slip rate and on the age theta of the
   contacts, which grows at rest and is renewed over the slip distance Dc.

   Dieterich: Modeling of rock friction 1, Journal of Geophysical Research 84(B5), 1979; Ruina: Slip instability and
   state variable friction laws, Journal of Geophysical Research 88(B12), 1983. The form that is regular at v = 0 is
   from Rice and Ben-Zion, PNAS 93, 1996. Start values: typical of rock, with sigma_n as a force.

       mu = a asinh( v/(2 V0) exp((mu0 + b ln(V0 theta/Dc))/a) )
       F  = load sigma_n mu,   load = max(Fn, 0)/Fn0
       aging law (Dieterich):  dtheta/dt = 1 - |v| theta/Dc
       slip law (Ruina):       dtheta/dt = -(|v| theta/Dc) ln(|v| theta/Dc)

   For |v| well above V0 exp(-mu/a), that is, at all relevant speeds, this is the logarithmic law

       mu = sign(v) (mu0 + a ln(|v|/V0) + b ln(V0 theta/Dc))
          = sign(v) (mu0 + (a - b) ln(|v|/V0))                in steady sliding

   A quasi-static slider on a spring is unstable below the stiffness k_c = load sigma_n (b - a)/Dc. At rest, theta grows
   with time in the aging law and is constant in the slip law, in which contacts heal only while slipping. Both laws are
   stepped in closed form for constant |v|, and by an integral, accurate to rounding, for linear v. law = false selects
   the aging law, law = true the slip law. theta starts at 10 s = Dc/V0, steady sliding at V0; it must be positive. With
   a = 0, the force is sign(v) times the term in brackets if that is positive.

   Use it for rock and for slow dry contacts, where friction changes with the logarithm of the speed and with the dwell
   time: earthquake cycles, creep, stick-slip. It needs a, b and Dc, usually from velocity steps.

   Limits: F = 0 at v = 0, so a mass held by the contact creeps with v ~ V0 exp(-mu/a). No presliding elasticity. a > 0
   should not be too small, as the force is steep in v at v = 0. With the slip law, a jump of the speed can make a
   spring slider unstable well above k_c. */

#define MODEL    RateAndState
#define SUMMARY  "Rate-and-state friction, aging or slip law, regular at rest"
#define SOURCE   "Dieterich, J. Geophysical Research 84(B5), 1979; Ruina, J. Geophysical Research 88(B12), 1983"
#define CITES    "Ruina1983, Dieterich1979"
#define STATUS   "not checked against the papers"
#define FEATURES "lag, dwell, rate dependent"

/* clang-format off */
#define VARIABLES                                                                                                   \
    INPUT    (v,       VELOCITY, 0.0,                   "relative sliding velocity")                                \
    OPTIONAL (Fn,      "N",      1.0,                   "normal force")                                             \
    OUTPUT   (F,       FORCE,                           "friction " FORCE_NOUN ", opposes v")                       \
    STATE    (theta,   TIME,     10.0,  1.0,            "age of the contacts; positive")                            \
    LOCAL    (mu,      NO_UNIT,                         "coefficient of friction, with the sign of v")              \
    LOCAL    (k_c,     STIFFNESS,                       "spring stiffness below which a slider is unstable")        \
    PARAMETER(mu0,     NO_UNIT,  0.6,   0.0,   INF,     "coefficient of friction in steady sliding at V0")          \
    PARAMETER(a,       NO_UNIT,  0.01,  0.0,   INF,     "direct effect of the slip rate")                           \
    PARAMETER(b,       NO_UNIT,  0.015, 0.0,   INF,     "effect of the contact age")                                \
    PARAMETER(Dc,      LENGTH,   1e-5,  1e-12, INF,     "slip distance that renews the contacts")                   \
    PARAMETER(V0,      VELOCITY, 1e-6,  1e-15, INF,     "reference velocity")                                       \
    PARAMETER(sigma_n, FORCE,    1.0,   0.0,   INF,     "normal force at Fn = Fn0; in the rotational twin, times the radius") \
    SWITCH   (law,     0,                               "law of the contact age; false: aging law, true: slip law") \
    PARAMETER(Fn0,     "N",      1.0,   1e-12, INF,     "value of Fn for which sigma_n is valid")

/* its parameters can only be distinguished by velocity steps */
#define IDENTIFIED METHOD(none)
/* clang-format on */

#define STEPS_BY step

#include "block.h"
#include "constants.h"
#include "load.h"
#include "ramp.h"

/* An age that is not positive is invalid and is replaced by the smallest positive one. */
static double age_of(double theta) { return fmax(theta, DBL_MIN); }

static void equations(Model *m)
{
    GIVEN(m)
    const double load = load_of(Fn, Fn0), speed = fabs(v), age = age_of(theta), worn_per_age = speed * age / Dc;

    /* a asinh(e^x / 2): above x = 20 it equals a x exactly, which does not overflow */
    double mu = 0.0;
    if (speed > 0.0) {
        const double ax = mu0 + a * log(speed / V0) + b * log(V0 * age / Dc);
        mu = ax > 20.0 * a ? ax : a > 0.0 ? a * asinh(0.5 * exp(ax / a)) : 0.0;
    }
    m->mu = sign(v) * mu;
    m->F = load * sigma_n * m->mu;
    m->k_c = load * sigma_n * (b - a) / Dc;
    m->der_theta = !law ? 1.0 - worn_per_age : worn_per_age > 0.0 ? -worn_per_age * log(worn_per_age) : 0.0;
}

/* The last part of the path in a step, of the length `span`, that still matters: earlier contacts are worn off. It is
   parametrised backwards, with r = 0 at the end of the step and r = 1 at the start of this part. */
typedef struct {
    double last, first; /* speed at the end and at the start */
    double span;        /* in units of Dc */
    double time;        /* duration */
} Ramp;

/* Return the speed where the fraction r of the path remains (s is 1 - r, accurate even for r near 1). */
static double speed_at(const Ramp *c, double r, double s) { return sqrt(square(c->last) * s + square(c->first) * r); }

/* Return the integral over the path, in units of Dc, of exp(-distance to the end) ln(Dc/V), or the integral over time
   of exp(-distance to the end). Double-exponential quadrature (Takahasi, Mori 1974) is accurate to rounding for
   integrands that are smooth inside, even with the logarithm of a speed that vanishes at an end. */
static double worn(const Ramp *c, double Dc, bool law)
{
    const double width = 1.0 / 20.0;
    double sum = 0.0;
    for (int k = -72; k <= 72; k++) {
        const double x = k * width, e = exp(PI * sinh(x)), r = e / (1.0 + e), s = 1.0 / (1.0 + e);
        const double weight = width * PI * cosh(x) * r * s;
        if (law)
            sum += weight * c->span * exp(-c->span * r) * log(Dc / speed_at(c, r, s));
        else {
            /* here r is a fraction of the time: the distance to the end is the mean speed times r time */
            const double distance = r * (c->last + 0.5 * r * (c->first - c->last)) * c->time / Dc;
            sum += weight * c->time * exp(-distance);
        }
    }
    return sum;
}

static bool step(Model *m, double h)
{
    GIVEN(m)
    const double worn_off = 45.0; /* exp(-45) is below the rounding error of 1 */
    const double first = fabs(v), last = fabs(v + SLOPE(v) * h), x = 0.5 * (first / Dc + last / Dc) * h;
    const double age = age_of(theta);

    if (SLOPE(v) == 0.0) {
        const double part = x < 0.7 ? -expm1(-x) : 1.0 - exp(-x); /* worn-off fraction, accurate to rounding */
        if (!law)
            m->theta = theta * (x < 0.7 ? 1.0 - part : exp(-x)) + (x == 0.0       ? h
                                                                   : x < worn_off ? h * part / x
                                                                                  : Dc / first);
        else if (first * age / Dc > 0.0) /* below this, nothing moves */
            m->theta = age * exp(-log(first * age / Dc) * part);
        return true;
    }
    /* over the last worn_off Dc, the square of the speed is linear in the path */
    const double part = x > worn_off ? worn_off / x : 1.0;
    Ramp c = {last, first, part * x, h};
    if (part < 1.0) {
        c.first = speed_at(&(Ramp){last, first, x, h}, part, 1.0 - part);
        c.time = time_between(c.span * Dc, c.last, c.first);
    }
    if (!law)
        m->theta = theta * exp(-x) + worn(&c, Dc, law);
    else
        m->theta = exp(log(age) * exp(-x) + worn(&c, Dc, law));
    return true;
}
