/* Steps. The engine advances from tick to tick, at start + k STEP_SIZE. A communication point between two ticks divides
   the tick; sampled parts take their samples at ticks only. */

#ifndef COMPOSITE_STEP_H
#define COMPOSITE_STEP_H

enum { MOST_TICKS = 100000000 };
#define ROUNDING 1e-6 /* of the step: differences of times that are rounding */

/* Advance to this time. */
static bool advance_to(Instance *c, double end)
{
    Engine *const e = &c->engine;
    Memory *const m = &c->memory;
    const double slack = ROUNDING * STEP_SIZE;
    e->start = m->start;
    for (;;) {
        const double next = time_of(e, m->tick + 1);
        const bool whole = next <= end + slack;
        if (!whole && end - m->reached <= slack)
            return true;
        span_tick(e, m->tick);
        e->begins = !m->inside;
        e->ends = whole;
        if (m->inside)
            e->time = m->reached;
        if (m->inside || !whole)
            e->length = (whole ? next : end) - e->time;
        if (!advance(e, m->tick))
            return false;
        m->reached = whole ? next : end;
        m->inside = !whole;
        m->tick += whole;
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
            if (line_groups[k] == g && m->moving[k].debt > error * m->moving[k].scale) {
                worst = k;
                error = m->moving[k].debt / m->moving[k].scale;
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
    const bool restored = roll_back_all(c);
    MODE(c) = STEP_FAILED;
    REQUIRE(restored, "fmi2DoStep: a part cannot return to the start of the step at t = %g s: %s", t, c->said)
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
    REQUIRE(t + h <= m->stop + slack, "fmi2DoStep: the step to %.17g s exceeds the stop time %.17g s", t + h, m->stop)

    c->said[0] = '\0';
    c->warning = false;
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
    m->begun = t;
    if (INPUT_PART >= 0) {
        EnginePart *const inputs = &e->parts[INPUT_PART < 0 ? 0 : INPUT_PART];
        m->sources[c->places[INPUT_PART < 0 ? 0 : INPUT_PART].source] = t;
        (void)fetch_outputs(inputs, e->signals);
    }
    if (!advance_to(c, t + h) || !outputs_finite(c))
        return refuse_step(c, t, h);
    for (int i = 0; i < INPUTS; i++)
        if (m->slopes[i] != 0.0)
            m->inputs[i] += m->slopes[i] * h;
    m->time = t + h;
    m->slopes_used = true;
    m->stale = c->refreshed = false;
    warn_of_errors(c, false);
    return c->warning ? fmi2Warning : fmi2OK;
}

#endif
