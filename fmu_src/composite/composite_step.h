/* Steps. The engine advances from tick to tick, at start + k STEP_SIZE; sampled parts take their samples at ticks only.
   A step that ends between two ticks computes the values there and keeps the state at the start of the tick, from which
   the next step repeats the tick. So the result does not depend on the communication points, and pieces of very unequal
   lengths, which amplify the errors of light masses, do not occur. An input that jumps within a tick acts in it as its
   mean. */

#ifndef COMPOSITE_STEP_H
#define COMPOSITE_STEP_H

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

/* Keep the start of a tick. */
static bool keep_tick(Instance *c)
{
    Memory *const m = &c->memory;
    const double start = time_of(&c->engine, m->tick);
    m->side = !m->side;
    for (int64_t i = 0; i < PARTS; i++)
        if (moves_inside(i) && c->parts[i].get_state(c->parts[i].component, &c->ticks[m->side][i]) > 1)
            return failed(&c->engine, i, SAVE, 2, m->time);
    memcpy(m->begun_signals, m->signals, sizeof m->signals);
    for (int i = 0; i < INPUTS; i++) {
        m->rate[i] = m->slopes[i];
        m->base[i] = m->inputs[i] + (m->rate[i] == 0.0 ? 0.0 : m->rate[i] * (start - m->begun));
    }
    return true;
}

/* Let the inputs that have jumped since the start of the tick act as their mean until `length` from now. */
static void average_inputs(Instance *c, double length)
{
    Memory *const m = &c->memory;
    for (int i = 0; i < INPUTS; i++) {
        const double jump = m->inputs[i] - (m->base[i] + m->rate[i] * m->spent);
        if (m->rate[i] == m->slopes[i] && (jump == 0.0 || fabs(jump) < 1e-12 * fabs(m->rate[i]) * STEP_SIZE))
            continue;
        c->uneven = true;
        m->base[i] = ((m->base[i] + 0.5 * m->rate[i] * m->spent) * m->spent +
                      (m->inputs[i] + 0.5 * m->slopes[i] * length) * length) /
                     (m->spent + length);
        m->rate[i] = 0.0;
    }
}

/* Return to the start of the tick. Sampled parts have acted there. */
static bool return_to_tick(Instance *c)
{
    Memory *const m = &c->memory;
    for (int64_t i = 0; i < PARTS; i++)
        if (moves_inside(i) && c->parts[i].set_state(c->parts[i].component, c->ticks[m->side][i]) > 1)
            return failed(&c->engine, i, RESTORE, 2, m->time);
    memcpy(m->signals, m->begun_signals, sizeof m->signals);
    m->begun = time_of(&c->engine, m->tick);
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
    for (int64_t i = 0; i < PARTS; i++)
        for (int64_t k = part_data[i].outputs[REAL]; part_data[i].sampled && k < part_data[i].outputs[TYPES]; k++)
            start->begun_signals[k] = m->signals[k];
    *m = *start;
    m->inside = true;
}

/* Move the parts over a part of the tick on the lines that solve the whole tick. A contact that rests in the whole tick
   has v = 0 exactly. */
static bool move_on_lines(Instance *c, double length, const bool *rests, const bool *holds)
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
            const double begin = 2.0 * l->mean - l->end, end = begin + (l->end - begin) * (length / STEP_SIZE);
            l->mean = 0.5 * (begin + end);
            l->end = c->memory.moving[i].unknown < 0 ? arriving(e, l->input) : end; /* of a part that has moved */
            if (rests[i]) {
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
        if (holds[j])
            e->signals[unknown_outputs[j]] = c->newton.w[j];
    return true;
}

/* Mark the unknowns of a loop that are holding forces, which the friction at v = 0 does not give. */
static void find_holding(const Instance *c, const Group *g, bool *holds)
{
    const Memory *const m = &c->memory;
    const Contact *const first = contacts_of(&c->newton, g), *const last = first + g->contacts;
    bool rests = false;
    for (const Contact *k = first; k < last; k++)
        rests = rests || is_rest(&m->moving[k->line]);
    for (int64_t j = g->unknown; j < g->unknown + g->unknowns; j++)
        holds[j] = m->guards[g - group_data].jumped && !rests;
    for (const Contact *k = first; k < last; k++)
        holds[k->unknown] = holds[k->unknown] || m->moving[k->line].role == IN_JUMP;
}

/* Compute the values within a tick and remember its start. The loop of a part of a tick may have other solutions,
   which are not those that the whole tick passes through. */
static bool divide_tick(Instance *c, double length)
{
    Engine *const e = &c->engine;
    Memory *const m = &c->memory;
    int64_t loops = 0;
    for (int64_t g = 0; g < GROUPS; g++)
        loops += group_data[g].is_loop;
    const int64_t spans = c->newton.substeps + loops;
    c->tick = *m;
    const bool whole = advance(e, m->tick) && c->newton.substeps == spans;
    bool rests[LINES + 1], holds[UNKNOWNS + 1];
    for (int64_t k = 0; k < LINES; k++)
        rests[k] = is_rest(&m->moving[k]) && c->tick.moving[k].u0 == 0.0;
    for (int64_t g = 0; g < GROUPS; g++)
        find_holding(c, &group_data[g], holds);
    remember_tick(c);
    if (!return_to_tick(c))
        return false;
    if (whole)
        return move_on_lines(c, length, rests, holds);
    c->tick = *m;
    e->status = 0;
    e->begins = false;
    e->length = length;
    const bool done = advance(e, m->tick);
    memcpy(c->tick.signals, m->signals, sizeof m->signals);
    *m = c->tick;
    return done;
}

/* Advance by this time. */
static bool advance_by(Instance *c, double h)
{
    Engine *const e = &c->engine;
    Memory *const m = &c->memory;
    const double slack = tick_slack(m);
    for (double left = h;;) {
        const double rest = STEP_SIZE - m->spent, begun = m->begun;
        const bool whole = rest <= left + slack, again = m->inside;
        if (!whole && !again && m->spent + left <= slack) {
            m->spent += left;
            return true;
        }
        if (again)
            average_inputs(c, fmin(left, rest));
        if (!(again ? return_to_tick(c) : whole || keep_tick(c)))
            return false;
        span_tick(e, m->tick);
        e->begins = !again;
        e->ends = whole;
        if (!(whole ? advance(e, m->tick) : divide_tick(c, m->spent + left)))
            return false;
        if (!whole) {
            m->spent += left;
            return true;
        }
        m->tick++;
        m->inside = false;
        m->spent = fmin(left - rest, 0.0);
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
        double error = guard->hopeless ? HOPELESS : 0.0;
        for (int64_t k = 0; k < LINES && last; k++)
            if (line_groups[k] == g && remaining_error(&m->moving[k]) > error) {
                worst = k;
                error = remaining_error(&m->moving[k]);
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
    c->uneven = false;
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
    m->stale = c->uneven ? INPUT_SET : 0; /* direct outputs follow the last value, not the mean */
    c->refreshed = false;
    warn_of_errors(c, false);
    return c->warning ? fmi2Warning : fmi2OK;
}

#endif
