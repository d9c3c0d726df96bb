/* The implicit master. In a loop of continuous parts (such as a mass and its friction), the values at the end of the
   step are unknown. The unknowns w are the values of the connections that run against the stepping order. One
   evaluation steps the parts of the loop in order and returns G(w). A quasi-Newton method solves r = G(w) - w = 0; the
   parts are rolled back between evaluations.

   An input with the value u0 at the start and u1 at the end of the step is passed as the line that ends at u1 and has
   the mean value of the generalised-alpha method (Jansen, Whiting, Hulbert, Computer Methods in Applied Mechanics and
   Engineering 190, 2000; first-order systems):

       am q1 + (1 - am) q0 = af u1 + (1 - af) u0,   mean = g q1 + (1 - g) q0
       am = (3 - rho)/(2 (1 + rho)),  af = 1/(1 + rho),  g = 1/2 + am - af

   The method is of second order for any rho. rho = 1 is the trapezoidal rule, which rings in contacts that are too
   stiff for the step; rho = 0 is BDF2, which is less accurate. Stiff components decay by the factor rho in each
   step. */

#ifndef NEWTON_H
#define NEWTON_H

#include "newton_data.h"

#define RHO     0.5
#define GA_M    (0.5 * (3.0 - RHO) / (1.0 + RHO))
#define GA_F    (1.0 / (1.0 + RHO))
#define GA_RATE (0.5 + GA_M - GA_F)

enum { SOLVED = 0, NOT_CONVERGED = 101, BREAKS_AWAY, MOST_EVALUATIONS = 60, MOST_BISECTIONS = 250, MOST_SPLITS = 8 };
#ifndef MOST_HALVINGS /* fuzzing has fewer */
#define MOST_HALVINGS 20
#endif

/* Part of a step: from t to t + h, the fraction [from, to] of the whole step. */
typedef struct {
    double t, h, from, to;
    double ratio; /* of its length to the length of the previous span */
    bool flat;    /* the values at its end are held from its start */
} Span;

/* Roles of a line: the velocity of a contact that is held by the sum of the other forces, or within the jump of its
   friction; its force, which varies linearly while it is held, and which is constant in a step that stops or starts. */
enum { FREE, AT_REST, IN_JUMP, HOLDING, CHANGING };

static inline bool is_rest(const Moving *m) { return m->role == AT_REST || m->role == IN_JUMP; }

/* Return q0 as if the previous step had the length of this one. q is the value of u at a time that lags by a fixed
   fraction of the step. */
static double earlier(const Moving *m, const Span *s) { return m->u0 + (m->q0 - m->u0) * s->ratio; }

static double mean_of(Moving *m, const Span *s)
{
    if (!m->inner)
        return m->u0 + (m->u1 - m->u0) * 0.5 * (s->from + s->to);
    if (s->flat || m->role >= HOLDING)
        return m->role == HOLDING && !s->flat ? 0.5 * (m->u0 + m->u1) : m->u1;
    if (is_rest(m))
        return 0.5 * m->u0;
    const double q0 = earlier(m, s);
    m->q1 = ((1.0 - GA_F) * m->u0 + GA_F * m->u1 - (1.0 - GA_M) * q0) / GA_M;
    return (1.0 - GA_RATE) * q0 + GA_RATE * m->q1;
}

/* Return the value of an input at the end of the span. */
static double end_of(const Moving *m, const Span *s) { return m->inner ? m->u1 : m->u0 + (m->u1 - m->u0) * s->to; }

/* Step one continuous part with inputs that vary linearly. */
static int move_part(Engine *e, Newton *newton, int64_t index, const Span *s)
{
    bool stops = false; /* a contact */
    fetch_inputs(e, &e->parts[index]);
    for (int64_t k = e->lines_from[index]; k < e->lines_from[index + 1]; k++) {
        Line *const l = &e->lines[k];
        Moving *const m = &newton->moving[k];
        m->u1 = m->unknown >= 0 ? carried(e, l->input, newton->w[m->unknown]) : arriving(e, l->input);
        if (is_rest(m)) {
            m->u1 = 0.0;
            stops = m->u0 != 0.0;
        }
        l->mean = mean_of(m, s);
        l->end = end_of(m, s);
    }
    int status = step_on_lines(e, index, s->t, s->h);
    if (status <= 1 && stops) /* the end of a line has a rounding error */
        status = hand_over(&e->parts[index], e->signals);
    if (status <= 1)
        status = fetch_outputs(&e->parts[index], e->signals);
    if (status > 1)
        failed(e, index, STEP, status, s->t);
    return status;
}

