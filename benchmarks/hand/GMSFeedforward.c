/* GMSFeedforward as one would write it by hand, for the structs of the exported C: with branches and without. */

#include <math.h>

enum { MOST = 10 };

static double stribeck(const law_parameters *p, double speed)
{
    const double ratio = speed / p->vs;
    const double power = p->delta == 2.0 ? ratio * ratio : pow(ratio, p->delta);
    return p->Fc + (p->Fs - p->Fc) * (power > 708.0 ? 0.0 : exp(-power));
}

static void clear(law_states *s)
{
    for (int i = 0; i < MOST; i++) {
        s->Fi[i] = 0.0;
        s->slipping[i] = false;
    }
    s->way = 0.0;
}

/* Moves the elements by a displacement that is not 0; how fast the force of those that slip changes over stiffness. */
static double move(const law_parameters *p, law_states *s, double dr, int used)
{
    const double side = dr < 0.0 ? -1.0 : 1.0, path = fabs(dr), S = stribeck(p, path / p->Ts);
    const int goes_on = side == s->way;
    double total = 0.0, decay = -1.0, creep = 0.0;
    for (int i = 0; i < used; i++)
        total += p->alpha[i];
    const double unit = total > 0.0 ? S / total : S;
    for (int i = 0; i < used; i++) {
        const double level = p->alpha[i] * unit;
        double along = side * s->Fi[i];
        if ((goes_on && s->slipping[i]) || along >= level) {
            if (decay < 0.0) /* the same for all elements */
                decay = exp(-p->C * p->Ts / S);
            const double behind = (along - level) * decay;
            if (p->sigma > 0.0 && p->k[i] > 0.0)
                creep += behind / p->k[i];
            along = level + behind;
            s->slipping[i] = true;
        } else {
            along += p->k[i] * path;
            s->slipping[i] = along >= level;
            if (along >= level)
                along = level;
        }
        s->Fi[i] = side * along;
    }
    s->way = side;
    return side * p->C * creep / S;
}

/* Does no more than this sample needs. */
static void branching(const law_parameters *p, law_states *s, const law_inputs *in, law_outputs *out)
{
    out->fault = !(isfinite(in->r) && isfinite(in->rd) && isfinite(in->rdd) && isfinite(in->Fn));
    if (out->fault)
        return;
    if (!in->enable) {
        clear(s);
        s->last = 0.0;
        s->started = false;
        out->u = out->F_hat = out->F_pre = out->slips = out->u_sat = 0.0;
        return;
    }
    if (in->reset)
        clear(s);
    const int used = (int)ceil(p->N);
    const double dr = s->started && !in->reset ? in->r - s->last : 0.0;
    double creep = 0.0;
    if (dr != 0.0)
        creep = move(p, s, dr, used);
    else
        for (int i = 0; i < used; i++)
            s->slipping[i] = false;
    s->last = in->r;
    s->started = true;

    double sum = 0.0, slips = 0.0;
    for (int i = 0; i < used; i++) {
        sum += s->Fi[i];
        slips += s->slipping[i];
    }
    double F = sum;
    if (p->sigma > 0.0)
        F += p->sigma * (in->rd * (used - slips) - creep);
    if (in->Fn != p->Fn0)
        F *= in->Fn > 0.0 ? in->Fn / p->Fn0 : 0.0;
    F += p->sigma2 * in->rd;
    const double wanted = p->m * in->rdd + p->gain * F;
    out->F_hat = F;
    out->F_pre = sum;
    out->slips = slips;
    if (wanted < p->u_min) {
        out->u = p->u_min;
        out->u_sat = -1.0;
    } else if (wanted > p->u_max) {
        out->u = p->u_max;
        out->u_sat = 1.0;
    } else {
        out->u = wanted;
        out->u_sat = 0.0;
    }
}

/* Computes everything and selects; the compiler may still branch. */
static void branch_free(const law_parameters *p, law_states *s, const law_inputs *in, law_outputs *out)
{
    const int ok = isfinite(in->r) & isfinite(in->rd) & isfinite(in->rdd) & isfinite(in->Fn);
    const int on = in->enable, anew = in->reset;
    const double dr = (s->started & !anew) ? in->r - s->last : 0.0, path = fabs(dr);
    const double side = (double)((dr > 0.0) - (dr < 0.0)), way = anew ? 0.0 : s->way;
    const double S = p->Fc + (p->Fs - p->Fc) * exp(-pow(path / p->Ts / p->vs, p->delta));
    const double decay = exp(-p->C * p->Ts / S);
    double total = 0.0, sum = 0.0, slips = 0.0, used = 0.0, creep = 0.0, force[MOST], slip[MOST];
    for (int i = 0; i < MOST; i++) {
        total += i < p->N ? p->alpha[i] : 0.0;
        used += i < p->N;
    }
    const double unit = S / (total > 0.0 ? total : 1.0);
    for (int i = 0; i < MOST; i++) {
        const double level = i < p->N ? p->alpha[i] * unit : 0.0, before = anew ? 0.0 : s->Fi[i], along = side * before;
        const int slipped = ((side == way) & s->slipping[i]) | (along >= level);
        const double stuck = along + p->k[i] * path, least = stuck < level ? stuck : level;
        const double behind = (along - level) * decay, moved = slipped ? level + behind : least;
        creep += ((slipped & (p->k[i] > 0.0)) ? behind : 0.0) / (p->k[i] > 0.0 ? p->k[i] : 1.0);
        force[i] = side == 0.0 ? before : side * moved;
        slip[i] = (double)((side != 0.0) & (i < p->N) & (slipped | (stuck >= level)));
    }
    for (int i = 0; i < MOST; i++) {
        sum += force[i];
        slips += slip[i];
    }
    const double stretching = in->rd * (used - slips) - side * (p->C * creep / S);
    const double load = in->Fn == p->Fn0 ? 1.0 : (in->Fn > 0.0 ? in->Fn : 0.0) / p->Fn0;
    const double F = load * (sum + p->sigma * stretching) + p->sigma2 * in->rd, wanted = p->m * in->rdd + p->gain * F;
    const double limited = wanted < p->u_min ? p->u_min : wanted > p->u_max ? p->u_max : wanted;
    const double active = (double)((wanted > p->u_max) - (wanted < p->u_min));
    out->u = ok ? on ? limited : 0.0 : out->u;
    out->F_hat = ok ? on ? F : 0.0 : out->F_hat;
    out->F_pre = ok ? on ? sum : 0.0 : out->F_pre;
    out->slips = ok ? on ? slips : 0.0 : out->slips;
    out->u_sat = ok ? on ? active : 0.0 : out->u_sat;
    for (int i = 0; i < MOST; i++) {
        s->Fi[i] = ok ? on ? force[i] : 0.0 : s->Fi[i];
        s->slipping[i] = ok ? on && slip[i] != 0.0 : s->slipping[i];
    }
    s->way = ok ? on ? (side == 0.0 ? way : side) : 0.0 : s->way;
    s->last = ok ? on ? in->r : 0.0 : s->last;
    s->started = ok ? on : s->started;
    out->fault = !ok;
}
