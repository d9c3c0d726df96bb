"""Prefilter of the reference with derivatives from a non-causal filter."""

from casadi import SX, if_else, logic_or

from friction_fmus.blocks.block_declarations import SHAPES_REFERENCE, Use
from friction_fmus.lawkit.law import Command, Input, Output, Parameter, SampleTime, State, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import at_most, filled, reference_shift, settles_fast, settles_slowly, when
from friction_fmus.lawkit.quantities import ACCELERATION, DAMPING, FORCE, LENGTH, NO_UNIT, STIFFNESS, VELOCITY

PREVIEW = 4
# weights of f(j) - f(-j) and of f(j) - 2 f(0) + f(-j), j = 1 ... 4
FIRST = (4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0)
SECOND = (8.0 / 5.0, -1.0 / 5.0, 8.0 / 315.0, -1.0 / 560.0)


@law(
    "PreviewPrefilter",
    "Prefilter R = 1 + F/C that only needs the reference position, four samples in advance",
    source="Identity C R r = C r + F r; Fornberg, Mathematics of Computation 51(184), 1988 (differences)",
    cites=("Fornberg1988",),
    Ts=1e-3,
    use=Use("feedforward", never=SHAPES_REFERENCE),
    outputs={
        "r_out": Output(LENGTH, "reference position for the controller"),
        "rd_out": Output(VELOCITY, "reference velocity for the controller"),
        "u_hat": Output(FORCE, "equivalent feedforward {force}"),
        "r_now": Output(LENGTH, "r four samples earlier"),
        "rd_now": Output(VELOCITY, "velocity of r_now"),
        "rdd_now": Output(ACCELERATION, "acceleration of r_now"),
    },
    conditions={"Ts Ki < Kp or Ki = 0": settles_slowly, "2 Ts Kp < 4 Kd + Ts^2 Ki": settles_fast},
)
def preview_prefilter(
    r: SX = Input(LENGTH, 0.0, "reference position, four samples in advance"),
    f: SX = Input(FORCE, 0.0, "feedforward {force} for r_now, added to the inertia {force}", optional=True),
    enable: SX = Command(True, "false: r_now and rd_now pass unchanged; the shift is at its start value"),
    reset: SX = Command(False, "true: as if r had always had its present value"),
    line: SX = State(LENGTH, (0.0,) * (2 * PREVIEW), "references of the previous samples, latest first"),
    seen: SX = State(NO_UNIT, 0.0, "number of samples in line, at most 8"),
    missed: SX = variables.MISSED,
    shift: SX = State(LENGTH, 0.0, "shift of r_now", nominal=1e-4),
    integral: SX = State(LENGTH + ".s", 0.0, "integral of the shift of r_now", nominal=1e-6),
    gain: SX = Parameter(NO_UNIT, 1.0, "fraction of the {force} that is replaced", min=0.0, max=1.0),
    m: SX = variables.INERTIA,
    Kp: SX = Parameter(STIFFNESS, 12e3, "proportional gain of the controller", min=0.0),
    Kd: SX = Parameter(DAMPING, 190.0, "derivative gain of the controller", min=1e-9),
    Ki: SX = Parameter(FORCE + "/(" + LENGTH + ".s)", 250e3, "integral gain of the controller; 0: PD", min=0.0),
    Ts: SX = SampleTime(),
) -> dict[str, SX | list[SX]]:
    """Prefilter with velocity and acceleration from a non-causal FIR filter of the reference position.

        r_now[k]   = r[k-4]
        rd_now[k]  = sum over j = 1 ... 4 of p_j (r[k-4+j] - r[k-4-j]) / Ts
        rdd_now[k] = sum over j = 1 ... 4 of
                     q_j (r[k-4+j] - 2 r[k-4] + r[k-4-j]) / Ts^2
        p = 4/5, -1/5, 4/105, -1/280;   q = 8/5, -1/5, 8/315, -1/560
        u_hat  = gain (m rdd_now + f)
        rd_out = rd_now + d',   Kp d + Kd d' + Ki D = u_hat
        r_out  = r_now + d,     d_next = d + Ts d',   D_next = D + Ts d

    The differences are of eighth order (Fornberg, Mathematics of Computation 51(184), 1988) and exact for polynomials
    up to degree eight (p) and nine (q). They have no lag, as the reference is known four samples in advance, which
    makes the improper F/C in R = 1 + F/C realisable. Everything else is as in Prefilter.

    Use it if only a table of positions is available and the reference is the only input of the controller. Compare the
    measured position with r_now.

    In the first sample and in a sample with reset, r is assumed to have been constant. While enable is false, r_now and
    rd_now pass unchanged and d is 0; the line of references continues. u_hat jumps when enabled, as in Prefilter.

    Limits: as for Prefilter. Noise and rounding errors of r enter rdd_now with the factor 3.5 / Ts^2. Corners of r
    cause ringing over four samples. f must correspond to r_now.
    """
    fresh = logic_or(seen == 0.0, reset)
    past = [r, *filled(r, [if_else(fresh, r, line[j]) for j in range(2 * PREVIEW)], missed)]
    now = past[PREVIEW]
    rd = sum((p * (past[PREVIEW - j] - past[PREVIEW + j]) for j, p in enumerate(FIRST, 1)), SX(0.0)) / Ts
    rdd = (
        sum((q * (past[PREVIEW - j] - 2.0 * now + past[PREVIEW + j]) for j, q in enumerate(SECOND, 1)), SX(0.0)) / Ts**2
    )

    u_hat = gain * (m * rdd + f)
    moved = if_else(reset, 0.0, shift)
    rate, shift_next, integral_next = reference_shift(u_hat, moved, if_else(reset, 0.0, integral), Kp, Kd, Ki, Ts)
    added = when(enable, r_out=moved, rd_out=rate)
    return {
        "r_now": now,
        "rd_now": rd,
        "rdd_now": rdd,
        "r_out": now + added["r_out"],
        "rd_out": rd + added["rd_out"],
        **when(enable, u_hat=u_hat, shift=shift_next, integral=integral_next),
        "line": past[: 2 * PREVIEW],
        "seen": at_most(if_else(reset, 0.0, seen) + 1.0, 2 * PREVIEW),
        "missed": SX(0.0),
    }
