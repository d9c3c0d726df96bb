/* FMI 2.0.5 around a system of parts: one instance, its memory, and its life. A rejected call is logged,
   returns the status required by the standard, and changes nothing. */

#ifndef COMPOSITE_H
#define COMPOSITE_H

/* What a step may change, without pointers, so that it is saved as it is. The arrays have a spare element, as C has no
   empty arrays. */
typedef struct {
    int mode, stale, slopes_used, inside; /* stale: see below; inside: the importer is between two ticks */
    int64_t exchange;                     /* whether the instance is for model exchange */
    int64_t tick;                         /* the next one, or the one in progress */
    int64_t side;                         /* which copies of the states of the parts are of the start of the tick */
    double time, spent, drift;            /* [s]; spent: since the start of the tick; drift: bound of its rounding */
    double solved;                        /* [s] since the start of the tick, until the last jump of an input in it */
    double start, stop, tolerance, begun; /* [s]; begun: begin of the step, at which the inputs have their values */
    double sources[SOURCES + 1];          /* [s] time of each recorded table and of the inputs */
    int64_t rows[SOURCES + 1];            /* of each recorded table: the one that applies, in model exchange */
    double inputs[INPUTS + 1], slopes[INPUTS + 1];
    double base[INPUTS + 1], rate[INPUTS + 1]; /* inputs over a span that is divided, as lines from its start */
    double begun_signals[SIGNALS + 1];         /* at the start of such a span */
    int rests[LINES + 1], holds[UNKNOWNS + 1]; /* between two ticks: contacts at rest, and holding forces, there */
    double signals[SIGNALS + 1], gains[MAPPED + 1], offsets[MAPPED + 1], past[PAST + 1];
    Moving moving[LINES + 1];
    StepCheck guards[GROUPS + 1];
    double w[UNKNOWNS + 1], w_last[UNKNOWNS + 1], trend[UNKNOWNS + 1], scale[UNKNOWNS + 1];
    double lasting[UNKNOWNS + 1], at_begin[UNKNOWNS + 1], prediction_error[UNKNOWNS + 1], growth[UNKNOWNS + 1];
    double held_values[HELD + 1], held_sizes[HELD + 1], state_sizes[STATE_OUTPUTS + 1];
    double inverse[GROUPS * MOST * MOST + 1], proposed[GROUPS + 1], before[GROUPS + 1];
} Memory;

/* What was set since the values in the connections were computed. */
enum { INPUT_SET = 1, PARAMETER_SET };

typedef struct Instance Instance;

/* The component of a part, as its logger and its functions see it. */
typedef struct {
    Instance *owner;
    int64_t part, source;
} Place;

struct Instance {
    Memory memory, backup, tick; /* tick: its start */
    Engine engine;
    Newton newton;
    EnginePart parts[PARTS];
    Line lines[LINES + 1];
    Manipulator delays[DELAYS + 1];
    Moving kept_lines[LINES + 1];
    double r[UNKNOWNS + 1], work[7 * MOST + 2 * MOST * MOST + 1], kept[6 * MOST + MOST * MOST + 3 * LINES + 1];
    double kept_states[STATE_OUTPUTS + 1];
    double start_values[ROOTS + 1], start_work[FIXED_POINT_WORK(ROOTS) + 1], earlier[SIGNALS + 1];
    double shown[SIGNALS + 1]; /* signals after values were set, if `refreshed` */
    double input_slopes[SIGNALS + 1];
    int whole[SIGNALS + 1], orders[SIGNALS + 1];
    void *backups[PARTS];  /* states of the parts at the start of a step */
    void *ticks[2][PARTS]; /* at the start of a span that is divided, and of an earlier one */
    Place places[PARTS];
    fmi2CallbackFunctions callbacks[PARTS];
    bool warned[PARTS]; /* the part's warning has been passed on */
    bool warning;       /* in this step */
    bool ended;         /* a part has ended the simulation in the last step */
    bool refreshed;
    bool told;      /* the warning of wrong results has been logged */
    char said[512]; /* last message of a part */
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
    int logging;
    char name[]; /* of the instance */
};

#define MODE(c)        ((c)->memory.mode)
#define SLOPES_USED(c) ((c)->memory.slopes_used)
#define NOW(c)         ((c)->memory.time)
#define KIND(c)        ((c)->memory.exchange ? fmi2ModelExchange : fmi2CoSimulation)
#define ENDED(c)       ((c)->ended)

#include "fmi2_calls.h"
#include "fmi2_saved.h"

static bool is_fmu(int64_t part) { return part_data[part].functions != NULL; }

/* Return whether a part moves within a tick, and not at its start only. */
static bool moves_inside(int64_t part) { return is_fmu(part) && !part_data[part].sampled; }

/* Store the message of a part; pass on the first warning of each part. */
static void listen(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...)
{
    const Place *const place = (const Place *)environment;
    Instance *const c = place->owner;
    va_list arguments;
    va_start(arguments, message);
    vsnprintf(c->said, sizeof c->said, message ? message : "", arguments);
    va_end(arguments);
    (void)name;
    (void)category;
    if (status == fmi2Warning && !c->warned[place->part]) {
        c->warned[place->part] = c->warning = true;
        report(c, fmi2Warning, LOG_WARNING, "%s: %s", part_data[place->part].name, c->said);
    }
}

/* ---- Parts without inputs: recorded tables, and the inputs of the composite. */

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

/* ---- the data of the engine --------------------------------------------------------------------------------- */

static void wire_parts(Instance *c)
{
    size_t used = 0;
    for (int64_t i = 0; i < PARTS; i++) {
        const PartData *const data = &part_data[i];
        EnginePart *const p = &c->parts[i];
        p->input_references = data->input_references;
        p->output_references = data->output_references;
        memcpy(p->inputs, data->inputs, sizeof p->inputs);
        memcpy(p->outputs, data->outputs, sizeof p->outputs);
        p->whole = c->whole;
        p->orders = c->orders;
        p->slopes = c->input_slopes + used;
        used += (size_t)(data->inputs[INTEGER] - data->inputs[REAL]);
        p->every = data->every;
        p->phase = data->phase;
        p->sampled = data->sampled;
        if (!is_fmu(i)) {
            p->component = &c->places[i];
            p->do_step = move_source;
            for (int type = REAL; type < TYPES; type++)
                p->get[type] = data->series ? get_series : type == REAL ? get_inputs : get_whole_inputs;
            continue;
        }
        p->direct = data->functions->direct ? data->functions->direct() : NULL;
        if (p->direct && p->direct->version != DIRECT_VERSION)
            p->direct = NULL;
        p->ports = (Ports){p->input_references,
                           p->output_references,
                           source_of + p->inputs[REAL],
                           p->inputs[REAL],
                           p->outputs[REAL],
                           count_of(p->inputs, REAL),
                           count_of(p->inputs, BOOLEAN),
                           count_of(p->outputs, REAL),
                           count_of(p->outputs, INTEGER),
                           count_of(p->outputs, BOOLEAN)};
        memcpy(p->set, data->functions->set, sizeof p->set);
        memcpy(p->get, data->functions->get, sizeof p->get);
        p->do_step = data->functions->do_step;
        p->get_state = data->functions->get_state;
        p->set_state = data->functions->set_state;
        p->set_slopes = data->interpolates ? data->functions->set_slopes : NULL;
    }
}

static void wire_engine(Instance *c)
{
    Engine *const e = &c->engine;
    Memory *const m = &c->memory;
    for (int64_t i = 0; i <= SIGNALS; i++)
        c->orders[i] = 1;
    for (int64_t k = 0; k < LINES; k++)
        c->lines[k].input = line_inputs[k];
    for (int64_t k = 0; k < DELAYS; k++) {
        const DelayData *const d = &delay_data[k];
        Manipulator *const delay = &c->delays[k];
        delay->kind = DELAY;
        delay->input = d->input;
        delay->last = INT64_MAX;
        delay->length = d->length;
        delay->every = d->every;
        delay->phase = d->phase;
        delay->fresh = d->fresh;
        delay->past = k == 0 ? m->past : c->delays[k - 1].past + c->delays[k - 1].length;
    }
    e->parts = c->parts;
    e->part_count = PARTS;
    e->signals = m->signals;
    e->sources = source_of;
    if (MAPPED > 0) {
        e->gains = m->gains;
        e->offsets = m->offsets;
        e->wire_gains = wire_gains;
        e->wire_offsets = wire_offsets;
    }
    e->manipulators = c->delays;
    e->manipulator_count = DELAYS;
    e->step = STEP_SIZE;
    e->lines = c->lines;
    e->lines_from = lines_from;
    e->advance = newton_tick;
    e->algorithm = &c->newton;
}

static void wire_newton(Instance *c)
{
    Memory *const m = &c->memory;
    c->newton = (Newton){
        .groups = group_data,
        .group_count = GROUPS,
        .order = part_order,
        .continuous = continuous,
        .moving = m->moving,
        .lines = group_lines,
        .unknowns = unknown_outputs,
        .held = held_inputs,
        .held_values = m->held_values,
        .held_sizes = m->held_sizes,
        .contacts = contact_data,
        .loads = load_inputs,
        .states = state_data,
        .state_sizes = m->state_sizes,
        .kept_states = c->kept_states,
        .w = m->w,
        .w_last = m->w_last,
        .trend = m->trend,
        .scale = m->scale,
        .lasting = m->lasting,
        .at_begin = m->at_begin,
        .prediction_error = m->prediction_error,
        .growth = m->growth,
        .r = c->r,
        .work = c->work,
        .inverse = m->inverse,
        .most_unknowns = MOST,
        .tolerance = LOOP_TOLERANCE,
        .error = LOOP_ERROR,
        .step_tolerance = STEP_TOLERANCE,
        .finest = FINEST,
        .proposed = m->proposed,
        .before = m->before,
        .guards = m->guards,
        .kept_lines = c->kept_lines,
        .kept = c->kept,
    };
}

/* ---- life of an instance ------------------------------------------------------------------------------------ */

