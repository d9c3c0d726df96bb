/* One solution attempt of a loop over a span of time: its values are lines, and its residual is G(w) - w, see newton.h.

   An input with the value u0 at the start and u1 at the end of the step is passed as the line that ends at u1 and has
   the mean value of the generalised-alpha method (Jansen, Whiting, Hulbert, Computer Methods in Applied Mechanics and
   Engineering 190, 2000; first-order systems):

       am q1 + (1 - am) q0 = af u1 + (1 - af) u0,   mean = g q1 + (1 - g) q0
       am = (3 - rho)/(2 (1 + rho)),  af = 1/(1 + rho),  g = 1/2 + am - af

   The method is of second order for any rho. rho = 1 is the trapezoidal rule, which rings in contacts that are too
   stiff for the step; rho = 0 is BDF2, which is less accurate. Stiff components decay by the factor rho in each
   step. */

#ifndef SPAN_H
#define SPAN_H

#include "newton_data.h"

#define RHO     0.5
#define GA_M    (0.5 * (3.0 - RHO) / (1.0 + RHO))
#define GA_F    (1.0 / (1.0 + RHO))
#define GA_RATE (0.5 + GA_M - GA_F)

#define LEAST_SHARE 0.0625 /* of a tolerance */

enum { SOLVED = 0, NOT_CONVERGED = 101, BREAKS_AWAY, MOST_EVALUATIONS = 60, MOST_BISECTIONS = 250, MOST_SPLITS = 8 };
#ifndef MOST_HALVINGS /* fuzzing has fewer */
#define MOST_HALVINGS 20
#endif

/* Return the larger of two ratios of errors; one that is not a number is infinite. */
static double worse(double worst, double off) { return off <= worst ? worst : isnan(off) ? INFINITY : off; }

/* Return SOLVED, or the status with which a part failed in an operation, and keep it for the message. */
static int outcome(Engine *e, int64_t part, int operation, int status, double t)
{
    if (status <= 1)
        return SOLVED;
    failed(e, part, operation, status, t);
    return status;
}

/* Part of a step: from t to t + h, the fraction [from, to] of the whole step. */
typedef struct {
    double t, h, from, to;
    double ratio; /* of its length to the length of the previous span */
    bool flat;    /* the values at its end are held from its start */
} Span;

/* Return the part of a tolerance that is left to a span: errors of the pieces of a divided step add up. */
static inline double share_of_tolerance(const Span *s) { return fmax(LEAST_SHARE, s->to - s->from); }

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

/* Return the value that an input from outside of a loop has at this part of the step, if it ends at `end`. */
static double value_at(const Moving *m, double end, double at) { return at == 1.0 ? end : m->u0 + (end - m->u0) * at; }

/* Step a part along its lines and read its outputs; `again`: at the end of the lines, which has a rounding error. */
static int follow_lines(Engine *e, int64_t index, const Span *s, bool again)
{
    int status = step_on_lines(e, index, s->t, s->h);
    if (status <= 1 && again)
        status = hand_over(&e->parts[index], e->signals);
    if (status <= 1)
        status = fetch_outputs(&e->parts[index], e->signals);
    return outcome(e, index, STEP, status, s->t);
}

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
        l->end = m->inner ? m->u1 : value_at(m, m->u1, s->to);
    }
    return follow_lines(e, index, s, stops);
}

static inline const Contact *contacts_of(const Newton *newton, const Group *g) { return newton->contacts + g->contact; }

/* Compute G(w) - w, and in *norm its magnitude over the scales. The residual of a contact at rest is its velocity, or,
   beside another one, its force less its share. */
