/* The implicit master. Within a loop of continuous parts (a mass and its friction) the values at the end of the step
   are unknown: w, one for each wire against the stepping order. One evaluation steps the parts of the loop in order
   and gives G(w); r = G(w) - w is brought to zero by a quasi-Newton method, the parts rolled back in between.

   An input with the value u0 at the start and u1 at the end of the step is handed over as the straight line that ends
   at u1 and has the mean value of the generalised-alpha method (Jansen, Whiting, Hulbert, Computer Methods in Applied
   Mechanics and Engineering 190, 2000; first-order systems):

       am q1 + (1 - am) q0 = af u1 + (1 - af) u0,   mean = g q1 + (1 - g) q0
       am = (3 - rho)/(2 (1 + rho)),  af = 1/(1 + rho),  g = 1/2 + am - af

   It is of second order for any rho; rho = 1 would be the trapezoidal rule, which rings in contacts that are stiff
   against the step, and rho = 0 BDF2, which is less accurate. What is stiff decays by rho in a step. */

#ifndef NEWTON_H
#define NEWTON_H

#include "line.h"

#define RHO     0.5
#define GA_M    (0.5 * (3.0 - RHO) / (1.0 + RHO))
#define GA_F    (1.0 / (1.0 + RHO))
#define GA_RATE (0.5 + GA_M - GA_F)

/* More about each line. */
typedef struct {
    int64_t inner;       /* source and target are in one loop */
    int64_t unknown;     /* number of the unknown that it reads, -1: its source has been stepped before */
    double u0, q0;       /* at the start */
    double u1, q1;       /* at the end, on trial */
    double scale;        /* largest size so far */
    double gain, offset; /* of the wire in this step, when there are manipulators */
} Moving;

typedef struct {
    int64_t first, count; /* its parts, in the order of stepping */
    int64_t is_loop;
    int64_t unknown, unknowns; /* the first of its unknowns and their number */
} Group;

struct newton {
    Group *groups;
    int64_t group_count;
    const int64_t *order;      /* parts, group by group */
    const int64_t *continuous; /* of each part */
    Moving *moving;
    const int64_t *unknowns;    /* the output behind each unknown */
    double *w, *w_last, *trend; /* value, that of the last step, slope over the last step */
    double *scale;              /* largest size so far */
    double *r, *work;           /* residuals; 6 n + n^2 places for n = most_unknowns */
    double *inverse;            /* of dr/dw, n by n, at n^2 times the number of the group */
    int64_t most_unknowns;      /* of any group */
    double tolerance;           /* of r over scale */
    double error;               /* tolerated error of a step over scale, 0: fixed steps */
    double *proposed, *before;  /* [s] next inner step of each group, and its last one or 0 */
    double worst_residual;
    int64_t jumped; /* the last solution lies where r jumps */
    int64_t evaluations, substeps, rejected;
};

enum {
    SOLVED = 0,
    NOT_CONVERGED = 101,
    MOST_EVALUATIONS = 60,
    MOST_BISECTIONS = 250,
    MOST_HALVINGS = 20,
    MOST_REFINEMENTS = 10
};

/* A piece of a step: from t over h, the part [from, to] of the whole. */
typedef struct {
    double t, h, from, to;
    double ratio; /* to the length of the piece before it */
} Span;

/* q0 as it would be had the step before been as long as this one: q is the value of u at a time that lies behind by a
   fixed part of the step. */
static double earlier(const Moving *m, const Span *s) { return m->u0 + (m->q0 - m->u0) * s->ratio; }

static double mean_of(Moving *m, const Span *s)
{
    if (!m->inner)
        return m->u0 + (m->u1 - m->u0) * 0.5 * (s->from + s->to);
    const double q0 = earlier(m, s);
    m->q1 = ((1.0 - GA_F) * m->u0 + GA_F * m->u1 - (1.0 - GA_M) * q0) / GA_M;
    return (1.0 - GA_RATE) * q0 + GA_RATE * m->q1;
}

/* Value of an input at the end of the span. */
static double end_of(const Moving *m, const Span *s) { return m->inner ? m->u1 : m->u0 + (m->u1 - m->u0) * s->to; }

/* Steps one continuous part on inputs that move. */
static int move_part(Engine *e, Newton *newton, int64_t index, const Span *s)
{
    fetch_inputs(e, &e->parts[index]);
    for (int64_t k = e->lines_from[index]; k < e->lines_from[index + 1]; k++) {
        Line *const l = &e->lines[k];
        Moving *const m = &newton->moving[k];
        m->u1 = m->unknown >= 0 ? carried(e, l->input, newton->w[m->unknown]) : arriving(e, l->input);
        l->mean = mean_of(m, s);
        l->end = end_of(m, s);
    }
    int status = step_on_lines(e, index, s->t, s->h);
    if (status <= 1)
        status = fetch_outputs(&e->parts[index], e->signals);
    if (status > 1)
        failed(e, index, STEP, status, s->t);
    return status;
}

/* G(w) - w, its size over the scales in *norm. */
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
        const double size = newton->r[j] == 0.0 ? 0.0 : fabs(newton->r[j]) / scale;
        *norm = size >= *norm ? size : isnan(size) ? INFINITY : *norm;
    }
    return SOLVED;
}

#include "quasi_newton.h"

