"""Cascade of a proportional position loop and a proportional-integral velocity loop."""

from casadi import SX, if_else

from friction_fmus.lawkit.law import Parameter, SampleTime, State, law, replaces_servo
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import carried, clip, limits, restarts, tracked, unless_winding_up
from friction_fmus.lawkit.quantities import DAMPING, LENGTH, STIFFNESS


@law(
    "CascadePPI",
    "Cascade of position P and velocity PI with feedforward, as in servo drives",
    source="Jamaludin, Van Brussel, Swevers, IEEE TIE 56(10), 2009",
    cites=("Jamaludin2009",),
    Ts=1e-3,
    use=replaces_servo("integral"),
    outputs=variables.CONTROL,
)
def cascade_ppi(
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
    integral: SX = State(LENGTH, 0.0, "integral of the velocity error w", nominal=1e-3, sums=True),
    kp: SX = Parameter("1/s", 30.0, "gain of the position loop", min=0.0),
    kv: SX = Parameter(DAMPING, 190.0, "proportional gain of the velocity loop", min=0.0),
    ki: SX = Parameter(STIFFNESS, 0.0, "integral gain of the velocity loop; 0: P", min=0.0),
    m: SX = variables.starting(variables.INERTIA, 0.0),
    d: SX = Parameter(DAMPING, 0.0, "feedforward of the reference velocity, in addition to rd in w"),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """P position loop around a PI velocity loop, with feedforward of velocity and acceleration, sampled every Ts.

        w      = kp (r - x) + (rd - v)
        u      = clip(m rdd + d rd + kv w + ki I + f, u_min, u_max)
        I_next = I + Ts w
        I_next = I while u is limited and w pushes further into that limit
        I      = (u_track - m rdd - d rd - kv w - f)/ki  while track is true

    Jamaludin, Van Brussel, Swevers, IEEE Transactions on Industrial Electronics 56(10), 2009 (the structure).

    As the integral of rd - v is r - x, the cascade is the PID controller

        Kp = kv kp + ki,   Kd = kv,   Ki = ki kp

    as long as no limit is active. This is exact in sampled time if rd - v is the forward difference of r - x and I
    starts at r - x; otherwise it holds up to the error of the velocity signal.

    The integral used in a sample does not contain w of that sample. While reset is true, the integral is 0, in the same
    sample and in the next one. While enable is false, u, u_sat and the integral are 0. When enable becomes true again,
    u does not jump if the reference starts at the state of the axis (r = x, rd = v, rdd = 0). While track is true, I is
    such that u = u_track within the limits, as in PID; with ki = 0, track has no effect.

    A velocity that is measured late by T lets I grow by T rd on a trajectory that the axis follows: m = M - kv T and
    d = -ki T, for an axis of mass M, remove this error.

    Limits: as for PID. The integral action causes hunting if static friction exceeds Coulomb friction. If f contains
    the inertia force, like u of StaticFeedforward, m must be 0. u_min must not exceed u_max.
    """
    start = 0.0
    w = kp * (r - x) + (rd - v)
    feedback = m * rdd + d * rd + kv * w
    free = if_else(reset, start, integral)
    wanted = tracked(track, u_track, ki, feedback + ki * free + f)
    u = clip(wanted, u_min, u_max)
    old = carried(track, u, feedback + f, ki, free)
    u_sat = limits(wanted, u_min, u_max)
    after = old + Ts * unless_winding_up(w, u_sat)
    return {
        "u": if_else(enable, u, 0.0),
        "u_sat": if_else(enable, u_sat, 0.0),
        "integral": if_else(restarts(reset, track), start, if_else(enable, after, start)),
    }
