/* FMI 2.0.5 co-simulation around one block: instances, logging, modes, values, steps. A rejected call (wrong order,
   unknown variable, invalid value) is logged, returns the status required by the standard, and changes nothing. */

#ifndef BLOCK_FMI2_H
#define BLOCK_FMI2_H

#include "fmi2_instance.h"
#include "fmi2_state.h"
#include "fmi2_derivatives.h"

/* ---- life of an instance ------------------------------------------------------------------------------------ */

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type kind, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)resources;
    (void)visible;
    Instance *const c = allocated(name, functions);
    if (!c)
        return NULL;
    write_guid(c->guid);
    const char *const fault = instantiation_fault(c, kind, EXCHANGES, guid, c->guid);
    if (fault) {
        report(c, fmi2Error, LOG_ERROR, "fmi2Instantiate of %s: %s", QUOTE(MODEL), fault);
        free(c);
        return NULL;
    }
    c->logging = logging ? LOG_EVERYTHING : 0;
    for (size_t i = 0; i < ROWS; i++)
        for (uint32_t k = 0; k < (rows[i].length ? rows[i].length : 1); k++)
            c->row_of[rows[i].index + k] = &rows[i];
    c->model.run.exchange = kind == fmi2ModelExchange;
    set_start_values(c);
    return c;
}

void fmi2FreeInstance(fmi2Component component) { free(component); }

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean tolerance_given, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_given, fmi2Real stop)
{
    ENTER("SetupExperiment", MAY_SetupExperiment)
    if (check_experiment(c, tolerance_given, tolerance, start, stop_given, stop) != fmi2OK)
        return fmi2Error;
    c->model.run.tolerance = tolerance_given ? tolerance : 0.0;
    c->model.run.start = c->model.time = start;
    c->model.run.stop = stop_given ? stop : INF;
    c->model.run.stale = true;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component)
{
    ENTER("EnterInitializationMode", MAY_EnterInitializationMode)
    MODE(c) = INITIALIZING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component)
{
    ENTER("ExitInitializationMode", MAY_ExitInitializationMode)
    const char *const relation = violated(&c->model);
    REQUIRE(!relation, "fmi2ExitInitializationMode: the parameters of \"%s\" must satisfy %s", c->name, relation)
    REQUIRE(refresh(c), "fmi2ExitInitializationMode: the start values of \"%s\" lead to outputs that are not finite",
            c->name)
    MODE(c) = c->model.run.exchange ? EVENT_MODE : STEP_COMPLETE;
    if (c->model.run.exchange)
        decide(&c->model);
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component component)
{
    ENTER("Terminate", MAY_Terminate)
    MODE(c) = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component)
{
    ENTER("Reset", MAY_Reset)
    set_start_values(c);
    return fmi2OK;
}

/* ---- values ------------------------------------------------------------------------------------------------- */

static const char *const type_names[] = {"Real", "Integer", "Boolean"};

static bool known(const Instance *c, fmi2ValueReference reference, int type)
{
    return reference < VALUES && c->row_of[reference]->type == type;
}

/* A trial of a solver may lead to values that are not finite; the solver then takes another. */
static fmi2Status not_finite(const Instance *c, const char *function, const char *what)
{
    const bool trial = MODE(c) == CONTINUOUS_TIME;
    return report(c, trial ? fmi2Discard : fmi2Error, trial ? LOG_DISCARD : LOG_ERROR,
                  "fmi2Get%s: with the values set at t = %g s, %s of \"%s\" is not finite", function, c->model.time,
                  what, c->name);
}

static fmi2Status check_outputs(Instance *c, const char *function)
{
    return refresh(c) ? fmi2OK : not_finite(c, function, "an output");
}

static fmi2Status check_get(Instance *c, const fmi2ValueReference references[], size_t n, const void *values, int type)
{
    REQUIRE(n == 0 || (references && values), "fmi2Get%s: a pointer is null", type_names[type])
    for (size_t i = 0; i < n; i++)
        REQUIRE(known(c, references[i], type), "fmi2Get%s: there is no %s variable with value reference %u",
                type_names[type], type_names[type], references[i])
    return c->model.run.stale ? check_outputs(c, type_names[type]) : fmi2OK;
}

/* Return whether a value other than a Real input may be set now. */
static bool settable(const Instance *c, const Row *row)
{
    switch (row->role) {
    case ROLE_INPUT:
    case ROLE_PARAMETER: return MODE(c) != CONTINUOUS_TIME;
    case ROLE_STATE: return before_stepping(&c->model) || (ALL_STATES > 0 && (MODE(c) & EXCHANGING));
    case ROLE_STATE_OUTPUT: return ALL_STATES > 0 && (MODE(c) & EXCHANGING); /* casadi sets states like this */
    default: return row->role == ROLE_FIXED && before_stepping(&c->model);
    }
}

