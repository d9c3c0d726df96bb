/* Steps of a continuous block from t to t + h. Inputs are u(s) = u + slope s, s in [0, h].

   integrate    error-controlled, for any block that has only `equations`
   linear_step  exact, for x' = A x + b + c s
   relax        exact, for z' = rate (target - z)                                                             */

#ifndef SOLVER_H
#define SOLVER_H

#define DEFAULT_TOLERANCE 1e-10

/* z(h) of z' = rate (target - z), `decay` = rate h >= 0; exact also where decay is tiny or infinite. */
static inline double relax(double z, double target, double decay) { return z - (target - z) * expm1(-decay); }

#ifndef SAMPLED

/* The inputs of s seconds later. */
static inline void move_inputs(Model *m, double s)
{
    for (int i = 0; i < INPUTS; i++)
        *value_of(m, inputs[i]) += m->slope[i] * s;
}

static inline bool inputs_held(const Model *m)
{
    for (int i = 0; i < INPUTS; i++)
        if (m->slope[i] != 0.0)
            return false;
    return true;
}

/* Time until the next input passes zero, at most h. Laws have their kinks there: between such points an exact
   or high-order step is valid. A ramp that ends at zero does not pass it by its rounding. */
static inline double time_to_reversal(const Model *m, double h)
{
    const double *value = (const double *)(const void *)m;
    for (int i = 0; i < INPUTS; i++) {
        const double u = value[inputs[i]], slope = m->slope[i];
        /* by signs, as u * slope may underflow; an input that is zero at the end but for rounding does not pass it */
        if (sign(u) * sign(slope) < 0.0 && -u / slope < h * (1.0 - 4.0 * DBL_EPSILON))
            h = -u / slope;
    }
    return h;
}

/* Solves the n by n system a x = b in place by elimination with row exchanges; false if a is singular. */
static inline bool solve_linear(int n, double *a, double *b, int columns)
{
    for (int k = 0; k < n; k++) {
        int pivot = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(a[i * n + k]) > fabs(a[pivot * n + k]))
                pivot = i;
        if (a[pivot * n + k] == 0.0 || !isfinite(a[pivot * n + k]))
            return false;
        for (int j = 0; j < n; j++) {
            const double swap = a[k * n + j];
            a[k * n + j] = a[pivot * n + j];
            a[pivot * n + j] = swap;
        }
        for (int j = 0; j < columns; j++) {
            const double swap = b[k * columns + j];
            b[k * columns + j] = b[pivot * columns + j];
            b[pivot * columns + j] = swap;
        }
        for (int i = 0; i < n; i++) {
            if (i == k)
                continue;
            const double factor = a[i * n + k] / a[k * n + k];
            for (int j = k; j < n; j++)
                a[i * n + j] -= factor * a[k * n + j];
            for (int j = 0; j < columns; j++)
                b[i * columns + j] -= factor * b[k * columns + j];
        }
    }
    for (int i = 0; i < n; i++)
        for (int j = 0; j < columns; j++)
            b[i * columns + j] /= a[i * n + i];
    return true;
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

/* f(s, y): the derivatives at state y, s seconds after the model `at`. */
static inline void derivatives(const Model *at, Model *work, double s, const double *y, double *f)
{
    for (int i = 0; i < INPUTS; i++)
        *value_of(work, inputs[i]) = ((const double *)(const void *)at)[inputs[i]] + at->slope[i] * s;
    work->time = at->time + s;
    set_states(work, y);
    equations(work);
    for (int r = 0; r < STATE_ROWS; r++)
        for (uint32_t k = 0; k < state_rows[r].count; k++)
            *f++ = *value_of(work, state_rows[r].derivative + k);
}

/* RODAS: six stages, order 4 with an embedded order 3, L-stable and stiffly accurate. A Rosenbrock method: one
   Jacobian and six linear solves a step, no Newton iteration.
   Hairer, Wanner: Solving Ordinary Differential Equations II, 2nd ed. 1996, section IV.7; coefficients of METH = 1
   in the form that needs no product with the Jacobian (equation 7.25).

       (1/(gamma h) - J) U_i = f(t + alpha_i h, y + sum_j a_ij U_j) + sum_j c_ij U_j / h + d_i h f_t
       y(t + h) = y + sum_j a_6j U_j + U_5 + U_6,   error = U_6                                               */
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

