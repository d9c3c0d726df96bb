/* Step checks of the implicit masters. A loop may converge at every step and still be wrong: a mass on a spring that
   oscillates many times within a step amplifies small errors. Some steps are therefore solved a second time, in two
   halves: at scheduled ticks, and where a value is far from its prediction. If the mean or the end value of a line, or
   an output that is a state, differs by more than `step_tolerance` (0.01) times its magnitude, or the distance along a
   contact by a quarter of that, the step is divided, and the following steps are checked until undivided steps agree
   with their halves again. An undivided step that passes its check keeps its values bit for bit. In a divided step,
   newton continues from the halves: what each of many pieces is tolerated would add up.

   What follows the start of a run, a jump of an input or a contact that breaks away may be over within a small part of
   the step: the mass swings beyond its new rest and comes to rest elsewhere, which two halves do not show. Such a step
   is compared with pieces each of which is four times as long as all before it, and so is one at the start of which the
   velocity of a contact was about to pass 0. */

#ifndef STEP_CHECK_H
#define STEP_CHECK_H

#include "restart.h"

#define RUNG             4.0  /* each piece ends at so many times the part of the step at which the one before ends */
#define NOTABLE          0.05 /* jump of an input over its magnitude */
#define AT_START         20.0 /* factor of `step_tolerance` in the first EARLY ticks of a value that starts at 0 */
#define BENT             0.1  /* of the change over the step: deviation from a straight line */
#define SLIGHT           1e-3 /* of the magnitude: deviation that does not matter */
#define SPLIT            0.44 /* first half of a step: equal halves miss an oscillation of twice their frequency */
#define DISTANCE_FACTOR  0.25 /* factor of `step_tolerance` for the distance along a contact */
#define PREDICTION_LIMIT 0.05 /* of the magnitude, between a value and its linear prediction */
#define JUMP_LIMIT       0.5  /* the same, during the cooldown: at most this, */
#define FARTHER          2.0  /* times the largest such deviation of a step that was right */
#define LEAP             1.5  /* over the largest magnitude so far */
#define ABANDONED        30.0 /* root of the sum of the squares of the unresolved errors, over the magnitude */
#define MOST_UNRESOLVED  40.0 /* sum of the shares of their steps */
#define TURNED           5.0  /* ratio that a velocity counts as which may have passed 0 twice within a piece */
#define FED_BACK   (-1.25)    /* diagonal of the inverse Jacobian if a fifth of a change of a value comes back to it */
#define AMPLIFIED  4.0        /* ratio of error to tolerance that an amplified value counts as */
#define NEGLIGIBLE 1e-6       /* holding force over the largest force of a contact in the loop */
enum { CHECK_EVERY = 512, CHECK_SOON = 16, CONFIRMATIONS = 4, LONGEST_COOLDOWN = 64, SOON = 16, EARLY = 8 };
enum { MOST_RECURRENCES = 8, RUNGS = 8, PART_OF_STEP = 1, WHOLE_STEP = 2 };
#define GROWTHS 3.0

/* Return whether a check is scheduled: at the ticks 0, 1, 2, 4, 8, every 16 ticks up to 512 ticks after the start or
   the last finding, and every 512 ticks. */
static bool is_scheduled(const StepCheck *guard, int64_t tick)
{
    const int64_t since = tick - guard->last;
    return tick < CHECK_SOON ? (tick & (tick - 1)) == 0 : since % (since < CHECK_EVERY ? CHECK_SOON : CHECK_EVERY) == 0;
}

/* Return the slope with which a line begins, times the length of the span. */
static double slope_of(const Moving *m, const Span *s) { return (m->u0 - earlier(m, s)) / (GA_M - GA_F); }

static double quotient(double miss, double size) { return miss > 0.0 ? size > 0.0 ? miss / size : INFINITY : 0.0; }

/* Return how far an unknown or a line is from its prediction, over its magnitude. */
static double misprediction(const Newton *newton, const Group *g, const Span *s)
{
    double most = 0.0;
    for (int64_t i = g->line; i < g->line + g->lines; i++) {
        const Moving *const m = &newton->moving[newton->lines[i]];
        if (m->inner && m->role == FREE)
            most = fmax(most, quotient(fabs(m->u1 - m->u0 - slope_of(m, s)), m->size));
    }
    for (int64_t j = g->unknown; j < g->unknown + g->unknowns; j++)
        most = fmax(most, quotient(fabs(prediction_error_of(newton, j, s)), newton->scale[j]));
    return most;
}

