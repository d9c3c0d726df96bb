"""Active disturbance rejection with an extended-state observer."""

from casadi import SX, exp, if_else

from friction_fmus.lawkit.law import Command, Output, Parameter, SampleTime, State, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import carried, clip, elapsed, limited, starts_now
from friction_fmus.lawkit.quantities import FORCE, VELOCITY


@law(
    "ExtendedStateObserver",
    "Tracking control with friction estimated by an extended-state observer (linear ADRC)",
    source="Gao, American Control Conference, 2003",
    cites=("Gao2003",),
    Ts=1e-3,
    use=Use("estimator", tuned={"m": "m", "wo": "observed", "wc": "bandwidth"}, output="F_hat"),
    outputs={**variables.TRACKING, "v_est": Output(VELOCITY, "estimated velocity")},
)
def extended_state_observer(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    x: SX = variables.X,
    u_prev: SX = variables.U_PREV,
    enable: SX = Command(True, "false: u = 0, F_hat = 0 and the observer is at its start values"),
    reset: SX = Command(False, "true: the observer restarts at the measured position"),
    track: SX = variables.TRACK,
    u_track: SX = variables.U_TRACK,
    running: SX = variables.RUNNING,
    missed: SX = variables.MISSED,
    x_hat: SX = variables.X_HAT,
    v_hat: SX = variables.V_HAT,
    F_est: SX = State(FORCE, 0.0, "estimated friction"),
    gain: SX = variables.GAIN,
    m: SX = variables.POSITIVE_MASS,
    wc: SX = Parameter("rad/s", 63.0, "bandwidth of the controller", min=0.0),
    wo: SX = Parameter("rad/s", 400.0, "bandwidth of the observer", min=0.0),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """Position control that estimates the sum of all unknown forces on a mass as a state and compensates it.

        x_p   = x_hat + Ts v_hat + Ts^2/(2 m) (u_prev - F_est)
        v_p   = v_hat + Ts/m (u_prev - F_est)
        x_hat = x_p   + (1 - p^3) (x - x_p)
        v_hat = v_p   + 3/2 (1 - p)^2 (1 + p)/Ts (x - x_p)
        F_est = F_est - m (1 - p)^3/Ts^2 (x - x_p),   p = exp(-wo Ts)
        F_hat = F_est
        w     = m (wc^2 (r - x_hat) + 2 wc (rd - v_hat) + rdd) + gain F_hat
        u     = clip(w, u_min, u_max)

    Gao: Scaling and bandwidth-parameterization based controller tuning, American Control Conference, 2003. Here the
    observer is in sampled time, exact for a force that is constant over a sample, with all three poles at p; the two
    poles of the controller are at wc. The estimate in a sample uses the position measured in that sample.

    Use it if no friction model is available and an encoder is the only sensor. It needs the mass and two bandwidths;
    choose wo three to ten times wc. u_prev is the force after all limits (in a system, the input F_ext of the plant),
    so that nothing winds up if the actuator saturates.

    F_est is exact for constant friction. For friction that grows at the rate c, it lags by

        F - F_est = c Ts (3/2 (1 + p)/(1 - p) - 1/2),   about 3 c/wo for small wo Ts

    The first sample after the start, a reset or a time with enable false adopts x and assumes rest without friction.
    While enable is false, u, F_hat, u_sat, v_est and all states are 0. While track is true, F_est is such that w =
    u_track, within the limits; with gain = 0 it is not changed.

    Limits: at a reversal, the estimate lags by about 3/wo. Noise of x enters F_est with the factor m (1 - p)^3/Ts^2.
    Full compensation with F_est is an integral action, which causes hunting if static friction exceeds Coulomb
    friction. With a wrong mass, F_est contains the difference of the inertia forces. u_min must not exceed u_max.
    """
    fresh = starts_now(reset, running)
    span = elapsed(missed, Ts)
    p = exp(-wo * span)
    force = (u_prev - F_est) / m
    x_p = x_hat + span * v_hat + span**2 / 2.0 * force
    v_p = v_hat + span * force
    residual = x - x_p
    position = if_else(fresh, x, x_p + (1.0 - p**3) * residual)
    velocity = if_else(fresh, 0.0, v_p + 1.5 * (1.0 - p) ** 2 * (1.0 + p) / span * residual)
    estimated = if_else(fresh, 0.0, F_est - m * (1.0 - p) ** 3 / span**2 * residual)

    tracking = m * (wc**2 * (r - position) + 2.0 * wc * (rd - velocity) + rdd)
    friction = carried(track, clip(u_track, u_min, u_max), tracking, gain, estimated)
    return {
        **limited(tracking, friction, gain, enable, u_min, u_max, track, u_track),
        "v_est": if_else(enable, velocity, 0.0),
        "running": enable,
        "missed": SX(0.0),
        "x_hat": if_else(enable, position, 0.0),
        "v_hat": if_else(enable, velocity, 0.0),
        "F_est": if_else(enable, friction, 0.0),
    }
