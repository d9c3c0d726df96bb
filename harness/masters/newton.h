/* The implicit master. In a loop of continuous parts (such as a mass and its friction), the values at the end of the
   step are unknown. The unknowns w are the values of the connections that run against the stepping order. One
   evaluation steps the parts of the loop in order and returns G(w). A quasi-Newton method solves r = G(w) - w = 0; the
   parts are rolled back between evaluations. */

#ifndef NEWTON_H
#define NEWTON_H

#include "begin.h"
#include "fixed_point.h"
#include "restart.h"
#include "step_check.h"

#define SLOWER 64.0 /* time since a jump over the shortest motion that still follows it */

/* Progress of a loop within a step. */
typedef struct {
    double t, h, done; /* the step, and how much of it is completed */
    double since;      /* the last begin of another motion in it; negative: none */
    bool slightly;     /* after a jump that is not large, as at each sample of a controller */
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

/* Return the shortest inner step that a check may require here, after one of the length `before`. At a jump, a force
   may be over at once, such as that of stiff bristles on a mass in motion; motions that still follow it are slower. A
   piece that is much longer than the one before it in the step extrapolates from that one. */
static double shortest(const Newton *newton, const Progress *p, double before)
{
    const double usual = p->h / newton->finest, first = ldexp(p->h, -MOST_HALVINGS);
    const double part = newton->error > 0.0 && p->slightly ? RUNG : SLOWER;
    const double least = p->since < 0.0 ? usual : fmin(usual, fmax(first, (p->done - p->since) / part));
    return p->done > 0.0 ? fmin(least, RUNG * before) : least;
}

/* Compute the error of a solved span over the tolerance: from the estimate of the adaptive master and, if the guard
   checks this span, from its two halves. *end: the span that the solution ends with. */
static int estimate_error(Engine *e, Newton *newton, int64_t number, Progress *p, const Span *s, bool stops,
                          double *off, bool *checked, Span *end)
{
    const Group *const g = &newton->groups[number];
    /* at a jump the contact sticks: v = 0 within the tolerance, and the estimate is meaningless */
    *off = newton->error > 0.0 && !newton->jumped ? error_of(newton, g, s) / newton->error : 0.0;
    if (!newton->guards[number].abandoned && amplifies(newton, g, s))
        *off = fmax(*off, AMPLIFIED);
    const bool anew = begins_anew(newton, number, p->tick, s);
    if (anew) {
        const double jump = newton->guards[number].jump;
        p->since = p->done;
        p->slightly = s->from == 0.0 && p->tick > 0 && jump > 0.0 && jump <= JUMP_LIMIT;
    }
    const bool smallest = s->h <= shortest(newton, p, s->h / s->ratio);
    if (smallest)
        *off = 0.0; /* only a check can find an error of the smallest spans */
    const bool soon = p->since >= 0.0 && !newton->guards[number].resolves;
    const bool other = stops || anew || soon, possible = *off <= 1.0 && !newton->guards[number].abandoned;
    *checked = possible && (wants_check(e, newton, number, p->tick, s) || other);
    return *checked ? check(e, newton, number, s, p->tick, anew, smallest, off, end) : SOLVED;
}

/* Advance a loop by a span of this length, or by a shorter one where errors require it, or where a contact stops or
   breaks away. */
static int advance_span(Engine *e, Newton *newton, int64_t number, Progress *p, double piece)
{
    const Group *const g = &newton->groups[number];
    const double smallest = ldexp(p->h, -MOST_HALVINGS);
    int splits = 0, status = save_loop(e, newton, g, p->t);
    if (status == SOLVED)
        status = share_again(e, newton, number, p->t + p->done, p->done / p->h);
    for (bool again = false; status == SOLVED; again = true) {
        const Span s = next_span(newton, number, p, piece);
        Span end = s;
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
            status = estimate_error(e, newton, number, p, &s, splits > 0, &off, &checked, &end);
        const double accurate = fmax(smallest, shortest(newton, p, s.h / s.ratio));
        if (status == SOLVED && (checked || off == AMPLIFIED))
            conclude(newton, number, p->tick, &s, off, piece <= accurate);
        if (status == SOLVED && (off <= 1.0 || piece <= accurate)) {
            status = follow_rest(e, newton, g, &s);
            if (status != SOLVED)
                return status;
            accept(e, newton, g, number, &end);
            newton->substeps++;
            if (again && splits == 0) /* the motion after a jump is soon slower, and an event is soon over */
                limit_steps(&newton->guards[number], fmax(s.h, p->h / (p->since < 0.0 ? newton->finest : RUNG * RUNG)));
            p->done = s.to >= 1.0 ? p->h : p->done + piece;
            const double growth = off < 0.039 ? 4.0 : fmin(4.0, 0.8 / sqrt(off + 1e-9)); /* more than 4 below 0.04 */
            if (splits == 0)
                newton->proposed[number] = fmax(accurate, piece * (again ? 1.0 : growth));
            return SOLVED;
        }
        newton->rejected++;
        const bool shorter = status == SOLVED || status == NOT_CONVERGED || status == 2; /* may help */
        if (!shorter || piece <= smallest)
            return status;
        piece = status == SOLVED ? fmax(accurate, piece * fmax(0.2, 0.8 / sqrt(off))) : 0.5 * piece;
        status = SOLVED;
    }
    return status;
}

/* Advance a loop over one step, in as many spans as needed. */
static int step_loop(Engine *e, Newton *newton, int64_t number, int64_t tick, double h)
{
    StepCheck *const guard = &newton->guards[number];
    Progress p = {e->time, h, 0.0, -1.0, false, tick};
    while (p.done < h) {
        const double proposed = newton->proposed[number];
        const bool varies = (newton->error > 0.0 || guard->checks_due > 0) && proposed > 0.0;
        double piece = fmin(varies ? proposed : h, h - p.done);
        piece = guard->limited_ticks > 0 ? fmin(piece, guard->limit) : piece;
        piece = p.since >= 0.0 && p.done > p.since ? fmin(piece, RUNG * (p.done - p.since)) : piece;
        const int status = advance_span(e, newton, number, &p, piece);
        if (status != SOLVED)
            return status;
    }
    forget_peaks(newton, &newton->groups[number]);
    release_limit(guard, h);
    if (p.since >= 0.0 && !guard->resolves && !guard->abandoned && guard->checks_due == 0)
        guard->checks_due = 1; /* the motion may be over within a part of the next step */
    return SOLVED;
}

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
    double begin = 0.0, length = 0.0;
    interval_of(e, p, tick, &begin, &length);
    fetch_inputs(e, p);
    return outcome(e, index, SET, hand_over(p, e->signals), t) == SOLVED &&
           outcome(e, index, STEP, step_part(p, begin, length), t) == SOLVED &&
           outcome(e, index, GET, fetch_outputs(p, e->signals), t) == SOLVED;
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

MIRRORED(Contact)
MIRRORED(Group)
MIRRORED(Moving)
MIRRORED(Newton)
MIRRORED(StateOutput)
MIRRORED(StepCheck)

#endif