/* One step of size h from (s, y) to y_new; the largest error over its tolerance, or -1 if it failed. */
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
        for (int i = 0; i < ALL_STATES; i++) {
            y_new[i] = y[i];
            for (int j = 0; j < stage; j++)
                y_new[i] += rodas_a[stage][j] * u[j][i];
        }
        derivatives(at, work, s + rodas_alpha[stage] * h, y_new, u[stage]);
        for (int i = 0; i < ALL_STATES; i++) {
            for (int j = 0; j < stage; j++)
                u[stage][i] += rodas_c[stage][j] / h * u[j][i];
            u[stage][i] += rodas_d[stage] * h * f_t[i];
        }
        for (int i = 0; i < ALL_STATES; i++)
            for (int j = 0; j < ALL_STATES; j++)
                matrix[i * ALL_STATES + j] = (i == j ? 1.0 / (rodas_gamma * h) : 0.0) - jacobian[i * ALL_STATES + j];
        if (!solve_linear(ALL_STATES, matrix, u[stage], 1))
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

/* Integrates `equations` over h with the block's relative tolerance; false if no step size meets it. */
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

    double s = 0.0, step = m->run.inner_step > 0.0 ? m->run.inner_step : 1e-3 * h;
    for (long tries = 0; s < h; tries++) {
        if (tries > MOST_TRIES)
            return too_much(m);
        const double wanted = step;
        const bool last = s + 1.01 * step >= h;
        if (last)
            step = h - s;
        const double error = rodas_step(m, &work, s, step, y, y_new, nominal, tolerance);
        const double factor = error < 0.0 ? 0.2 : clip(0.9 * pow(fmax(error, 1e-12), -0.25), 0.2, 6.0);
        if (error >= 0.0 && error <= 1.0) {
            s = last ? h : s + step;
            for (int i = 0; i < ALL_STATES; i++)
                y[i] = y_new[i];
            step = last ? fmax(wanted, step * factor) : step * factor;
        } else {
            step *= fmin(factor, 0.9);
            if (!(s + 1e-3 * step > s) && step < 1e-15 * h)
                return false;
        }
    }
    m->run.inner_step = step;
    set_states(m, y);
    return true;
}

/* x(h) of x' = a x + b + c s, exact: the exponential of the matrix [a c b; 0 0 1; 0 0 0] h by its Taylor series
   after halving h, then squaring. Van Loan, IEEE TAC 23(3), 1978. At most 6 states, balanced by the caller. */
static inline void linear_step(int n, const double *a, const double *b, const double *c, double *x, double h)
{
    enum { LARGEST = 8, TERMS = 16 };
    const int size = n + 2;
    double matrix[LARGEST * LARGEST] = {0.0}, result[LARGEST * LARGEST] = {0.0}, term[LARGEST * LARGEST],
                            next[LARGEST * LARGEST];

    double norm = 0.0;
    for (int i = 0; i < n; i++) {
        double row = 0.0;
        for (int j = 0; j < n; j++)
            row += fabs(a[i * n + j]) * h;
        norm = fmax(norm, row);
    }
    int halvings = 0;
    while (ldexp(norm, -halvings) > 0.5 && halvings < 1000)
        halvings++;
    const double part = ldexp(h, -halvings);

    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++)
            matrix[i * size + j] = a[i * n + j] * part;
        matrix[i * size + n] = c[i] * part;
        matrix[i * size + n + 1] = b[i] * part;
    }
    matrix[n * size + n + 1] = part;

    for (int i = 0; i < size; i++)
        result[i * size + i] = 1.0;
    for (int i = 0; i < size * size; i++)
        term[i] = result[i];
    for (int k = 1; k <= TERMS; k++) {
        for (int i = 0; i < size; i++)
            for (int j = 0; j < size; j++) {
                double sum = 0.0;
                for (int l = 0; l < size; l++)
                    sum += matrix[i * size + l] * term[l * size + j];
                next[i * size + j] = sum / k;
            }
        for (int i = 0; i < size * size; i++) {
            term[i] = next[i];
            result[i] += next[i];
        }
    }
    for (; halvings > 0; halvings--) {
        for (int i = 0; i < size; i++)
            for (int j = 0; j < size; j++) {
                double sum = 0.0;
                for (int l = 0; l < size; l++)
                    sum += result[i * size + l] * result[l * size + j];
                next[i * size + j] = sum;
            }
        for (int i = 0; i < size * size; i++)
            result[i] = next[i];
    }

    double moved[LARGEST];
    for (int i = 0; i < n; i++) {
        moved[i] = result[i * size + n + 1];
        for (int j = 0; j < n; j++)
            moved[i] += result[i * size + j] * x[j];
    }
    for (int i = 0; i < n; i++)
        x[i] = moved[i];
}

#endif
#endif
