"""Expressions shared by laws: limits, bumpless start, friction observers and estimators, the reference.

While the input ``track`` is true, a law computes its memory backwards from the input ``u_track`` and continues with it:
Astrom, Hagglund: Advanced PID Control, ISA 2006 (tracking mode and bumpless transfer); Hanus, Kinnaert, Henrotte:
Conditioning technique, a general anti-windup and bumpless transfer method, Automatica 23(6), 1987.
"""

from collections.abc import Sequence

from casadi import SX, exp, expm1, fabs, fmax, if_else, logic_and, logic_not, logic_or, sign


def clip(value: SX, low: SX, high: SX) -> SX:
    """Return the value limited to low and high; NaN stays NaN (fmin and fmax would return a limit)."""
    return if_else(value < low, low, if_else(value > high, high, value))


def limits(value: SX, low: SX, high: SX) -> SX:
    """Return the active limit: -1 below low, +1 above high, else 0."""
    return if_else(value < low, -1.0, if_else(value > high, 1.0, 0.0))


def unless_winding_up(rate: SX, active: SX) -> SX:
    """Return the rate of an integral, or 0 while it would drive the output further into the active limit."""
    return if_else(rate * active > 0.0, 0.0, rate)


def elapsed(missed: SX, Ts: SX) -> SX:
    """Return the time since the last valid sample."""
    return (missed + 1.0) * Ts


def stribeck_level(speed: SX, Fc: SX, Fs: SX, vs: SX, delta: SX) -> SX:
    """Return the Stribeck curve g = Fc + (Fs - Fc) exp(-(speed/vs)^delta) for a speed that is not negative."""
    ratio = speed / vs
    power = if_else(delta == 2.0, ratio**2, ratio**delta)
    # beyond 87 the exponential is a denormal float: negligible, and several times slower
    excess = (Fs - Fc) * if_else(power > 87.0, 0.0, exp(-power))
    return Fc + excess


def direction(rd: SX, v_rest: SX) -> SX:
    """Return the sign of the reference velocity, 0 at rest."""
    return if_else(fabs(rd) <= v_rest, 0.0, sign(rd))  # NaN stays NaN


def restarts(reset: SX, track: SX) -> SX:
    """Return whether the memory is at its start value: during a reset, unless the law tracks a force."""
    return logic_and(reset, logic_not(track))


def tracked(track: SX, u_track: SX, gain: SX, otherwise: SX) -> SX:
    """Return the output of a law before its limits: u_track itself, or `otherwise` if the law has no memory to set."""
    # Computed from the memory, it would reach a limit or not as rounding decides.
    return if_else(logic_and(track, gain != 0.0), u_track, otherwise)


def carried(track: SX, u: SX, rest: SX, gain: SX, otherwise: SX) -> SX:
    """Return the memory with which a law begins a sample."""
    follows = logic_and(track, gain != 0.0)
    return if_else(follows, (u - rest) / if_else(follows, gain, 1.0), otherwise)


def deflected(track: SX, u_track: SX, rest: SX, stiffness: SX, most: SX, u_min: SX, u_max: SX, otherwise: SX) -> SX:
    """Return the deflection of a contact with which a law begins a sample, as `carried`."""
    squared = stiffness**2  # of a known sign, unlike the stiffness, so that the generated C need not exclude -0.0
    follows = logic_and(track, squared != 0.0)
    limited_track = clip(u_track, u_min, u_max)
    deflection = (limited_track - rest) * stiffness / if_else(follows, squared, 1.0)
    return if_else(follows, clip(deflection, -most, most), otherwise)


def load_of(Fn: SX, Fn0: SX) -> SX:
    """Return the factor of the friction that a normal force has, which is exactly 1 for Fn = Fn0."""
    return fmax(Fn, 0.0) / Fn0


def starts_now(reset: SX, running: SX) -> SX:
    """Return whether this sample only adopts the measured values: the first sample, or one with reset true."""
    return logic_or(reset, logic_not(running))


def corrected(
    mean: Sequence[SX], P: Sequence[Sequence[SX]], units: Sequence[SX], i: int, measured: SX, variance: SX
) -> tuple[list[SX], list[list[SX]]]:
    """Return the state of a Kalman filter after a measurement of its element i."""
    n = len(mean)
    column = [P[min(i, j)][abs(i - j)] for j in range(n)]
    total = column[i] + variance
    residual = (measured - mean[i]) / units[i]
    found = [value + unit * c / total * residual for value, unit, c in zip(mean, units, column, strict=True)]
    share = variance / total
    triangle = [
        [P[j][k - j] * share if i in (j, k) else P[j][k - j] - column[j] / total * column[k] for k in range(j, n)]
        for j in range(n)
    ]
    return found, triangle