/* Return whether a line is far beyond its largest magnitude so far. */
static bool leaps(const Newton *newton, const Group *g)
{
    for (int64_t i = g->line; i < g->line + g->lines; i++) {
        const Moving *const m = &newton->moving[newton->lines[i]];
        if (m->inner && fabs(m->u1) > LEAP * m->scale)
            return true;
    }
    return false;
}

/* Return whether a value alternates from step to step and grows. */
static bool amplifies(const Newton *newton, const Group *g, const Span *s)
{
    for (int64_t j = g->unknown; j < g->unknown + g->unknowns; j++) {
        const double miss = prediction_error_of(newton, j, s);
        if (newton->growth[j] >= GROWTHS && turns_and_grows(newton, j, s, miss) && fabs(miss) > 1e-4 * newton->scale[j])
            return true;
    }
    return false;
}

/* Return whether a loop adds to a change of its values, as friction that falls with the velocity does: a motion that
   grows fast is damped by a long implicit step. */
static bool feeds_back(const Newton *newton, const Group *g, int64_t number)
{
    const double *const inverse = newton->inverse + number * newton->most_unknowns * newton->most_unknowns;
    for (int64_t j = 0; j < g->unknowns; j++)
        if (inverse[j * (g->unknowns + 1)] < FED_BACK || inverse[j * (g->unknowns + 1)] > 0.0)
            return true;
    return false;
}

/* Return whether the velocity of a contact was about to pass 0, but has the same sign at the end of the span. */
static bool turns_within(const Newton *newton, const Group *g, const Span *s)
{
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++) {
        const Moving *const m = &newton->moving[c->line];
        if (m->rigid >= 0 && m->u0 * m->u1 > 0.0 && m->u0 * (m->u0 + slope_of(m, s)) < 0.0)
            return true;
    }
    return false;
}

/* Return whether another motion begins with the solved span: with the run, with a jump of an input, or because a
   contact breaks away. */
static bool begins_anew(const Newton *newton, int64_t number, int64_t tick, const Span *s)
{
    const Group *const g = &newton->groups[number];
    const StepCheck *const guard = &newton->guards[number];
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++) {
        const Moving *const m = velocity_of(newton, c);
        if (m->rests && (!is_rest(m) || (m->rests == AT_REST && m->role == IN_JUMP)))
            return true; /* in the latter case, the load was too high within the span */
    }
    const double least = guard->resolves == WHOLE_STEP && tick < guard->next ? JUMP_LIMIT : NOTABLE;
    return s->from == 0.0 && (tick == 0 || guard->jump > least);
}

/* Return by how much the motion of a mass in a span differs from the mean velocity that its contact was given, other
   than by rounding: a mass may swing within the span while its velocity at the ends varies slowly. */
static double strayed(const Engine *e, const Newton *newton, const Contact *c, const Span *s)
{
    const Moving *const m = velocity_of(newton, c);
    if (c->position < 0 || is_rest(m))
        return 0.0;
    const Line *const l = &e->lines[c->line];
    const double x = e->signals[c->position], gain = e->gains ? e->gains[l->input] : 1.0,
                 offset = e->gains ? e->offsets[l->input] : 0.0;
    const double apart = fabs(gain * (x - m->x0) + (offset - l->mean) * s->h);
    return apart > 4.0 * DBL_EPSILON * fabs(gain * x) ? apart : 0.0;
}

/* Return whether a mass strays by more than is tolerated of the distance along its contact. */
static bool strays(const Engine *e, const Newton *newton, const Group *g, const Span *s)
{
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++)
        if (strayed(e, newton, c, s) > DISTANCE_FACTOR * newton->step_tolerance *
                                           (velocity_of(newton, c)->path + s->h * fabs(e->lines[c->line].mean)))
            return true;
    return false;
}

/* Return whether the span that has just been solved needs a check. After one without a finding, only a span that is
   much farther from its prediction than that one is suspicious for a while. */
