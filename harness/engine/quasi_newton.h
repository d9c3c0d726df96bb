/* Solve r(w) = 0 by Broyden's method; the inverse Jacobian is kept from step to step. A single unknown is bracketed by
   values with residuals of opposite sign, so that the solution is found even at a jump of r. For several unknowns,
   steps are halved until the residual decreases; if that is slow, a new Jacobian is computed from differences. */

#ifndef QUASI_NEWTON_H
#define QUASI_NEWTON_H

#include "span.h"

#include <float.h>

#define PATIENT 20   /* evaluations after which a part of a step is solved to the tolerance of the whole one only */
#define NOISY   10.0 /* largest residual of a solution, over the tolerance, if no iteration reaches the tolerance */

/* inverse += (s - inverse y) s' inverse / (s' inverse y), Broyden 1965, for the step s that changed r by y. */
static void update_inverse(double *inverse, int64_t n, const double *s, const double *y, double *by)
{
    double denominator = 0.0, size = 0.0;
    for (int64_t i = 0; i < n; i++) {
        by[i] = 0.0;
        for (int64_t j = 0; j < n; j++)
            by[i] += inverse[i * n + j] * y[j];
        denominator += s[i] * by[i];
        size += s[i] * s[i];
    }
    if (!(fabs(denominator) > 1e-12 * size) || !isfinite(denominator))
        return;
    for (int64_t j = 0; j < n; j++) {
        double row = 0.0;
        for (int64_t i = 0; i < n; i++)
            row += s[i] * inverse[i * n + j];
        by[n + j] = row / denominator;
    }
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j < n; j++)
            inverse[i * n + j] += (s[i] - by[i]) * by[n + j];
}

/* Compute the inverse of a by elimination with row exchanges; minus the unit matrix if a is singular. */
static void invert(double *a, double *inverse, int64_t n)
{
    for (int64_t i = 0; i < n * n; i++)
        inverse[i] = i % (n + 1) == 0 ? 1.0 : 0.0;
    for (int64_t k = 0; k < n; k++) {
        int64_t pivot = k;
        for (int64_t i = k + 1; i < n; i++)
            if (fabs(a[i * n + k]) > fabs(a[pivot * n + k]))
                pivot = i;
        const double d = a[pivot * n + k];
        if (!(fabs(d) > 0.0) || !isfinite(d)) {
            for (int64_t i = 0; i < n * n; i++)
                inverse[i] = i % (n + 1) == 0 ? -1.0 : 0.0;
            return;
        }
        for (int64_t j = 0; j < n; j++) {
            const double swap = a[k * n + j], other = inverse[k * n + j];
            a[k * n + j] = a[pivot * n + j] / d;
            inverse[k * n + j] = inverse[pivot * n + j] / d;
            if (pivot != k) {
                a[pivot * n + j] = swap;
                inverse[pivot * n + j] = other;
            }
        }
        for (int64_t i = 0; i < n; i++) {
            const double factor = i == k ? 0.0 : a[i * n + k];
            for (int64_t j = 0; j < n && factor != 0.0; j++) {
                a[i * n + j] -= factor * a[k * n + j];
                inverse[i * n + j] -= factor * inverse[k * n + j];
            }
        }
    }
}

/* Compute Newton's step, -inverse r. */
static void newton_step(double *step, const double *inverse, const double *r, int64_t n)
{
    for (int64_t i = 0; i < n; i++) {
        step[i] = 0.0;
        for (int64_t j = 0; j < n; j++)
            step[i] -= inverse[i * n + j] * r[j];
    }
}

/* Compute the inverse of dr/dw by forward differences at w, where r is `r0`. */
static int differentiate(Engine *e, Newton *newton, const Group *g, const Span *s, const double *r0, double *inverse)
{
    const int64_t n = g->unknowns;
    double *const jacobian = newton->work + 6 * newton->most_unknowns, norm = 0.0;
    for (int64_t j = 0; j < n; j++) {
        double *const w = &newton->w[g->unknown + j], kept = *w;
        const double scale = newton->scale[g->unknown + j], moved = kept + 1e-6 * (scale > 0.0 ? scale : 1.0);
        *w = moved;
        const int status = evaluate(e, newton, g, s, true, &norm);
        *w = kept;
        if (status != SOLVED)
            return status;
        for (int64_t i = 0; i < n; i++)
            jacobian[i * n + j] = (newton->r[g->unknown + i] - r0[i]) / (moved - kept);
    }
    invert(jacobian, inverse, n);
    return SOLVED;
}

/* Bracket of a single unknown: values with residuals of opposite sign. */
typedef struct {
    double w[2], width; /* w with r <= 0, w with r > 0; width three evaluations ago */
    bool known[2];
    double w0, r0;           /* previous evaluation */
    double limit;            /* limit of |w| without a bracket */
    double r[2];             /* at its ends */
    double wide;             /* largest of them when it was WIDE times as wide as at a jump */
    double outer_w, outer_r; /* the end that was replaced last */
    int outer;               /* its side; -1: none */
    bool steep;              /* r does not jump */
} Bracket;

#define WIDE 1e6
#define POLE 1e3 /* growth of r since then: a pole; next to a jump, r has a limit */

/* Update the bracket with r at w. */
static void note(Bracket *b, double w, double r)
{
    if (!isfinite(r)) /* beyond what a part accepts */
        return;
    const int side = r > 0.0;
    if (b->known[side]) {
        b->outer = side;
        b->outer_w = b->w[side];
        b->outer_r = b->r[side];
    }
    b->w[side] = w;
    b->r[side] = fabs(r);
    b->known[side] = true;
}

/* Return whether the bracket is as narrow as at a jump, and r has another slope outside of it: the force of a stiff
   contact under a light mass is as steep within as outside. */