static fmi2Status check_set(Instance *c, fmi2ValueReference reference, double value, int type)
{
    REQUIRE(known(c, reference, type), "fmi2Set%s: there is no %s variable with value reference %u", type_names[type],
            type_names[type], reference)
    const Row *const row = c->row_of[reference];
    REQUIRE((row->role == ROLE_INPUT && type == TYPE_REAL) || settable(c, row),
            "fmi2Set%s: %s cannot be set in the mode \"%s\"", type_names[type], row->name, mode_name(MODE(c)))
#ifdef GUARDED
    if (row->role == ROLE_INPUT)
        return fmi2OK;
#endif
    if (!isfinite(value))
        return report(c, fmi2Discard, LOG_DISCARD, "fmi2Set%s: %s = %g is not finite", type_names[type], row->name,
                      value);
    if (!(value >= row->min && value <= row->max))
        return report(c, fmi2Discard, LOG_DISCARD, "fmi2Set%s: %s = %g is outside [%g, %g]", type_names[type],
                      row->name, value, row->min, row->max);
    return fmi2OK;
}

/* All values are checked before the first one is written. */
#define SET(TYPE, type, as_double)                                                                                     \
    fmi2Status fmi2Set##TYPE(fmi2Component component, const fmi2ValueReference references[], size_t n,                 \
                             const fmi2##TYPE values[])                                                                \
    {                                                                                                                  \
        ENTER("Set" #TYPE, MAY_Set)                                                                                    \
        REQUIRE(n == 0 || (references && values), "fmi2Set" #TYPE ": a pointer is null")                               \
        for (size_t i = 0; i < n; i++) {                                                                               \
            const fmi2Status status = check_set(c, references[i], as_double, type);                                    \
            if (status != fmi2OK)                                                                                      \
                return status;                                                                                         \
        }                                                                                                              \
        for (size_t i = 0; i < n; i++)                                                                                 \
            *value_of(&c->model, references[i]) = as_double;                                                           \
        c->model.run.stale = c->model.run.stale || n > 0;                                                              \
        return fmi2OK;                                                                                                 \
    }
SET(Real, TYPE_REAL, values[i])
SET(Integer, TYPE_INTEGER, (double)values[i])
SET(Boolean, TYPE_BOOLEAN, (double)(values[i] != fmi2False))

#define GET(TYPE, type, from_double)                                                                                   \
    fmi2Status fmi2Get##TYPE(fmi2Component component, const fmi2ValueReference references[], size_t n,                 \
                             fmi2##TYPE values[])                                                                      \
    {                                                                                                                  \
        ENTER("Get" #TYPE, MAY_Get)                                                                                    \
        const fmi2Status status = check_get(c, references, n, values, type);                                           \
        if (status != fmi2OK)                                                                                          \
            return status;                                                                                             \
        for (size_t i = 0; i < n; i++)                                                                                 \
            values[i] = from_double(*value_of(&c->model, references[i]));                                              \
        return fmi2OK;                                                                                                 \
    }
#define AS_BOOLEAN(value) ((value) != 0.0 ? fmi2True : fmi2False)
GET(Real, TYPE_REAL, (fmi2Real))
GET(Integer, TYPE_INTEGER, (fmi2Integer))
GET(Boolean, TYPE_BOOLEAN, AS_BOOLEAN)

/* ---- steps -------------------------------------------------------------------------------------------------- */

#ifdef SAMPLED
#define UNDONE "has more than " QUOTE(MOST_TRIES) " samples; use shorter steps"

/* Take a sample at every start + k Ts in [t, t + h). The tolerance prevents rounding of the step from adding or losing
   a sample. */
static bool advance(Model *m, double t, double h)
{
    follow_time(m, t);
    if (h - m->run.rest > MOST_TRIES * m->Ts)
        return false;
    const double last = h - sample_slack(m);
    double begin[INPUTS + 1];
    const bool used = m->run.rest < last || m->run.sloped;
    for (int i = 0; used && i < INPUTS; i++)
        begin[i] = *value_of(m, inputs[i]);
    for (; m->run.rest < last; m->run.rest += m->Ts) {
        const double passed = m->run.rest > 0.0 ? m->run.rest : 0.0;
        for (int i = 0; i < INPUTS; i++)
            *value_of(m, inputs[i]) = begin[i] + m->slope[i] * passed;
        m->time = next_sample(m);
        take_sample(m);
        m->run.tick++;
    }
    m->run.rest -= h;
    for (int i = 0; m->run.sloped && i < INPUTS; i++)
        *value_of(m, inputs[i]) = begin[i] + m->slope[i] * h;
    return true;
}
#else
#define UNDONE "does not meet the tolerance"

/* Perform the block's own step, except over a time so short that 1/h overflows and no state can change. */
static bool own_step(Model *m, double h) { return h < 1e-290 || STEPS_BY(m, h); }

/* Advance from one zero of the inputs to the next, each time by the block's own step. */
static bool advance(Model *m, double t, double h)
{
    m->time = t;
    m->run.outputs_done = false;
    if (inputs_held(m)) {
        if (!own_step(m, h))
            return false;
    } else {
        for (double rest = h; rest > 0.0;) {
            const double piece = time_to_reversal(m, rest);
            if (!own_step(m, piece))
                return false;
            const bool whole = piece >= rest;
            for (int i = 0; i < INPUTS; i++) {
                double *const u = value_of(m, inputs[i]);
                const bool arrives = !whole && sign(*u) * sign(m->slope[i]) < 0.0 && -*u / m->slope[i] <= piece;
                *u = arrives ? 0.0 : *u + m->slope[i] * piece;
            }
            m->run.outputs_done = false; /* the inputs have changed */
            rest = whole ? 0.0 : rest - piece;
            m->time += piece;
        }
    }
    m->time = t + h;
    if (!m->run.outputs_done)
        equations(m);
    return true;
}
#endif

/* Log, once, what the block warns of in the step from t or in the sample at t. */
static fmi2Status warned(Instance *c, double t)
{
    Model *const m = &c->model;
    (void)m;
    (void)t;
#ifdef GUARDED
    if (m->fault != 0.0 && !m->run.warned) {
        const int bad = bad_input(m);
        m->run.warned = true;
        return report(c, fmi2Warning, LOG_WARNING,
                      "%s at t = %g s: %s is not finite; outputs and states are held until all inputs are finite again",
                      c->name, t, bad < INPUTS ? c->row_of[inputs[bad]]->name : "an input");
    }
#endif
#ifdef WARNING
    if (m->run.warning && !m->run.warned) {
        m->run.warned = true;
        return report(c, fmi2Warning, LOG_WARNING, "%s at t = %g s: %s", c->name, m->time, WARNING);
    }
#endif
    return fmi2OK;
}

static const char *violated_relation(Instance *c)
{
    const char *const relation = c->model.run.stale ? violated(&c->model) : NULL;
    if (relation) {
        MODE(c) = STEP_FAILED;
        (void)report(c, fmi2Discard, LOG_DISCARD, "fmi2DoStep: the parameters of \"%s\" must satisfy %s", c->name,
                     relation);
    }
    return relation;
}

static bool take_step(Model *m, double t, double h)
{
    if (m->run.slopes_used && m->run.sloped) {
        memset(m->slope, 0, sizeof m->slope);
        m->run.sloped = false;
    }
    const bool done = advance(m, t, h);
    m->time = t + h;
    return done;
}

static fmi2Status accept_step(Instance *c, double t, double h)
{
    Model *const m = &c->model;
    m->run.stale = false;
    m->run.slopes_used = true;
    m->run.last_step = h;
    m->run.drift += DBL_EPSILON * fabs(m->time);
    return warned(c, t);
}

/* Report why a step failed. */
static fmi2Status refuse_step(Instance *c, double t, double h, bool done, bool too_much)
{
    const char *const undone =
        too_much ? "exceeds the limit of work in one communication step; use shorter steps" : UNDONE;
    MODE(c) = STEP_FAILED;
    return report(c, fmi2Discard, LOG_DISCARD,
                  "fmi2DoStep: the step from %.17g s over %g s %s; the state at its start is kept", t, h,
                  done ? "leads to a value that is not finite" : undone);
}

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real t, fmi2Real h, fmi2Boolean keeps_no_state)
{
    (void)keeps_no_state;
    ENTER("DoStep", MAY_DoStep)
    Model *const m = &c->model;
    /* The time of the master applies; it may differ by rounding, or by the error of a master that sums steps. */
    const double slack = 1e-6 * h + 1e-12 * (fabs(t) + fabs(m->run.start)) + 1e-12;
    REQUIRE(fabs(t) < INF && h > 0.0 && h < INF, "fmi2DoStep: step size %g at t = %g s must be positive and finite", h,
            t)
    REQUIRE(fabs(t - m->time) <= slack, "fmi2DoStep: communication point %.17g s is not the current time %.17g s", t,
            m->time)
    REQUIRE(t + h <= m->run.stop + slack + m->run.drift,
            "fmi2DoStep: the step to %.17g s exceeds the stop time %.17g s", t + h, m->run.stop)
    if (violated_relation(c))
        return fmi2Discard;
    keep(c);
    const bool done = take_step(m, t, h);
    if (done && results_finite(m))
        return accept_step(c, t, h);
    const bool too_much = m->run.too_much;
    roll_back(c);
    return refuse_step(c, t, h, done, too_much);
}

#ifndef NO_EXCHANGE
#include "fmi2_exchange.h"
#endif

#include "fmi2_direct.h"

#endif