static bool wants_check(const Engine *e, const Newton *newton, int64_t number, int64_t tick, const Span *s)
{
    StepCheck *const guard = &newton->guards[number];
    if (guard->abandoned)
        return false;
    const Group *const g = &newton->groups[number];
    const double after = tick >= guard->next ? 0.0 : fmin(JUMP_LIMIT, FARTHER * guard->harmless);
    guard->miss = misprediction(newton, g, s);
    const bool due = guard->checks_due > 0 || guard->limited_ticks > 0 || (s->from == 0.0 && is_scheduled(guard, tick));
    const bool unexpected = guard->miss > fmax(PREDICTION_LIMIT, after) || leaps(newton, g) || strays(e, newton, g, s);
    return due || unexpected || feeds_back(newton, g, number) || turns_within(newton, g, s);
}

/* Save (or restore, if `back`) everything that a check must not change. */
static void keep(const Engine *e, Newton *newton, const Group *g, int64_t number, bool back)
{
    const size_t n = (size_t)g->unknowns, square = (size_t)(newton->most_unknowns * newton->most_unknowns);
    const size_t lines = (size_t)e->lines_from[e->part_count];
    double *const parts[] = {
        newton->w + g->unknown,     newton->w_last + g->unknown,           newton->trend + g->unknown,
        newton->scale + g->unknown, newton->prediction_error + g->unknown, newton->growth + g->unknown};
    double *to = newton->kept;
    for (size_t i = 0; i < 6; i++, to += n)
        memcpy(back ? parts[i] : to, back ? to : parts[i], n * sizeof(double));
    double *const inverse = newton->inverse + (size_t)number * square;
    memcpy(back ? inverse : to, back ? to : inverse, square * sizeof(double));
    Moving *const moving = newton->moving, *const kept = newton->kept_lines;
    memcpy(back ? moving : kept, back ? kept : moving, lines * sizeof(Moving));
}

static void swap_loop(Engine *e, const Newton *newton, const Group *g)
{
    for (int64_t i = g->first; i < g->first + g->count; i++)
        swap_part(&e->parts[newton->order[i]]);
}

/* Return the part of a span that is over after piece i of n. After a jump each piece is `RUNG` times as long as those
   before it together, as the motion that follows may be over within any part of the span. */
static double part_after(int i, int n, bool growing)
{
    return i + 1 == n ? 1.0 : growing ? pow(RUNG, (double)(i + 1 - n)) : SPLIT;
}

/* Return the number of pieces of a part of a step: the first piece has the same length for all. */
static int pieces_of(double part)
{
    int n = RUNGS;
    for (double length = part * RUNG; length < 1.5 && n > 2; length *= RUNG)
        n--;
    return n;
}

/* A solved span, and the pieces in which it is solved again. */
typedef struct {
    const Span *span;
    double *whole, *halves; /* means of the lines over it, and over all pieces */
    double *within;         /* values of the lines at the end of the last piece but one */
    int count;              /* of the pieces */
    bool growing;           /* each is `RUNG` times as long as those before it together */
    bool jumped; /* a solution lies at a jump: the unknown is the holding force, and only its mean counts; the values
                    beyond the jump are rounding errors */
    bool turns;  /* the velocity of a contact may have passed 0 twice in a piece */
    bool early;  /* the values are small, and may be off by more */
    double part, tolerance; /* of its step, over which the mean counts; tolerated difference over the magnitude */
    double strength;        /* largest force of a contact */
    Span last;              /* piece */
} Comparison;

