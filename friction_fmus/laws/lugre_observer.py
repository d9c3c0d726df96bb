"""Friction feedback from an observed LuGre bristle state."""

from __future__ import annotations

from casadi import SX, fabs, if_else

from friction_fmus.lawkit.expressions import limits, stribeck_level, unless_winding_up
from friction_fmus.lawkit.law import (
    FORCE,
    LENGTH,
    NO_UNIT,
    Command,
    Friction,
    Loop,
    Output,
    Parameter,
    SampleTime,
    State,
    Use,
    law,
)
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.observers import acting, limited


@law(
    "LuGreObserver",
    "Feedback of friction from an observed LuGre bristle deflection",
    source="Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995",
    Ts=1e-3,
    quotes=("injection", "fed_back_stiffness", "overcompensation", "explicit_observer"),
    needs={"presliding in feedback": 1, "stiction error": 2},
    loop=Loop(
        friction=Friction("Fc", "Fs", "sigma2", "vs", "delta"),
        measured=True,
        at_rest=True,
        rules=("injection_of_error", "feeds_stiffness_back"),
    ),
    use=Use("model feedback", models=("LuGre",)),
    outputs={
        "u": Output(FORCE, "compensation force gain F_hat, within u_min and u_max"),
        "F_hat": Output(FORCE, "estimated friction force; u contains gain F_hat"),
        "u_sat": Output(NO_UNIT, "active limit: -1 lower, +1 upper, 0 none"),
    },
)
def lugre_observer(
    r: SX = variables.R,
    x: SX = variables.X,
    v: SX = variables.V,
    enable: SX = Command(True, "false: u = 0, F_hat = 0 and z at its start"),
    reset: SX = Command(False, "true: z at its start"),
    z: SX = State(LENGTH, 0.0, "observed mean bristle deflection", nominal=1e-5),
    gain: SX = variables.GAIN,
    k: SX = Parameter("1/s", 0.0, "injection of the position error, 0: observer without correction", min=0.0),
    sigma0: SX = variables.SIGMA0,
    sigma1: SX = variables.SIGMA1,
    sigma2: SX = variables.SIGMA2,
    Fc: SX = variables.POSITIVE_FC,
    Fs: SX = variables.POSITIVE_FS,
    vs: SX = variables.VS,
    delta: SX = variables.DELTA,
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """Positive feedback of the friction of a LuGre bristle that is observed from the measured velocity.

        g(v)  = Fc + (Fs - Fc) exp(-|v/vs|^delta)
        z'    = v - sigma0 |v|/g(v) z + k (r - x)
                without k (r - x) while u is limited and r - x pushes further
                into that limit
        F_hat = sigma0 z + sigma1 z' + sigma2 v
        u     = clip(gain F_hat, u_min, u_max)

    Canudas de Wit, Olsson, Astrom, Lischinsky: A new model for control of systems with friction, IEEE TAC 40(3), 1995.
    u goes to the input f of a position controller H(s), which makes the paper's law u = H(s) (r - x) + F_hat + m rdd.
    Parameters and start values as in the friction block LuGre. From sample to sample z follows the exact solution for
    constant inputs,

        z_next = z + Ts phi1(q) z',   q = sigma0 |v|/g(v) Ts
        phi1(q) = (1 - exp(-q))/q

    which stays bounded at any velocity; Euler's explicit step diverges from 2 g/(sigma0 Ts) on, at 20 mm/s with the
    start values. F_hat of a sample contains z before that step.

    Use it where the motion is not known in advance, or differs much from the reference, and a LuGre model of the axis
    is at hand. Where the reference is known feedforward of the same model is several times better: the error here is
    proportional to Ts. With it a position loop without integrator moves slowly to its reference instead of sticking,
    and does not hunt.

    With k = 0 the error of z obeys z_err' = -sigma0 |v|/g z_err: it dies in any motion. Injection, k > 0, makes it
    faster and corrects errors of the model. For H(s) = Kp + Kd s + Ki/s and the mass m the loop

        G(s) = s (sigma1 s + sigma0) / (m s^3 + Kd s^2 + Kp s + Ki)

    is positive real, and the closed loop with an exact model stable for every k (before sampling), if and only if

        sigma1 Kd >= sigma0 m   and   sigma0 Kp >= sigma1 Ki

    (derived for this library). With the start values and 1 kg that is Kd >= 316 N.s/m. A position loop of 10 Hz has
    less; there the tracking error turns up again from a certain k on.

    While enable is false, u, F_hat, u_sat and z are 0; reset sets z to 0 in its own sample.

    Limits: needs a measured velocity; delay and noise in it are multiplied by sigma1. The estimate pushes where the
    parameters are larger than those of the axis: keep gain below 1 then. u_min must not exceed u_max.
    """
    rate = sigma0 * fabs(v) / stribeck_level(fabs(v), Fc, Fs, vs, delta)
    injected = k * (r - x)
    slope = v + injected - rate * z
    F_hat = if_else(reset, sigma1 * (v + injected), sigma0 * z + sigma1 * slope) + sigma2 * v
    active = limits(gain * F_hat, u_min, u_max)
    # apart from the usual case, which has computed its slope for F_hat
    held = if_else(active != 0.0, v + unless_winding_up(injected, active) - rate * z, slope)
    return {
        **limited(SX(0.0), F_hat, gain, enable, u_min, u_max),
        "z": if_else(enable, if_else(reset, 0.0, z + acting(rate, Ts) * held), 0.0),
    }
