/* Rate-and-state friction: the coefficient of friction of rock depends on the slip rate and on the age theta of the
   contacts, which grows at rest and is renewed over the slip distance Dc.

   Dieterich: Modeling of rock friction 1, Journal of Geophysical Research 84(B5), 1979; Ruina: Slip instability and
   state variable friction laws, Journal of Geophysical Research 88(B12), 1983. The form that is regular at v = 0 is
   that of Rice and Ben-Zion, PNAS 93, 1996. Start values: usual ones of rock, with sigma_n as a force.

       mu = a asinh( v/(2 V0) exp((mu0 + b ln(V0 theta/Dc))/a) )
       F  = load sigma_n mu,   load = max(Fn, 0)/Fn0
       aging law (Dieterich):  dtheta/dt = 1 - |v| theta/Dc
       slip law (Ruina):       dtheta/dt = -(|v| theta/Dc) ln(|v| theta/Dc)

   For |v| well above V0 exp(-mu/a), that is at all speeds that matter, it is the logarithmic law

       mu = sign(v) (mu0 + a ln(|v|/V0) + b ln(V0 theta/Dc))
          = sign(v) (mu0 + (a - b) ln(|v|/V0))                in steady sliding

   A quasi-static slider on a spring is unstable below the stiffness k_c = load sigma_n (b - a)/Dc. At rest theta grows
   with time by the aging law and stays by the slip law, which heals only while it slips. Both laws are stepped in
   closed form: with |v| constant, and as an integral to rounding where v changes linearly. With law = false it is
   the aging law, with law = true the slip law. theta starts at 10 s = Dc/V0, in steady sliding at V0; it must be
   positive. With a = 0 the force is sign(v) times the term in brackets, where that is positive.

   Use it for rock, and for dry contacts that slide slowly, where friction changes with the logarithm of the speed and
   with the time at rest: earthquake cycles, creep, stick-slip. It needs a, b and Dc, usually from steps of the speed.

   Limits: F = 0 at v = 0, where the contact creeps rather than holds: a mass that is held by it moves on, by v ~ V0
   exp(-mu/a). No presliding elasticity. a > 0 should not be tiny: the force is steep in v at v = 0. With the slip law a
   jump of the speed makes a spring slider unstable well above k_c. */

/* @article{Ruina1983,
     author  = {Ruina, A.},
     title   = {Slip instability and state variable friction laws},
     journal = {Journal of Geophysical Research},
     volume  = {88}, number = {B12}, pages = {10359--10370}, year = {1983}}
   @article{Dieterich1979,
     author  = {Dieterich, J. H.},
     title   = {Modeling of rock friction: 1. {E}xperimental results and constitutive equations},
     journal = {Journal of Geophysical Research},
     volume  = {84}, number = {B5}, pages = {2161--2168}, year = {1979}} */

#define MODEL    RateAndState
#define SUMMARY  "Rate-and-state friction, aging or slip law, regular at rest"
#define SOURCE   "Dieterich, J. Geophysical Research 84(B5), 1979; Ruina, J. Geophysical Research 88(B12), 1983"
#define STATUS   "equations from memory of the papers"
#define FEATURES "lag, dwell, rate dependent"

/* clang-format off */
#define VARIABLES                                                                                           \
    INPUT    (v,       VELOCITY, 0.0,                   "relative sliding velocity")                        \
    OPTIONAL (Fn,      FORCE,    1.0,                   "normal force")                                     \
    OUTPUT   (F,       FORCE,                           "friction force, opposes v")                        \
    STATE    (theta,   TIME,     10.0,  1.0,            "age of the contacts, positive")                    \
    LOCAL    (mu,      NO_UNIT,                         "coefficient of friction, with the sign of v")      \
    LOCAL    (k_c,     STIFFNESS,                       "stiffness below which a slider is unstable")       \
    PARAMETER(mu0,     NO_UNIT,  0.6,   0.0,   INF,     "coefficient of friction in steady sliding at V0")  \
    PARAMETER(a,       NO_UNIT,  0.01,  0.0,   INF,     "direct effect of the slip rate")                   \
    PARAMETER(b,       NO_UNIT,  0.015, 0.0,   INF,     "effect of the age")                                \
    PARAMETER(Dc,      LENGTH,   1e-5,  1e-12, INF,     "slip distance that renews the contacts")           \
    PARAMETER(V0,      VELOCITY, 1e-6,  1e-15, INF,     "reference velocity")                               \
    PARAMETER(sigma_n, FORCE,    1.0,   0.0,   INF,     "normal force that is meant at Fn = Fn0")           \
    SWITCH   (law,     0,                               "law of the age, false: aging law, true: slip law") \
    PARAMETER(Fn0,     FORCE,    1.0,   1e-12, INF,     "value of Fn at which sigma_n holds")