static inline const Contact *contacts_of(const Newton *newton, const Group *g) { return newton->contacts + g->contact; }

/* Compute G(w) - w, and in *norm its magnitude over the scales. The residual of a contact at rest is its velocity. */
static int evaluate(Engine *e, Newton *newton, const Group *g, const Span *s, bool again, double *norm)
{
    for (int64_t i = g->first; i < g->first + g->count; i++) {
        const int64_t index = newton->order[i];
        int status = again ? restore_part(&e->parts[index]) : 0;
        if (status > 1) {
            failed(e, index, RESTORE, status, s->t);
            return status;
        }
        status = move_part(e, newton, index, s);
        if (status > 1)
            return status;
    }
    newton->evaluations++;
    *norm = 0.0;
    for (int64_t j = g->unknown; j < g->unknown + g->unknowns; j++) {
        const double G = e->signals[newton->unknowns[j]];
        const double scale = fmax(newton->scale[j], fmin(fabs(newton->w[j]), fabs(G)));
        newton->r[j] = G - newton->w[j];
        const double size = newton->r[j] == 0.0 ? 0.0 : scale > 0.0 ? fabs(newton->r[j]) / scale : INFINITY;
        *norm = size >= *norm ? size : isnan(size) ? INFINITY : *norm;
    }
    for (const Contact *c = newton->contacts + g->contact; c < newton->contacts + g->contact + g->contacts; c++)
        if (is_rest(&newton->moving[c->line]))
            newton->r[c->unknown] = arriving(e, e->lines[c->line].input);
    return SOLVED;
}

/* Return the difference between an unknown and its prediction from the last step. */
static double prediction_error_of(const Newton *newton, int64_t j, const Span *s)
{
    return newton->w[j] - newton->w_last[j] - newton->trend[j] * s->h;
}

/* Return whether the prediction error has changed its sign and grown since the last step of the same length. */
static bool turns_and_grows(const Newton *newton, int64_t j, const Span *s, double miss)
{
    return miss * newton->prediction_error[j] < 0.0 && fabs(miss) > fabs(newton->prediction_error[j]) &&
           fabs(s->ratio - 1.0) < 1e-6;
}

/* The contacts keep their state; a step that stops or starts one is the beginning of another motion. */
static void accept_contacts(const Engine *e, Newton *newton, const Group *g, const Span *s)
{
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++) {
        Moving *const m = &newton->moving[c->line];
        m->rests = is_rest(m) ? m->role : FREE;
        m->path += s->h * fabs(e->lines[c->line].mean);
        if (m->rests)
            newton->w[c->unknown] = e->signals[newton->unknowns[c->unknown]];
    }
}

static void accept(const Engine *e, Newton *newton, const Group *g, int64_t number, const Span *s)
{
    accept_contacts(e, newton, g, s);
    for (int64_t i = g->first; i < g->first + g->count; i++)
        for (int64_t k = e->lines_from[newton->order[i]]; k < e->lines_from[newton->order[i] + 1]; k++) {
            Moving *const m = &newton->moving[k];
            if (m->inner) {
                m->u0 = m->role == HOLDING || m->role == CHANGING ? arriving(e, e->lines[k].input) : m->u1;
                m->q0 = m->role == FREE ? m->q1 : m->u0;
                m->scale = fmax(m->scale, fabs(m->u1));
            }
        }
    for (int64_t j = g->unknown; j < g->unknown + g->unknowns; j++) {
        const double miss = prediction_error_of(newton, j, s);
        newton->growth[j] = turns_and_grows(newton, j, s, miss) ? newton->growth[j] + 1.0 : 0.0;
        newton->prediction_error[j] = miss;
        newton->trend[j] = (newton->w[j] - newton->w_last[j]) / s->h;
        newton->w_last[j] = newton->w[j];
        newton->scale[j] = fmax(newton->scale[j], fabs(newton->w[j]));
    }
    for (int64_t i = g->state; i < g->state + g->states; i++)
        newton->state_sizes[i] = fmax(newton->state_sizes[i], fabs(e->signals[newton->states[i].output]));
    newton->before[number] = s->h;
}

/* Return the error of the means over the magnitudes of the values, estimated by comparison with the trapezoidal rule,
   which is of the same order. */
