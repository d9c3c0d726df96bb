"""Prefilter of the reference with the effect of a feedforward force."""

from casadi import SX, if_else

from friction_fmus.blocks.block_declarations import SHAPES_REFERENCE, Use
from friction_fmus.lawkit.law import Command, Input, Output, Parameter, SampleTime, State, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import reference_shift, settles_fast, settles_slowly, when
from friction_fmus.lawkit.quantities import DAMPING, FORCE, LENGTH, NO_UNIT, STIFFNESS, VELOCITY


@law(
    "Prefilter",
    "Reference shaping that makes a PID controller generate a feedforward {force}: R = 1 + F/C",
    source="Identity C R r = C r + F r",
    cites=("FrictionFmus2026",),
    Ts=1e-3,
    use=Use("feedforward", never=SHAPES_REFERENCE),
    outputs={
        "r_out": Output(LENGTH, "reference position for the controller"),
        "rd_out": Output(VELOCITY, "reference velocity for the controller"),
        "u_hat": Output(FORCE, "equivalent feedforward {force}"),
    },
    conditions={"Ts Ki < Kp or Ki = 0": settles_slowly, "2 Ts Kp < 4 Kd + Ts^2 Ki": settles_fast},
)
def prefilter(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    f: SX = Input(FORCE, 0.0, "feedforward {force}, added to the inertia {force}", optional=True),
    enable: SX = Command(True, "false: r and rd pass unchanged; the states are at their start values"),
    reset: SX = variables.RESET,
    shift: SX = State(LENGTH, 0.0, "shift of r", nominal=1e-4),
    integral: SX = State(LENGTH + ".s", 0.0, "integral of the shift of r", nominal=1e-6),
    gain: SX = Parameter(NO_UNIT, 1.0, "fraction of the {force} that is replaced", min=0.0, max=1.0),
    m: SX = variables.INERTIA,
    Kp: SX = Parameter(STIFFNESS, 12e3, "proportional gain of the controller", min=0.0),
    Kd: SX = Parameter(DAMPING, 190.0, "derivative gain of the controller", min=1e-9),
    Ki: SX = Parameter(FORCE + "/(" + LENGTH + ".s)", 250e3, "integral gain of the controller; 0: PD", min=0.0),
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """Shift of the reference with which the controller itself generates the feedforward force in every sample.

        u_hat  = gain (m rdd + f)
        rd_out = rd + d',   Kp d + Kd d' + Ki D = u_hat
        r_out  = r + d,     d_next = d + Ts d',   D_next = D + Ts d

    Let C be the law PID with the same gains and sample time; then C (r + d) = C r + u_hat. Any plant with any friction
    thus receives the same force as from the same PID with u_hat at its input f. As a transfer function, the prefilter
    is R = 1 + F/C. F/C = m s^3 / (Kd s^2 + Kp s + Ki) is improper in r, so the derivatives of the reference are inputs;
    the remaining 1/C is proper and is the recursion above. PreviewPrefilter computes the derivatives from r by a
    non-causal FIR filter. A survey describes feedforward by such a prefilter R with a non-causal filter; its source
    could not be identified.

    Use it with controllers without a force input, such as many drives: the reference input gives the same result. Set m
    and f of the controller to 0. For CascadePPI, give the gains of the equivalent PID.

    The recursion is unstable, independent of the loop, unless

        Ts Ki < Kp or Ki = 0   and   2 Ts Kp < 4 Kd + Ts^2 Ki

    (Jury's conditions for its polynomial z^2 - (2 - Ts Kp/Kd) z + 1 - Ts Kp/Kd + Ts^2 Ki/Kd). These conditions are
    required.

    While reset is true, the states are 0 in the same sample; while enable is false, they are 0, and r and rd pass
    unchanged. When enable becomes true again, d starts at 0; the force u_hat = d' Kd jumps when enabled, like a
    feedforward.

    Limits: the identity holds while u of the controller is not limited, as its anti-windup uses r_out. Kp, Kd, Ki and
    Ts must equal those of the controller. The position error in the controller contains d, so limits of the following
    error must allow for d.
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
