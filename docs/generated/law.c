#include "law.h"

#include <math.h>
#include <stddef.h>

#ifdef __FAST_MATH__
#error "compile this file without -ffast-math, which breaks the detection of NaN inputs"
#endif

/* The numbers in comments are those of the equations in law.h. Results are stored at the end. */
static void sample(const law_parameters *parameters, law_states *states, const law_inputs *inputs, law_outputs *outputs)
{
    if (inputs->enable) {
        const bool follows = inputs->track && (parameters->gain != 0.0);
        const bool fresh = inputs->reset || !states->running;
        const double span = (states->missed + 1.0) * parameters->Ts;
        const double span_squared = span * span;
        const double force = (inputs->u_prev - states->F_est) / parameters->m;
        /* (1) x_p = x_hat + Ts v_hat + Ts^2/(2 m) (u_prev - F_est) */
        const double x_p = states->x_hat + span * states->v_hat + span_squared / 2.0 * force;
        const double p = exp(-(parameters->wo * span));
        const double residual = inputs->x - x_p;
        /* (3) x_hat = x_p + (1 - p^3) (x - x_p) */
        const double position = fresh ? inputs->x : (x_p + (1.0 - p * (p * p)) * residual);
        const double difference_1 = 1.0 - p;
        const double square_1 = difference_1 * difference_1;
        /* (4) v_hat = v_p + 3/2 (1 - p)^2 (1 + p)/Ts (x - x_p) */
        double velocity;
        if (fresh) {
            velocity = 0.0;
        } else {
            /* (2) v_p = v_hat + Ts/m (u_prev - F_est) */
            const double v_p = states->v_hat + span * force;
            velocity = v_p + 1.5 * square_1 * (1.0 + p) / span * residual;
        }
        const double tracking = parameters->m
            * (parameters->wc * parameters->wc * (inputs->r - position)
                + 2.0 * parameters->wc * (inputs->rd - velocity) + inputs->rdd);
        /* (5) F_est = F_est - m (1 - p)^3/Ts^2 (x - x_p), p = exp(-wo Ts) */
        /* (6) F_hat = F_est */
        double friction;
        if (follows) {
            const double u = (inputs->u_track < parameters->u_min) ? parameters->u_min
                : ((parameters->u_max < inputs->u_track) ? parameters->u_max : inputs->u_track);
            friction = (u - tracking) / parameters->gain;
        } else if (fresh) {
            friction = 0.0;
        } else {
            friction = states->F_est - parameters->m * (difference_1 * square_1) / span_squared * residual;
        }
        const double wanted_0 = tracking + parameters->gain * friction;
        const double wanted_1 = follows ? inputs->u_track : wanted_0;
        const bool wanted_1_below_u_min = wanted_1 < parameters->u_min;
        const bool wanted_1_above_u_max = wanted_1 > parameters->u_max;
        /* (7) w = m (wc^2 (r - x_hat) + 2 wc (rd - v_hat) + rdd) + gain F_hat */
        /* (8) u = clip(w, u_min, u_max) */
        outputs->u = wanted_1_below_u_min ? parameters->u_min
            : (wanted_1_above_u_max ? parameters->u_max : wanted_1);
        outputs->F_hat = friction;
        states->F_est = friction;
        outputs->u_sat = wanted_1_below_u_min ? -1.0 : (wanted_1_above_u_max ? 1.0 : 0.0);
        outputs->v_est = velocity;
        states->v_hat = velocity;
        states->x_hat = position;
    } else {
        outputs->u = 0.0;
        outputs->F_hat = 0.0;
        states->F_est = 0.0;
        outputs->u_sat = 0.0;
        outputs->v_est = 0.0;
        states->v_hat = 0.0;
        states->x_hat = 0.0;
    }
    states->running = inputs->enable;
    states->missed = 0.0;
}

/* Set what does not depend on inputs as in a sample with `enable` = false. */
static void disable(const law_parameters *parameters, law_states *states, law_outputs *outputs)
{
    outputs->u = 0.0;
    outputs->F_hat = 0.0;
    outputs->u_sat = 0.0;
    outputs->v_est = 0.0;
    states->running = false;
    states->x_hat = 0.0;
    states->v_hat = 0.0;
    states->F_est = 0.0;
    (void)parameters;
}

void law_init(law_parameters *parameters, law_states *states, law_inputs *inputs, law_outputs *outputs)
{
#ifdef LAW_CHECK_POINTERS
    if ((parameters != NULL) && (states != NULL) && (inputs != NULL) && (outputs != NULL))
#endif
    {
        inputs->r = 0.0;
        inputs->rd = 0.0;
        inputs->rdd = 0.0;
        inputs->x = 0.0;
        inputs->u_prev = 0.0;
        inputs->enable = true;
        inputs->reset = false;
        inputs->track = false;
        inputs->u_track = 0.0;
        states->running = false;
        states->missed = 0.0;
        states->x_hat = 0.0;
        states->v_hat = 0.0;
        states->F_est = 0.0;
        parameters->gain = 1.0;
        parameters->m = 1.0;
        parameters->wc = 63.0;
        parameters->wo = 400.0;
        parameters->u_min = -1000.0;
        parameters->u_max = 1000.0;
        parameters->Ts = 0.001;
        outputs->u = 0.0;
        outputs->F_hat = 0.0;
        outputs->u_sat = 0.0;
        outputs->v_est = 0.0;
        outputs->fault = false;
    }
}

/* Find the relations between parameters that hold. */
static void relations(const law_parameters *parameters, bool *holds)
{
    holds[0] = parameters->u_min <= parameters->u_max;
}

int32_t law_check(const law_parameters *parameters)
{
    int32_t violated = -1;
#ifdef LAW_CHECK_POINTERS
    if (parameters != NULL)
#endif
    {
        bool holds[1];
        relations(parameters, holds);
        if (!(isfinite(parameters->gain) && (parameters->gain >= 0.0) && (parameters->gain <= 1.0))) {
            violated = 1;
        } else if (!(isfinite(parameters->m) && (parameters->m >= 1e-12))) {
            violated = 2;
        } else if (!(isfinite(parameters->wc) && (parameters->wc >= 0.0))) {
            violated = 3;
        } else if (!(isfinite(parameters->wo) && (parameters->wo >= 0.0))) {
            violated = 4;
        } else if (!isfinite(parameters->u_min)) {
            violated = 5;
        } else if (!isfinite(parameters->u_max)) {
            violated = 6;
        } else if (!(isfinite(parameters->Ts) && (parameters->Ts >= 1e-09))) {
            violated = 7;
        } else if (!holds[0]) {
            violated = 8;
        } else {
            violated = 0;
        }
    }
    return violated;
}

void law_step(const law_parameters *parameters, law_states *states, const law_inputs *inputs, law_outputs *outputs)
{
#ifdef LAW_CHECK_POINTERS
    if ((parameters != NULL) && (states != NULL) && (inputs != NULL) && (outputs != NULL))
#endif
    {
        bool valid = isfinite(inputs->r + inputs->rd + inputs->rdd + inputs->x + inputs->u_prev + inputs->u_track);
        bool rests = !inputs->enable && !valid;
        if (valid) {
            law_outputs found;
            found.fault = false;
            sample(parameters, states, inputs, &found);
            const double sum = found.u + found.F_hat + found.v_est + states->x_hat + states->v_hat + states->F_est;
            valid = isfinite(sum);
            if (valid) {
                *outputs = found;
            }
            rests = !valid;
        } else {
            states->missed += 1.0;
        }
        if (rests) {
            disable(parameters, states, outputs);
        }
        outputs->fault = !valid;
    }
}