/* only tests with steps of the velocity tell its parameters apart */
#define IDENTIFIED METHOD(none)
/* clang-format on */

#define STEPS_BY step

#include "block.h"
#include "constants.h"
#include "load.h"
#include "ramp.h"

/* An age that is not positive is no state of the contact; it counts as newborn. */
static double age_of(double theta) { return fmax(theta, DBL_MIN); }

static void equations(Model *m)
{
    GIVEN(m)
    const double load = load_of(Fn, Fn0), speed = fabs(v), age = age_of(theta), worn_per_age = speed * age / Dc;

    /* a asinh(e^x / 2): above x = 20 it is a x, to the last bit, which does not overflow */
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

/* The path of a step of which the last part, `span` long, still counts: contacts of before are worn off. All is told
   backwards, r = 0 at the end of the step and r = 1 at the start of that part. */
typedef struct {
    double last, first; /* speed at its end and at its start */
    double span;        /* in units of Dc */
    double time;        /* how long it takes */
} Course;

/* The speed where a fraction r of the path is to go (s is 1 - r, exact also where r is nearly 1). */
static double speed_at(const Course *c, double r, double s) { return sqrt(square(c->last) * s + square(c->first) * r); }

/* Integral over the path in units of Dc of exp(-distance to the end) ln(Dc/V), and over the time of
   exp(-distance to the end). Double-exponential quadrature (Takahasi, Mori 1974): to rounding for integrands that
   are smooth inside, also with the logarithm of a speed that vanishes at an end. */
static double worn(const Course *c, double Dc, bool law)
{
    const double width = 1.0 / 20.0;
    double sum = 0.0;
    for (int k = -72; k <= 72; k++) {
        const double x = k * width, e = exp(PI * sinh(x)), r = e / (1.0 + e), s = 1.0 / (1.0 + e);
        const double weight = width * PI * cosh(x) * r * s;
        if (law)
            sum += weight * c->span * exp(-c->span * r) * log(Dc / speed_at(c, r, s));
        else {
            /* here r is a fraction of the time: the way to the end is the mean of the speeds times r time */
            const double distance = r * (c->last + 0.5 * r * (c->first - c->last)) * c->time / Dc;
            sum += weight * c->time * exp(-distance);
        }
    }
    return sum;
}

static bool step(Model *m, double h)
{
    GIVEN(m)
    const double worn_off = 45.0; /* exp(-45) is below the rounding of 1 */
    const double first = fabs(v), last = fabs(v + SLOPE(v) * h), x = 0.5 * (first / Dc + last / Dc) * h;
    const double age = age_of(theta);

    if (SLOPE(v) == 0.0) {
        const double part = x < 0.7 ? -expm1(-x) : 1.0 - exp(-x); /* worn off, to the last digit */
        if (!law)
            m->theta = theta * (x < 0.7 ? 1.0 - part : exp(-x)) + (x == 0.0       ? h
                                                                   : x < worn_off ? h * part / x
                                                                                  : Dc / first);
        else if (first * age / Dc > 0.0) /* below, nothing moves */
            m->theta = age * exp(-log(first * age / Dc) * part);
        return true;
    }
    /* on the last worn_off Dc the square of the speed is linear in the path */
    const double part = x > worn_off ? worn_off / x : 1.0;
    Course c = {last, first, part * x, h};
    if (part < 1.0) {
        c.first = speed_at(&(Course){last, first, x, h}, part, 1.0 - part);
        c.time = time_between(c.span * Dc, c.last, c.first);
    }
    if (!law)
        m->theta = theta * exp(-x) + worn(&c, Dc, law);
    else
        m->theta = exp(log(age) * exp(-x) + worn(&c, Dc, law));
    return true;
}