static int evaluate(Engine *e, Newton *newton, const Group *g, const Span *s, bool again, double *norm)
{
    for (int64_t i = g->first; i < g->first + g->count; i++) {
        const int64_t index = newton->order[i];
        int status = again ? outcome(e, index, RESTORE, restore_part(&e->parts[index]), s->t) : SOLVED;
        if (status == SOLVED)
            status = move_part(e, newton, index, s);
        if (status != SOLVED)
            return status;
    }
    newton->evaluations++;
    *norm = 0.0;
    for (int64_t j = g->unknown; j < g->unknown + g->unknowns; j++) {
        const double G = e->signals[newton->unknowns[j]];
        const double scale = fmax(newton->scale[j], fmin(fabs(newton->w[j]), fabs(G)));
        newton->r[j] = G - newton->w[j];
        const double size = newton->r[j] == 0.0 ? 0.0 : scale > 0.0 ? fabs(newton->r[j]) / scale : INFINITY;
        *norm = worse(*norm, size);
    }
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++) {
        const Moving *const m = &newton->moving[c->line];
        if (is_rest(m))
            newton->r[c->unknown] = m->leader < 0 ? arriving(e, e->lines[c->line].input)
                                                  : m->base + m->slope * newton->w[m->leader] - newton->w[c->unknown];
    }
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
        m->leaves = 0;
        m->path += s->h * fabs(e->lines[c->line].mean);
        if (c->position >= 0)
            m->x0 = e->signals[c->position];
        if (m->rests)
            newton->w[c->unknown] = e->signals[newton->unknowns[c->unknown]];
    }
}

static void accept(const Engine *e, Newton *newton, const Group *g, int64_t number, const Span *s)
{
    accept_contacts(e, newton, g, s);
    for (int64_t i = g->line; i < g->line + g->lines; i++) {
        const int64_t k = newton->lines[i];
        Moving *const m = &newton->moving[k];
        if (m->inner) {
            m->u0 = m->role == HOLDING || m->role == CHANGING ? arriving(e, e->lines[k].input) : m->u1;
            m->q0 = m->role == FREE ? m->q1 : m->u0;
            m->scale = fmax(m->scale, fabs(m->u1));
            m->size = fmax(m->size, fabs(m->u1));
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

/* A peak that is over within a step, such as the force of an impact, is no measure for the errors of later values. The
   magnitude of a value is the largest that it had at both ends of a step, or at an end of the last step, but not less
   than PEAK times a peak, whose rounding errors last. */
#define PEAK 1e-3

static void forget_peak(double *size, double *lasting, double *at_begin, double value)
{
    *lasting = fmax(fmax(*lasting, PEAK * *size), fmin(*at_begin, fabs(value)));
    *at_begin = fabs(value);
    *size = fmax(*lasting, *at_begin);
}

static void forget_peaks(Newton *newton, const Group *g)
{
    for (int64_t i = g->line; i < g->line + g->lines; i++) {
        Moving *const m = &newton->moving[newton->lines[i]];
        forget_peak(&m->size, &m->lasting, &m->at_begin, m->u0);
    }
    for (int64_t j = g->unknown; j < g->unknown + g->unknowns; j++)
        forget_peak(&newton->scale[j], &newton->lasting[j], &newton->at_begin[j], newton->w[j]);
}

/* Return the error of the means over the magnitudes of the values, estimated by comparison with the trapezoidal rule,
   which is of the same order. */
static double error_of(const Newton *newton, const Group *g, const Span *s)
{
    double worst = 0.0;
    for (int64_t i = g->line; i < g->line + g->lines; i++) {
        const Moving *const m = &newton->moving[newton->lines[i]];
        if (m->inner && m->role == FREE) {
            const double mean = (1.0 - GA_RATE) * earlier(m, s) + GA_RATE * m->q1;
            const double error = mean - 0.5 * (m->u0 + m->u1);
            worst = fmax(worst, error != 0.0 ? fabs(error) / fmax(m->size, fabs(m->u1)) : 0.0);
        }
    }
    return worst;
}

static int save_loop(Engine *e, const Newton *newton, const Group *g, double t)
{
    int status = SOLVED;
    for (int64_t i = g->first; i < g->first + g->count && status == SOLVED; i++)
        status = outcome(e, newton->order[i], SAVE, save_part(&e->parts[newton->order[i]]), t);
    return status;
}

#endif
