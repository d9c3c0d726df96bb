/* Plain laws, continued: those with events, stacks, histories or populations. Where no closed form is in use, they take
   Runge-Kutta substeps that are short enough for some 1e-6. */

/* Fc, Fs, vs, delta, sigma0, sigma1, sigma2, z_ba; x: z */
static double blend(double y, double z_max, double z_ba)
{
    const double alpha = y <= z_ba ? 0.0 : y >= z_max ? 1.0 : 0.5 - 0.5 * cos(M_PI * (y - z_ba) / (z_max - z_ba));
    return 1.0 - alpha * y / z_max;
}
static double ElastoPlastic(double *x, const double *p, double v, double h)
{
    const double s = sign(v), z_ba = p[7], z_max = stribeck(p, v) / p[4];
    double y = s * x[0], path = fabs(v) * h;
    const double elastic = fmin(path, fmax(z_ba - y, 0.0));
    y += elastic;
    path = fmin(path - elastic, 60.0 * z_max);
    if (path > 0.0 && y < z_max) {
        const int parts = (int)ceil(path / (0.1 * (z_max - z_ba)));
        const double d = path / parts;
        for (int j = 0; j < parts; j++) {
            const double a = blend(y, z_max, z_ba), b = blend(y + 0.5 * d * a, z_max, z_ba),
                         c = blend(y + 0.5 * d * b, z_max, z_ba), e = blend(y + d * c, z_max, z_ba);
            y += d / 6.0 * (a + 2.0 * b + 2.0 * c + e);
        }
    } else if (path > 0.0)
        y = z_max + (y - z_max) * exp(-path / z_max);
    x[0] = s == 0.0 ? x[0] : s * y;
    return p[4] * x[0] + p[5] * v * (s * x[0] > 0.0 ? blend(s * x[0], z_max, z_ba) : 1.0) + p[6] * v;
}

/* kt, Fc, Fv, Fs_a, Fs_inf, vs, tauL, gamma; tauL a multiple of h; x: d, t2, Fs_last, slip, started, place in the ring,
   the ring */
static double SevenParameter(double *x, const double *p, double v, double h)
{
    const double kt = p[0], Fc = p[1], Fs_inf = p[4], vs = p[5], gamma = p[7], s = sign(v);
    const int delay = (int)lround(p[6] / h) > 0 ? (int)lround(p[6] / h) : 1;
    double *const d = &x[0], *const t2 = &x[1], *const last = &x[2], *const slip = &x[3], *const ring = &x[6];
    int now = (int)x[5];
    if (x[4] == 0.0) {
        *last = p[3];
        x[4] = 1.0;
    }
    if (*slip != 0.0 && s != *slip) {
        const double ratio = ring[now] / vs;
        *last = (*last + (Fs_inf - *last) * *t2 / (*t2 + gamma)) / (1.0 + ratio * ratio);
        *d = *slip * (Fc + *last) / kt;
        *t2 = *slip = 0.0;
    }
    ring[now] = v;
    now = now + 1 < delay ? now + 1 : 0;
    x[5] = now;
    if (*slip == 0.0) { /* (kt s d - Fc - last) (t2 + gamma) = (Fs_inf - last) t2 is quadratic in time */
        const double over = kt * s * *d - Fc - *last, rise = Fs_inf - *last, pull = kt * fabs(v), t = *t2 + gamma;
        const double c = over * t - rise * *t2, b = over + pull * t - rise;
        double wait = h;
        if (s != 0.0 && c + h * (b + h * pull) > 0.0) {
            wait = c >= 0.0 ? 0.0 : 2.0 * -c / (b + sqrt(b * b - 4.0 * pull * c));
            *slip = s;
        }
        *d += v * wait;
        *t2 += wait;
    }
    if (*slip == 0.0)
        return kt * *d;
    const double ratio = ring[now] / vs, Fs = *last + (Fs_inf - *last) * *t2 / (*t2 + gamma);
    return *slip * (Fc + Fs / (1.0 + ratio * ratio)) + p[2] * v;
}

