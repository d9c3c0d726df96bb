"""PID position control."""

from __future__ import annotations

from casadi import SX, if_else

from friction_fmus.expressions import clip, limits, unless_winding_up
from friction_fmus.law import (
    ACCELERATION,
    DAMPING,
    FORCE,
    LENGTH,
    MASS,
    NO_UNIT,
    STIFFNESS,
    VELOCITY,
    Command,
    Input,
    Output,
    Parameter,
    SampleTime,
    State,
    law,
)


@law(
    "PID",
    "PID position controller with inertia feedforward and conditional anti-windup",
    source="Astrom, Hagglund: Advanced PID Control, ISA 2006",
    Ts=1e-3,
    outputs={
        "u": Output(FORCE, "control force, within u_min and u_max"),
        "u_sat": Output(NO_UNIT, "active limit: -1 lower, +1 upper, 0 none"),
    },
)
def pid(
    r: SX = Input(LENGTH, 0.0, "reference position"),
    rd: SX = Input(VELOCITY, 0.0, "reference velocity"),
    rdd: SX = Input(ACCELERATION, 0.0, "reference acceleration"),
    x: SX = Input(LENGTH, 0.0, "measured position"),
    v: SX = Input(VELOCITY, 0.0, "measured velocity"),
    f: SX = Input(FORCE, 0.0, "feedforward force, added before the limits", optional=True),
    enable: SX = Command(True, "false: u = 0 and the integral at its start"),
    reset: SX = Command(False, "true: the integral at its start"),
    integral: SX = State(LENGTH + ".s", 0.0, "integral of the position error", nominal=1e-4),
    Kp: SX = Parameter(STIFFNESS, 12e3, "proportional gain", min=0.0),
    Kd: SX = Parameter(DAMPING, 190.0, "derivative gain", min=0.0),
    Ki: SX = Parameter(FORCE + "/(" + LENGTH + ".s)", 250e3, "integral gain, 0: PD", min=0.0),
    m: SX = Parameter(MASS, 0.0, "mass of the inertia feedforward, 0: none", min=0.0),
    u_min: SX = Parameter(FORCE, -1000.0, "lower limit of u"),
    u_max: SX = Parameter(FORCE, 1000.0, "upper limit of u"),
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """PID position control with feedforward of the reference acceleration, sampled every Ts.

        e      = r - x
        u      = clip(Kp e + Kd (rd - v) + Ki I + m rdd + f, u_min, u_max)
        I_next = I + Ts e
        I_next = I while u is limited and e pushes further into that limit

    Astrom, Hagglund: Advanced PID Control, ISA 2006 (conditional integration against windup). Ki = 0 is PD
    control. The start values place three poles near 10 Hz for a mass of 1 kg without friction.

    The integral of a sample does not contain that sample's error. While reset is true the integral is at its start, 0,
    in that very sample and in the next. While enable is false u and u_sat are 0 and the integral is at its start:
    nothing winds up, nothing old comes back, and u returns without a jump if the reference is then led from where the
    axis stands (r = x, rd = v, rdd = 0).

    The linear loop with viscous friction s2 is stable for (Kd + s2) Kp > mass Ki, if Ts is short against its time
    constants.

    Limits: if static friction exceeds Coulomb friction, the integral makes the loop hunt around a constant reference
    for every stabilising set of gains (Armstrong, Amin, Automatica 32(5), 1996); without the integral the axis stays
    up to Fs/Kp away. If f already holds the inertia force, as u of StaticFeedforward does, m must be 0. u_min must not
    exceed u_max.
    """
    start = 0.0
    old = if_else(reset, start, integral)
    e = r - x
    wanted = Kp * e + Kd * (rd - v) + Ki * old + m * rdd + f
    u_sat = limits(wanted, u_min, u_max)
    return {
        "u": if_else(enable, clip(wanted, u_min, u_max), 0.0),
        "u_sat": if_else(enable, u_sat, 0.0),
        "integral": if_else(reset, start, if_else(enable, old + Ts * unless_winding_up(e, u_sat), start)),
    }
