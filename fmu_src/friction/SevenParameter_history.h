/* The history of the velocity in SevenParameter.c. Included after block.h. */

#ifndef SEVEN_PARAMETER_HISTORY_H
#define SEVEN_PARAMETER_HISTORY_H

#include "search.h"

static bool is_history(const Model *m)
{
    const struct memory *const past = &m->memory;
    bool good = is_direction(past->slip) && isfinite(past->Fs_last) && is_count(past->slid, 1.0) &&
                is_count(past->forgot, 1.0) && past->first < PIECES && is_count(past->first, PIECES) &&
                is_count(past->count, PIECES);
    for (int i = 0; good && i < past->count; i++)
        good = isfinite(past->ring[(past->first + i) % PIECES].begin);
    return good;
}

static struct piece *piece(struct memory *past, int i) { return &past->ring[(past->first + i) % PIECES]; }

/* A step appends a few segments, the first of which may replace the last one, unless the history is thinned out. */
static void keep_history(Memory *to, const Memory *from, const Model *m, bool follows)
{
    (void)m;
    if (follows && to->thinned == from->thinned && to->count > 0) {
        const int end = (from->first + from->count) % PIECES;
        int i = (to->first + to->count - 1) % PIECES;
        memcpy(to, from, offsetof(struct memory, ring));
        do {
            to->ring[i] = from->ring[i];
            i = (i + 1) % PIECES;
        } while (i != end);
    } else
        *to = *from;
}

static double along(const struct piece *p, double t) { return p->v + p->rate * (t - p->begin); }

/* Return v up to now: at a jump, the earlier value. */
static double until_now(const Model *m)
{
    const struct memory *const past = &m->memory;
    return past->count > 0 ? along(&past->ring[(past->first + past->count - 1) % PIECES], m->time) : 0.0;
}

static double begin_of(const void *past, int64_t i)
{
    const struct memory *const of = (const struct memory *)past;
    return of->ring[(of->first + i) % PIECES].begin;
}

/* Return v(t - tauL): at a jump, the later value, even if the times differ by rounding. */
static double delayed(const Model *m)
{
    const struct memory *const past = &m->memory;
    const double t = m->time - m->tauL, later = t + 1e-9 * m->tauL + 1e-15 * fabs(m->time);
    if (m->tauL == 0.0)
        return m->v;
    const int last = (int)last_not_above(begin_of, past, -1, past->count, later); /* segment that has begun */
    const struct piece at_rest = {0.0, 0.0, 0.0}, oldest = {0.0, past->ring[past->first].v, 0.0};
    if (last < 0)
        return along(past->forgot ? &oldest : &at_rest, t);
    return along(&past->ring[(past->first + last) % PIECES], t);
}

/* Join neighbours whose total duration is at most four times the mean duration, at least a quarter of the segments, by
   the line through their mean values, which preserves the distance. */
static void thin_out(struct memory *past, double now)
{
    const double longest = 4.0 * (now - piece(past, 0)->begin) / (double)PIECES;
    int kept = 0;
    for (int i = 0; i < PIECES; i++) {
        struct piece a = *piece(past, i);
        const double end = i + 2 < PIECES ? piece(past, i + 2)->begin : now;
        if (i + 1 < PIECES && end - a.begin <= longest) {
            const struct piece b = *piece(past, ++i);
            const double at_a = 0.5 * (a.begin + b.begin), at_b = 0.5 * (b.begin + end);
            const double rate = (along(&b, at_b) - along(&a, at_a)) / (at_b - at_a);
            a = (struct piece){a.begin, along(&a, at_a) - rate * (at_a - a.begin), rate};
        }
        *piece(past, kept++) = a;
    }
    past->count = kept;
    past->thinned++;
}

/* Append v for the step from now over h, unless it continues the last segment. */
static void remember(Model *m, double h)
{
    struct memory *const past = &m->memory;
    const double now = m->time, v = m->v, rate = m->slope[INPUT_v], end = v + rate * h;
    if (past->count > 0) {
        struct piece *const last = piece(past, past->count - 1);
        const double same = 1e-14 * fmax(fabs(v), fabs(end));
        if (fabs(along(last, now) - v) <= same && fabs(along(last, now + h) - end) <= same)
            return;
        if (!(now > last->begin))
            past->count--; /* it had no duration */
    }
    if (past->count == PIECES) {
        while (past->count > 1 && piece(past, 1)->begin < now - (1.0 + 1e-6) * m->tauL) {
            past->first = (past->first + 1) % PIECES;
            past->count--;
            past->forgot = 1;
        }
        if (past->count == PIECES) {
            thin_out(past, now);
            m->run.warning = true;
        }
    }
    *piece(past, past->count++) = (struct piece){now, v, rate};
}

#endif