/* Set the start values that the system states, and forget the run. */
static bool set_start_values(Instance *c)
{
    Memory *const m = &c->memory;
    const int64_t exchange = m->exchange;
    memset(m, 0, sizeof *m);
    m->exchange = exchange;
    memset(c->warned, 0, sizeof c->warned);
    for (int i = 0; i < INPUTS; i++)
        m->inputs[i] = input_starts[i];
    for (int64_t k = 0; k < LINES; k++)
        memcpy(&m->moving[k], &line_data[k], sizeof line_data[k]);
    c->refreshed = c->told = c->ended = false;
    MODE(c) = INSTANTIATED;
    m->stop = INFINITY;
    m->stale = PARAMETER_SET;
    for (int64_t i = 0; i < START_VALUES; i++) {
        const StartValue *const s = &start_values[i];
        EnginePart *const p = &c->parts[s->part];
        double real = s->value;
        int whole = s->type == REAL ? 0 : (int)s->value;
        if (p->set[s->type](p->component, &s->reference, 1, s->type == REAL ? (void *)&real : (void *)&whole) > 1)
            return false;
    }
    return true;
}

static bool make_parts(Instance *c, fmi2Boolean visible)
{
    for (int64_t i = 0, source = 0; i < PARTS; i++) {
        const PartFunctions *const f = part_data[i].functions;
        c->places[i] = (Place){c, i, is_fmu(i) ? -1 : source++};
        if (!f)
            continue;
        const fmi2CallbackFunctions callbacks = {listen, calloc, free, NULL, &c->places[i]};
        memcpy(&c->callbacks[i], &callbacks, sizeof callbacks); /* its members are const */
        c->parts[i].component =
            f->instantiate(part_data[i].name, KIND(c), f->guid, "", &c->callbacks[i], visible, fmi2True);
        EnginePart *const p = &c->parts[i];
        if (!p->component || p->get_state(p->component, &p->state) > 1 ||
            p->get_state(p->component, &p->other_state) > 1 || p->get_state(p->component, &c->backups[i]) > 1 ||
            p->get_state(p->component, &c->ticks[0][i]) > 1 || p->get_state(p->component, &c->ticks[1][i]) > 1)
            return false;
    }
    return true;
}

void fmi2FreeInstance(fmi2Component component)
{
    Instance *const c = (Instance *)component;
    for (int64_t i = 0; c && i < PARTS; i++) {
        EnginePart *const p = &c->parts[i];
        if (!is_fmu(i) || !p->component)
            continue;
        void **const states[] = {&p->state, &p->other_state, &c->backups[i], &c->ticks[0][i], &c->ticks[1][i]};
        for (size_t k = 0; k < sizeof states / sizeof states[0]; k++)
            part_data[i].functions->free_state(p->component, states[k]);
        part_data[i].functions->free_instance(p->component);
    }
    free(c);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type kind, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)resources;
    Instance *const c = allocated(name, functions);
    if (!c)
        return NULL;
    wire_parts(c);
    wire_engine(c);
    wire_newton(c);

    const char *fault = instantiation_fault(c, kind, MODEL_EXCHANGE, guid, GUID);
    c->memory.exchange = kind == fmi2ModelExchange;
    if (!fault && (!make_parts(c, visible) || !set_start_values(c)))
        fault = c->said[0] ? c->said : "a part cannot be instantiated";
    if (fault) {
        report(c, fmi2Error, LOG_ERROR, "fmi2Instantiate of %s: %s", QUOTE(MODEL), fault);
        fmi2FreeInstance(c);
        return NULL;
    }
    c->logging = logging ? LOG_EVERYTHING : 0;
    return c;
}

/* Save what a call may change. */
static bool keep_all(Instance *c)
{
    c->backup = c->memory;
    for (int64_t i = 0; i < PARTS; i++)
        if (is_fmu(i) && save_to(&c->parts[i], &c->backups[i]) > 1)
            return false;
    return true;
}

static bool roll_back_all(Instance *c)
{
    bool good = true;
    c->memory = c->backup;
    for (int64_t i = 0; i < PARTS; i++)
        if (is_fmu(i) && restore_from(&c->parts[i], c->backups[i]) > 1)
            good = false;
    return good;
}

/* ---- The start of a run: initialisation mode of all parts, with consistent values in all connections. */

#define SOLVED_START 1e-10 /* largest residual of an algebraic loop, relative to its values */

/* Note that values were set. */
static void set_stale(Memory *m, int what)
{
    if (m->stale != PARAMETER_SET)
        m->stale = what;
}

/* Return whether the outputs of parts are finite; a law may accept an input that is not. The exponents are compared, as
   a sum of doubles takes four times as long. */
static bool outputs_finite(const Instance *c)
{
    uint64_t bits[CHECKED + 1], none = 0;
    memcpy(bits, c->memory.signals, CHECKED * sizeof(double));
    for (int64_t k = 0; k < CHECKED; k++)
        none |= (uint64_t)((bits[k] << 1) >= UINT64_C(0xffe0000000000000));
    return none == 0;
}

/* Update the outputs of all parts. */
static bool fetch_all(Instance *c)
{
    Engine *const e = &c->engine;
    for (int64_t i = 0; i < PARTS; i++) {
        const int status = fetch_outputs(&e->parts[i], e->signals);
        if (status > 1)
            return failed(e, i, GET, status, NOW(c));
    }
    return true;
}

/* Between two events, a sampled part keeps its inputs too. */
static bool hand_over_to(Instance *c, int64_t part)
{
    Engine *const e = &c->engine;
    const bool takes = is_fmu(part) && !(MODE(c) == CONTINUOUS_TIME && e->parts[part].sampled);
    const int status = takes ? hand_over(&e->parts[part], e->signals) : 0;
    return status <= 1 || failed(e, part, SET, status, NOW(c));
}

/* Set and read all parts once, in the order in which start values spread. */
static bool spread(Instance *c)
{
    Engine *const e = &c->engine;
    for (int64_t k = 0; k < PARTS; k++) {
        EnginePart *const p = &e->parts[start_order[k]];
        fetch_inputs(e, p);
        if (!hand_over_to(c, start_order[k]))
            return false;
        const int status = fetch_outputs(p, e->signals);
        if (status > 1)
            return failed(e, start_order[k], GET, status, NOW(c));
    }
    return true;
}

/* G(w) - w of the outputs on which the algebraic loops depend. */
static bool start_residual(void *context, const double *w, double *r)
{
    Instance *const c = (Instance *)context;
    for (int64_t i = 0; i < ROOTS; i++)
        c->memory.signals[root_signals[i]] = w[i];
    if (!spread(c))
        return false;
    for (int64_t i = 0; i < ROOTS; i++)
        r[i] = c->memory.signals[root_signals[i]] - w[i];
    return true;
}

static bool solve_start(Instance *c, double *norm)
{
    double *const r = c->start_work;
    for (int64_t i = 0; i < ROOTS; i++)
        c->start_values[i] = c->memory.signals[root_signals[i]];
    return find_fixed_point(start_residual, c, c->start_values, ROOTS, c->start_work, norm) &&
           start_residual(c, c->start_values, r) && spread(c);
}

/* Begin with the inputs that the parts have by themselves, so that the result does not depend on earlier calls. */
static bool begin_spreading(Instance *c)
{
    Engine *const e = &c->engine;
    memset(c->memory.signals, 0, sizeof c->memory.signals);
    for (int64_t k = 0; k < MAPPED; k++) {
        c->memory.gains[k] = wire_gains[k];
        c->memory.offsets[k] = wire_offsets[k];
    }
    for (const DelayData *d = delay_data; d < delay_data + DELAYS; d++)
        if (d->given) {
            c->memory.gains[d->input] = 0.0;
            c->memory.offsets[d->input] = map_of(wire_gains[d->input], wire_offsets[d->input], d->initial);
        }
    for (int64_t i = 0; i < PARTS; i++)
        if (!is_fmu(i))
            (void)fetch_outputs(&e->parts[i], e->signals);
    for (int64_t i = 0; i < PARTS; i++) {
        const EnginePart *const p = &e->parts[i];
        for (int64_t k = p->inputs[REAL]; k < p->inputs[TYPES]; k++)
            e->signals[k] = from_outside[k] ? arriving(e, k) : own_starts[k];
        if (!hand_over_to(c, i))
            return false;
    }
    return fetch_all(c);
}

/* Report why values cannot be computed; the solver of an importer then tries others. */
static fmi2Status no_values(const Instance *c, const char *function)
{
    const bool trial = MODE(c) == CONTINUOUS_TIME;
    return report(c, trial ? fmi2Discard : fmi2Error, trial ? LOG_DISCARD : LOG_ERROR, "%s: %s rejected its %s: %s",
                  function, part_data[c->engine.failed_part].name, MODE(c) & EXCHANGING ? "inputs" : "start values",
                  c->said);
}

/* Compute the values of all connections, if something was set. One sweep gives the start values of a loop through a
   sampled part or a delay, which has no fixed point. */
static fmi2Status settle(Instance *c, const char *function)
{
    Memory *const m = &c->memory;
    double norm = 0.0;
    if (!m->stale)
        return fmi2OK;
    c->said[0] = '\0';
    const bool exchanging = (MODE(c) & EXCHANGING) != 0;
    if (!exchanging && !begin_spreading(c))
        return no_values(c, function);
    if (START_LOOP) {
        if (!solve_start(c, &norm))
            return no_values(c, function);
        REQUIRE(norm <= SOLVED_START,
                "%s: no values satisfy the algebraic loop through %s: the best ones have an error of %.2g of "
                "their size; set other start values",
                function, start_loop_name, norm)
    } else
        for (int64_t sweep = 0; sweep < (LATE_LOOP && !exchanging ? 1 : PARTS + 1); sweep++) {
            memcpy(c->earlier, m->signals, sizeof m->signals);
            if (!spread(c))
                return no_values(c, function);
            if (memcmp(c->earlier, m->signals, sizeof m->signals) == 0)
                break;
        }
    if (exchanging && !outputs_finite(c)) {
        snprintf(c->said, sizeof c->said, "an output is not finite");
        return no_values(c, function);
    }
    m->stale = false;
    return fmi2OK;
}

/* The same for a call that may be refused: then nothing changes. */
static fmi2Status settle_or_return(Instance *c, const char *function)
{
    if (!c->memory.stale)
        return fmi2OK;
    REQUIRE(keep_all(c), "%s: a part cannot save its state: %s", function, c->said)
    const fmi2Status status = settle(c, function);
    if (status != fmi2OK)
        (void)roll_back_all(c);
    return status;
}

