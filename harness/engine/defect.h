/* Coupling error of an explicit master: inputs are held while their sources change, which generates energy. A jump,
   such as Coulomb friction at a reversal, causes an error in one step only. An error that persists over two steps or
   alternates in sign, even every few steps, shows that the loop is too fast for the communication step. A contact that
   passes or leaves v = 0, although friction would hold it there, shows that static friction is lost. */

#ifndef DEFECT_H
#define DEFECT_H

#include "part.h"

/* An undamped oscillation, for example of a mass on a sticking contact, must not grow. It grows if the energy that the
   coupling supplies is not small compared with the energy that friction dissipates. An incomplete period at the end of
   the window contributes less than FED times the transferred energy. */
enum { WINDOW = 2000 };
#define FED 1e-3

static void end_window(Pair *p)
{
    p->unstable += fabs(p->fed) > FED * p->flow && fabs(p->fed) > 0.5 * fabs(p->net);
    p->windows++;
    p->passed += p->flow;
    p->fed = p->net = p->flow = 0.0;
    p->ticks = 0;
}

#define SMALL    0.25  /* defects over the last large one that are none of an alternation */
#define ROUNDING 1e-15 /* of a position */
#define HELD     1e-9  /* relative difference of a holding force and its load */
enum { MOST_MISSED = 100, MOST_SIGNALS = 32 };

/* A contact has passed or left v = 0: count it if its friction at v = 0 would balance the other forces. */
static void look_for_rest(Engine *e, Pair *p, int64_t input)
{
    EnginePart *const part = &e->parts[p->contact];
    const int64_t first = part->inputs[REAL], outputs = part->outputs[REAL];
    const size_t in = (size_t)(part->inputs[TYPES] - first), out = (size_t)(part->outputs[TYPES] - outputs);
    double before[MOST_SIGNALS], after[MOST_SIGNALS];
    if (e->time + 1.5 * e->length > e->stop)
        return;
    if (p->missed >= MOST_MISSED || in > MOST_SIGNALS || out > MOST_SIGNALS || save_part(part) > 1)
        return;
    memcpy(before, e->signals + first, in * sizeof(double));
    memcpy(after, e->signals + outputs, out * sizeof(double));
    fetch_inputs(e, part);
    e->signals[input] = 0.0;
    const double load = e->signals[p->load];
    int status = hand_over(part, e->signals);
    status = status <= 1 ? step_part(part, e->time + e->length, e->length) : status;
    status = status <= 1 ? fetch_outputs(part, e->signals) : status;
    const double force = e->signals[e->sources[e->defects[p->force].input]];
    p->missed += status <= 1 && fabs(force - load) <= HELD * fabs(load);
    memcpy(e->signals + first, before, in * sizeof(double));
    memcpy(e->signals + outputs, after, out * sizeof(double));
    if (restore_part(part) > 1)
        p->contact = -1;
}

/* Compare the motion of a position in a step with the mean of its velocity. They differ if the part moves, within the
   step, in ways that the velocities at its ends do not show, such as a light mass that follows its support. */
static void measure_path(const Engine *e, Pair *p)
{
    const double x = e->signals[p->position], v = e->signals[e->sources[e->defects[p->velocity].input]];
    const double moved = x - p->x, shown = 0.5 * (p->v + v) * e->step, apart = fabs(moved - shown);
    p->path += fabs(moved);
    p->strayed += apart > ROUNDING * fabs(x) ? apart : 0.0;
    p->xx += moved * moved;
    p->xv += moved * shown;
    p->vv += shown * shown;
    p->x = x;
    p->v = v;
}

#define JUMP   0.05 /* of the largest force */
#define SUDDEN 0.5  /* the same under Gauss-Seidel: a force that rises over several steps is half a step late */
#define STEPS  3.0  /* by which the whole motion may be early */

/* A force that acts two steps late changes the velocity by twice the change of the acceleration that follows; one that
   is held for a step, as under Gauss-Seidel, by once that. Between jumps this error shrinks with the acceleration. */
static void measure_lead(Pair *p, double F, double v)
{
    const double dF = fabs(F - p->F), dv = v - p->v1;
    if (p->jumped)
        p->ahead += (double)p->late * (dv - p->dv);
    else if (p->ahead != 0.0 && fabs(dv) < fabs(p->dv))
        p->ahead *= fabs(dv / p->dv);
    if (fabs(F) > p->strongest)
        p->strongest = fabs(F);
    p->jumped = dF > (p->late > 1 ? JUMP : SUDDEN) * p->strongest && dF > p->dF;
    p->way += v;
    if (p->way < p->lowest)
        p->lowest = p->way;
    else if (p->way > p->highest)
        p->highest = p->way;
    if (p->ahead != 0.0 || p->lead != 0.0) {
        p->lead += p->ahead;
        if (!p->jumped)
            p->led = fmax(p->led, fabs(p->lead) - STEPS * fabs(v));
    }
    p->F = F, p->dF = dF, p->v1 = v, p->dv = dv;
}

/* Measure the defect of an input, which this output drives. */
static inline void measure_defect(const Engine *e, Defect *d, int64_t input, double end, bool renewed)
{
    if (!renewed)
        d->held = e->signals[input];
    const double defect = end - d->held;
    const double lasting = fmin(fabs(defect), fabs(d->before));
    const bool large = fabs(defect) >= SMALL * fabs(d->before);
    if (large && defect * d->before < 0.0)
        d->flips += lasting;
    d->squares += lasting * lasting;
    d->before = large ? defect : 0.5 * d->before;
    d->mean = 0.5 * (d->value + end);
    d->value = end;
    d->values += fabs(end);
    d->value_squares += end * end;
}

static inline void measure_pair(Engine *e, Pair *p, const Defect *force, const Defect *velocity, bool has_position,
                                bool late)
{
    const double F = force->mean, v = velocity->mean, passed = F * v * e->step;
    const double made = (force->held * v - velocity->held * F) * e->step;
    const double before = 2.0 * v - velocity->value; /* at the start of the step */
    if (before * velocity->value <= 0.0 && velocity->value != 0.0 && p->contact >= 0)
        look_for_rest(e, p, velocity->input);
    if (has_position)
        measure_path(e, p);
    if (late)
        measure_lead(p, force->value, velocity->value);
    p->made += fabs(made);
    p->fed += made;
    p->net += passed;
    p->flow += fabs(passed);
    if (++p->ticks == WINDOW)
        end_window(p);
}

static inline void measure_defects(Engine *e)
{
    for (Defect *d = e->defects; d < e->defects + e->defect_count; d++)
        measure_defect(e, d, d->input, arriving(e, d->input), d->renewed);
    for (Pair *p = e->pairs; p < e->pairs + e->pair_count; p++)
        measure_pair(e, p, &e->defects[p->force], &e->defects[p->velocity], p->position >= 0, p->late > 0);
}

#endif
