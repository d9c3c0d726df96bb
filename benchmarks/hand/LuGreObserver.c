/* LuGreObserver as one would write it by hand, for the structs of the exported C: with branches and without. */

#include <math.h>

static double stribeck(const law_parameters *p, double speed)
{
    const double ratio = speed / p->vs;
    const double power = p->delta == 2.0 ? ratio * ratio : pow(ratio, p->delta);
    return p->Fc + (p->Fs - p->Fc) * (power > 708.0 ? 0.0 : exp(-power));
}

/* Does no more than this sample needs. */
static void branching(const law_parameters *p, law_states *s, const law_inputs *in, law_outputs *out)
{
    out->fault = !(isfinite(in->r) && isfinite(in->x) && isfinite(in->v) && isfinite(in->Fn));
    if (out->fault)
        return;
    if (in->reset || !in->enable)
        s->z = 0.0;
    if (!in->enable) {
        out->u = out->F_hat = out->u_sat = 0.0;
        return;
    }
    const double rate = p->sigma0 * fabs(in->v) / stribeck(p, fabs(in->v));
    const double injected = p->k * (in->r - in->x);
    double slope = in->v + injected - rate * s->z;
    const double load = fmax(in->Fn, 0.0) / p->Fn0;
    const double F = load * (p->sigma0 * s->z + p->sigma1 * slope) + p->sigma2 * in->v, wanted = p->gain * F;
    out->F_hat = F;
    if (wanted < p->u_min) {
        out->u = p->u_min;
        out->u_sat = -1.0;
        if (injected < 0.0) /* it would push further into the limit */
            slope = in->v - rate * s->z;
    } else if (wanted > p->u_max) {
        out->u = p->u_max;
        out->u_sat = 1.0;
        if (injected > 0.0)
            slope = in->v - rate * s->z;
    } else {
        out->u = wanted;
        out->u_sat = 0.0;
    }
    if (!in->reset) {
        const double q = rate * p->Ts;
        s->z += slope * (q < 1e-5 ? p->Ts * (1.0 - 0.5 * q) : -expm1(-q) / rate);
    }
}

/* Computes everything and selects; the compiler may still branch. */
static void branch_free(const law_parameters *p, law_states *s, const law_inputs *in, law_outputs *out)
{
    const int ok = isfinite(in->r) & isfinite(in->x) & isfinite(in->v) & isfinite(in->Fn), on = in->enable,
              goes_on = on & !in->reset;
    const double z = in->reset ? 0.0 : s->z, ratio = fabs(in->v) / p->vs;
    const double g = p->Fc + (p->Fs - p->Fc) * exp(-pow(ratio, p->delta));
    const double rate = p->sigma0 * fabs(in->v) / g;
    const double injected = p->k * (in->r - in->x), slope = in->v + injected - rate * z;
    const double load = fmax(in->Fn, 0.0) / p->Fn0;
    const double F = load * (p->sigma0 * z + p->sigma1 * slope) + p->sigma2 * in->v, wanted = p->gain * F;
    const double q = rate * p->Ts, phi = q < 1e-5 ? 1.0 - 0.5 * q : -expm1(-q) / q;
    const double limited = wanted < p->u_min ? p->u_min : wanted > p->u_max ? p->u_max : wanted;
    const double side = (double)((wanted > p->u_max) - (wanted < p->u_min));
    const double kept = side * injected > 0.0 ? 0.0 : injected; /* pushes no further into a limit */
    const double next = goes_on ? z + p->Ts * (in->v + kept - rate * z) * phi : 0.0;
    out->u = ok ? on ? limited : 0.0 : out->u;
    out->F_hat = ok ? on ? F : 0.0 : out->F_hat;
    out->u_sat = ok ? on ? side : 0.0 : out->u_sat;
    s->z = ok ? next : s->z;
    out->fault = !ok;
}