/* Solve the span again, in pieces. */
static int solve_pieces(Engine *e, Newton *newton, int64_t number, Comparison *by)
{
    const Span *const s = by->span;
    const Group *const g = &newton->groups[number];
    const int64_t lines = e->lines_from[e->part_count];
    const int n = by->count;
    double done = 0.0, before = 1.0; /* part of the span; length of the last piece over that of the span before */
    int status = SOLVED;
    for (int64_t k = 0; k < lines; k++)
        by->halves[k] = 0.0;
    for (int i = 0; i < n && status == SOLVED; i++) {
        const double end = part_after(i, n, by->growing), share = end - done;
        const bool last = i + 1 == n;
        const Span piece = {s->t + done * s->h,
                            last ? s->h - done * s->h : share * s->h,
                            s->from + done * (s->to - s->from),
                            last ? s->to : s->from + end * (s->to - s->from),
                            i == 0 ? share * s->ratio : share / before,
                            false};
        by->last = piece;
        if (i == 1)
            swap_loop(e, newton, g); /* the state at the start of the span is still needed */
        if (i > 0)
            status = save_loop(e, newton, g, piece.t);
        if (i > 0 && status == SOLVED)
            status = share_again(e, newton, number, piece.t, piece.from);
        if (status == SOLVED)
            status = solve(e, newton, g, number, &piece, i == 0);
        for (int64_t k = 0; k < lines; k++) {
            by->halves[k] += share * e->lines[k].mean;
            by->within[k] = i == n - 2 ? newton->moving[k].u1 : by->within[k];
        }
        by->jumped = by->jumped || newton->jumped;
        by->turns = by->turns || (by->growing && status == SOLVED && turns_within(newton, g, &piece));
        if (status == SOLVED && !last)
            status = follow_rest(e, newton, g, &piece);
        if (status == SOLVED && !last)
            accept(e, newton, g, number, &piece);
        if ((status != SOLVED || last) && i > 0)
            swap_loop(e, newton, g);
        done = end;
        before = share;
    }
    return status;
}

/* Which difference of an output between a span and its halves is a rounding error. */
typedef struct {
    bool held;  /* any: a contact holds its mass in both */
    bool rests; /* one over the largest output of its unit: the position of a mass that a contact holds in the halves */
    double noise; /* [1/s] one of the velocity of its mass, see measure_noise */
} Rounding;

static Rounding rounding_of(const Newton *newton, const Group *g, int64_t output)
{
    Rounding found = {false, false, 0.0};
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++) {
        const Moving *const whole = &newton->kept_lines[c->line], *const halves = velocity_of(newton, c);
        const bool of_mass = output >= c->of_mass && output < c->of_next, position = output == c->position;
        const bool moved = whole->rests == AT_REST && whole->role == IN_JUMP; /* before it came to rest again */
        found.held = found.held || (of_mass && !moved && is_rest(whole) && is_rest(halves));
        found.rests = found.rests || (position && is_rest(halves));
        if ((of_mass || position) && found.noise == 0.0)
            found.noise = whole->noise;
    }
    return found;
}

/* Return the value at the end of a span that a line has, or, at rest, should have: 0 but for errors of the forces. */
static double ended(const Engine *e, const Moving *m, int64_t line)
{
    return is_rest(m) ? arriving(e, e->lines[line].input) : m->u1;
}

/* Measure how much the values at the end of a solved span change if the unknowns do by the tolerance of the loop, which
   for a contact is that of the largest force. */
static int measure_noise(Engine *e, Newton *newton, const Group *g, int64_t number, const Span *s)
{
    const double strength = strength_of(newton, g);
    double norm = 0.0;
    for (int64_t i = g->line; i < g->line + g->lines; i++) {
        const int64_t k = newton->lines[i];
        newton->kept_lines[k].noise = ended(e, &newton->moving[k], k);
    }
    for (int64_t j = g->unknown; j < g->unknown + g->unknowns; j++)
        newton->w[j] += newton->tolerance * fmax(newton->scale[j], fabs(newton->w[j]));
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++)
        newton->w[c->unknown] +=
            newton->tolerance * (strength - fmax(newton->scale[c->unknown], fabs(newton->w[c->unknown])));
    const int status = evaluate(e, newton, g, s, true, &norm);
    for (int64_t i = g->line; i < g->line + g->lines; i++) {
        const int64_t k = newton->lines[i];
        newton->kept_lines[k].noise = fabs(ended(e, &newton->moving[k], k) - newton->kept_lines[k].noise) / s->h;
    }
    keep(e, newton, g, number, true);
    return status;
}

/* Return the largest magnitude of the states with this unit. */
static double largest_of_unit(const Newton *newton, const Group *g, int64_t unit)
{
    double most = 0.0;
    for (int64_t i = g->state; i < g->state + g->states; i++)
        if (newton->states[i].unit == unit)
            most = fmax(most, newton->state_sizes[i]);
    return most;
}

