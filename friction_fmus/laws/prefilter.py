"""Prefilter of the reference that does what a feedforward force does."""

from __future__ import annotations

from casadi import SX, if_else

from friction_fmus.lawkit.law import (
    DAMPING,
    FORCE,
    LENGTH,
    NO_UNIT,
    SHAPES_REFERENCE,
    STIFFNESS,
    VELOCITY,
    Command,
    Input,
    Loop,
    Output,
    Parameter,
    SampleTime,
    State,
    law,
)
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.feedforward import reference_shift, settles_fast, settles_slowly, when


@law(
    "Prefilter",
    "Reference that makes a PID controller give a feedforward force: R = 1 + F/C",
    source="Identity C R r = C r + F r",
    Ts=1e-3,
    portrait="shaping",
    quotes=("prefilter", "prefilter_match"),
    needs={"reference only": 1},
    loop=Loop(shapes=True),
    use=SHAPES_REFERENCE,
    outputs={
        "r_out": Output(LENGTH, "reference position for the controller"),
        "rd_out": Output(VELOCITY, "reference velocity for the controller"),
        "u_hat": Output(FORCE, "feedforward force that it stands for"),
    },
    conditions={
        "Ts Ki < Kp or Ki = 0": settles_slowly,
        "2 Ts Kp < 4 Kd + Ts^2 Ki": settles_fast,
    },
)
def prefilter(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    f: SX = Input(FORCE, 0.0, "feedforward force, added to the inertia force", optional=True),
    enable: SX = Command(True, "false: r and rd pass, the states at their start"),
    reset: SX = variables.RESET,
    shift: SX = State(LENGTH, 0.0, "what is added to r", nominal=1e-4),
    integral: SX = State(LENGTH + ".s", 0.0, "integral of what was added to r", nominal=1e-6),
    gain: SX = Parameter(NO_UNIT, 1.0, "fraction of the force that is replaced", min=0.0, max=1.0),
    m: SX = variables.INERTIA,
    Kp: SX = Parameter(STIFFNESS, 12e3, "proportional gain of the controller", min=0.0),
    Kd: SX = Parameter(DAMPING, 190.0, "derivative gain of the controller", min=1e-9),
    Ki: SX = Parameter(FORCE + "/(" + LENGTH + ".s)", 250e3, "integral gain of the controller, 0: PD", min=0.0),
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """Shifts the reference so that the controller itself gives the feedforward force, in every sample.

        u_hat  = gain (m rdd + f)
        rd_out = rd + d',   Kp d + Kd d' + Ki D = u_hat
        r_out  = r + d,     d_next = d + Ts d',   D_next = D + Ts d

    With C the law PID of the same gains and sample time, C (r + d) = C r + u_hat: the plant gets the same force as from
    the same PID with u_hat at its input f, on any plant, with any friction. In terms of transfer functions this is
    R = 1 + F/C. F/C = m s^3 / (Kd s^2 + Kp s + Ki) is improper in r, so the derivatives of the reference are inputs;
    what is left, 1/C, is proper and the recursion above. PreviewPrefilter takes them from r by a non-causal FIR filter.
    R is the prefilter of a form of feedforward that a survey describes with a non-causal filter, whose source could not
    be identified.

    Use it where a controller has no input for a force, as many drives: its reference input gives the same result. The
    controller's own m and f must be 0, and CascadePPI needs the gains of the PID that it is equal to.

    The recursion is unstable by itself, whatever the loop, unless

        Ts Ki < Kp or Ki = 0   and   2 Ts Kp < 4 Kd + Ts^2 Ki

    (Jury's conditions of its polynomial z^2 - (2 - Ts Kp/Kd) z + 1 - Ts Kp/Kd + Ts^2 Ki/Kd), which is required.

    While reset is true the states are 0 in that very sample; while enable is false they are 0 and r and rd pass. Coming
    back, d begins at 0: the force d' Kd is there at once, as a feedforward's would be.

    Limits: the identity holds while the controller's u is not limited: its anti-windup sees r_out. Kp, Kd, Ki and Ts
    must be those of the controller. The position error that the controller sees contains d, so limits of a following
    error have to allow for it.
    """
    u_hat = gain * (m * rdd + f)
    moved = if_else(reset, 0.0, shift)
    rate, shift_next, integral_next = reference_shift(u_hat, moved, if_else(reset, 0.0, integral), Kp, Kd, Ki, Ts)
    added = when(enable, r_out=moved, rd_out=rate)
    return {
        "r_out": r + added["r_out"],
        "rd_out": rd + added["rd_out"],
        **when(enable, u_hat=u_hat, shift=shift_next, integral=integral_next),
    }
