"""Friction feedback with an observed LuGre bristle deflection."""

from casadi import SX, fabs, if_else

from friction_fmus.lawkit.law import Command, Friction, Parameter, SampleTime, State, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import (
    acting,
    deflected,
    limited,
    limits,
    load_of,
    restarts,
    stribeck_level,
    unless_winding_up,
)
from friction_fmus.lawkit.quantities import LENGTH


@law(
    "LuGreObserver",
    "Friction feedback with an observed LuGre bristle deflection",
    source="Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995",
    cites=("CanudasDeWit1995",),
    Ts=1e-3,
    friction=Friction("Fc", "Fs", "sigma2", "vs", "delta", stiffness="sigma0"),
    use=Use("model feedback", models=("LuGre",)),
    outputs=variables.COMPENSATION,
)
def lugre_observer(
    r: SX = variables.R,
    x: SX = variables.X,
    v: SX = variables.V,
    Fn: SX = variables.FN,
    enable: SX = Command(True, "false: u = 0, F_hat = 0 and z is at its start value"),
    reset: SX = Command(False, "true: z is reset to its start value"),
    track: SX = variables.TRACK,
    u_track: SX = variables.U_TRACK,
    z: SX = State(LENGTH, 0.0, "observed mean bristle deflection", nominal=1e-5),
    gain: SX = variables.GAIN,
    k: SX = Parameter("1/s", 0.0, "injection of the position error; 0: observer without correction", min=0.0),
    sigma0: SX = variables.SIGMA0,
    sigma1: SX = variables.SIGMA1,
    sigma2: SX = variables.SIGMA2,
    Fc: SX = variables.POSITIVE_FC,
    Fs: SX = variables.POSITIVE_FS,
    vs: SX = variables.VS,
    delta: SX = variables.DELTA,
    Fn0: SX = variables.FN0,
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """Positive feedback of LuGre friction with a bristle deflection observed from the measured velocity.

        g(v)  = Fc + (Fs - Fc) exp(-|v/vs|^delta)
        z'    = v - sigma0 |v|/g(v) z + k (r - x)
                without k (r - x) while u is limited and r - x pushes further
                into that limit
        F_hat = (sigma0 z + sigma1 z') max(Fn, 0)/Fn0 + sigma2 v
        u     = clip(gain F_hat, u_min, u_max)

    Canudas de Wit, Olsson, Astrom, Lischinsky: A new model for control of systems with friction, IEEE TAC 40(3), 1995.
    Connect u to the input f of a position controller H(s), which gives the law of the paper, u = H(s) (r - x) + F_hat +
    m rdd. Parameters and start values are the same as in the block LuGre. Between samples, z follows the exact solution
    for constant inputs,

        z_next = z + Ts phi1(q) z',   q = sigma0 |v|/g(v) Ts
        phi1(q) = (1 - exp(-q))/q

    which is bounded at any velocity. An explicit Euler step diverges from 2 g/(sigma0 Ts) on, which is 20 mm/s with the
    start values. F_hat in a sample uses z before that step.

    Use it if the motion is not known in advance or differs considerably from the reference, and a LuGre model of the
    axis is available. With a known reference, feedforward with the same model is several times better, as the error of
    this law is proportional to Ts. With this law, a position loop without integral action moves slowly to its reference
    instead of sticking, and does not hunt.

    With k = 0, the error of z obeys z_err' = -sigma0 |v|/g z_err, so it decays during any motion. Injection (k > 0)
    accelerates this and corrects model errors. For H(s) = Kp + Kd s + Ki/s and the mass m, the loop

        G(s) = s (sigma1 s + sigma0) / (m s^3 + Kd s^2 + Kp s + Ki)

    is positive real, and the closed loop with an exact model is stable for every k (in continuous time), if and only if

        sigma1 Kd >= sigma0 m   and   sigma0 Kp >= sigma1 Ki

    (derived for this library). With the start values and 1 kg, this requires Kd >= 316 N.s/m. A position loop of 10 Hz
    has less damping; the tracking error then grows again above a certain k.

    While enable is false, u, F_hat, u_sat and z are 0; reset sets z to 0 in the same sample. While track is true, z is
    such that u = u_track, as far as |z| <= g(v)/sigma0.

    Limits: the law needs a measured velocity, whose delay and noise are amplified by sigma1. If the parameters exceed
    the parameters of the axis, the estimate drives the axis; set gain < 1 in this case. u_min must not exceed u_max.
    """
    level = stribeck_level(fabs(v), Fc, Fs, vs, delta)
    rate = sigma0 * fabs(v) / level
    injected = k * (r - x)
    stretch = v + injected
    load = load_of(Fn, Fn0)
    rest, stiffness = gain * (sigma1 * load * stretch + sigma2 * v), gain * load * (sigma0 - sigma1 * rate)
    old = deflected(track, u_track, rest, stiffness, level / sigma0, u_min, u_max, z)
    fresh = restarts(reset, track)
    slope = stretch - rate * old
    F_hat = load * if_else(fresh, sigma1 * stretch, sigma0 * old + sigma1 * slope) + sigma2 * v
    active = limits(gain * F_hat, u_min, u_max)
    # separate from the usual case, where the slope is already computed for F_hat
    held = if_else(active != 0.0, v + unless_winding_up(injected, active) - rate * old, slope)
    return {
        **limited(SX(0.0), F_hat, gain, enable, u_min, u_max),
        "z": if_else(enable, if_else(fresh, 0.0, old + acting(rate, Ts) * held), 0.0),
    }