static void accept(const Engine *e, Newton *newton, const Group *g, const Span *s)
{
    for (int64_t i = g->first; i < g->first + g->count; i++)
        for (int64_t k = e->lines_from[newton->order[i]]; k < e->lines_from[newton->order[i] + 1]; k++) {
            Moving *const m = &newton->moving[k];
            if (m->inner) {
                m->u0 = m->u1;
                m->q0 = m->q1;
            }
        }
    for (int64_t j = g->unknown; j < g->unknown + g->unknowns; j++) {
        newton->trend[j] = (newton->w[j] - newton->w_last[j]) / s->h;
        newton->w_last[j] = newton->w[j];
        newton->scale[j] = fmax(newton->scale[j], fabs(newton->w[j]));
    }
}

/* Error of the means over the sizes of the values: against the trapezoidal rule, which is of the same order. */
static double error_of(const Engine *e, Newton *newton, const Group *g, const Span *s)
{
    double worst = 0.0;
    for (int64_t i = g->first; i < g->first + g->count; i++)
        for (int64_t k = e->lines_from[newton->order[i]]; k < e->lines_from[newton->order[i] + 1]; k++) {
            Moving *const m = &newton->moving[k];
            if (m->inner) {
                const double mean = (1.0 - GA_RATE) * earlier(m, s) + GA_RATE * m->q1;
                const double error = mean - 0.5 * (m->u0 + m->u1);
                m->scale = fmax(m->scale, fmax(fabs(m->u0), fabs(m->u1)));
                worst = fmax(worst, error != 0.0 ? fabs(error) / m->scale : 0.0);
            }
        }
    return worst;
}

/* A loop over one step, in as many pieces as it takes. */
static int step_loop(Engine *e, Newton *newton, int64_t number, double t, double h)
{
    const Group *const g = &newton->groups[number];
    const double smallest = ldexp(h, -MOST_HALVINGS), accurate = ldexp(h, -MOST_REFINEMENTS);
    double done = 0.0, *const proposed = &newton->proposed[number], *const before = &newton->before[number];
    while (done < h) {
        double piece = newton->error > 0.0 && *proposed > 0.0 ? fmin(*proposed, h - done) : h - done;
        for (int64_t i = g->first; i < g->first + g->count; i++) {
            const int status = save_part(&e->parts[newton->order[i]]);
            if (status > 1) {
                failed(e, newton->order[i], SAVE, status, t);
                return status;
            }
        }
        for (bool again = false;; again = true) {
            const bool last = piece >= (h - done) * (1.0 - 1e-9);
            const double length = last ? h - done : piece, ratio = *before > 0.0 ? length / *before : 1.0;
            const Span s = {t + done, length, done / h, last ? 1.0 : (done + piece) / h, ratio};
            const int status = solve(e, newton, g, number, &s, again);
            /* on a jump the parts hold each other: v = 0 but for the tolerance, and nothing is left to refine */
            const bool measures = status == SOLVED && newton->error > 0.0 && !newton->jumped;
            const double error = measures ? error_of(e, newton, g, &s) / newton->error : 0.0;
            if (status == SOLVED && (error <= 1.0 || piece <= accurate)) {
                accept(e, newton, g, &s);
                *before = s.h;
                newton->substeps++;
                done = last ? h : done + piece;
                if (newton->error > 0.0)
                    *proposed = fmax(accurate, piece * (again ? 1.0 : fmin(4.0, 0.8 / sqrt(error + 1e-9))));
                break;
            }
            newton->rejected++;
            if ((status != SOLVED && status != NOT_CONVERGED && status != 2) || piece <= smallest)
                return status;
            piece = status == SOLVED ? fmax(accurate, piece * fmax(0.2, 0.8 / sqrt(error))) : 0.5 * piece;
        }
    }
    return SOLVED;
}

/* A manipulator that sets in is a jump: the inputs begin this step with the manipulated value. */
static void restart_manipulated(Engine *e, Newton *newton)
{
    for (int64_t k = 0; k < e->lines_from[e->part_count]; k++) {
        Moving *const m = &newton->moving[k];
        const int64_t input = e->lines[k].input;
        const double gain = e->gains[input], offset = e->offsets[input];
        if (gain == m->gain && offset == m->offset)
            continue;
        m->gain = gain;
        m->offset = offset;
        m->u0 = m->q0 = arriving(e, input);
    }
}

static bool newton_tick(Engine *e, Newton *newton, int64_t tick)
{
    const double t = time_of(e, tick);
    if (e->manipulator_count > 0)
        restart_manipulated(e, newton);
    for (int64_t number = 0; number < newton->group_count; number++) {
        const Group *const g = &newton->groups[number];
        const int64_t index = newton->order[g->first];
        EnginePart *const p = &e->parts[index];
        if (g->is_loop) {
            const int status = step_loop(e, newton, number, t, e->step);
            if (status == NOT_CONVERGED)
                return failed(e, number, NOT_CONVERGED, status, t);
            if (status != SOLVED)
                return false;
        } else if (newton->continuous[index] && p->every == 1) {
            const Span whole = {t, e->step, 0.0, 1.0, 1.0};
            if (move_part(e, newton, index, &whole) > 1)
                return false;
        } else if (is_due(p, tick)) {
            fetch_inputs(e, p);
            int status = hand_over(p, e->signals);
            if (status > 1)
                return failed(e, index, SET, status, t);
            status = step_part(p, time_of(e, tick - p->phase), (double)p->every * e->step);
            if (status > 1)
                return failed(e, index, STEP, status, t);
            status = fetch_outputs(p, e->signals);
            if (status > 1)
                return failed(e, index, GET, status, t);
        }
    }
    for (Moving *m = newton->moving; m < newton->moving + e->lines_from[e->part_count]; m++)
        if (!m->inner)
            m->u0 = m->u1;
    return true;
}

#endif