/* Return the largest difference of a line over the tolerated one. Keep the largest error that would remain: the mean
   counts over the whole step, of which the span is a part. An instantaneous event, such as a mass that stops, is never
   resolved, but does not matter in a span that is short enough. */
static double compare_lines(const Engine *e, const Newton *newton, const Group *g, const Comparison *by,
                            StepCheck *guard)
{
    const Span *const s = by->span;
    double worst = 0.0, most = -1.0;
    for (int64_t i = g->line; i < g->line + g->lines; i++) {
        const int64_t k = newton->lines[i];
        const Moving *const a = &newton->kept_lines[k], *const b = &newton->moving[k];
        if (!a->inner || (by->jumped && a->unknown < 0) || (a->role == HOLDING && b->role == HOLDING))
            continue;
        if (!a->is_force && rounding_of(newton, g, e->sources[e->lines[k].input]).held)
            continue;
        const double in_mean = fabs(by->whole[k] - by->halves[k]), at_end = by->jumped ? 0.0 : fabs(a->u1 - b->u1);
        const double noise = a->is_force ? 0.0 : a->noise * s->h;
        const double apart = fmax(0.0, fmax(by->part * in_mean, at_end) - noise);
        const double least = a->role == CHANGING ? NEGLIGIBLE * by->strength : a->is_force ? EQUAL * by->strength : 0.0;
        const double size = fmax(fmax(a->size, fmax(fabs(a->u1), fabs(b->u1))), least);
        const double tolerated = by->tolerance * (by->early && a->from_rest ? AT_START : 1.0);
        const double remains = fmax((s->to - s->from) * in_mean, at_end);
        worst = worse(worst, apart == 0.0 ? 0.0 : apart / (tolerated * size));
        if (!(remains <= most * size)) {
            most = remains == 0.0 ? 0.0 : remains / size;
            guard->line = k;
            guard->apart = remains;
        }
    }
    return worst;
}

/* Return the same for the outputs that are states. */
static double compare_states(const Engine *e, const Newton *newton, const Group *g, const Comparison *by)
{
    const double tolerated = by->tolerance * (by->early ? AT_START : DISTANCE_FACTOR), h = by->span->h;
    double worst = 0.0;
    for (int64_t i = g->state; i < g->state + g->states; i++) {
        const StateOutput *const state = &newton->states[i];
        const Rounding rounding = rounding_of(newton, g, state->output);
        const double whole = newton->kept_states[i], halves = e->signals[state->output], apart = fabs(whole - halves);
        if (rounding.held || apart <= rounding.noise * h * h)
            continue;
        const double beside = rounding.rests ? largest_of_unit(newton, g, state->unit) : 0.0;
        const double least = state->unit == 0 ? EQUAL * by->strength : NEGLIGIBLE * beside;
        const double size = fmax(fmax(newton->state_sizes[i], least), fmax(fabs(whole), fabs(halves)));
        worst = worse(worst, apart / (tolerated * size));
    }
    return worst;
}

/* Return the same for the distances along the contacts. Keep the largest error of one over the path. */
static double compare_distances(const Engine *e, const Newton *newton, const Group *g, const Comparison *by,
                                StepCheck *guard)
{
    const double h = by->span->h;
    double worst = 0.0, farthest = 0.0;
    guard->distance_error = 0.0;
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++) {
        const Moving *const a = &newton->kept_lines[c->line];
        const bool held = rounding_of(newton, g, e->sources[e->lines[c->line].input]).held;
        if (held && (a->rests || a->u0 == 0.0))
            continue;
        const bool begins = by->early && a->from_rest; /* the distance is short, whatever the method */
        const double tolerated = by->tolerance * (begins ? AT_START : DISTANCE_FACTOR);
        const double whole = by->whole[c->line], halves = by->halves[c->line];
        const double path = a->path + h * fmax(fabs(whole), fabs(halves));
        const double error = fmax(h * fabs(whole - halves), begins ? 0.0 : a->strayed);
        if (error <= a->noise * h * h || path == 0.0)
            continue;
        if (!held) /* contacts.h has divided the step where a stop needs it: what remains counts, but does not divide it
                    */
            worst = fmax(worst, error / (tolerated * path));
        if (error > farthest * path) {
            farthest = error / path;
            guard->contact = c->line;
            guard->distance_error = error;
        }
    }
    return worst;
}