static double error_of(const Engine *e, const Newton *newton, const Group *g, const Span *s)
{
    double worst = 0.0;
    for (int64_t i = g->first; i < g->first + g->count; i++)
        for (int64_t k = e->lines_from[newton->order[i]]; k < e->lines_from[newton->order[i] + 1]; k++) {
            const Moving *const m = &newton->moving[k];
            if (m->inner && m->role == FREE) {
                const double mean = (1.0 - GA_RATE) * earlier(m, s) + GA_RATE * m->q1;
                const double error = mean - 0.5 * (m->u0 + m->u1);
                worst = fmax(worst, error != 0.0 ? fabs(error) / fmax(m->scale, fabs(m->u1)) : 0.0);
            }
        }
    return worst;
}

static int save_loop(Engine *e, const Newton *newton, const Group *g, double t)
{
    for (int64_t i = g->first; i < g->first + g->count; i++) {
        const int status = save_part(&e->parts[newton->order[i]]);
        if (status > 1) {
            failed(e, newton->order[i], SAVE, status, t);
            return status;
        }
    }
    return SOLVED;
}

#include "contacts.h"
#include "step_check.h"

/* Progress of a loop within a step. */
typedef struct {
    double t, h, done; /* the step, and how much of it is completed */
    double since;      /* the last begin of another motion in it; negative: none */
    int64_t tick;
} Progress;

/* Return the next span of a step, of at most this length. */
static Span next_span(const Newton *newton, int64_t number, const Progress *p, double piece)
{
    const bool last = piece >= (p->h - p->done) * (1.0 - 1e-9);
    const double length = last ? p->h - p->done : piece, before = newton->before[number];
    return (Span){p->t + p->done,
                  length,
                  p->done / p->h,
                  last ? 1.0 : (p->done + piece) / p->h,
                  before > 0.0 ? length / before : 1.0,
                  false};
}

/* Return the shortest inner step that a check may require here. A motion that follows a jump may be as short as the
   first piece of the check; later pieces grow with the time since the jump. */
static double shortest(const Newton *newton, const Progress *p)
{
    const double usual = p->h / newton->finest, first = p->h * pow(RUNG, 1 - RUNGS);
    return p->since < 0.0 ? usual : fmin(usual, fmax(first, (p->done - p->since) / RUNG));
}

/* Compute the error of a solved span over the tolerance: from the estimate of the adaptive master and, if the guard
   checks this span, from its two halves. */
static int estimate_error(Engine *e, Newton *newton, int64_t number, Progress *p, const Span *s, bool stops,
                          double *off, bool *checked)
{
    const Group *const g = &newton->groups[number];
    /* at a jump the contact sticks: v = 0 within the tolerance, and the estimate is meaningless */
    *off = newton->error > 0.0 && !newton->jumped ? error_of(e, newton, g, s) / newton->error : 0.0;
    if (!newton->guards[number].abandoned && amplifies(newton, g, s))
        *off = fmax(*off, AMPLIFIED);
    const bool anew = begins_anew(newton, number, p->tick, s);
    if (anew)
        p->since = p->done;
    if (s->h <= shortest(newton, p))
        *off = 0.0; /* only a check can find an error of the smallest spans */
    const bool soon = p->since >= 0.0 && !newton->guards[number].resolves;
    *checked = *off <= 1.0 && (stops || anew || soon || wants_check(e, newton, number, p->tick, s)) &&
               !newton->guards[number].abandoned;
    return *checked ? check(e, newton, number, s, p->tick, anew, off) : SOLVED;
}

