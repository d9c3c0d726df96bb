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
    double start, stop, tolerance, begun; /* [s]; begun: begin of the step, at which the inputs have their values */
    double sources[SOURCES + 1];          /* [s] time of each recorded table and of the inputs */
    int64_t rows[SOURCES + 1];            /* of each recorded table: the one that applies, in model exchange */
    double inputs[INPUTS + 1], slopes[INPUTS + 1];
    double base[INPUTS + 1], rate[INPUTS + 1]; /* inputs over a tick that is divided, as lines from its start */
    double begun_signals[SIGNALS + 1];         /* at the start of such a tick */
    double signals[SIGNALS + 1], gains[MAPPED + 1], offsets[MAPPED + 1], past[PAST + 1];
    Moving moving[LINES + 1];
    StepCheck guards[GROUPS + 1];
    double w[UNKNOWNS + 1], w_last[UNKNOWNS + 1], trend[UNKNOWNS + 1], scale[UNKNOWNS + 1];
    double surprise[UNKNOWNS + 1], growth[UNKNOWNS + 1], held_values[HELD + 1];
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
    double r[UNKNOWNS + 1], work[7 * MOST + 2 * MOST * MOST + 1], kept[6 * MOST + MOST * MOST + 2 * LINES + 1];
    double start_values[ROOTS + 1], start_work[FIXED_POINT_WORK(ROOTS) + 1], earlier[SIGNALS + 1];
    double shown[SIGNALS + 1]; /* signals after values were set, if `refreshed` */
    double input_slopes[SIGNALS + 1];
    int whole[SIGNALS + 1], orders[SIGNALS + 1];
    void *backups[PARTS];  /* states of the parts at the start of a step */
    void *ticks[2][PARTS]; /* at the start of a tick that is divided, and of an earlier one */
    bool uneven;           /* the inputs have jumped within a tick in this step */
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

#include "composite_sources.h"

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
        .unknowns = unknown_outputs,
        .held = held_inputs,
        .held_values = m->held_values,
        .contacts = contact_data,
        .loads = load_inputs,
        .w = m->w,
        .w_last = m->w_last,
        .trend = m->trend,
        .scale = m->scale,
        .surprise = m->surprise,
        .growth = m->growth,
        .r = c->r,
        .work = c->work,
        .inverse = m->inverse,
        .most_unknowns = MOST,
        .tolerance = LOOP_TOLERANCE,
        .error = LOOP_ERROR,
        .doubt = DOUBT,
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
    for (int64_t k = 0; k < LINES; k++) {
        m->moving[k].inner = line_data[k].inner;
        m->moving[k].unknown = line_data[k].unknown;
    }
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
        if (is_fmu(i) && c->parts[i].get_state(c->parts[i].component, &c->backups[i]) > 1)
            return false;
    return true;
}

static bool roll_back_all(Instance *c)
{
    bool good = true;
    c->memory = c->backup;
    for (int64_t i = 0; i < PARTS; i++)
        if (is_fmu(i) && c->parts[i].set_state(c->parts[i].component, c->backups[i]) > 1)
            good = false;
    return good;
}

#include "composite_start.h"
#include "composite_state.h"
#include "composite_values.h"
#include "composite_step.h"
#include "composite_derivatives.h"
#if MODEL_EXCHANGE
#include "composite_exchange.h"
#endif

#endif
