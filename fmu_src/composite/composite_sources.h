/* Parts without inputs: recorded tables, and the inputs of the composite. */

#ifndef COMPOSITE_SOURCES_H
#define COMPOSITE_SOURCES_H

static int move_source(void *component, double t, double h, int keeps_no_state)
{
    const Place *const place = (const Place *)component;
    Instance *const c = place->owner;
    const Series *const series = part_data[place->part].series;
    (void)keeps_no_state;
    c->memory.sources[place->source] = t + h;
    if (!series || t + h <= series->reach)
        return fmi2OK;
    snprintf(c->said, sizeof c->said, "the record ends at %.12g s", series->times[series->rows - 1]);
    return fmi2Discard;
}

/* Return an input at the time of the engine: it varies linearly in a step for which a derivative was set, and in a tick
   that is repeated. */
static double input_now(const Place *place, uint32_t number)
{
    const Memory *const m = &place->owner->memory;
    const double slope = m->inside ? m->rate[number] : m->slopes[number];
    const double value = m->inside ? m->base[number] : m->inputs[number];
    return slope == 0.0 ? value : value + slope * (m->sources[place->source] - m->begun);
}

static int get_inputs(void *component, const uint32_t *references, size_t n, void *values)
{
    for (size_t i = 0; i < n; i++)
        ((double *)values)[i] = input_now((const Place *)component, references[i]);
    return fmi2OK;
}

static int get_whole_inputs(void *component, const uint32_t *references, size_t n, void *values)
{
    for (size_t i = 0; i < n; i++)
        ((int *)values)[i] = (int)((const Place *)component)->owner->memory.inputs[references[i]];
    return fmi2OK;
}

/* Return the last row whose time has come, by bisection; -1: none. */
static int64_t row_at(const Series *series, double t)
{
    int64_t row = -1, end = series->rows;
    while (end - row > 1) {
        const int64_t middle = row + (end - row) / 2;
        if (series->times[middle] <= t + series->slack)
            row = middle;
        else
            end = middle;
    }
    return row;
}

static int get_series(void *component, const uint32_t *references, size_t n, void *values)
{
    const Place *const place = (const Place *)component;
    const Series *const series = part_data[place->part].series;
    const double now = place->owner->memory.sources[place->source];
    const Memory *const m = &place->owner->memory;
    const int64_t row = m->mode & EXCHANGING ? m->rows[place->source] : row_at(series, now);
    const bool between = row >= 0 && row < series->rows - 1;
    const int64_t first = (row < 0 ? 0 : row) * series->columns;
    for (size_t i = 0; i < n; i++) {
        const int64_t place_of = first + (int64_t)references[i];
        ((double *)values)[i] =
            series->values[place_of] + (between ? (now - series->times[row]) * series->slopes[place_of] : 0.0);
    }
    return fmi2OK;
}

#endif
