"""Friction force modelled as a random walk and estimated by a Kalman filter."""

from casadi import SX, if_else

from friction_fmus.lawkit.law import Command, Input, Output, Parameter, SampleTime, State, Switch, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import carried, clip, corrected, elapsed, limited, starts_now
from friction_fmus.lawkit.quantities import FORCE, LENGTH, NO_UNIT, VELOCITY


@law(
    "KalmanFriction",
    "Compensation of friction estimated as a random walk by a Kalman filter",
    source="Ray, Ramasubramanian, Townsend, Control Engineering Practice 9(2), 2001",
    cites=("Ray2001", "AndersonMoore1979"),
    Ts=1e-3,
    use=Use(
        "estimator",
        tuned={"m": "m", "x_noise": "x_noise", "v_noise": "v_noise", "F_step": "m * x_noise * Ts * observed**3"},
    ),
    outputs={
        "u": variables.U_COMPENSATION,
        "F_hat": Output(FORCE, "estimated friction {force}, positive for positive velocity"),
        "u_sat": variables.U_SAT,
    },
)
def kalman_friction(
    x: SX = variables.X,
    v: SX = Input(VELOCITY, 0.0, "measured velocity", optional=True),
    u_prev: SX = variables.U_PREV,
    enable: SX = Command(True, "false: u = 0, F_hat = 0 and the filter is at its start values"),
    reset: SX = Command(False, "true: the filter restarts at the measured position"),
    track: SX = variables.TRACK,
    u_track: SX = variables.U_TRACK,
    x_hat: SX = variables.X_HAT,
    v_hat: SX = variables.V_HAT,
    F_walk: SX = State(FORCE, 0.0, "estimated friction {force}"),
    P11: SX = State(NO_UNIT, 0.0, "variance of the position, in units of (Ts^2/m F_step)^2"),
    P12: SX = State(NO_UNIT, 0.0, "covariance of position and velocity"),
    P13: SX = State(NO_UNIT, 0.0, "covariance of position and {force}"),
    P22: SX = State(NO_UNIT, 0.0, "variance of the velocity, in units of (Ts/m F_step)^2"),
    P23: SX = State(NO_UNIT, 0.0, "covariance of velocity and {force}"),
    P33: SX = State(NO_UNIT, 0.0, "variance of the {force}, in units of F_step^2"),
    running: SX = variables.RUNNING,
    missed: SX = variables.MISSED,
    gain: SX = variables.GAIN,
    m: SX = variables.POSITIVE_MASS,
    x_noise: SX = Parameter(LENGTH, 3e-7, "standard deviation of the measured position", min=1e-15),
    v_noise: SX = Parameter(VELOCITY, 1e-3, "standard deviation of the measured velocity", min=1e-15),
    use_v: SX = Switch(False, "true: v is a second measurement; false: v is the start value only"),
    F_step: SX = Parameter(FORCE, 0.03, "standard deviation of the change of friction per sample", min=1e-12),
    u_min: SX = variables.starting(variables.U_MIN, -100.0),
    u_max: SX = variables.starting(variables.U_MAX, 100.0),
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """Kalman filter for a mass with an unknown friction force modelled as a random walk.

        x_p = x_hat + Ts v_hat + Ts^2/(2 m) (u_prev - F_walk)
        v_p = v_hat + Ts/m (u_prev - F_walk)
        (x_hat, v_hat, F_walk) = (x_p, v_p, F_walk) + K (x - x_p)
        F_hat = F_walk,   u = clip(gain F_hat, u_min, u_max)

    with the gain K of the Kalman filter. In the units X = Ts^2/m F_step of position, V = Ts/m F_step of velocity and
    F_step of force, with n = x_noise/X:

        A = [1 1 -1/2; 0 1 -1; 0 0 1],   P_p = A P A' + diag(0, 0, 1)
        K = P_p c / (P_p11 + n^2),       P = P_p - K c' P_p,   c = (1, 0, 0)

    With use_v, the velocity is a second measurement, processed after the position in the same way with n = v_noise/V.

    Ray, Ramasubramanian, Townsend: Adaptive friction compensation using extended Kalman-Bucy filter friction
    estimation, Control Engineering Practice 9(2), 2001 (only its abstract was read); the equations are the Kalman
    filter, Anderson, Moore: Optimal Filtering, 1979. There is no friction model: the estimate contains all forces on
    the mass except u_prev. K converges to the gain of the algebraic Riccati equation within about ten to a hundred
    samples.

    Use it with an encoder of the resolution q: x_noise = q/sqrt(12). F_step is then the only tuning parameter: a larger
    value is faster and noisier. Connect u to the input f of a position controller; u_prev is the force after all
    limits, so that nothing winds up if the actuator saturates. In a system file, the connection to u_prev needs a
    delay.

    For friction that grows at the rate c, with use_v = false and constant K, the estimate lags by exactly

        F - F_hat = c (m |K2/K3| - Ts/2)

    where K2 (1/s) and K3 (N/m) are the gains of velocity and force. The first sample and a sample with reset adopt x
    and v (v = 0 if unconnected), and set F_hat to 0 and P to diag(n^2, 2 n^2, 1). While enable is false, u, F_hat,
    u_sat and all states are 0. While track is true, F_walk is such that u = u_track, within the limits; with gain = 0
    it is not changed.

    Limits: a wrong mass puts the missing inertia force into F_hat. At a reversal, the estimate lags by about the time
    constant of the filter. Full compensation with F_hat is an integral action, which can hunt if static friction
    exceeds Coulomb friction. u_min must not exceed u_max.
    """
    new = starts_now(reset, running)
    span = elapsed(missed, Ts)
    force = (u_prev - F_walk) / m
    x_p = if_else(new, x, x_hat + span * v_hat + span**2 / 2.0 * force)
    v_p = if_else(new, v, v_hat + span * force)
    mean = [x_p, v_p, if_else(new, 0.0, F_walk)]

    position_unit, velocity_unit = Ts**2 / m * F_step, Ts / m * F_step
    n2 = (x_noise / position_unit) ** 2
    start = ((n2, 0.0, 0.0), (2.0 * n2, 0.0), (1.0,))
    predicted = (
        (P11 + 2.0 * P12 - P13 + P22 - P23 + P33 / 4.0, P12 - P13 + P22 - 1.5 * P23 + P33 / 2.0, P13 + P23 - P33 / 2.0),
        (P22 - 2.0 * P23 + P33, P23 - P33),
        (P33 + 1.0,),
    )
    P = [[if_else(new, a, b) for a, b in zip(*rows, strict=True)] for rows in zip(start, predicted, strict=True)]
    units = (position_unit, velocity_unit, F_step)
    mean, P = corrected(mean, P, units, 0, x, n2)
    with_v = corrected(mean, P, units, 1, v, (v_noise / velocity_unit) ** 2)
    mean = [if_else(use_v, a, b) for a, b in zip(with_v[0], mean, strict=True)]
    P = [[if_else(use_v, a, b) for a, b in zip(*rows, strict=True)] for rows in zip(with_v[1], P, strict=True)]

    mean[2] = carried(track, clip(u_track, u_min, u_max), SX(0.0), gain, mean[2])
    names = ("P11", "P12", "P13", "P22", "P23", "P33")
    states = dict(zip(("x_hat", "v_hat", "F_walk", *names), (*mean, *P[0], *P[1], *P[2]), strict=True))
    return {
        **limited(SX(0.0), mean[2], gain, enable, u_min, u_max, track, u_track),
        **{name: if_else(enable, value, 0.0) for name, value in states.items()},
        "running": enable,
        "missed": SX(0.0),
    }
