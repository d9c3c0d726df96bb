/* Steps of a continuous block from t to t + h, for the methods in numerics/. Inputs are u(s) = u + slope s for s in [0,
   h]. `integrate` is the step, with error control, of a block that defines only `equations`. */

#ifndef SOLVER_H
#define SOLVER_H

#include "linear_step.h"

#define DEFAULT_TOLERANCE 1e-10

#ifndef SAMPLED

#include "elimination.h"
#include "rodas.h"

/* Advance the inputs by s seconds. */
static inline void move_inputs(Model *m, double s)
{
    for (int i = 0; i < INPUTS; i++)
        *value_of(m, inputs[i]) += m->slope[i] * s;
}

static inline bool inputs_held(const Model *m)
{
    for (int i = 0; m->run.sloped && i < INPUTS; i++)
        if (m->slope[i] != 0.0)
            return false;
    return true;
}

/* Return the time until an input passes zero, at most h. Friction models have kinks there; between such points, an
   exact or high-order step is valid. A ramp that ends at zero within rounding does not pass zero. */
static inline double time_to_reversal(const Model *m, double h)
{
    const double *value = (const double *)(const void *)m;
    for (int i = 0; i < INPUTS; i++) {
        const double u = value[inputs[i]], slope = m->slope[i];
        /* compare signs, as u * slope may underflow; an input that is zero at the end except for rounding does not pass
           zero */
        if (sign(u) * sign(slope) < 0.0 && -u / slope < h * (1.0 - 4.0 * DBL_EPSILON))
            h = -u / slope;
    }
    return h;
}

static inline void get_states(const Model *m, double *y)
{
    for (int r = 0; r < STATE_ROWS; r++)
        for (uint32_t k = 0; k < state_rows[r].count; k++)
            *y++ = ((const double *)(const void *)m)[state_rows[r].index + k];
}

static inline void set_states(Model *m, const double *y)
{
    for (int r = 0; r < STATE_ROWS; r++)
        for (uint32_t k = 0; k < state_rows[r].count; k++)
            *value_of(m, state_rows[r].index + k) = *y++;
}

/* Set the inputs of `work` to those of the model `at` s seconds later. */
static inline void inputs_after(const Model *at, Model *work, double s)
{
    for (int i = 0; i < INPUTS; i++)
        *value_of(work, inputs[i]) = ((const double *)(const void *)at)[inputs[i]] + at->slope[i] * s;
}

/* Compute f(s, y), the derivatives at the state y, s seconds after the model `at`. */
static inline void derivatives(const Model *at, Model *work, double s, const double *y, double *f)
{
    inputs_after(at, work, s);
    work->time = at->time + s;
    set_states(work, y);
    equations(work);
    for (int r = 0; r < STATE_ROWS; r++)
        for (uint32_t k = 0; k < state_rows[r].count; k++)
            *f++ = *value_of(work, state_rows[r].derivative + k);
}

/* Perform one RODAS step of size h from (s, y) to y_new; return the largest error over its tolerance, or -1 if it
   failed. */
static inline double rodas_step(const Model *at, Model *work, double s, double h, const double *y, double *y_new,
                                const double *nominal, double tolerance)
{
    enum { N = ALL_STATES + 1 }; /* no empty arrays */
    double f[N], f_moved[N], y_moved[N], f_t[N], jacobian[N * N], matrix[N * N], u[STAGES][N];

    derivatives(at, work, s, y, f);
    for (int j = 0; j < ALL_STATES; j++) {
        const double delta = 1e-8 * fmax(fabs(y[j]), nominal[j]);
        for (int i = 0; i < ALL_STATES; i++)
            y_moved[i] = y[i];
        y_moved[j] += delta;
        derivatives(at, work, s, y_moved, f_moved);
        for (int i = 0; i < ALL_STATES; i++)
            jacobian[i * ALL_STATES + j] = (f_moved[i] - f[i]) / (y_moved[j] - y[j]);
    }
    derivatives(at, work, s + 1e-6 * h, y, f_moved);
    for (int i = 0; i < ALL_STATES; i++)
        f_t[i] = (f_moved[i] - f[i]) / (1e-6 * h);

    for (int stage = 0; stage < STAGES; stage++) {
        for (int i = 0; i < ALL_STATES; i++)
            y_new[i] = rodas_place(stage, y[i], &u[0][i], N);
        derivatives(at, work, s + rodas_alpha[stage] * h, y_new, u[stage]);
        for (int i = 0; i < ALL_STATES; i++)
            u[stage][i] = rodas_side(stage, u[stage][i], h, &u[0][i], N) + rodas_d[stage] * h * f_t[i];
        for (int i = 0; i < ALL_STATES; i++)
            for (int j = 0; j < ALL_STATES; j++)
                matrix[i * ALL_STATES + j] = (i == j ? 1.0 / (rodas_gamma * h) : 0.0) - jacobian[i * ALL_STATES + j];
        if (!solve_linear(ALL_STATES, matrix, u[stage]))
            return -1.0;
    }
    double worst = 0.0;
    for (int i = 0; i < ALL_STATES; i++) {
        y_new[i] += u[STAGES - 1][i];
        const double error = fabs(u[STAGES - 1][i]) / (tolerance * fmax(fmax(fabs(y[i]), fabs(y_new[i])), nominal[i]));
        if (!isfinite(error))
            return -1.0;
        worst = fmax(worst, error);
    }
    return worst;
}

/* Integrate `equations` over h with the relative tolerance of the block; return false if no step size meets it. */
static inline bool integrate(Model *m, double h)
{
    if (ALL_STATES == 0)
        return true;
    const double tolerance = m->run.tolerance > 0.0 ? m->run.tolerance : DEFAULT_TOLERANCE;
    double y[ALL_STATES + 1], y_new[ALL_STATES + 1], nominal[ALL_STATES + 1];
    Model work = *m;
    get_states(m, y);
    for (int r = 0, i = 0; r < STATE_ROWS; r++)
        for (uint32_t k = 0; k < state_rows[r].count; k++)
            nominal[i++] = state_rows[r].nominal;

    double s = 0.0;
    RodasSize step = {.size = m->run.inner_step > 0.0 ? m->run.inner_step : 1e-3 * h};
    for (long tries = 0; s < h; tries++) {
        if (tries > MOST_TRIES)
            return too_much(m);
        rodas_try(&step, s, h);
        const double error = rodas_step(m, &work, s, step.taken, y, y_new, nominal, tolerance);
        if (rodas_accepts(&step, error)) {
            s = step.last ? h : s + step.taken;
            for (int i = 0; i < ALL_STATES; i++)
                y[i] = y_new[i];
        } else if (!(s + 1e-3 * step.size > s) && step.size < 1e-15 * h)
            return false;
    }
    m->run.inner_step = step.size;
    set_states(m, y);
    return true;
}

#endif
#endif