/* Advance a loop over one step, in as many spans as needed. */
static int step_loop(Engine *e, Newton *newton, int64_t number, int64_t tick, double h)
{
    const Group *const g = &newton->groups[number];
    StepCheck *const guard = &newton->guards[number];
    const double smallest = ldexp(h, -MOST_HALVINGS);
    double *const proposed = &newton->proposed[number];
    Progress p = {e->time, h, 0.0, -1.0, tick};
    while (p.done < h) {
        const bool varies = (newton->error > 0.0 || guard->checks_due > 0) && *proposed > 0.0;
        double piece = fmin(varies ? *proposed : h, h - p.done);
        piece = guard->limited_ticks > 0 ? fmin(piece, guard->limit) : piece;
        piece = p.since >= 0.0 && p.done > p.since ? fmin(piece, RUNG * (p.done - p.since)) : piece;
        int status = save_loop(e, newton, g, p.t);
        int splits = 0;
        for (bool again = false; status == SOLVED; again = true) {
            const Span s = next_span(newton, number, &p, piece);
            double off = 0.0;
            bool checked = false;
            newton->splits = splits < MOST_SPLITS && piece > smallest;
            status = solve(e, newton, g, number, &s, again);
            newton->splits = false;
            if (status == BREAKS_AWAY) {
                piece *= newton->share;
                splits++;
                status = SOLVED;
                continue;
            }
            if (status == SOLVED)
                status = estimate_error(e, newton, number, &p, &s, splits > 0, &off, &checked);
            const double accurate = shortest(newton, &p);
            if (status == SOLVED && (checked || off == AMPLIFIED))
                conclude(newton, number, tick, &s, off, piece <= accurate);
            if (status == SOLVED && (off <= 1.0 || piece <= accurate)) {
                accept(e, newton, g, number, &s);
                newton->substeps++;
                if (again && splits == 0) /* the motion after a jump is soon slower */
                    limit_steps(guard, p.since < 0.0 ? s.h : fmax(s.h, h / (RUNG * RUNG)));
                p.done = s.to >= 1.0 ? h : p.done + piece;
                if (splits == 0)
                    *proposed = fmax(accurate, piece * (again ? 1.0 : fmin(4.0, 0.8 / sqrt(off + 1e-9))));
                break;
            }
            newton->rejected++;
            if ((status != SOLVED && status != NOT_CONVERGED && status != 2) || piece <= smallest)
                return status;
            piece = status == SOLVED ? fmax(accurate, piece * fmax(0.2, 0.8 / sqrt(off))) : 0.5 * piece;
            status = SOLVED;
        }
        if (status != SOLVED)
            return status;
    }
    release_limit(guard, h);
    return SOLVED;
}

#include "restart.h"

static bool moves(const Engine *e, const Newton *newton, const Group *g)
{
    const int64_t index = newton->order[g->first];
    return newton->continuous[index] && e->parts[index].every == 1;
}

/* Advance a loop or a part over a tick. */
static bool advance_group(Engine *e, Newton *newton, int64_t number, int64_t tick)
{
    const Group *const g = &newton->groups[number];
    const double t = e->time;
    const int64_t index = newton->order[g->first];
    EnginePart *const p = &e->parts[index];
    if (g->is_loop) {
        const int status = step_loop(e, newton, number, tick, e->length);
        if (status == NOT_CONVERGED)
            return failed(e, number, NOT_CONVERGED, status, t);
        newton->guards[number].jumped = newton->jumped;
        return status == SOLVED;
    }
    if (moves(e, newton, g)) {
        const Span whole = {t, e->length, 0.0, 1.0, 1.0, false};
        return move_part(e, newton, index, &whole) <= 1;
    }
    if (!is_due(e, p, tick))
        return true;
    fetch_inputs(e, p);
    int status = hand_over(p, e->signals);
    if (status > 1)
        return failed(e, index, SET, status, t);
    double begin = 0.0, length = 0.0;
    interval_of(e, p, tick, &begin, &length);
    status = step_part(p, begin, length);
    if (status > 1)
        return failed(e, index, STEP, status, t);
    status = fetch_outputs(p, e->signals);
    return status <= 1 || failed(e, index, GET, status, t);
}

EXPORT bool newton_tick(Engine *e, int64_t tick);

EXPORT bool newton_tick(Engine *e, int64_t tick)
{
    Newton *const newton = e->algorithm;
    int64_t number = 0;
    if (e->manipulator_count > 0)
        restart_manipulated(e, newton);
    for (; number < newton->group_count && !moves(e, newton, &newton->groups[number]); number++)
        if (!advance_group(e, newton, number, tick)) /* sampled parts */
            return false;
    for (int64_t i = number; i < newton->group_count && moves(e, newton, &newton->groups[i]); i++)
        if ((newton->guards[i].jump = largest_jump(e, newton, &newton->groups[i])) != 0.0) {
            const int status = restart(e, newton, i, e->time);
            if (status == NOT_CONVERGED)
                return failed(e, i, NOT_CONVERGED, status, e->time);
            if (status != SOLVED)
                return false;
        }
    for (; number < newton->group_count; number++)
        if (!advance_group(e, newton, number, tick))
            return false;
    for (Moving *m = newton->moving; m < newton->moving + e->lines_from[e->part_count]; m++)
        if (!m->inner)
            m->u0 = m->u1;
    return true;
}

#include "begin.h"
#include "fixed_point.h"

MIRRORED(Contact)
MIRRORED(Group)
MIRRORED(Moving)
MIRRORED(Newton)
MIRRORED(StateOutput)
MIRRORED(StepCheck)

#endif