/* Return the largest difference between a span and its halves over the tolerated one. */
static double difference(const Engine *e, Newton *newton, int64_t number, const Comparison *by)
{
    const Group *const g = &newton->groups[number];
    const bool divides = by->span->to - by->span->from > 1.0 / newton->finest; /* a smaller step would not show more */
    double worst = compare_lines(e, newton, g, by, &newton->guards[number]);
    if (divides)
        worst = fmax(worst, compare_states(e, newton, g, by));
    return fmax(worst, compare_distances(e, newton, g, by, &newton->guards[number]));
}

/* Return whether a motion that begins with a span is slower than that: all values vary almost linearly, or, from rest,
   none has most of its change at the start, as one that settles or oscillates has. `within`: the values at the end of
   the last piece but one. */
static bool resolves(const Newton *newton, const Group *g, const double *within, bool from_rest)
{
    for (int64_t i = g->line; i < g->line + g->lines; i++) {
        const int64_t k = newton->lines[i];
        const double u0 = newton->kept_lines[k].u0, change = newton->moving[k].u1 - u0;
        const double ahead = fabs(within[k] - u0) - fabs(change) / RUNG;
        const double bend = from_rest ? ahead : fabs(within[k] - (u0 + change / RUNG));
        if (newton->moving[k].inner && bend > BENT * fabs(change) && bend > SLIGHT * newton->moving[k].scale)
            return false;
    }
    return true;
}

/* Compare a solved span with its halves and raise *off to the difference. Halves in a divided step that differ by no
   more than tolerated, or of the `smallest` span, become the solution, and *end their last piece; but not where a
   contact stops, as a stop is located in whole spans only. Else the span stays solved. */
static int check(Engine *e, Newton *newton, int64_t number, const Span *s, int64_t tick, bool anew, bool smallest,
                 double *off, Span *end)
{
    const Group *const g = &newton->groups[number];
    StepCheck *const guard = &newton->guards[number];
    const int64_t lines = e->lines_from[e->part_count], most = newton->most_unknowns;
    double *const whole = newton->kept + 6 * most + most * most, norm = 0.0;
    const double before = newton->before[number], length = s->to - s->from;
    const bool jumped = newton->jumped, finer = anew || turns_within(newton, g, s);
    Comparison by = {.span = s, .whole = whole, .growing = finer, .jumped = jumped};
    by.halves = whole + lines;
    by.within = by.halves + lines;
    by.count = finer ? pieces_of(length) : 2;
    by.part = smallest ? 1.0 : share_of_tolerance(s);
    by.tolerance = by.part * newton->step_tolerance;
    for (int64_t k = 0; k < lines; k++)
        whole[k] = e->lines[k].mean;
    for (int64_t i = g->state; i < g->state + g->states; i++)
        newton->kept_states[i] = e->signals[newton->states[i].output];
    for (const Contact *c = contacts_of(newton, g); c < contacts_of(newton, g) + g->contacts; c++)
        velocity_of(newton, c)->strayed = strayed(e, newton, c, s);
    keep(e, newton, g, number, false);
    int status = anew && tick == 0 ? measure_noise(e, newton, g, number, s) : SOLVED;
    if (status != SOLVED && status != 2)
        return status;
    status = solve_pieces(e, newton, number, &by);
    const bool failed_halves = status == NOT_CONVERGED || status == 2;
    if (status != SOLVED && !failed_halves)
        return status;
    if (anew && (failed_halves || !resolves(newton, g, by.within, tick == 0)))
        guard->resolves = 0;
    else if (anew)
        guard->resolves = length < 1.0 ? PART_OF_STEP : WHOLE_STEP;
    by.early = tick < EARLY && guard->resolves == WHOLE_STEP;
    by.strength = strength_of(newton, g);
    *off = fmax(*off, failed_halves ? INFINITY : difference(e, newton, number, &by));
    *off = by.turns ? fmax(*off, TURNED) : *off;
    guard->checks++;
    const bool smooth = !finer && !failed_halves && !by.jumped, right = *off <= 1.0 || smallest;
    if (newton->error == 0.0 && length < 1.0 && smooth && right) {
        *end = by.last;
        return SOLVED;
    }
    keep(e, newton, g, number, true);
    newton->before[number] = before;
    if (failed_halves) { /* as where a contact breaks away: the error is over with the span */
        guard->apart = length * newton->moving[guard->line].scale;
        guard->distance_error = 0.0;
    }
    status = evaluate(e, newton, g, s, true, &norm);
    newton->jumped = jumped;
    set_at_rest(e, newton, g);
    return status;
}