/* Perform a call of every FMU; the reason for a failure is its last message. */
#define ALL_PARTS(function, call)                                                                                      \
    c->said[0] = '\0';                                                                                                 \
    for (int64_t i = 0; i < PARTS; i++) {                                                                              \
        const PartFunctions *const f = part_data[i].functions;                                                         \
        const fmi2Component p = c->parts[i].component;                                                                 \
        REQUIRE(!f || (call) <= fmi2Warning, "%s: %s failed: %s", function, part_data[i].name, c->said)                \
    }

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean tolerance_given, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_given, fmi2Real stop)
{
    ENTER("SetupExperiment", MAY_SetupExperiment)
    if (check_experiment(c, tolerance_given, tolerance, start, stop_given, stop) != fmi2OK)
        return fmi2Error;
    /* not the stop time: a sampled part may end its last step after it */
    ALL_PARTS("fmi2SetupExperiment", f->setup(p, tolerance_given, tolerance, start, fmi2False, 0.0))
    Memory *const m = &c->memory;
    m->tolerance = tolerance_given ? tolerance : 0.0;
    m->start = m->time = m->begun = start;
    for (int i = 0; i <= SOURCES; i++)
        m->sources[i] = start;
    m->stop = stop_given ? stop : INFINITY;
    m->stale = PARAMETER_SET;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component)
{
    ENTER("EnterInitializationMode", MAY_EnterInitializationMode)
    ALL_PARTS("fmi2EnterInitializationMode", f->enter(p))
    MODE(c) = INITIALIZING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component)
{
    ENTER("ExitInitializationMode", MAY_ExitInitializationMode)
    Memory *const m = &c->memory;
    REQUIRE(keep_all(c), "fmi2ExitInitializationMode: a part cannot save its state: %s", c->said)
    const fmi2Status status = settle(c, "fmi2ExitInitializationMode");
    bool good = true;
    for (int64_t i = 0; i < PARTS && good && status == fmi2OK; i++)
        good = !is_fmu(i) || part_data[i].functions->leave(c->parts[i].component) <= fmi2Warning;
    good = good && (status != fmi2OK || fetch_all(c));
    if (!good || status != fmi2OK)
        (void)roll_back_all(c);
    if (status != fmi2OK)
        return status;
    REQUIRE(good, "fmi2ExitInitializationMode: %s", c->said)
    m->stale = false;
    if (m->exchange) {
        MODE(c) = EVENT_MODE;
        return fmi2OK;
    }
    newton_begin(&c->engine, &c->newton);
    for (int64_t k = 0; k < DELAYS; k++)
        for (int64_t i = 0; i < c->delays[k].length; i++)
            c->delays[k].past[i] =
                delay_data[k].given ? delay_data[k].initial : m->signals[source_of[delay_data[k].input]];
    MODE(c) = STEP_COMPLETE;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component)
{
    ENTER("Reset", MAY_Reset)
    ALL_PARTS("fmi2Reset", f->reset(p))
    REQUIRE(set_start_values(c), "fmi2Reset: a part rejects its start value: %s", c->said)
    return fmi2OK;
}

/* ---- Saved states: the memory of the engine and the states of all parts. */

static const char magic_text[MAGIC_SIZE] = "compose";
static const char guid_text[GUID_SIZE] = GUID;

typedef struct {
    SavedHeader header; /* with the checksum of everything that follows */
    Memory memory;
    void *parts[2 * PARTS]; /* states of the parts, and those at the start of a tick that is divided */
} Saved;

/* Return whether the state of a part is saved at this place. */
static bool is_saved(const Memory *m, int64_t i)
{
    return i < PARTS ? is_fmu(i) : m->inside && moves_inside(i - PARTS);
}

/* A serialized state: these bytes, then the size and the bytes of each part's state. */
enum { SAVED_SIZE = offsetof(Saved, parts), AFTER_CHECKSUM = offsetof(Saved, memory) };

static uint64_t checksum_of(const char *bytes, size_t size)
{
    return checksum_of_bytes(bytes + AFTER_CHECKSUM, size - AFTER_CHECKSUM);
}

static const char *fault_of(const Instance *c, const Saved *saved)
{
    const char *const fault = fault_of_header(&saved->header, magic_text, guid_text, sizeof(Saved));
    return !fault && saved->memory.exchange != c->memory.exchange ? OTHER_KIND : fault;
}

static void free_saved(Instance *c, Saved *saved)
{
    for (int64_t i = 0; saved && i < 2 * PARTS; i++)
        if (saved->parts[i])
            part_data[i % PARTS].functions->free_state(c->parts[i % PARTS].component, &saved->parts[i]);
    free(saved);
}

/* Copy a state of a part that is in the state `now`. */
static bool copied(Instance *c, int64_t part, void *from, void **to, void *now)
{
    EnginePart *const p = &c->parts[part];
    return p->set_state(p->component, from) <= 1 && p->get_state(p->component, to) <= 1 &&
           p->set_state(p->component, now) <= 1;
}

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    ENTER("GetFMUstate", MAY_FMUstate)
    REQUIRE(state, "fmi2GetFMUstate: the pointer to the state is null")
    if (!*state)
        *state = calloc(1, sizeof(Saved));
    Saved *const saved = (Saved *)*state;
    REQUIRE(saved, "fmi2GetFMUstate: out of memory")
    write_header(&saved->header, magic_text, guid_text, sizeof(Saved));
    memcpy(&saved->memory, &c->memory, sizeof c->memory);
    for (int64_t i = 0; i < PARTS; i++)
        REQUIRE(!is_fmu(i) || c->parts[i].get_state(c->parts[i].component, &saved->parts[i]) <= 1,
                "fmi2GetFMUstate: %s cannot save its state: %s", part_data[i].name, c->said)
    for (int64_t i = 0; i < PARTS; i++)
        REQUIRE(!is_saved(&c->memory, PARTS + i) ||
                    copied(c, i, c->ticks[c->memory.side][i], &saved->parts[PARTS + i], saved->parts[i]),
                "fmi2GetFMUstate: %s cannot save its state: %s", part_data[i].name, c->said)
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state)
{
    ENTER("SetFMUstate", MAY_FMUstate)
    REQUIRE(state, "fmi2SetFMUstate: the state is a null pointer")
    const Saved *const saved = (const Saved *)state;
    const char *const fault = fault_of(c, saved);
    REQUIRE(!fault, "fmi2SetFMUstate: the state cannot be used: %s", fault)
    for (int64_t i = 0; i < PARTS; i++) {
        const bool divided = is_saved(&saved->memory, PARTS + i);
        REQUIRE(!divided || copied(c, i, saved->parts[PARTS + i], &c->ticks[saved->memory.side][i], saved->parts[i]),
                "fmi2SetFMUstate: %s rejects its state: %s", part_data[i].name, c->said)
        REQUIRE(divided || !is_fmu(i) || c->parts[i].set_state(c->parts[i].component, saved->parts[i]) <= 1,
                "fmi2SetFMUstate: %s rejects its state: %s", part_data[i].name, c->said)
    }
    c->memory = saved->memory;
    c->refreshed = false;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    ENTER("FreeFMUstate", MAY_FMUstate)
    if (state) {
        free_saved(c, (Saved *)*state);
        *state = NULL;
    }
    return fmi2OK;
}

/* Return the number of bytes of a serialized state; 0 if a part cannot tell. */
static size_t serialized_size(Instance *c, const Saved *saved)
{
    size_t size = SAVED_SIZE;
    for (int64_t i = 0; i < 2 * PARTS; i++) {
        size_t inner = 0;
        if (!is_saved(&saved->memory, i))
            continue;
        if (part_data[i % PARTS].functions->size_of_state(c->parts[i % PARTS].component, saved->parts[i], &inner) >
            fmi2Warning)
            return 0;
        size += sizeof(uint64_t) + inner;
    }
    return size;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate state, size_t *size)
{
    ENTER("SerializedFMUstateSize", MAY_FMUstate)
    REQUIRE(state && size, "fmi2SerializedFMUstateSize: a pointer is null")
    *size = serialized_size(c, (const Saved *)state);
    REQUIRE(*size > 0, "fmi2SerializedFMUstateSize: a part cannot serialize its state: %s", c->said)
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    ENTER("SerializeFMUstate", MAY_FMUstate)
    REQUIRE(state && bytes, "fmi2SerializeFMUstate: a pointer is null")
    const Saved *const saved = (const Saved *)state;
    const size_t needed = serialized_size(c, saved);
    REQUIRE(needed > 0 && size >= needed, "fmi2SerializeFMUstate: %u bytes are too few for a state with %u bytes",
            (unsigned)size, (unsigned)needed)
    memcpy(bytes, saved, SAVED_SIZE);
    size_t end = SAVED_SIZE;
    for (int64_t i = 0; i < 2 * PARTS; i++) {
        if (!is_saved(&saved->memory, i))
            continue;
        const char *const name = part_data[i % PARTS].name;
        const PartFunctions *const f = part_data[i % PARTS].functions;
        const fmi2Component part = c->parts[i % PARTS].component;
        size_t inner = 0;
        REQUIRE(f->size_of_state(part, saved->parts[i], &inner) <= fmi2Warning,
                "fmi2SerializeFMUstate: %s cannot serialize its state: %s", name, c->said)
        const uint64_t stored = inner;
        memcpy(bytes + end, &stored, sizeof stored);
        end += sizeof stored;
        REQUIRE(f->serialize(part, saved->parts[i], bytes + end, inner) <= fmi2Warning,
                "fmi2SerializeFMUstate: %s cannot serialize its state: %s", name, c->said)
        end += inner;
    }
    const uint64_t checksum = checksum_of(bytes, needed);
    memcpy(bytes + offsetof(Saved, header.checksum), &checksum, sizeof checksum);
    return fmi2OK;
}

static bool is_bit(int64_t flag) { return flag == 0 || flag == 1; }
static bool in_range(int64_t value, int64_t first, int64_t last) { return value >= first && value <= last; }

static bool plausible_guard(const StepCheck *g)
{
    const int64_t most = INT64_C(1) << 53;
    return in_range(g->line, 0, LINES) && in_range(g->contact, 0, LINES) && in_range(g->checks_due, 0, CONFIRMATIONS) &&
           in_range(g->cooldown, 0, 2 * LONGEST_COOLDOWN) && in_range(g->next, 0, most) &&
           in_range(g->last, -most, most) && in_range(g->recurrences, 0, MOST_RECURRENCES) &&
           in_range(g->limited_ticks, 0, most) && in_range(g->checks, 0, most) && is_bit(g->abandoned) &&
           in_range(g->resolves, 0, WHOLE_STEP) && is_bit(g->jumped);
}

