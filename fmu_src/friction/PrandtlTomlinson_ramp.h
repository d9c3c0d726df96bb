/* Steps of PrandtlTomlinson.c: Rosenbrock steps with the exact Jacobian, from one kick of the noise to the next.
   Included at its end. */

#ifndef PRANDTL_TOMLINSON_RAMP_H
#define PRANDTL_TOMLINSON_RAMP_H

#include "ramp.h"

/* Perform one Rosenbrock step of size h from s seconds after the start of the step; return the largest error over its
   tolerance. */
static double tip_step(const Model *model, const Motion *motion, double s, double h, const double *y, double *y_new,
                       double rate, double tolerance)
{
    GIVEN(model)
    const double pace = motion->pace, slope = model->slope[INPUT_v];
    const double shift = floor(y[0] / a + 0.5) * a, from = X - shift;
    const double curvature = -(k + TWO_PI * PI * E0 / (a * a) * cos(TWO_PI * (y[0] - shift) / a)) / m; /* df/dx */
    const double f_t = pace * k * (v + slope * s) / m, g = 1.0 / (rodas_gamma * h), damped = g + motion->damping,
                 determinant = g * damped - pace * pace * curvature;
    double u[STAGES][2];

    for (int stage = 0; stage < STAGES; stage++) {
        const double dx = rodas_place(stage, 0.0, &u[0][0], 2), dw = rodas_place(stage, 0.0, &u[0][1], 2);
        y_new[0] = y[0] + dx;
        y_new[1] = y[1] + dw;
        const double at = s + rodas_alpha[stage] * h, x_at = (y[0] - shift) + dx;
        const double driver = from + path_after(v, slope, at);
        const double force = k * (driver - x_at) - PI * E0 / a * sin(TWO_PI * x_at / a);
        const double w_rate = pace * force / m - motion->damping * y_new[1] + rodas_d[stage] * h * f_t;
        const double right[2] = {rodas_side(stage, pace * y_new[1], h, &u[0][0], 2),
                                 rodas_side(stage, w_rate, h, &u[0][1], 2)};
        u[stage][0] = (damped * right[0] + pace * right[1]) / determinant;
        u[stage][1] = (pace * curvature * right[0] + g * right[1]) / determinant;
    }
    y_new[0] += u[STAGES - 1][0];
    y_new[1] += u[STAGES - 1][1];
    const double error = fmax(fabs(u[STAGES - 1][0]), fabs(u[STAGES - 1][1]) / rate) / (tolerance * a);
    return isfinite(error) && isfinite(y_new[0]) && isfinite(y_new[1]) ? error : -1.0;
}

/* Move the tip from s to `end`, with at most the number of inner steps left. */
static bool move_tip(Model *model, double s, double end, double *y, long *left)
{
    GIVEN(model)
    const Motion motion = motion_of(model);
    const double rate = sqrt((k + TWO_PI * PI * E0 / (a * a)) / m) + 1e-3 * motion.damping;
    const double tolerance = model->run.tolerance > 0.0 ? model->run.tolerance : TIP_TOLERANCE;
    RodasSize step_size = {.size = model->run.inner_step > 0.0 ? model->run.inner_step : 0.01 / rate};

    while (s < end) {
        double y_new[2];
        rodas_try(&step_size, s, end);
        if (rodas_accepts(&step_size, tip_step(model, &motion, s, step_size.taken, y, y_new, rate, tolerance))) {
            s = step_size.last ? end : s + step_size.taken;
            y[0] = y_new[0];
            y[1] = y_new[1];
        }
        if (--*left < 0)
            return too_much(model);
        if (!(step_size.size * rate > 1e-12))
            return false;
    }
    model->run.inner_step = step_size.size;
    return true;
}

/* Step from one kick of the noise to the next. */
static bool warm_step(Model *model, double h, double *y, long *left)
{
    GIVEN(model)
    struct noise *const noise = &model->memory;
    const double kept = exp(-damping * dt), kick = thermal_velocity(model), slack = 1e-6 * dt;
    if (!(h / dt < (double)*left))
        return too_much(model);
    for (double s = 0.0; s < h;) {
        if (!noise->drawn || noise->left <= slack) {
            noise->interval += noise->drawn;
            noise->left += dt;
            noise->drawn = true;
            noise->number = drawn_for(seed, noise->interval);
            y[1] = kept * y[1] + kick * noise->number;
        }
        const double end = h - s - noise->left < slack ? h : s + noise->left;
        if (!move_tip(model, s, end, y, left))
            return false;
        noise->left -= end - s;
        s = end;
    }
    return true;
}

static bool step(Model *model, double h)
{
    double y[2] = {model->x, model->w};
    long left = (long)(MOST_WORK / WORK_OF_A_STEP);

    if (!(model->kT == 0.0 ? move_tip(model, 0.0, h, y, &left) : warm_step(model, h, y, &left)))
        return false;
    model->x = y[0];
    model->w = y[1];
    model->X += path_after(model->v, model->slope[INPUT_v], h);
    return true;
}

#endif