static bool narrows(Bracket *b, double width)
{
    const double now = fabs(b->w[1] - b->w[0]);
    if (!b->known[0] || !b->known[1])
        return false;
    if (b->wide == 0.0 && now <= WIDE * width)
        b->wide = fmax(b->r[0], b->r[1]);
    if (now > width || b->steep || b->outer < 0)
        return false;
    const double outside = (b->outer_r - b->r[b->outer]) * now, /* negative beside a pole */
        within = (b->r[0] + b->r[1]) * fabs(b->outer_w - b->w[b->outer]);
    b->steep = outside > 0.5 * within && within > 0.5 * outside;
    return !b->steep;
}

/* Return the next iterate after w: the candidate; a longer step if r decreases too slowly to find a bracket; or the
   middle of the bracket if the candidate leaves it or the bracket shrinks too slowly. */
static double inside(Bracket *b, double w, double r, double candidate, int64_t tries)
{
    if (!isfinite(r)) /* go back to where it was a number */
        return 0.5 * (w + b->w0);
    const double last = fabs(w - b->w0), step = candidate - w;
    const bool lags = tries > 1 && fabs(r) > 0.5 * fabs(b->r0);
    b->w0 = w;
    b->r0 = r;
    if (!b->known[0] || !b->known[1])
        return lags && fabs(w) < b->limit ? w + copysign(fmax(fabs(step), 4.0 * last), step) : candidate;
    const double low = fmin(b->w[0], b->w[1]), high = fmax(b->w[0], b->w[1]);
    bool slow = false;
    if (tries % 3 == 0) {
        slow = high - low > 0.5 * b->width;
        b->width = high - low;
    }
    return slow || !(candidate > low && candidate < high) ? 0.5 * (low + high) : candidate;
}

#define UNCERTAIN 0.01 /* largest remaining correction of a solution over its size: r may also decay without a zero */

static int iterate(Engine *e, Newton *newton, const Group *g, int64_t number, const Span *s, bool again)
{
    const int64_t n = g->unknowns, most = newton->most_unknowns;
    double *const w = newton->w + g->unknown, *const r = newton->r + g->unknown;
    double *const inverse = newton->inverse + number * most * most;
    double *const w0 = newton->work, *const r0 = w0 + most, *const step = r0 + most, *const change = step + most;
    Bracket bracket = {.width = INFINITY, .outer = -1};
    double norm = 0.0;
    const double inverse_before = inverse[0], fine = newton->tolerance * share_of_tolerance(s);

    newton->jumped = false;
    for (int64_t j = 0; j < n; j++) /* warm start */
        w[j] = newton->w_last[g->unknown + j] + newton->trend[g->unknown + j] * s->h;
    int status = evaluate(e, newton, g, s, again, &norm);
    for (int64_t tries = 1; status == SOLVED && norm > (tries <= PATIENT ? fine : newton->tolerance); tries++) {
        if (tries > (n == 1 ? MOST_BISECTIONS : MOST_EVALUATIONS)) {
            if (norm <= NOISY * newton->tolerance)
                break; /* the outputs of a part with an error control of its own are not smoother */
            newton->worst_residual = norm;
            return NOT_CONVERGED;
        }
        memcpy(w0, w, (size_t)n * sizeof(double));
        memcpy(r0, r, (size_t)n * sizeof(double));
        const double norm0 = norm;
        if (n > 1 && tries % 8 == 0) {
            status = differentiate(e, newton, g, s, r0, inverse);
            if (status != SOLVED)
                return status;
        }
        newton_step(step, inverse, r0, n);
        if (n == 1) {
            if (w0[0] + step[0] == w0[0])
                step[0] = r0[0]; /* the inverse is that of a jump: take the value that the parts return */
            if (tries == 1)
                bracket.limit = 1e3 * fmax(newton->scale[g->unknown], fmax(fabs(w0[0]), fabs(w0[0] + r0[0])));
            note(&bracket, w0[0], r0[0]);
            if (narrows(&bracket, fine * fmax(newton->scale[g->unknown], fabs(w0[0])))) {
                if (fmax(bracket.r[0], bracket.r[1]) > POLE * bracket.wide) {
                    newton->worst_residual = norm;
                    return NOT_CONVERGED;
                }
                /* r jumps, as with Coulomb friction at v = 0: w is the holding force */
                e->signals[newton->unknowns[g->unknown]] = w0[0];
                newton->jumped = true;
                break;
            }
            step[0] = inside(&bracket, w0[0], r0[0], w0[0] + step[0], tries) - w0[0];
            if (bracket.steep && (w0[0] + step[0] == bracket.w[0] || w0[0] + step[0] == bracket.w[1]))
                break; /* no number is between its ends */
        }
        for (double part = 1.0;; part *= 0.5) {
            for (int64_t j = 0; j < n; j++)
                w[j] = w0[j] + part * step[j];
            status = evaluate(e, newton, g, s, true, &norm);
            if (status != SOLVED || n == 1 || norm < norm0 || part < 0.1)
                break;
        }
        for (int64_t j = 0; j < n; j++) {
            step[j] = w[j] - w0[j];
            change[j] = r[j] - r0[j];
        }
        if (status == SOLVED && !(n == 1 && step[0] * change[0] >= 0.0))
            update_inverse(inverse, n, step, change, newton->work + 4 * most);
    }
    if (n == 1 && status == SOLVED && !newton->jumped &&
        fabs(inverse[0]) * (fabs(r[0]) + DBL_EPSILON * fabs(w[0])) >
            UNCERTAIN * fmax(newton->scale[g->unknown], fabs(w[0]))) {
        inverse[0] = inverse_before;
        newton->worst_residual = norm;
        return NOT_CONVERGED;
    }
    return status;
}

#endif