/* Return whether a variable can have the value in this memory; a law may accept an input that is not finite. */
static bool plausible_value(const Memory *m, const Variable *v)
{
    const double value = v->is_input ? m->inputs[v->reference] : v->signal >= 0 ? m->signals[v->signal] : 0.0;
    return v->type == REAL ? v->is_input || isfinite(value) : value == floor(value) && fabs(value) <= 2147483648.0;
}

/* Return whether a run can reach this memory: whatever is used as an index, a count or a time is in range. */
static bool plausible(const Memory *m)
{
    const int modes =
        BEFORE_STEPPING | TERMINATED | (m->exchange ? (int)EXCHANGING : (int)STEP_COMPLETE | (int)STEP_FAILED);
    const double now = m->start + (double)m->tick * STEP_SIZE + m->spent;
    const double slack = 1e-3 * STEP_SIZE + 1e-9 * fabs(now) + m->drift;
    bool good = m->solved >= 0.0 && m->solved <= fmax(m->spent, 0.0) + slack && is_bit(m->exchange) &&
                (MODEL_EXCHANGE || !m->exchange) && (m->mode & modes) == m->mode && m->mode > 0 &&
                (m->mode & (m->mode - 1)) == 0 && in_range(m->stale, 0, PARAMETER_SET) && is_bit(m->slopes_used) &&
                is_bit(m->inside) && in_range(m->tick, 0, INT64_C(1) << 53) && is_bit(m->side) && isfinite(m->start) &&
                isfinite(m->time) && fabs(m->spent) <= 1.001 * STEP_SIZE && m->drift >= 0.0 && m->drift < INFINITY &&
                (m->exchange || fabs(m->time - now) <= slack) && m->stop >= m->start && m->tolerance >= 0.0 &&
                m->tolerance < INFINITY && isfinite(m->begun);
    for (int64_t i = 0, source = 0; i < PARTS; i++) {
        const Series *const series = part_data[i].series;
        good = good && (is_fmu(i) || in_range(m->rows[source], -1, series ? series->rows - 1 : 0));
        source += !is_fmu(i);
    }
    for (int64_t k = 0; k < LINES; k++)
        good = good && memcmp(&m->moving[k], &line_data[k], sizeof line_data[k]) == 0 &&
               is_bit(m->moving[k].from_rest) && in_range(m->moving[k].role, FREE, CHANGING) &&
               in_range(m->moving[k].rests, FREE, CHANGING) && in_range(m->moving[k].force, FREE, CHANGING) &&
               in_range(m->moving[k].rigid, -1, 1);
    for (int64_t g = 0; g < GROUPS; g++)
        good = good && plausible_guard(&m->guards[g]);
    for (int i = 0; i < INPUTS; i++)
        good = good && isfinite(m->slopes[i]) && isfinite(m->rate[i]);
    for (size_t i = 0; i < VARIABLES; i++)
        good = good && plausible_value(m, &variables[i]);
    return good;
}

/* Read the states of the parts; return the reason why the bytes cannot be used, or NULL. */
static const char *read_parts(Instance *c, Saved *saved, const fmi2Byte bytes[], size_t size)
{
    size_t end = SAVED_SIZE;
    for (int64_t i = 0; i < 2 * PARTS; i++) {
        uint64_t inner = 0;
        if (!is_saved(&saved->memory, i))
            continue;
        if (size - end < sizeof inner)
            return "they are too few";
        memcpy(&inner, bytes + end, sizeof inner);
        end += sizeof inner;
        if (inner > size - end)
            return "they are too few";
        if (part_data[i % PARTS].functions->deserialize(c->parts[i % PARTS].component, bytes + end, (size_t)inner,
                                                        &saved->parts[i]) > fmi2Warning)
            return c->said;
        end += (size_t)inner;
    }
    return end == size ? NULL : "they are too many";
}

static const char *fault_of_bytes(const Instance *c, const Saved *read, const fmi2Byte bytes[], size_t size)
{
    const char *const fault = fault_of(c, read);
    if (fault)
        return fault;
    if (read->header.checksum != checksum_of(bytes, size))
        return "they are damaged";
    return plausible(&read->memory) ? NULL : "no run can reach such values";
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    ENTER("DeSerializeFMUstate", MAY_FMUstate)
    REQUIRE(bytes && state, "fmi2DeSerializeFMUstate: a pointer is null")
    REQUIRE(size >= SAVED_SIZE, "fmi2DeSerializeFMUstate: %u bytes were given, but a state of this FMU has more",
            (unsigned)size)
    Saved *const read = (Saved *)calloc(1, sizeof(Saved));
    REQUIRE(read, "fmi2DeSerializeFMUstate: out of memory")
    memcpy(read, bytes, SAVED_SIZE);
    const char *fault = fault_of_bytes(c, read, bytes, size);
    read->header.checksum = 0;
    if (!fault)
        fault = read_parts(c, read, bytes, size);
    if (fault) {
        report(c, fmi2Error, LOG_ERROR, "fmi2DeSerializeFMUstate: the bytes cannot be used: %s", fault);
        free_saved(c, read);
        return fmi2Error;
    }
    *state = read;
    return fmi2OK;
}

/* ---- Values of variables, and derivatives of inputs and outputs. */

static const char *const type_names[] = {"Real", "Integer", "Boolean"};

static bool known(fmi2ValueReference reference, int type)
{
    return reference < VARIABLES && variables[reference].type == type;
}

/* Give the contacts at rest v = 0 exactly, and those that stick the holding force of the last step. Between two ticks
   the loops are those at the start of the tick. */
static void keep_at_rest(Instance *c)
{
    for (int64_t k = 0; c->memory.inside && k < LINES; k++)
        if (c->memory.rests[k])
            stop_source(&c->engine, &c->lines[k]);
    for (int64_t j = 0; c->memory.inside && j < UNKNOWNS; j++)
        if (c->memory.holds[j])
            c->memory.signals[unknown_outputs[j]] = c->earlier[unknown_outputs[j]];
    if (c->memory.inside)
        return;
    const int64_t jumped = c->newton.jumped;
    for (int64_t g = 0; g < GROUPS; g++) {
        c->newton.jumped = c->memory.guards[g].jumped;
        set_at_rest(&c->engine, &c->newton, &group_data[g]);
    }
    c->newton.jumped = jumped;
}

/* Update the outputs that depend directly on an input or a parameter that was set since the last step. The engine keeps
   its values until the next step; outputs in algebraic loops and holding forces keep theirs, as FMI allows. */
static fmi2Status refresh_direct(Instance *c, const char *function)
{
    Engine *const e = &c->engine;
    double *const signals = c->memory.signals;
    if (c->refreshed || !c->memory.stale || MODE(c) != STEP_COMPLETE || START_LOOP)
        return fmi2OK;
    c->said[0] = '\0';
    REQUIRE(keep_all(c), "%s: a part cannot save its state: %s", function, c->said)
    memcpy(c->earlier, signals, sizeof c->memory.signals);
    for (int64_t k = 0; k < SIGNALS; k++)
        if (input_of_signal[k] >= 0)
            signals[k] = c->memory.inputs[input_of_signal[k]];
    int status = 0;
    const bool all = c->memory.stale == PARAMETER_SET;
    for (int64_t k = 0; k < (all ? PARTS : DIRECT) && status <= 1; k++) {
        const int64_t part = all ? start_order[k] : direct_parts[k];
        EnginePart *const p = &c->parts[part];
        if (!is_fmu(part))
            continue;
        if (!p->sampled)
            fetch_inputs(e, p);
        status = hand_over(p, signals);
        if (status <= 1)
            status = fetch_outputs(p, signals);
        keep_at_rest(c);
    }
    memcpy(c->shown, signals, sizeof c->memory.signals);
    memcpy(signals, c->earlier, sizeof c->memory.signals);
    if (status > 1)
        (void)roll_back_all(c);
    REQUIRE(status <= 1, "%s: a part rejects the values that were set: %s", function, c->said)
    c->refreshed = true;
    return fmi2OK;
}

/* Read a variable; *whole gets an Integer or Boolean, *real a Real. */
static fmi2Status read_variable(Instance *c, const Variable *v, double *real, int *whole)
{
    if (v->part >= 0 && v->signal < 0 && !v->is_input) {
        EnginePart *const p = &c->parts[v->part];
        return (fmi2Status)p->get[v->type](p->component, &v->reference, 1,
                                           v->type == REAL ? (void *)real : (void *)whole);
    }
    *real = v->is_input    ? c->memory.inputs[v->reference]
            : v->part < 0  ? NOW(c)
            : c->refreshed ? c->shown[v->signal]
                           : c->memory.signals[v->signal];
    *whole = v->type == REAL ? 0 : (int)*real;
    return fmi2OK;
}

static fmi2Status check_get(Instance *c, const fmi2ValueReference references[], size_t n, const void *values, int type)
{
    REQUIRE(n == 0 || (references && values), "fmi2Get%s: a pointer is null", type_names[type])
    for (size_t i = 0; i < n; i++)
        REQUIRE(known(references[i], type), "fmi2Get%s: there is no %s variable with value reference %u",
                type_names[type], type_names[type], references[i])
    return MODE(c) & (INITIALIZING | EXCHANGING) ? settle_or_return(c, "fmi2Get") : refresh_direct(c, "fmi2Get");
}