def limited(
    rest: SX, F_hat: SX, gain: SX, enable: SX, u_min: SX, u_max: SX, track: SX | None = None, u_track: SX | None = None
) -> dict[str, SX]:
    """Return u, F_hat and u_sat, with u from a fraction of the friction and other terms; all 0 unless enabled."""
    wanted = rest + gain * F_hat
    if track is not None and u_track is not None:
        wanted = tracked(track, u_track, gain, wanted)
    return {
        "u": if_else(enable, clip(wanted, u_min, u_max), 0.0),
        "F_hat": if_else(enable, F_hat, 0.0),
        "u_sat": if_else(enable, limits(wanted, u_min, u_max), 0.0),
    }


def acting(rate: SX, Ts: SX) -> SX:
    """Return (1 - exp(-rate Ts)) / rate, the effective duration of the initial slope of z' = drive - rate z in Ts."""
    # Drive and rate >= 0 are constant. A series replaces the quotient where it would lose accuracy.
    q = rate * Ts
    # fabs instead of a minus, as it is known not to return -0.0, which saves an operation in the generated C
    return if_else(q < 1e-5, Ts * (1.0 - q / 2.0), fabs(expm1(-q) / rate))


def relaxed(z: SX, drive: SX, rate: SX, Ts: SX) -> SX:
    """Return the exact solution of z' = drive - rate z after Ts for constant drive and rate >= 0, however stiff."""
    return z + acting(rate, Ts) * (drive - rate * z)


def adapted(value: SX, rate: SX, push: SX, active: SX, low: SX, high: SX, Ts: SX) -> SX:
    """Return a parameter after one step of its adaptation, limited to low and high."""
    return clip(value + Ts * if_else(push * active > 0.0, 0.0, rate), low, high)


def periodic_table(place: SX, table: SX) -> SX:
    """Interpolate linearly in a periodic table with n elements; place is 0 at the first element and at most n."""
    n = table.numel()
    total = SX(0.0)
    for i in range(n):
        # without decisions, so that NaN in the place stays NaN
        apart = n / 2.0 - fabs(fabs(place - i) - n / 2.0)
        weight = (fabs(apart + 1.0) + fabs(apart - 1.0) - 2.0 * apart) / 2.0
        total += weight * table[i]
    return total


def increment(r: SX, last: SX, started: SX, reset: SX) -> SX:
    """Return the displacement of the reference since the previous sample; 0 in the first sample and during reset."""
    # r - r instead of 0, so that NaN stays NaN
    return r - if_else(logic_and(started, logic_not(reset)), last, r)


def filled(now: SX, before: Sequence[SX], missed: SX) -> list[SX]:
    """Return the values of the previous samples, latest first; after missing samples they lie on a straight line."""
    slope = (now - before[0]) / (missed + 1.0)
    return [if_else(missed > 0.0, now - (j + 1.0) * slope, value) for j, value in enumerate(before)]


def at_most(value: SX, limit: SX | float) -> SX:
    """Return the smaller of both; NaN stays NaN."""
    return if_else(value > limit, limit, value)


def relax(value: SX, target: SX, decay: SX) -> SX:
    """Return the value after exact relaxation to a target over `decay` time constants, as in solver.h."""
    return value - (target - value) * expm1(-decay)


def fading(sigma1: SX, speed: SX, v_d: SX) -> SX:
    """Return the bristle damping, which decreases with speed if v_d > 0, as in presliding.h."""
    fades = v_d > 0.0
    ratio = speed / if_else(fades, v_d, 1.0)
    return if_else(fades, sigma1 * exp(-(ratio**2)), sigma1)


def when(enable: SX, **values: SX | float) -> dict[str, SX]:
    """Return the values while enabled, else 0, the start value of the states of these laws."""
    return {name: if_else(enable, value, 0.0) for name, value in values.items()}


def reference_shift(force: SX, shift: SX, integral: SX, Kp: SX, Kd: SX, Ki: SX, Ts: SX) -> tuple[SX, SX, SX]:
    """Return the shift of the reference for which a PID controller generates a given force."""
    rate = (force - Kp * shift - Ki * integral) / Kd
    return rate, shift + Ts * rate, integral + Ts * shift


def settles_slowly(Kp: SX, Ki: SX, Ts: SX) -> SX:
    """Return whether the product of both poles of `reference_shift` is below 1; Ki = 0 leaves its integral unused."""
    return logic_or(Ts * Ki < Kp, Ki == 0.0)


def settles_fast(Kp: SX, Kd: SX, Ki: SX, Ts: SX) -> SX:
    """Return whether the characteristic polynomial of `reference_shift` is positive at -1."""
    return 2.0 * Ts * Kp < 4.0 * Kd + Ts**2 * Ki