/* Fc, Fs, vs, delta, A, zc, n, sigma1, sigma2; x: base, z, last direction, number of reversal points, they */
static double leuven_curve(const double *p, double y) { return copysign(p[4] * (1.0 - exp(-fabs(y) / p[5])), y); }
static double leuven_inverse(const double *p, double force)
{
    return copysign(-p[5] * log(1.0 - fabs(force) / p[4]), force);
}
static double leuven_rate(const double *p, double y, double room)
{
    const double r = leuven_curve(p, y) / room;
    return 1.0 - copysign(pow(fabs(r), p[6]), r);
}
static double leuven_slip(const double *p, double y, double room, double d)
{
    const double a = leuven_rate(p, y, room), b = leuven_rate(p, y + 0.5 * d * a, room),
                 c = leuven_rate(p, y + 0.5 * d * b, room), e = leuven_rate(p, y + d * c, room);
    return y + d / 6.0 * (a + 2.0 * b + 2.0 * c + e);
}
static double Leuven(double *x, const double *p, double v, double h)
{
    enum { DEEPEST = 64 };
    double *const base = &x[0], *const z = &x[1], *const before = &x[2], *const stack = &x[4];
    const double s = sign(v), S = stribeck(p, v);
    int depth = (int)x[3];
    if (s != 0.0 && s == -*before) {
        *base += leuven_curve(p, *z);
        if (depth == DEEPEST)
            depth -= 2;
        stack[depth++] = *base;
        *z = 0.0;
    }
    if (s != 0.0)
        *before = s;
    double y = s * *z, path = fabs(v) * h;
    for (;;) {
        const double force = s * *base + leuven_curve(p, y), room = S - s * *base;
        const double closing = depth >= 2 ? s * stack[depth - 2] : HUGE_VAL;
        const bool slides = depth > 0 && force - s * *base >= 0.999 * room - 1e-12;
        if (s != 0.0 && (slides || force >= closing - 1e-12)) {
            depth = slides ? 0 : depth - 2;
            *base = depth > 0 ? stack[depth - 1] : 0.0;
            y = leuven_inverse(p, force - s * *base);
            continue;
        }
        if (path <= 0.0)
            break;
        const double target = fmin(depth > 0 ? leuven_inverse(p, 0.999 * room) : HUGE_VAL,
                                   depth >= 2 ? leuven_inverse(p, closing - s * *base) : HUGE_VAL);
        const double d = fmin(path, 0.1 / fmax(p[6], 1.0) * p[5] * room / p[4]);
        const double next = leuven_slip(p, y, room, d);
        if (next < target) {
            path -= d;
            y = next;
        } else { /* the path to the target, by Simpson's rule for dx/dy */
            path -= (target - y) / 6.0 *
                    (1.0 / leuven_rate(p, y, room) + 4.0 / leuven_rate(p, 0.5 * (y + target), room) +
                     1.0 / leuven_rate(p, target, room));
            y = target;
        }
    }
    *z = s == 0.0 ? *z : s * y;
    x[3] = depth;
    return *base + leuven_curve(p, *z) + p[7] * v * leuven_rate(p, s * *z, S - s * *base) + p[8] * v;
}

/* Fc, Fs, vs, delta, n, sigma1, sigma2, N, k[10], W[10]; x: the forces of the elements */
static double modified_rate(const double *p, const double *F, double way, double S)
{
    double sum = 0.0;
    for (int j = 0; j < (int)p[7]; j++)
        sum += clip(F[j] + p[8 + j] * way, -p[18 + j], p[18 + j]);
    const double r = sum / S;
    return 1.0 - copysign(pow(fabs(r), p[4]), r);
}
static double ModifiedLeuven(double *x, const double *p, double v, double h)
{
    const int N = (int)p[7];
    double stiffness = 0.0, sum = 0.0;
    for (int j = 0; j < N; j++)
        stiffness += p[8 + j];
    const double s = sign(v), S = s * stribeck(p, v), path = v * h;
    const int parts = s == 0.0 ? 0 : (int)ceil(fabs(path * stiffness / S) * fmax(p[4], 1.0) / 0.05);
    for (int part = 0; part < parts; part++) {
        const double d = path / parts;
        const double a = modified_rate(p, x, 0.0, S), b = modified_rate(p, x, 0.5 * d * a, S),
                     c = modified_rate(p, x, 0.5 * d * b, S), e = modified_rate(p, x, d * c, S);
        const double way = d / 6.0 * (a + 2.0 * b + 2.0 * c + e);
        for (int j = 0; j < N; j++)
            x[j] = clip(x[j] + p[8 + j] * way, -p[18 + j], p[18 + j]);
    }
    for (int j = 0; j < N; j++)
        sum += x[j];
    return sum + (s != 0.0 ? p[5] * v * modified_rate(p, x, 0.0, S) + p[6] * v : 0.0);
}

/* mu0, a, b, Dc, V0, sigma_n; x: theta; the aging law */
static double RateAndState(double *x, const double *p, double v, double h)
{
    const double mu0 = p[0], a = p[1], b = p[2], Dc = p[3], V0 = p[4], path = fabs(v) * h / Dc;
    if (x[0] == 0.0)
        x[0] = Dc / V0;
    x[0] = path > 0.0 ? Dc / fabs(v) + (x[0] - Dc / fabs(v)) * exp(-path) : x[0] + h;
    return p[5] * a * asinh(0.5 * v / V0 * exp((mu0 + b * log(V0 * x[0] / Dc)) / a));
}

/* N, sigma0, delta_s, Delta; x: the state of a linear congruential generator, the deflections */
static double Bristle(double *x, const double *p, double v, double h)
{
    double sum = 0.0;
    for (int j = 1; j <= (int)p[0]; j++) {
        x[j] += v * h;
        while (fabs(x[j]) > p[2]) {
            x[0] = fmod(16807.0 * (x[0] + 1.0), 2147483647.0);
            x[j] -= sign(x[j]) * p[3] * (x[0] + 0.5) / 2147483647.0;
        }
        sum += p[1] * x[j];
    }
    return sum;
}