#define GET(TYPE, type, value_type, from)                                                                              \
    fmi2Status fmi2Get##TYPE(fmi2Component component, const fmi2ValueReference references[], size_t n,                 \
                             fmi2##TYPE values[])                                                                      \
    {                                                                                                                  \
        ENTER("Get" #TYPE, MAY_Get)                                                                                    \
        const fmi2Status status = check_get(c, references, n, values, type);                                           \
        if (status != fmi2OK)                                                                                          \
            return status;                                                                                             \
        c->said[0] = '\0';                                                                                             \
        for (size_t i = 0; i < n; i++) {                                                                               \
            double real = 0.0;                                                                                         \
            int whole = 0;                                                                                             \
            REQUIRE(read_variable(c, &variables[references[i]], &real, &whole) <= fmi2Warning, "fmi2Get" #TYPE ": %s", \
                    c->said)                                                                                           \
            values[i] = (value_type)from;                                                                              \
        }                                                                                                              \
        return fmi2OK;                                                                                                 \
    }
GET(Real, REAL, fmi2Real, real)
GET(Integer, INTEGER, fmi2Integer, whole)
GET(Boolean, BOOLEAN, fmi2Boolean, (whole ? fmi2True : fmi2False))

static fmi2Status check_set(Instance *c, fmi2ValueReference reference, double value, int type)
{
    REQUIRE(known(reference, type), "fmi2Set%s: there is no %s variable with value reference %u", type_names[type],
            type_names[type], reference)
    const Variable *const v = &variables[reference];
    const bool always = MODE(c) != CONTINUOUS_TIME || (v->is_input && type == REAL);
    REQUIRE((v->setting == SET_ALWAYS && always) || (v->setting == SET_EARLY && (MODE(c) & BEFORE_STEPPING)) ||
                (v->is_state && (MODE(c) & EXCHANGING)),
            "fmi2Set%s: %s cannot be set in the mode \"%s\"", type_names[type], v->name, mode_name(MODE(c)))
    if (v->finite && !isfinite(value))
        return report(c, fmi2Discard, LOG_DISCARD, "fmi2Set%s: %s = %g is not finite", type_names[type], v->name,
                      value);
    if (value < v->min || value > v->max)
        return report(c, fmi2Discard, LOG_DISCARD, "fmi2Set%s: %s = %g is outside [%g, %g]", type_names[type], v->name,
                      value, v->min, v->max);
    return fmi2OK;
}

/* Set a variable of a part or an input. */
static fmi2Status write_variable(Instance *c, const Variable *v, double real, int whole)
{
    if (v->is_input) {
        c->memory.inputs[v->reference] = real;
        return fmi2OK;
    }
    EnginePart *const p = &c->parts[v->part];
    return (fmi2Status)p->set[v->type](p->component, &v->reference, 1,
                                       v->type == REAL ? (void *)&real : (void *)&whole);
}

/* Set a variable of a part also in its state at the start of a tick that is divided. */
static bool write_at_tick(Instance *c, const Variable *v, double real, int whole)
{
    if (v->is_input || !c->memory.inside || !moves_inside(v->part))
        return true;
    EnginePart *const p = &c->parts[v->part];
    void **const tick = &c->ticks[c->memory.side][v->part], **const now = &c->backups[v->part];
    return p->get_state(p->component, now) <= 1 && p->set_state(p->component, *tick) <= 1 &&
           write_variable(c, v, real, whole) <= fmi2Warning && p->get_state(p->component, tick) <= 1 &&
           p->set_state(p->component, *now) <= 1;
}

/* All values are checked before the first one is written; if a part rejects one, all parts return to their state. */
#define SET(TYPE, type, as_double, as_whole)                                                                           \
    fmi2Status fmi2Set##TYPE(fmi2Component component, const fmi2ValueReference references[], size_t n,                 \
                             const fmi2##TYPE values[])                                                                \
    {                                                                                                                  \
        ENTER("Set" #TYPE, MAY_Set)                                                                                    \
        bool inner = false;                                                                                            \
        REQUIRE(n == 0 || (references && values), "fmi2Set" #TYPE ": a pointer is null")                               \
        for (size_t i = 0; i < n; i++) {                                                                               \
            const fmi2Status status = check_set(c, references[i], as_double, type);                                    \
            if (status != fmi2OK)                                                                                      \
                return status;                                                                                         \
            inner = inner || !variables[references[i]].is_input;                                                       \
        }                                                                                                              \
        c->said[0] = '\0';                                                                                             \
        REQUIRE(!inner || n == 1 || keep_all(c), "fmi2Set" #TYPE ": a part cannot save its state: %s", c->said)        \
        for (size_t i = 0; i < n; i++) {                                                                               \
            const Variable *const v = &variables[references[i]];                                                       \
            const fmi2Status status = write_variable(c, v, as_double, as_whole);                                       \
            if (status <= fmi2Warning)                                                                                 \
                continue;                                                                                              \
            REQUIRE(n == 1 || roll_back_all(c), "fmi2Set" #TYPE ": a part cannot return to its state: %s", c->said)    \
            return report(c, status, status == fmi2Discard ? LOG_DISCARD : LOG_ERROR, "fmi2Set" #TYPE ": %s: %s",      \
                          v->name, c->said);                                                                           \
        }                                                                                                              \
        for (size_t i = 0; i < n; i++)                                                                                 \
            REQUIRE(write_at_tick(c, &variables[references[i]], as_double, as_whole), "fmi2Set" #TYPE ": %s", c->said) \
        c->refreshed = false;                                                                                          \
        if (n > 0)                                                                                                     \
            set_stale(&c->memory, inner ? PARAMETER_SET : INPUT_SET);                                                  \
        return fmi2OK;                                                                                                 \
    }
SET(Real, REAL, values[i], 0)
SET(Integer, INTEGER, (double)values[i], values[i])
SET(Boolean, BOOLEAN, (double)(values[i] != fmi2False), values[i])

/* ---- derivatives -------------------------------------------------------------------------------------------- */

static const char *name_of(const Instance *c, fmi2ValueReference reference)
{
    (void)c;
    return variables[reference].name;
}

static fmi2Status check_derivatives(const Instance *c, const char *function, bool of_inputs,
                                    const fmi2ValueReference references[], size_t n, const fmi2Integer orders[],
                                    const fmi2Real values[])
{
    REQUIRE(n == 0 || (references && orders && values), "%s: a pointer is null", function)
    for (size_t i = 0; i < n; i++) {
        const Variable *const v = references[i] < VARIABLES ? &variables[references[i]] : NULL;
        REQUIRE(v && v->type == REAL && (of_inputs ? v->is_input : v->is_output),
                "%s: value reference %u is not a Real %s", function, references[i], of_inputs ? "input" : "output")
        REQUIRE(orders[i] == 1, "%s: order %d of %s is not supported, only order 1", function, orders[i], v->name)
    }
    return fmi2OK;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t n,
                                       const fmi2Integer orders[], const fmi2Real values[])
{
    ENTER_AS(fmi2CoSimulation, "SetRealInputDerivatives", MAY_SetRealInputDerivatives)
    if (check_derivatives(c, "fmi2SetRealInputDerivatives", true, references, n, orders, values) != fmi2OK)
        return fmi2Error;
    if (!slopes_are_finite(c, references, n, values))
        return fmi2Discard;
    Memory *const m = &c->memory;
    if (m->slopes_used)
        memset(m->slopes, 0, sizeof m->slopes);
    m->slopes_used = false;
    for (size_t i = 0; i < n; i++)
        m->slopes[variables[references[i]].reference] = values[i];
    return fmi2OK;
}

/* Each part computes the time derivatives of its outputs; those of a recorded table are 0. */
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t n,
                                        const fmi2Integer orders[], fmi2Real values[])
{
    ENTER_AS(fmi2CoSimulation, "GetRealOutputDerivatives", MAY_GetRealOutputDerivatives)
    const fmi2Status status =
        check_derivatives(c, "fmi2GetRealOutputDerivatives", false, references, n, orders, values);
    if (status != fmi2OK)
        return status;
    c->said[0] = '\0';
    for (int pass = 0; pass < 2; pass++) /* the second one writes, as a refused call must not */
        for (size_t i = 0; i < n; i++) {
            const Variable *const v = &variables[references[i]];
            const PartFunctions *const f = part_data[v->part].functions;
            fmi2Real value = 0.0;
            REQUIRE(!f || f->get_derivatives(c->parts[v->part].component, &v->reference, 1, &orders[i], &value) <=
                              fmi2Warning,
                    "fmi2GetRealOutputDerivatives: %s: %s", v->name, c->said)
            if (pass == 1)
                values[i] = value;
        }
    return fmi2OK;
}

/* ---- Steps. The engine advances from tick to tick, at start + k STEP_SIZE; sampled parts take their samples at ticks
   only. A step that ends between two ticks computes the values there and keeps the state at the start of the tick, from
   which the next step repeats the tick. So the result does not depend on the communication points, and pieces of very
   unequal lengths, which amplify the errors of light masses, do not occur. Only an input that jumps within a tick
   divides it there. */

enum { MOST_TICKS = 100000000 };

/* Return the difference of times that is rounding. */
static double tick_slack(const Memory *m)
{
    return fmin(1e-6 * STEP_SIZE + time_rounding(m->time, m->start), 0.25 * STEP_SIZE);
}

static void read_inputs(Instance *c, double t)
{
    if (INPUT_PART < 0)
        return;
    const int64_t part = INPUT_PART < 0 ? 0 : INPUT_PART;
    c->memory.sources[c->places[part].source] = t;
    (void)fetch_outputs(&c->parts[part], c->memory.signals);
}

/* Let the span of the engine be the rest of the tick, after the last jump of an input in it. */
static void span_rest(Instance *c)
{
    Engine *const e = &c->engine;
    span_tick(e, c->memory.tick);
    e->time += c->memory.solved;
    e->length -= c->memory.solved;
}

/* Keep the start of a span. */
static bool keep_span(Instance *c)
{
    Memory *const m = &c->memory;
    const double start = c->engine.time;
    m->side = !m->side;
    for (int64_t i = 0; i < PARTS; i++)
        if (moves_inside(i) && save_to(&c->parts[i], &c->ticks[m->side][i]) > 1)
            return failed(&c->engine, i, SAVE, 2, m->time);
    memcpy(m->begun_signals, m->signals, sizeof m->signals);
    for (int i = 0; i < INPUTS; i++) {
        m->rate[i] = m->slopes[i];
        m->base[i] = m->inputs[i] + (m->rate[i] == 0.0 ? 0.0 : m->rate[i] * (start - m->begun));
    }
    return true;
}

/* Return whether an input no longer follows its line from the start of the span. */
static bool inputs_jump(const Instance *c)
{
    const Memory *const m = &c->memory;
    for (int i = 0; i < INPUTS; i++) {
        const double jump = m->inputs[i] - (m->base[i] + m->rate[i] * (m->spent - m->solved));
        if (m->rate[i] != m->slopes[i] || fabs(jump) > 1e-12 * fabs(m->rate[i]) * STEP_SIZE)
            return true;
    }
    return false;
}

/* Return to the start of the span. Sampled parts have acted there. */
static bool return_to_span(Instance *c)
{
    Memory *const m = &c->memory;
    for (int64_t i = 0; i < PARTS; i++)
        if (moves_inside(i) && restore_from(&c->parts[i], c->ticks[m->side][i]) > 1)
            return failed(&c->engine, i, RESTORE, 2, m->time);
    memcpy(m->signals, m->begun_signals, sizeof m->signals);
    m->begun = c->engine.time;
    read_inputs(c, m->begun);
    return true;
}

/* Let the memory be that at the start of the tick, but for what sampled parts and delays have done there. */
static void remember_tick(Instance *c)
{
    Memory *const m = &c->memory, *const start = &c->tick;
    memcpy(start->past, m->past, sizeof m->past);
    memcpy(start->gains, m->gains, sizeof m->gains);
    memcpy(start->offsets, m->offsets, sizeof m->offsets);
    memcpy(start->rests, m->rests, sizeof m->rests);
    memcpy(start->holds, m->holds, sizeof m->holds);
    for (int64_t i = 0; i < PARTS; i++)
        for (int64_t k = part_data[i].outputs[REAL]; part_data[i].sampled && k < part_data[i].outputs[TYPES]; k++)
            start->begun_signals[k] = m->signals[k];
    *m = *start;
    m->inside = true;
}

/* Find the contacts that are at rest, and the unknowns of loops that are holding forces, which the friction at v = 0
   does not give. */
static void find_resting(Instance *c)
{
    Memory *const m = &c->memory;
    for (int64_t k = 0; k < LINES; k++)
        m->rests[k] = is_rest(&m->moving[k]);
    for (const Group *g = group_data; g < group_data + GROUPS; g++) {
        const Contact *const first = contacts_of(&c->newton, g), *const last = first + g->contacts;
        bool rests = false;
        for (const Contact *k = first; k < last; k++)
            rests = rests || m->rests[k->line];
        for (int64_t j = g->unknown; j < g->unknown + g->unknowns; j++)
            m->holds[j] = m->guards[g - group_data].jumped && !rests;
        for (const Contact *k = first; k < last; k++)
            m->holds[k->unknown] = m->holds[k->unknown] || m->moving[k->line].role == IN_JUMP;
    }
}

/* Move the parts over a part of the tick on the lines that solve the whole tick. A contact that rests in the whole tick
   has v = 0 exactly. */
static bool move_on_lines(Instance *c, double length)
{
    Engine *const e = &c->engine;
    for (int64_t k = 0; k < PARTS; k++) {
        const int64_t part = part_order[k];
        EnginePart *const p = &e->parts[part];
        if (p->sampled || p->every > 1)
            continue;
        fetch_inputs(e, p);
        for (int64_t i = lines_from[part]; i < lines_from[part + 1]; i++) {
            Line *const l = &e->lines[i];
            const double begin = 2.0 * l->mean - l->end, end = begin + (l->end - begin) * (length / e->length);
            l->mean = 0.5 * (begin + end);
            l->end = c->memory.moving[i].unknown < 0 ? arriving(e, l->input) : end; /* of a part that has moved */
            if (c->memory.rests[i]) {
                l->mean = l->end = 0.0;
                stop_source(e, l);
            }
        }
        int status = step_on_lines(e, part, e->time, length);
        if (status <= 1)
            status = fetch_outputs(p, e->signals);
        if (status > 1)
            return failed(e, part, STEP, status, e->time);
    }
    for (int64_t j = 0; j < UNKNOWNS; j++)
        if (c->memory.holds[j])
            e->signals[unknown_outputs[j]] = c->newton.w[j];
    return true;
}

#define STIFF 0.1 /* diagonal of the inverse Jacobian of a loop that returns ten times a change */

/* Return whether a change of a value comes back to it many times as large: between the ends of the tick, the forces on
   a light mass differ little on their lines, but its velocity much. */
static bool is_stiff(const Newton *n)
{
    for (int64_t g = 0; g < GROUPS; g++)
        for (int64_t j = 0; group_data[g].is_loop && j < group_data[g].unknowns; j++) {
            const double slope = n->inverse[g * n->most_unknowns * n->most_unknowns + j * (group_data[g].unknowns + 1)];
            if (slope < 0.0 && slope > -STIFF)
                return true;
        }
    return false;
}

/* Compute the values within a tick and remember its start. The loop of a part of a tick may have other solutions,
   which are not those that the whole tick passes through. */
static bool divide_span(Instance *c, double length)
{
    Engine *const e = &c->engine;
    Memory *const m = &c->memory;
    int64_t loops = 0;
    for (int64_t g = 0; g < GROUPS; g++)
        loops += group_data[g].is_loop;
    const int64_t spans = c->newton.substeps + loops;
    c->tick = *m;
    const bool whole = advance(e, m->tick) && c->newton.substeps == spans;
    find_resting(c);
    for (int64_t k = 0; k < LINES; k++)
        m->rests[k] = m->rests[k] && c->tick.moving[k].u0 == 0.0; /* in the whole tick */
    remember_tick(c);
    if (!return_to_span(c))
        return false;
    if (whole && !is_stiff(&c->newton))
        return move_on_lines(c, length);
    c->tick = *m;
    e->status = 0;
    e->begins = false;
    e->length = length;
    const bool done = advance(e, m->tick);
    find_resting(c);
    memcpy(c->tick.signals, m->signals, sizeof m->signals);
    memcpy(c->tick.rests, m->rests, sizeof m->rests);
    memcpy(c->tick.holds, m->holds, sizeof m->holds);
    *m = c->tick;
    return done;
}

/* Advance over a part of a tick. That a short one agrees with its halves is no evidence for a whole tick, and limits of
   the inner steps are counted in ticks. */
static bool advance_part(Instance *c)
{
    Memory *const m = &c->memory;
    const bool brief = c->engine.length < 0.5 * STEP_SIZE;
    memcpy(c->tick.guards, m->guards, sizeof m->guards);
    if (!advance(&c->engine, m->tick))
        return false;
    for (int64_t g = 0; g < GROUPS; g++) {
        StepCheck *const now = &m->guards[g], *const before = &c->tick.guards[g];
        if (brief && now->checks_due < before->checks_due)
            now->checks_due = before->checks_due;
        if (brief && now->next > before->next) {
            now->cooldown = before->cooldown;
            now->next = before->next;
        }
        if (!c->engine.ends && now->limited_ticks < before->limited_ticks)
            now->limited_ticks = before->limited_ticks;
    }
    return true;
}

/* Solve the span up to now; the rest of the tick is the next one. */
static bool end_span(Instance *c)
{
    Engine *const e = &c->engine;
    Memory *const m = &c->memory;
    const double begun = m->begun;
    span_rest(c);
    e->length = m->spent - m->solved;
    e->begins = e->ends = false;
    if (!return_to_span(c) || !advance_part(c))
        return false;
    m->solved = m->spent;
    m->inside = false;
    m->begun = begun;
    read_inputs(c, begun);
    return true;
}

/* Advance by this time. */
static bool advance_by(Instance *c, double h)
{
    Engine *const e = &c->engine;
    Memory *const m = &c->memory;
    const double slack = tick_slack(m);
    for (double left = h;;) {
        if (m->inside && inputs_jump(c) && !end_span(c))
            return false;
        const double rest = STEP_SIZE - m->spent, begun = m->begun, length = m->spent + left - m->solved;
        const bool whole = rest <= left + slack, again = m->inside;
        if (!whole && !again && length <= slack) {
            m->spent += left;
            return true;
        }
        span_rest(c);
        if (!(again ? return_to_span(c) : whole || keep_span(c)))
            return false;
        e->begins = !again && m->solved == 0.0;
        e->ends = whole;
        if (!(!whole ? divide_span(c, length) : m->solved > 0.0 ? advance_part(c) : advance(e, m->tick)))
            return false;
        if (!whole) {
            m->spent += left;
            return true;
        }
        m->tick++;
        m->inside = false;
        m->spent = fmin(left - rest, 0.0);
        m->solved = 0.0;
        left = fmax(left - rest, 0.0);
        m->begun = begun;
        if (again)
            read_inputs(c, time_of(e, m->tick));
    }
}

/* Warn once if a loop is too fast for the step: as soon as the checks of a loop have ended without success; at the end
   of the run (`last`) also of smaller errors that remain. */
static void warn_of_errors(Instance *c, bool last)
{
    const Memory *const m = &c->memory;
    for (int64_t g = 0; g < GROUPS && !c->told; g++) {
        const StepCheck *const guard = &m->guards[g];
        int64_t worst = guard->line;
        double error = guard->abandoned ? ABANDONED : 0.0;
        for (int64_t i = group_data[g].line; i < group_data[g].line + group_data[g].lines && last; i++)
            if (remaining_error(&m->moving[group_lines[i]]) > error) {
                worst = group_lines[i];
                error = remaining_error(&m->moving[worst]);
            }
        if (!(error > UNRESOLVED))
            continue;
        c->told = c->warning = true;
        report(c, fmi2Warning, LOG_WARNING,
               "%s changes too fast for the step of %g s from t = %.6g s on: errors of %.2g of its size remain: the "
               "result is wrong; compose the system with a shorter step",
               line_names[worst], STEP_SIZE, guard->time, error);
    }
}

/* Update the outputs of the parts if a parameter was set; before the first step also what the iteration begins with. */
static bool take_parameters(Instance *c)
{
    Memory *const m = &c->memory;
    if (m->stale != PARAMETER_SET)
        return true;
    if (refresh_direct(c, "fmi2DoStep") != fmi2OK || (START_LOOP && !fetch_all(c)))
        return false;
    if (!START_LOOP)
        memcpy(m->signals, c->shown, sizeof m->signals);
    if (m->tick == 0 && !m->inside)
        newton_begin(&c->engine, &c->newton);
    return true;
}

static fmi2Status refuse_step(Instance *c, double t, double h)
{
    const Engine e = c->engine;
    fmi2Boolean ended = fmi2False;
    if (e.status == fmi2Discard && e.failed_operation == STEP && is_fmu(e.failed_part))
        (void)part_data[e.failed_part].functions->get_status(c->parts[e.failed_part].component, fmi2Terminated, &ended);
    c->ended = ended != fmi2False;
    const bool restored = roll_back_all(c);
    c->refreshed = false;
    MODE(c) = STEP_FAILED;
    REQUIRE(restored, "fmi2DoStep: a part cannot return to the start of the step at t = %g s: %s", t, c->said)
    if (c->ended)
        return report(c, fmi2Discard, LOG_DISCARD, "fmi2DoStep: %s ended the simulation in the step from t = %.12g s",
                      part_data[e.failed_part].name, e.failed_time);
    if (e.status == NOT_CONVERGED)
        return report(
            c, fmi2Discard, LOG_DISCARD,
            "fmi2DoStep: the loop %s does not converge at t = %.12g s, even with a millionth of the step; the "
            "state at the start of the step is kept",
            loop_names[e.failed_part], e.failed_time);
    if (e.status == NOT_WHOLE)
        return report(c, fmi2Discard, LOG_DISCARD,
                      "fmi2DoStep: an Integer input of %s gets a value that is not whole at t = %.12g s",
                      part_data[e.failed_part].name, e.failed_time);
    if (e.status > 1)
        return report(c, fmi2Discard, LOG_DISCARD, "fmi2DoStep: %s failed at t = %.12g s: %s",
                      part_data[e.failed_part].name, e.failed_time, c->said);
    return report(c, fmi2Discard, LOG_DISCARD,
                  "fmi2DoStep: the step from %.17g s over %g s leads to an output that is not finite; the state at its "
                  "start is kept",
                  t, h);
}

fmi2Status fmi2Terminate(fmi2Component component)
{
    ENTER("Terminate", MAY_Terminate)
    if (MODE(c) & EXCHANGING)
        (void)settle_or_return(c, "fmi2Terminate"); /* a terminated part takes no inputs; its values can be read */
    ALL_PARTS("fmi2Terminate", f->terminate(p))
    warn_of_errors(c, true);
    MODE(c) = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real t, fmi2Real h, fmi2Boolean keeps_no_state)
{
    (void)keeps_no_state;
    ENTER_AS(fmi2CoSimulation, "DoStep", MAY_DoStep)
    Memory *const m = &c->memory;
    Engine *const e = &c->engine;
    /* The time of the master applies; it may differ by rounding, or by the error of a master that sums steps. */
    const double slack = 1e-6 * h + 1e-12 * (fabs(t) + fabs(m->start)) + 1e-12;
    REQUIRE(fabs(t) < INFINITY && h > 0.0 && h < INFINITY,
            "fmi2DoStep: step size %g at t = %g s must be positive and finite", h, t)
    REQUIRE(fabs(t - m->time) <= slack, "fmi2DoStep: communication point %.17g s is not the current time %.17g s", t,
            m->time)
    REQUIRE(t + h <= m->stop + slack + m->drift, "fmi2DoStep: the step to %.17g s exceeds the stop time %.17g s", t + h,
            m->stop)

    c->said[0] = '\0';
    c->warning = c->ended = false;
    e->status = 0;
    if (h > (double)MOST_TICKS * STEP_SIZE) {
        MODE(c) = STEP_FAILED;
        return report(c, fmi2Discard, LOG_DISCARD,
                      "fmi2DoStep: a step of %g s has more than %d inner steps of %g s; use shorter steps", h,
                      (int)MOST_TICKS, STEP_SIZE);
    }
    REQUIRE(keep_all(c), "fmi2DoStep: a part cannot save its state: %s", c->said)
    if (!take_parameters(c))
        return refuse_step(c, t, h);
    if (m->slopes_used)
        memset(m->slopes, 0, sizeof m->slopes);
    e->start = m->start;
    const double spent = t - time_of(e, m->tick); /* the time of the importer, unless it is a sum with its rounding */
    if (!(fabs(spent - m->spent) <= m->drift + time_rounding(t, m->start)))
        m->spent = spent;
    m->begun = time_of(e, m->tick) + m->spent;
    if (!m->inside)
        read_inputs(c, m->begun);
    if (!advance_by(c, h) || !outputs_finite(c))
        return refuse_step(c, t, h);
    for (int i = 0; i < INPUTS; i++)
        if (m->slopes[i] != 0.0)
            m->inputs[i] += m->slopes[i] * h;
    m->time = t + h;
    m->drift += DBL_EPSILON * fabs(m->time);
    m->slopes_used = true;
    m->stale = 0;
    c->refreshed = false;
    warn_of_errors(c, false);
    return c->warning ? fmi2Warning : fmi2OK;
}

/* ---- Directional derivatives, by the chain rule through the connections: each part gives its own. In an algebraic
   loop, the derivatives dw of its root values solve dw = G_w dw + G_u du. */

/* A request, with room for the knowns of one part. */
typedef struct {
    const fmi2ValueReference *knowns;
    const fmi2Real *seed;
    size_t n_knowns;
    double *d; /* derivatives of all signals */
    fmi2ValueReference *references;
    double *seeds;
} Direction;

/* Compute derivatives of Real outputs of a part for the derivatives of its inputs and for its own seeded variables. */
static bool differentiate_part(Instance *c, const Direction *q, int64_t part, const fmi2ValueReference *unknowns,
                               size_t n, double *result)
{
    const EnginePart *const p = &c->parts[part];
    size_t count = 0;
    memset(result, 0, n * sizeof(double));
    for (int64_t k = p->inputs[REAL]; k < p->inputs[INTEGER]; k++) {
        const double gain = MAPPED > 0 ? c->memory.gains[k] : 1.0; /* 0 for a delayed value */
        const double seed = gain * q->d[source_of[k]];
        if (seed == 0.0)
            continue;
        q->references[count] = p->input_references[k - p->inputs[REAL]];
        q->seeds[count++] = seed;
    }
    for (size_t i = 0; i < q->n_knowns; i++) {
        const Variable *const v = &variables[q->knowns[i]];
        if (v->is_input || v->part != part || q->seed[i] == 0.0)
            continue;
        q->references[count] = v->reference;
        q->seeds[count++] = q->seed[i];
    }
    return count == 0 || n == 0 ||
           part_data[part].functions->get_directional(p->component, unknowns, n, q->references, count, q->seeds,
                                                      result) <= fmi2Warning;
}

/* Pass the derivatives through all parts until they stay; after the start, a sampled part holds its outputs. A loop
   needs one sweep, as the values that close it are given. */
static bool sweep_derivatives(Instance *c, const Direction *q)
{
    for (int64_t sweep = 0; sweep < (START_LOOP ? 1 : PARTS + 1); sweep++) {
        memcpy(c->earlier, q->d, SIGNALS * sizeof(double));
        for (int64_t k = 0; k < PARTS; k++) {
            const int64_t part = start_order[k];
            const EnginePart *const p = &c->parts[part];
            if (is_fmu(part) && (!p->sampled || MODE(c) == INITIALIZING) &&
                !differentiate_part(c, q, part, p->output_references, (size_t)count_of(p->outputs, REAL),
                                    q->d + p->outputs[REAL]))
                return false;
        }
        if (memcmp(c->earlier, q->d, SIGNALS * sizeof(double)) == 0)
            break;
    }
    return true;
}

/* Return the derivatives of all signals in q->d. */
static bool differentiate_signals(Instance *c, const Direction *q)
{
    double *const jacobian = c->start_work, *const inverse = jacobian + ROOTS * ROOTS,
                  *const g = inverse + ROOTS * ROOTS;
    const Direction none = {NULL, NULL, 0, q->d, q->references, q->seeds};
    for (int64_t j = 0; START_LOOP && j < ROOTS; j++) { /* columns of 1 - G_w */
        memset(q->d, 0, SIGNALS * sizeof(double));
        q->d[root_signals[j]] = 1.0;
        if (!sweep_derivatives(c, &none))
            return false;
        for (int64_t i = 0; i < ROOTS; i++)
            jacobian[i * ROOTS + j] = (double)(i == j) - q->d[root_signals[i]];
    }
    for (int pass = 0; pass < 2; pass++) { /* G_u du with dw = 0, then with the solution */
        memset(q->d, 0, SIGNALS * sizeof(double));
        for (int64_t k = 0; k < SIGNALS; k++)
            for (size_t i = 0; i < q->n_knowns && input_of_signal[k] >= 0; i++)
                if (variables[q->knowns[i]].is_input &&
                    variables[q->knowns[i]].reference == (uint32_t)input_of_signal[k])
                    q->d[k] += q->seed[i];
        for (int64_t i = 0; START_LOOP && pass == 1 && i < ROOTS; i++)
            for (int64_t j = 0; j < ROOTS; j++)
                q->d[root_signals[i]] += inverse[i * ROOTS + j] * g[j];
        if (!sweep_derivatives(c, q))
            return false;
        if (!START_LOOP)
            break;
        for (int64_t i = 0; pass == 0 && i < ROOTS; i++)
            g[i] = q->d[root_signals[i]];
        if (pass == 0)
            invert(jacobian, inverse, ROOTS);
    }
    return true;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component component, const fmi2ValueReference unknowns[], size_t n_unknowns,
                                        const fmi2ValueReference knowns[], size_t n_knowns, const fmi2Real seed[],
                                        fmi2Real result[])
{
    ENTER("GetDirectionalDerivative", MAY_GetDirectionalDerivative)
    REQUIRE((n_unknowns == 0 || (unknowns && result)) && (n_knowns == 0 || (knowns && seed)),
            "fmi2GetDirectionalDerivative: a pointer is null")
    REQUIRE(PROVIDES_DERIVATIVES, "fmi2GetDirectionalDerivative: a part of %s provides no directional derivatives",
            QUOTE(MODEL))
    for (size_t i = 0; i < n_unknowns; i++) {
        const Variable *const v = unknowns[i] < VARIABLES ? &variables[unknowns[i]] : NULL;
        REQUIRE(v && v->type == REAL && v->part >= 0 && !v->is_input && (v->setting == SET_NEVER || v->is_state),
                "fmi2GetDirectionalDerivative: value reference %u is not an output", unknowns[i])
    }
    for (size_t i = 0; i < n_knowns; i++) {
        const Variable *const v = knowns[i] < VARIABLES ? &variables[knowns[i]] : NULL;
        REQUIRE(v && v->type == REAL &&
                    (v->is_input || v->is_state || (v->setting != SET_NEVER && MODE(c) == INITIALIZING)),
                "fmi2GetDirectionalDerivative: value reference %u is not an input, state or, in initialization mode, a "
                "parameter",
                knowns[i])
        REQUIRE(isfinite(seed[i]), "fmi2GetDirectionalDerivative: seed %d is not finite", (int)i)
    }
    const bool fresh = c->refreshed || !c->memory.stale;
    const fmi2Status status = check_get(c, NULL, 0, NULL, REAL);
    if (status != fmi2OK)
        return status;
    double *const room = (double *)calloc(2 * (SIGNALS + 1) + n_knowns + n_unknowns, sizeof(double));
    fmi2ValueReference *const references = (fmi2ValueReference *)calloc(SIGNALS + 1 + n_knowns, sizeof *references);
    double *const found = room ? room + 2 * (SIGNALS + 1) + n_knowns : NULL;
    const Direction q = {knowns, seed, n_knowns, room, references, room ? room + SIGNALS + 1 : NULL};
    c->said[0] = '\0';
    bool good = room && references && differentiate_signals(c, &q);
    for (size_t i = 0; i < n_unknowns && good; i++) {
        const Variable *const v = &variables[unknowns[i]];
        const bool held = MODE(c) != INITIALIZING && c->parts[v->part].sampled;
        if (v->signal >= 0)
            found[i] = q.d[v->signal];
        else if (is_fmu(v->part) && !held)
            good = differentiate_part(c, &q, v->part, &v->reference, 1, &found[i]);
        good = good && isfinite(found[i]);
    }
    for (size_t i = 0; i < n_unknowns && good; i++)
        result[i] = found[i];
    free(room);
    free(references);
    if (!good && !fresh) { /* as before the values were computed */
        (void)roll_back_all(c);
        c->refreshed = false;
    }
    REQUIRE(good, "fmi2GetDirectionalDerivative: a derivative is not finite: %s", c->said)
    return fmi2OK;
}

#if MODEL_EXCHANGE

/* ---- Model exchange (FMI 2.0, chapter 3): the states and event indicators of the parts side by side, their
   connections solved, their events merged. */

enum { MOST_SWEEPS = 2 * PARTS + 8 }; /* of one event */

/* ---- modes -------------------------------------------------------------------------------------------------- */

#define ALL_EXCHANGE(function, call)                                                                                   \
    c->said[0] = '\0';                                                                                                 \
    for (int64_t i = 0; i < PARTS; i++) {                                                                              \
        const ExchangeFunctions *const f = part_data[i].exchange;                                                      \
        const fmi2Component p = c->parts[i].component;                                                                 \
        REQUIRE(!f || (call) <= fmi2Warning, "%s: %s failed: %s", function, part_data[i].name, c->said)                \
    }

fmi2Status fmi2EnterEventMode(fmi2Component component)
{
    ENTER_AS(fmi2ModelExchange, "EnterEventMode", MAY_EnterEventMode)
    ALL_EXCHANGE("fmi2EnterEventMode", f->enter_event(p))
    MODE(c) = EVENT_MODE;
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component component)
{
    ENTER_AS(fmi2ModelExchange, "EnterContinuousTimeMode", MAY_EnterContinuousTimeMode)
    ALL_EXCHANGE("fmi2EnterContinuousTimeMode", f->enter_continuous(p))
    MODE(c) = CONTINUOUS_TIME;
    return fmi2OK;
}

/* Take the row of a record that applies from now on; the next one is an event, and the last one ends the simulation. */
static void choose_row(Instance *c, int64_t part, fmi2EventInfo *info)
{
    const Series *const series = part_data[part].series;
    int64_t *const row = &c->memory.rows[c->places[part].source];
    if (!series)
        return;
    *row = row_at(series, NOW(c));
    if (*row < series->rows - 1) {
        info->nextEventTimeDefined = fmi2True;
        info->nextEventTime = series->times[*row + 1];
    } else
        info->terminateSimulation = series->reach < INFINITY ? fmi2True : fmi2False;
}

/* Let all parts act once, in the order in which they step, and merge what they report; return the status. */
static int update_parts(Instance *c, fmi2EventInfo *info)
{
    Engine *const e = &c->engine;
    memset(info, 0, sizeof *info);
    for (int64_t k = 0; k < PARTS; k++) {
        const int64_t part = part_order[k];
        EnginePart *const p = &e->parts[part];
        fmi2EventInfo own = {0};
        e->failed_part = part;
        int status = 0;
        fetch_inputs(e, p);
        if (!is_fmu(part))
            choose_row(c, part, &own);
        else if ((status = hand_over(p, e->signals)) <= 1)
            status = (int)part_data[part].exchange->new_discrete_states(p->component, &own);
        if (status <= 1)
            status = fetch_outputs(p, e->signals);
        if (status > 1)
            return status;
        info->newDiscreteStatesNeeded |= own.newDiscreteStatesNeeded;
        info->terminateSimulation |= own.terminateSimulation;
        info->nominalsOfContinuousStatesChanged |= own.nominalsOfContinuousStatesChanged;
        info->valuesOfContinuousStatesChanged |= own.valuesOfContinuousStatesChanged;
        if (own.nextEventTimeDefined && (!info->nextEventTimeDefined || own.nextEventTime < info->nextEventTime)) {
            info->nextEventTimeDefined = fmi2True;
            info->nextEventTime = own.nextEventTime;
        }
    }
    return 0;
}

/* The event of one part may cause that of another: repeat until no connection changes. */
static fmi2Status update_all(Instance *c, fmi2EventInfo *info)
{
    Memory *const m = &c->memory;
    fmi2Status status = settle(c, "fmi2NewDiscreteStates");
    bool jumped = false, scaled = false;
    for (int tries = 0; status == fmi2OK && tries < MOST_SWEEPS; tries++) {
        memcpy(c->shown, m->signals, sizeof m->signals);
        REQUIRE(update_parts(c, info) <= 1, "fmi2NewDiscreteStates: %s failed: %s",
                part_data[c->engine.failed_part].name, c->said)
        m->stale = INPUT_SET;
        status = settle(c, "fmi2NewDiscreteStates");
        jumped = jumped || info->valuesOfContinuousStatesChanged;
        scaled = scaled || info->nominalsOfContinuousStatesChanged;
        if (!info->newDiscreteStatesNeeded && memcmp(c->shown, m->signals, sizeof m->signals) == 0) {
            info->valuesOfContinuousStatesChanged = jumped ? fmi2True : fmi2False;
            info->nominalsOfContinuousStatesChanged = scaled ? fmi2True : fmi2False;
            return fmi2OK;
        }
    }
    REQUIRE(status != fmi2OK, "fmi2NewDiscreteStates: at t = %.12g s the parts cause events of each other without end",
            NOW(c))
    return status;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *info)
{
    ENTER_AS(fmi2ModelExchange, "NewDiscreteStates", MAY_NewDiscreteStates)
    REQUIRE(info, "fmi2NewDiscreteStates: the pointer to the event information is null")
    REQUIRE(keep_all(c), "fmi2NewDiscreteStates: a part cannot save its state: %s", c->said)
    c->said[0] = '\0';
    c->warning = false;
    fmi2EventInfo found = {0};
    const fmi2Status status = update_all(c, &found);
    if (status != fmi2OK) {
        (void)roll_back_all(c);
        return status;
    }
    *info = found;
    return c->warning ? fmi2Warning : fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component component, fmi2Boolean keeps_no_state, fmi2Boolean *event,
                                       fmi2Boolean *terminate)
{
    ENTER_AS(fmi2ModelExchange, "CompletedIntegratorStep", MAY_CompletedIntegratorStep)
    REQUIRE(event && terminate, "fmi2CompletedIntegratorStep: a pointer is null")
    const fmi2Status status = settle_or_return(c, "fmi2CompletedIntegratorStep");
    if (status != fmi2OK)
        return status;
    fmi2Boolean events = fmi2False, ends = fmi2False, own_event = fmi2False, own_end = fmi2False;
    ALL_EXCHANGE("fmi2CompletedIntegratorStep",
                 (events |= own_event, ends |= own_end, f->completed(p, keeps_no_state, &own_event, &own_end)))
    *event = events | own_event;
    *terminate = ends | own_end;
    return fmi2OK;
}

/* ---- values ------------------------------------------------------------------------------------------------- */

fmi2Status fmi2SetTime(fmi2Component component, fmi2Real t)
{
    ENTER_AS(fmi2ModelExchange, "SetTime", MAY_SetTime)
    REQUIRE(isfinite(t), "fmi2SetTime: time %g must be finite", t)
    ALL_EXCHANGE("fmi2SetTime", f->set_time(p, t))
    Memory *const m = &c->memory;
    m->time = t;
    for (int i = 0; i <= SOURCES; i++)
        m->sources[i] = t;
    set_stale(m, INPUT_SET);
    return fmi2OK;
}

fmi2Status fmi2SetContinuousStates(fmi2Component component, const fmi2Real states[], size_t n)
{
    ENTER_AS(fmi2ModelExchange, "SetContinuousStates", MAY_SetContinuousStates)
    REQUIRE_STATES(states, n, STATES)
    const fmi2Real *from = states;
    ALL_EXCHANGE("fmi2SetContinuousStates",
                 (from += part_data[i].states, f->set_states(p, from - part_data[i].states, part_data[i].states)))
    set_stale(&c->memory, INPUT_SET);
    return fmi2OK;
}

/* Gather a vector from the parts, whose inputs settle first if it `depends` on them. All of its values are read before
   the first one is returned. */
#define GATHER(function, member, count, total, what, depends)                                                          \
    fmi2Status fmi2##function(fmi2Component component, fmi2Real values[], size_t n)                                    \
    {                                                                                                                  \
        ENTER_AS(fmi2ModelExchange, #function, MAY_##function)                                                         \
        REQUIRE_VECTOR(#function, values, n, total, what)                                                              \
        const fmi2Status status = depends ? settle_or_return(c, "fmi2" #function) : fmi2OK;                            \
        if (status != fmi2OK)                                                                                          \
            return status;                                                                                             \
        double found[(total) + 1], *to = found;                                                                        \
        ALL_EXCHANGE("fmi2" #function,                                                                                 \
                     (to += part_data[i].count, f->member(p, to - part_data[i].count, part_data[i].count)))            \
        if (n > 0)                                                                                                     \
            memcpy(values, found, n * sizeof(double));                                                                 \
        return fmi2OK;                                                                                                 \
    }
enum {
    MAY_GetContinuousStates = MAY_GetContinuous,
    MAY_GetDerivatives = MAY_GetContinuous,
    MAY_GetEventIndicators = MAY_GetContinuous,
    MAY_GetNominalsOfContinuousStates = ANY_MODE
};
GATHER(GetContinuousStates, get_states, states, STATES, "states", true)
GATHER(GetDerivatives, get_derivatives, states, STATES, "states", true)
GATHER(GetNominalsOfContinuousStates, get_nominals, states, STATES, "states", false)
GATHER(GetEventIndicators, get_indicators, indicators, INDICATORS, "event indicators", true)

#endif

#endif
