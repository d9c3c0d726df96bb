"""Sliding mode in implicit discretisation."""

from __future__ import annotations

from casadi import SX

from friction_fmus.lawkit.expressions import clip
from friction_fmus.lawkit.law import (
    FORCE,
    NO_UNIT,
    REPLACES_SERVO,
    Loop,
    Output,
    Parameter,
    SampleTime,
    law,
)
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.observers import limited


@law(
    "ImplicitSlidingMode",
    "Sliding mode of first order without chattering, by an implicit step",
    source="Acary, Brogliato, Systems and Control Letters 59(5), 2010",
    Ts=1e-3,
    quotes=("loop_poles", "sliding_gain", "break_away"),
    needs={"bound only": 1},
    loop=Loop(
        gains={"Kp": "gain * m / Ts * lam", "Kd": "gain * m / Ts + m * lam"}, linear={}, rules=("covers_friction",)
    ),
    use=REPLACES_SERVO,
    outputs={
        "u": Output(FORCE, "control force, within u_min and u_max"),
        "F_hat": Output(FORCE, "force of the sliding mode: in sliding, with gain 1, the friction of the last sample"),
        "u_sat": Output(NO_UNIT, "active limit: -1 lower, +1 upper, 0 none"),
    },
)
def implicit_sliding_mode(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    x: SX = variables.X,
    v: SX = variables.V,
    f: SX = variables.FED_FORWARD,
    enable: SX = variables.ENABLE,
    gain: SX = Parameter(NO_UNIT, 1.0, "fraction of the sliding-mode force", min=0.0, max=1.0),
    m: SX = variables.MASS_OR_NONE,
    lam: SX = variables.LAM,
    K: SX = Parameter(FORCE, 5.0, "bound of the sliding-mode force, above the friction that f leaves", min=0.0),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """Sliding mode whose sign is that of the next sample, which makes it one saturation.

        s     = (rd - v) + lam (r - x)
        F_hat = clip(m s/Ts, -K, K)
        u     = clip(m (rdd + lam (rd - v)) + f + gain F_hat, u_min, u_max)

    Acary, Brogliato: Implicit Euler numerical scheme and chattering-free implementation of sliding mode systems,
    Systems and Control Letters 59(5), 2010; Kikuuwe, Fujimoto: Proxy-based sliding mode control, IEEE ICRA 2006. The
    continuous law is u = m (rdd + lam (rd - v)) + K sgn(s). Its implicit Euler step without friction,

        m (s_next - s)/Ts = -K sgn(s_next),   sgn(0) = anything from -1 to 1

    has the one solution s_next = s - Ts/m clip(m s/Ts, -K, K): s falls by K Ts/m a sample and is exactly 0 after

        n = ceil(m |s|/(K Ts))

    samples, where the explicit sign would swing about 0 by K Ts/m for ever. With a friction force F, |F| <= K, the
    same law ends with s = F Ts/m, whatever K is, and F_hat is F of one sample before. (All of it for gain = 1, and up
    to terms of the order lam Ts of one step of s, as r - x changes within a sample.)

    Use it for robust tracking with an upper bound of friction as the only model; a bound that is too high does no
    harm, unlike in the explicit law. There is no state, and nothing that winds up. f takes a friction feedforward,
    without its inertia part. gain below 1 takes a share of the step to s = 0: softer, and less sensitive to noise of v
    and to a mass that is smaller than m.

    While enable is false, u, F_hat and u_sat are 0.

    Limits: within K it is a proportional controller of the highest gain that one sample allows, gain m/Ts on s: a
    delay, a flexible load or a true mass below gain m/2 makes it unstable, and noise of v goes into u by that factor.
    F_hat is one sample late, so the error is proportional to Ts; ImplicitSuperTwisting has Ts^2. u_min must not exceed
    u_max.
    """
    ed = rd - v
    s = ed + lam * (r - x)
    return limited(m * (rdd + lam * ed) + f, clip(m * s / Ts, -K, K), gain, enable, u_min, u_max)
