#include "law.h"

#include <math.h>
#if defined __STDC_VERSION__ && __STDC_VERSION__ >= 199901L
#include <stdbool.h>
#elif !defined __cplusplus
typedef int bool;
#endif

#ifdef __FAST_MATH__
#error "compile this file without -ffast-math, which breaks the detection of NaN inputs"
#endif
#if defined __STDC_VERSION__ && __STDC_VERSION__ >= 199901L
#define FINITE(value) isfinite(value)
#else
#define FINITE(value) ((value) - (value) == 0.0) /* NaN if not finite */
#endif

/* The numbers in comments are those of the equations in law.h. Results are stored at the end.
   x + 0.0 is x, but 0 for x = -0, as in the FMU. */
static void sample(const law_parameters *parameters, law_states *states, const law_inputs *inputs, law_outputs *outputs)
{
    const bool enable = inputs->enable != 0;
    const bool reset = inputs->reset != 0;
    const bool track = inputs->track != 0;
    if (enable) {
        const bool fresh = reset || (states->running <= 0.5);
        const double estimated_1 = parameters->Ts * parameters->Ts;
        const double force = (inputs->u_prev - states->F_est) / parameters->m;
        /* (1) x_p = x_hat + Ts v_hat + Ts^2/(2 m) (u_prev - F_est) */
        const double x_p = states->x_hat + parameters->Ts * states->v_hat + estimated_1 / 2.0 * force;
        const double p = exp(-(parameters->wo * parameters->Ts));
        const double residual = inputs->x - x_p;
        /* (3) x_hat = x_p + (1 - p^3) (x - x_p) */
        const double position = fresh ? inputs->x : (x_p + (1.0 - p * (p * p)) * residual);
        const double estimated_2 = 1.0 - p;
        const double estimated_3 = estimated_2 * estimated_2;
        double velocity, tracking_1, tracking_2, tracking, friction, wanted;
        bool follows, u_sat_1, u_sat_2;
        /* (4) v_hat = v_p + 3/2 (1 - p)^2 (1 + p)/Ts (x - x_p) */
        if (fresh) {
            velocity = 0.0;
        } else {
            /* (2) v_p = v_hat + Ts/m (u_prev - F_est) */
            const double v_p = states->v_hat + parameters->Ts * force;
            velocity = v_p + 1.5 * estimated_3 * (1.0 + p) / parameters->Ts * residual;
        }
        tracking_1 = parameters->wc * parameters->wc * (inputs->r - position);
        tracking_2 = tracking_1 + 2.0 * parameters->wc * (inputs->rd - velocity) + inputs->rdd;
        tracking = parameters->m * tracking_2;
        follows = track && (parameters->gain != 0.0);
        /* (5) F_est = F_est - m (1 - p)^3/Ts^2 (x - x_p), p = exp(-wo Ts) */
        /* (6) F_hat = F_est */
        if (follows) {
            const double memory_value_1 = (parameters->u_max < inputs->u_track) ? parameters->u_max : inputs->u_track;
            const double memory_value_2 = (inputs->u_track < parameters->u_min) ? parameters->u_min : memory_value_1;
            const double memory_value = (memory_value_2 - tracking) / parameters->gain;
            friction = memory_value + 0.0;
        } else {
            double estimated;
            if (fresh) {
                estimated = 0.0;
            } else {
                estimated = states->F_est - parameters->m * (estimated_2 * estimated_3) / estimated_1 * residual;
            }
            friction = estimated;
        }
        wanted = tracking + parameters->gain * friction;
        u_sat_1 = wanted < parameters->u_min;
        u_sat_2 = wanted > parameters->u_max;
        /* (7) w = m (wc^2 (r - x_hat) + 2 wc (rd - v_hat) + rdd) + gain F_hat */
        /* (8) u = clip(w, u_min, u_max) */
        outputs->u = u_sat_1 ? parameters->u_min : (u_sat_2 ? parameters->u_max : (wanted + 0.0));
        outputs->F_hat = friction;
        states->F_est = friction;
        outputs->u_sat = u_sat_1 ? (-1.0) : (u_sat_2 ? 1.0 : 0.0);
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
    states->running = enable ? 1.0 : 0.0;
}

void law_init(law_parameters *parameters, law_states *states, law_inputs *inputs, law_outputs *outputs)
{
    inputs->r = 0.0;
    inputs->rd = 0.0;
    inputs->rdd = 0.0;
    inputs->x = 0.0;
    inputs->u_prev = 0.0;
    inputs->enable = 1;
    inputs->reset = 0;
    inputs->track = 0;
    inputs->u_track = 0.0;
    states->running = 0.0;
    states->x_hat = 0.0;
    states->v_hat = 0.0;
    states->F_est = 0.0;
    parameters->gain = 1.0;
    parameters->m = 1.0;
    parameters->wc = 63.0;
    parameters->wo = 400.0;
    parameters->u_min = (-1000.0);
    parameters->u_max = 1000.0;
    parameters->Ts = 0.001;
    outputs->u = 0.0;
    outputs->F_hat = 0.0;
    outputs->u_sat = 0.0;
    outputs->v_est = 0.0;
    outputs->fault = 0;
}

static void relations(const law_parameters *parameters, double *holds)
{
    holds[0] = (parameters->u_min <= parameters->u_max) ? 1.0 : 0.0;
}

int law_check(const law_parameters *parameters)
{
    double holds[1];
    int violated = 0;
    relations(parameters, holds);
    if (!(FINITE(parameters->gain) && (parameters->gain >= 0.0) && (parameters->gain <= 1.0))) {
        violated = 1;
    }
    if ((violated == 0) && !(FINITE(parameters->m) && (parameters->m >= 1e-12))) {
        violated = 2;
    }
    if ((violated == 0) && !(FINITE(parameters->wc) && (parameters->wc >= 0.0))) {
        violated = 3;
    }
    if ((violated == 0) && !(FINITE(parameters->wo) && (parameters->wo >= 0.0))) {
        violated = 4;
    }
    if ((violated == 0) && !(FINITE(parameters->u_min))) {
        violated = 5;
    }
    if ((violated == 0) && !(FINITE(parameters->u_max))) {
        violated = 6;
    }
    if ((violated == 0) && !(FINITE(parameters->Ts) && (parameters->Ts >= 1e-09))) {
        violated = 7;
    }
    if ((violated == 0) && !(holds[0] != 0.0)) {
        violated = 8;
    }
    return violated;
}

void law_step(const law_parameters *parameters, law_states *states, const law_inputs *inputs, law_outputs *outputs)
{
    if (FINITE(inputs->r)
        && FINITE(inputs->rd)
        && FINITE(inputs->rdd)
        && FINITE(inputs->x)
        && FINITE(inputs->u_prev)
        && FINITE(inputs->u_track)) {
        outputs->fault = 0;
        sample(parameters, states, inputs, outputs);
    } else {
        outputs->fault = 1;
    }
}
