"""Super-twisting sliding mode with implicit discretisation."""

from casadi import SX, fabs, if_else, sign, sqrt

from friction_fmus.lawkit.law import Command, Parameter, SampleTime, State, law, replaces_servo
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import carried, clip, limited, restarts, unless_winding_up
from friction_fmus.lawkit.quantities import FORCE, NO_UNIT


@law(
    "ImplicitSuperTwisting",
    "Super-twisting sliding mode without chattering, by implicit discretisation",
    source="Levant, Automatica 34(3), 1998; Brogliato, Polyakov, Efimov, IEEE TAC 65(8), 2020",
    cites=("Levant1998", "Brogliato2020"),
    Ts=1e-3,
    use=replaces_servo("sliding mode"),
    outputs=variables.TRACKING,
)
def implicit_super_twisting(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    x: SX = variables.X,
    v: SX = variables.V,
    f: SX = variables.FED_FORWARD,
    enable: SX = Command(True, "false: u = 0, F_hat = 0 and w is at its start value"),
    reset: SX = Command(False, "true: w is reset to its start value"),
    track: SX = variables.TRACK,
    u_track: SX = variables.U_TRACK,
    w: SX = State(FORCE, 0.0, "friction estimate in the previous sample"),
    gain: SX = variables.GAIN,
    m: SX = variables.POSITIVE_MASS,
    lam: SX = variables.LAM,
    L: SX = Parameter(FORCE + "/s", 500.0, "bound of the rate of change of friction", min=0.0),
    c1: SX = Parameter(NO_UNIT, 1.5, "gain of the square root", min=0.0),
    c2: SX = Parameter(NO_UNIT, 1.1, "gain of the integral, above 1", min=0.0),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """Second-order sliding mode: a continuous force that follows friction with a bounded rate exactly.

    With s = (rd - v) + lam (r - x), the law in continuous time (Levant: Robust exact differentiation via sliding mode
    technique, Automatica 34(3), 1998, also for the gains) is

        u  = m (rdd + lam (rd - v)) + c1 sqrt(m L |s|) sgn(s) + w + f
        w' = c2 L sgn(s)

    It is discretised by two successive implicit Euler steps. The first step is for w: with the friction estimate
    changed by w_next - w, s in this sample would be s - (Ts/m) (w_next - w), whose sign is used:

        w_next = w + Ts c2 L sgn(s - (Ts/m) (w_next - w)), that is
        w_next = w + clip(m s/Ts, -c2 L Ts, c2 L Ts)

    The second step is for s with the friction w_next, where y = sqrt(|s_next|) solves a quadratic equation:

        s_next = s - (Ts/m) c1 sqrt(m L |s_next|) sgn(s_next)
               =>  y = (-b + sqrt(b^2 + 4 |s|))/2,   b = Ts c1 sqrt(L/m)
        F_hat  = w_next
        p      = m (rdd + lam (rd - v)) + c1 sqrt(m L) y sgn(s) + f + gain F_hat
        u      = clip(p, u_min, u_max)
        w_next = w while u is limited and s pushes further into that limit

    Near s = 0, u = 2 m s/Ts + w + ..., which is dead-beat in two samples. For friction that changes at a rate below L,
    s settles at (Ts^2/m) dF/dt, which is of second order in Ts. A step that is implicit in both equations at once, for
    a nominal plant without friction (Brogliato, Polyakov, Efimov: The implicit discretization of the super-twisting
    sliding-mode control algorithm, IEEE TAC 65(8), 2020), settles at s = F Ts/m for constant friction; the
    splitting, which is specific to this library, removes this error.

    Use it for precise tracking with smooth friction, with the bound L of its rate as the only model. Connect a friction
    feedforward without its inertia part to f.

    While enable is false, u, F_hat, u_sat and w are 0; reset takes effect in the same sample. While track is true, w is
    such that p = u_track, within the limits; with gain = 0 it is not changed.

    Limits: a jump of friction at a reversal is followed with a rate of at most c2 L. The gain on s is up to 2 m/Ts:
    delays, flexible loads and noise of v have the same effects as in ImplicitSlidingMode, and a true mass below m
    causes oscillation earlier. u_min must not exceed u_max.
    """
    ed = rd - v
    s = ed + lam * (r - x)
    most = c2 * L * Ts
    step = clip(m * s / Ts, -most, most)
    b = Ts * c1 * sqrt(L / m)
    # the root without a difference of nearly equal numbers
    y = 2.0 * fabs(s) / (b + sqrt(b**2 + 4.0 * fabs(s)) + if_else(s == 0.0, 1.0, 0.0))
    twisting = m * (rdd + lam * ed) + c1 * sqrt(m * L) * y * sign(s) + f
    own = if_else(reset, 0.0, w)
    old = carried(track, clip(u_track, u_min, u_max), twisting + gain * step, gain, own)
    outputs = limited(twisting, old + step, gain, enable, u_min, u_max, track, u_track)
    after = old + unless_winding_up(step, outputs["u_sat"])
    return {**outputs, "w": if_else(restarts(reset, track), 0.0, if_else(enable, after, 0.0))}
