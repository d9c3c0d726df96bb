"""PID position control with an integral that jumps at sign changes of the error."""

from casadi import SX, if_else, logic_or, sign

from friction_fmus.lawkit.law import Output, Parameter, SampleTime, State, law, replaces_servo
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import carried, clip, limits, restarts, tracked, unless_winding_up
from friction_fmus.lawkit.quantities import DAMPING, FORCE, LENGTH, MASS, NO_UNIT, STIFFNESS


@law(
    "ResetPID",
    "PID with an integral that jumps at sign changes of the error, against hunting",
    source="This library; the idea from Beerens et al., Automatica 107, 2019",
    cites=("Beerens2019",),
    Ts=1e-3,
    use=replaces_servo("integral"),
    outputs={**variables.CONTROL, "jumped": Output(NO_UNIT, "1 in a sample in which the integral jumps")},
)
def reset_pid(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    x: SX = variables.X,
    v: SX = variables.V,
    f: SX = variables.FED_FORWARD,
    enable: SX = variables.ENABLE_INTEGRAL,
    reset: SX = variables.RESET_INTEGRAL,
    track: SX = variables.TRACK,
    u_track: SX = variables.U_TRACK,
    integral: SX = State(LENGTH + ".s", 0.0, "integral of the position error", nominal=1e-4, sums=True),
    side: SX = State(NO_UNIT, 0.0, "last sign of the position error"),
    Kp: SX = Parameter(STIFFNESS, 12e3, "proportional gain", min=0.0),
    Kd: SX = Parameter(DAMPING, 190.0, "derivative gain", min=1e-9),
    Ki: SX = Parameter(FORCE + "/(" + LENGTH + ".s)", 250e3, "integral gain; 0: PD", min=0.0),
    rho: SX = Parameter(NO_UNIT, 0.8, "fraction of the integral that is reversed in a jump", min=0.0, max=1.0),
    mass: SX = Parameter(MASS, 1.0, "{moving_mass}, for the jump", min=0.0),
    m: SX = variables.starting(variables.INERTIA, 0.0),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """PID position control with feedforward of the reference acceleration and an integral I that jumps.

        e      = r - x
        I      = -h - rho (I + h),   h = mass/Kd e,
                 in a sample in which e has changed its sign
        u      = clip(Kp e + Kd (rd - v) + Ki I + m rdd + f, u_min, u_max)
        I_next = I + Ts e
        I_next = I while u is limited and e pushes further into that limit
        I      = (u_track - Kp e - Kd (rd - v) - m rdd - f)/Ki,  without a
                 jump, while track is true

    Without jumps, the law equals PID. The idea of resetting or reversing the integral of a PID controller when the
    error passes zero is from Beerens, Bisoffi, Zaccarian, Heemels, Nijmeijer, van de Wouw: Reset integral control for
    improved settling of PID-based motion systems with friction, Automatica 107, 2019. The jump is derived for this
    library and is not in that paper.

    Stability: for a constant reference and a mass without friction (viscous friction may be added to Kd), let a =
    Kd/mass, b = Kp/mass, c = Ki/mass. Then

        V  = (e' + a e)^2/2 + b e^2/2 + c I e + a c I^2/2
           = (e' + a e)^2/2 + (b - c/a) e^2/2 + a c (I + e/a)^2/2
        V' = -(a b - c) e^2

    between jumps, in continuous time. V is positive definite and decreases exactly if the loop without jumps is stable,
    Kd Kp > mass Ki. A jump changes only the last term, I + e/a to -rho (I + e/a), so

        V after - V before = -(1 - rho^2) a c (I + e/a)^2/2 <= 0

    for every rho up to 1. The linear loop therefore stays stable however often the integral jumps. The jump with rho =
    0 minimises V; at e = 0 the jump is I to -rho I. There is no proof for dry friction, where V' has a term e F of
    either sign. In sampled time, the result holds up to the order of Ts.

    Use it for point-to-point motion with static friction, where PID hunts and PD leaves an error. When the axis passes
    the target, the integral, which has grown to overcome static friction, is reversed immediately instead of having to
    unwind. With rho = 0.8, each overshoot is smaller than the previous one. With rho = 0, the axis waits until the
    integral has grown again. With rho = 1, the integral keeps its magnitude, and the axis may oscillate permanently
    within presliding.

    While reset is true, the integral is 0 and the sign of the error is discarded; while enable is false, u and u_sat
    are also 0. jumped is then 0. While track is true, I is such that u = u_track within the
    limits, as in PID; with Ki = 0, track has no effect.

    Limits: the law is meant for positioning, as zero crossings of the error during tracking or due to noise also cause
    jumps. With encoder noise near the target, rho well below 1 removes the integral. If f contains the inertia force, m
    must be 0. u_min must not exceed u_max.
    """
    start = 0.0
    e = r - x
    before = if_else(logic_or(reset, track), 0.0, side)
    crossing = before * e < 0.0
    offset = mass / Kd * e
    held = if_else(reset, start, integral)
    jumped = if_else(crossing, -offset - rho * (held + offset), held)
    feedback, ahead = Kp * e + Kd * (rd - v), m * rdd + f
    wanted = tracked(track, u_track, Ki, feedback + Ki * jumped + m * rdd + f)
    u = clip(wanted, u_min, u_max)
    old = carried(track, u, feedback + ahead, Ki, jumped)
    u_sat = limits(wanted, u_min, u_max)
    runs = if_else(restarts(reset, track), 0.0, enable)
    return {
        "u": if_else(enable, u, 0.0),
        "u_sat": if_else(enable, u_sat, 0.0),
        "jumped": if_else(enable, crossing, 0.0),
        "integral": if_else(runs, old + Ts * unless_winding_up(e, u_sat), start),
        "side": if_else(runs, if_else(e == 0.0, before, sign(e)), 0.0),
    }
