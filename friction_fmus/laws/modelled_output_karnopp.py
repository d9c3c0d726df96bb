"""Karnopp friction of a modelled velocity in a cascade with command feedforward."""

from __future__ import annotations

from casadi import SX, exp, fabs, if_else, sign

from friction_fmus.expressions import clip
from friction_fmus.law import (
    ACCELERATION,
    DAMPING,
    FORCE,
    LENGTH,
    MASS,
    NO_UNIT,
    VELOCITY,
    Command,
    Input,
    Output,
    Parameter,
    SampleTime,
    State,
    law,
)
from friction_fmus.law_parts.observers import limited


@law(
    "ModelledOutputKarnopp",
    "Cascade with command feedforward and Karnopp friction of the modelled velocity",
    source="Karnopp, ASME J. Dynamic Systems, Measurement and Control 107, 1985 (the friction)",
    Ts=1e-3,
    outputs={
        "u": Output(FORCE, "control force, within u_min and u_max"),
        "F_hat": Output(FORCE, "friction that is compensated, times gain"),
        "u_sat": Output(NO_UNIT, "active limit: -1 lower, +1 upper, 0 none"),
    },
)
def modelled_output_karnopp(
    r: SX = Input(LENGTH, 0.0, "reference position"),
    rd: SX = Input(VELOCITY, 0.0, "reference velocity"),
    rdd: SX = Input(ACCELERATION, 0.0, "reference acceleration"),
    x: SX = Input(LENGTH, 0.0, "measured position"),
    v: SX = Input(VELOCITY, 0.0, "measured velocity"),
    enable: SX = Command(True, "false: u = 0, F_hat = 0 and v_model = 0"),
    reset: SX = Command(False, "true: v_model = 0"),
    v_model: SX = State(VELOCITY, 0.0, "velocity of the modelled loop", nominal=1e-2),
    gain: SX = Parameter(NO_UNIT, 1.0, "share of the friction that is compensated", min=0.0, max=1.0),
    m: SX = Parameter(MASS, 1.0, "mass of the model", min=1e-12),
    KP: SX = Parameter("1/s", 63.0, "gain of the position loop", min=0.0),
    CV: SX = Parameter(DAMPING, 127.0, "gain of the velocity loop", min=0.0),
    Kv1: SX = Parameter(NO_UNIT, 1.0, "velocity feedforward to the velocity command", min=0.0),
    Ka: SX = Parameter(MASS, 1.0, "acceleration feedforward to the force", min=0.0),
    Kv2: SX = Parameter(DAMPING, 0.4, "velocity feedforward to the force", min=0.0),
    Fc: SX = Parameter(FORCE, 1.0, "Coulomb friction", min=0.0),
    Fs: SX = Parameter(FORCE, 1.5, "static friction, may be below Fc", min=0.0),
    Fv: SX = Parameter(DAMPING, 0.0, "viscous friction of the Karnopp model, beside Kv2", min=0.0),
    DV: SX = Parameter(VELOCITY, 1e-3, "half width of the band of velocity that counts as rest", min=1e-12),
    u_min: SX = Parameter(FORCE, -1000.0, "lower limit of u"),
    u_max: SX = Parameter(FORCE, 1000.0, "upper limit of u"),
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """TODO."""
    old = if_else(reset, 0.0, v_model)
    Vs = KP * (r - x) + Kv1 * rd
    drive = CV * (Vs - old)
    stuck = clip(drive, -Fs, Fs)
    F_hat = gain * if_else(fabs(old) < DV, stuck, Fc * sign(old) + Fv * old)
    wanted = CV * (Vs - v) + Ka * rdd + Kv2 * rd + F_hat
    after = Vs + (old - Vs) * exp(-CV * Ts / m)
    return {
        **limited(wanted, F_hat, enable, u_min, u_max),
        "v_model": if_else(reset, 0.0, if_else(enable, after, 0.0)),
    }
