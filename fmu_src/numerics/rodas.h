/* RODAS: a Rosenbrock method with six stages, order 4 with an embedded order 3, L-stable and stiffly accurate. It needs
   one Jacobian and six linear solves per step, and no Newton iteration. Hairer, Wanner: Solving Ordinary Differential
   Equations II, 2nd ed. 1996, section IV.7; coefficients of METH = 1 in the form without products with the Jacobian
   (equation 7.25).

       (1/(gamma h) - J) U_i = f(t + alpha_i h, y + sum_j a_ij U_j) + sum_j c_ij U_j / h + d_i h f_t
       y(t + h) = y + sum_j a_6j U_j + U_6,   error = U_6

   This file contains the sums and the step-size control. The caller, which knows its Jacobian, evaluates f and solves
   for U_i: `rodas_step` in solver.h uses differences for any block, PrandtlTomlinson a closed form. */

#ifndef RODAS_H
#define RODAS_H

#include "constants.h"

enum { STAGES = 6 };
static const double rodas_gamma = 0.25;
static const double rodas_alpha[STAGES] = {0.0, 0.386, 0.21, 0.63, 1.0, 1.0};
static const double rodas_d[STAGES] = {0.25, -0.1043, 0.1035, -0.0362, 0.0, 0.0};
static const double rodas_a[STAGES][STAGES] = {
    {0.0},
    {1.544},
    {0.9466785280815826, 0.2557011698983284},
    {3.314825187068521, 2.896124015972201, 0.9986419139977817},
    {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950},
    {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1.0},
};
static const double rodas_c[STAGES][STAGES] = {
    {0.0},
    {-5.6688},
    {-2.430093356833875, -0.2063599157091915},
    {-0.1073529058151375, -9.594562251023355, -20.47028614809616},
    {7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160},
    {8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054},
};

/* Return the argument of f at a stage: `start` + sum_j a_ij U_j of one variable, whose U_j are `stride` apart. */
static inline double rodas_place(int stage, double start, const double *u, int stride)
{
    for (int j = 0; j < stage; j++)
        start += rodas_a[stage][j] * u[j * stride];
    return start;
}

/* Return the right-hand side of a stage: f + sum_j c_ij U_j / h of one variable. */
static inline double rodas_side(int stage, double f, double h, const double *u, int stride)
{
    for (int j = 0; j < stage; j++)
        f += rodas_c[stage][j] / h * u[j * stride];
    return f;
}

/* The recommended step size and the step that is tried, which is shorter at the end of the interval. */
typedef struct {
    double size, taken;
    bool last;
} RodasSize;

static inline void rodas_try(RodasSize *step, double s, double end)
{
    step->last = s + 1.01 * step->size >= end;
    step->taken = step->last ? end - s : step->size;
}

/* Return whether a step is accepted, given its error over the tolerance (negative if the step failed). The next size
   follows from this error, which is of order 4. */
static inline bool rodas_accepts(RodasSize *step, double error)
{
    const double factor = error < 0.0 ? 0.2 : clip(0.9 * pow(fmax(error, 1e-12), -0.25), 0.2, 6.0);
    const bool accepted = error >= 0.0 && error <= 1.0;
    if (!accepted)
        step->size = step->taken * fmin(factor, 0.9);
    else
        step->size = fmin(step->last ? fmax(step->size, step->taken * factor) : step->taken * factor, DBL_MAX);
    return accepted;
}

#endif