/* Record an error that remains in the result. Errors of separate events are independent, so their squares add up. */
static void accumulate_error(Newton *newton, StepCheck *guard, const Span *s)
{
    Moving *const m = &newton->moving[guard->line];
    guard->unresolved += s->to - s->from;
    m->accumulated_error = hypot(m->accumulated_error, guard->apart);
    const double size = fmax(m->scale, fabs(m->u1)); /* 0: it begins to move */
    guard->abandoned = (size > 0.0 && m->accumulated_error > ABANDONED * size) || guard->unresolved > MOST_UNRESOLVED;
}

/* Return the larger of the remaining errors of a line, over its magnitude or over the distance. */
static inline double remaining_error(const Moving *m)
{
    return fmax(m->accumulated_error > 0.0 ? m->accumulated_error / m->scale : 0.0,
                m->distance_error > 0.0 ? m->distance_error / m->path : 0.0);
}

/* Evaluate a check: a finding makes checks due; undivided steps that agree end them. */
static void conclude(Newton *newton, int64_t number, int64_t tick, const Span *s, double off, bool smallest)
{
    StepCheck *const guard = &newton->guards[number];
    if (off <= 1.0 || smallest) { /* what each of many steps is tolerated adds up */
        newton->moving[guard->contact].distance_error += guard->distance_error;
        guard->distance_error = 0.0;
    }
    if (off > 1.0) {
        if (guard->time == 0.0 || (smallest && guard->unresolved == 0.0))
            guard->time = s->t;
        if (smallest)
            accumulate_error(newton, guard, s);
        if (tick > guard->last) /* findings in the first ticks do not limit steps: values and errors are small there */
            guard->recurrences = tick < SOON || tick > guard->last + SOON + guard->limited_ticks ? 0
                                 : guard->recurrences < MOST_RECURRENCES ? guard->recurrences + 1
                                                                         : MOST_RECURRENCES;
        if (off == AMPLIFIED && guard->recurrences < 2)
            guard->recurrences = 2;
        guard->last = tick;
        guard->checks_due = !guard->abandoned ? CONFIRMATIONS : 0;
        guard->cooldown = 0;
    } else if (newton->error > 0.0 || (s->from == 0.0 && s->to == 1.0) ||
               (guard->limited_ticks > 0 && s->h > 0.99 * guard->limit)) {
        if (guard->checks_due > 0)
            guard->checks_due--;
        else {
            guard->cooldown = guard->cooldown < LONGEST_COOLDOWN ? 2 * guard->cooldown + 1 : LONGEST_COOLDOWN;
            guard->harmless = tick < guard->next ? fmax(guard->harmless, guard->miss) : guard->miss;
        }
        guard->next = tick + 1 + guard->cooldown;
    }
}

/* If findings recur, limit the steps to the length that was right for a while. */
static void limit_steps(StepCheck *guard, double length)
{
    if (guard->recurrences < 2 || guard->abandoned)
        return;
    guard->limit = guard->limited_ticks > 0 ? fmin(guard->limit, length) : length;
    guard->limited_ticks = (int64_t)CONFIRMATIONS << guard->recurrences;
}

/* At the end of a step of length h, double a limit that has been in force long enough. */
static void release_limit(StepCheck *guard, double h)
{
    if (guard->abandoned)
        guard->limited_ticks = 0;
    if (guard->limited_ticks == 0 || --guard->limited_ticks > 0)
        return;
    guard->limit *= 2.0;
    guard->checks_due = CONFIRMATIONS;
    if (guard->limit < h)
        guard->limited_ticks = (int64_t)CONFIRMATIONS << guard->recurrences;
}

#endif
