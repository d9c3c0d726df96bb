/* Friction laws as an engineer would write them by hand: a function of the state x, the parameters p and a velocity
   that is held for h, which moves x and returns the force. No checks, no outputs but the force, no states to save; the
   external force is 0 and the normal force nominal. LAW names the parameters p, in their order. */

static double sign(double a) { return (double)((a > 0.0) - (a < 0.0)); }
static double clip(double a, double low, double high) { return a < low ? low : a > high ? high : a; }
static double stribeck(const double *p, double v) { return p[0] + (p[1] - p[0]) * exp(-pow(fabs(v) / p[2], p[3])); }

/* p: Fc */
static double Coulomb(double *x, const double *p, double v, double h)
{
    (void)x;
    (void)h;
    return p[0] * sign(v);
}

/* p: Fc, Fs, vs, delta, Fv */
static double Stribeck(double *x, const double *p, double v, double h)
{
    (void)x;
    (void)h;
    return stribeck(p, v) * sign(v) + p[4] * v;
}

/* p: sigma, Fc, n; x: F */
static double Dahl(double *x, const double *p, double v, double h)
{
    const double target = p[1] * sign(v), path = p[0] * fabs(v) * h / p[1];
    if (p[2] == 1.0)
        return x[0] = target + (x[0] - target) * exp(-path);
    const double gap = fabs(target - x[0]) / p[1], q = 1.0 + (p[2] - 1.0) * path * pow(gap, p[2] - 1.0);
    return x[0] = q > 0.0 ? target + (x[0] - target) * pow(q, -1.0 / (p[2] - 1.0)) : target;
}

/* p: Fc, Fs, vs, delta, sigma0, sigma1, sigma2; x: z */
static double LuGre(double *x, const double *p, double v, double h)
{
    const double g = stribeck(p, v), rate = p[4] * fabs(v) / g, target = sign(v) * g / p[4];
    x[0] = target + (x[0] - target) * exp(-rate * h);
    return p[4] * x[0] + p[5] * (v - rate * x[0]) + p[6] * v;
}

/* p: sigma0, z0, a, beta; x: z */
static double ResetIntegrator(double *x, const double *p, double v, double h)
{
    x[0] = clip(x[0] + v * h, -p[1], p[1]);
    const bool held = fabs(x[0]) < p[1];
    return (held ? 1.0 + p[2] : 1.0) * p[0] * x[0] + p[3] * (held ? v : 0.0);
}

/* p: N, k[10], W[10]; x: the forces */
static double MaxwellSlip(double *x, const double *p, double v, double h)
{
    double F = 0.0;
    for (int j = 0; j < (int)p[0]; j++) {
        x[j] = clip(x[j] + p[1 + j] * v * h, -p[11 + j], p[11 + j]);
        F += x[j];
    }
    return F;
}

/* p: f1, f2, eta, eps; x: the two forces of the second order */
static double BlimanSorine(double *x, const double *p, double v, double h)
{
    const double path = fabs(v) * h, s = sign(v);
    x[0] = s * p[0] + (x[0] - s * p[0]) * exp(-path / (p[2] * p[3]));
    x[1] = -s * p[1] + (x[1] + s * p[1]) * exp(-path / p[3]);
    return x[0] + x[1];
}

/* p: Fc, Fs, vs, delta, C, sigma2, N, k[10], alpha[10]; x: the forces, whether they slip, the last direction */
static double GMS(double *x, const double *p, double v, double h)
{
    const double s = sign(v), level = stribeck(p, v), fade = exp(-p[4] * h / level);
    double F = p[5] * v, *const slips = x + 10, *const before = x + 20;
    for (int j = 0; j < (int)p[6]; j++) {
        const double target = s * p[17 + j] * level;
        if (s != *before)
            slips[j] = 0.0;
        if (slips[j] != 0.0)
            x[j] = target + (x[j] - target) * fade;
        else {
            x[j] += p[7 + j] * v * h;
            if (s != 0.0 && s * x[j] >= s * target) {
                x[j] = target;
                slips[j] = 1.0;
            }
        }
        F += x[j];
    }
    *before = s;
    return F;
}

/* Fv, delta_v */
static double Viscous(double *x, const double *p, double v, double h)
{
    (void)x;
    (void)h;
    return p[0] * sign(v) * pow(fabs(v), p[1]);
}

/* Fc, Fs, Fv */
static double Stiction(double *x, const double *p, double v, double h)
{
    (void)x;
    (void)h;
    return v == 0.0 ? 0.0 : p[0] * sign(v) + p[2] * v;
}

/* Fc, Fs, vs, Fv */
static double Tustin(double *x, const double *p, double v, double h)
{
    (void)x;
    (void)h;
    return sign(v) * (p[0] + (p[1] - p[0]) * exp(-fabs(v) / p[2])) + p[3] * v;
}

/* Fc, Fs, Fv, DV */
static double Karnopp(double *x, const double *p, double v, double h)
{
    (void)x;
    (void)h;
    return fabs(v) < p[3] ? 0.0 : p[0] * sign(v) + p[2] * v;
}

/* Fc, T_dz, Fv, DV */
static double DeadZoneTorque(double *x, const double *p, double v, double h)
{
    (void)x;
    (void)h;
    return fabs(v) < p[3] ? 0.0 : p[0] * sign(v) + p[2] * v;
}
