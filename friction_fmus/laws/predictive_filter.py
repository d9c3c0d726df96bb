"""Friction force as the model error in a predictive filter."""

from casadi import SX, if_else

from friction_fmus.lawkit.law import Command, Output, Parameter, SampleTime, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import carried, clip, elapsed, limited, starts_now
from friction_fmus.lawkit.quantities import FORCE, VELOCITY


@law(
    "PredictiveFilter",
    "Compensation of friction estimated as the model error in a predictive filter",
    source="Crassidis, Markley, Journal of Guidance, Control, and Dynamics 20(3), 1997",
    cites=("CrassidisMarkley1997", "Ray2001"),
    Ts=1e-3,
    use=Use(
        "estimator",
        tuned={
            "m": "m",
            "F_size": "max(level, 1e-9)",
            "v_noise": "max(level, 1e-9) * Ts / m * sqrt(1 / (1 - exp(-2 * pi * corner * Ts)) - 1)",
        },
    ),
    outputs={
        "u": variables.U_COMPENSATION,
        "F_hat": Output(FORCE, "estimated friction {force}, positive for positive velocity"),
        "u_sat": variables.U_SAT,
    },
)
def predictive_filter(
    v: SX = variables.V,
    u_prev: SX = variables.U_PREV,
    enable: SX = Command(True, "false: u = 0, F_hat = 0 and the filter is at its start values"),
    reset: SX = Command(False, "true: the filter restarts at the measured velocity"),
    track: SX = variables.TRACK,
    u_track: SX = variables.U_TRACK,
    v_hat: SX = variables.V_HAT,
    running: SX = variables.RUNNING,
    missed: SX = variables.MISSED,
    gain: SX = variables.GAIN,
    m: SX = variables.POSITIVE_MASS,
    v_noise: SX = Parameter(VELOCITY, 1e-3, "standard deviation of the measured velocity, R = v_noise^2", min=0.0),
    F_size: SX = Parameter(FORCE, 0.5, "magnitude of the model error, with the weight W = 1/F_size^2", min=1e-12),
    u_min: SX = variables.starting(variables.U_MIN, -100.0),
    u_max: SX = variables.starting(variables.U_MAX, 100.0),
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """The friction force that best explains the last sampling interval, weighted against its magnitude.

        minimise  (v - v_hat_next)^2 / R + W F_hat^2
        v_hat_next = v_hat + Ts/m (u_prev - F_hat)
        R = v_noise^2,   W = 1/F_size^2

        rho   = v - (v_hat + Ts/m u_prev)
        a     = (Ts/m)^2 / ((Ts/m)^2 + W R)
        F_hat = -(m/Ts) a rho
        v_hat = v_hat + Ts/m (u_prev - F_hat)
        u     = clip(gain F_hat, u_min, u_max)

    Crassidis, Markley: Predictive filtering for nonlinear systems, Journal of Guidance, Control, and Dynamics 20(3),
    1997, for a mass with a velocity measurement. It is not certain that Ray, Ramasubramanian, Townsend
    (2001) estimate friction with this filter.

    Use it if velocity is measured and a single tuning parameter is wanted: only v_noise/F_size matters. The law equals
    DisturbanceObserver with the first-order filter and a = 1 - exp(-w Ts) in every sample; the start values give a =
    0.2. Connect u to the input f of a position controller; u_prev is the force after all limits. In a system file, the
    connection to u_prev needs a delay.

    For friction that grows at the rate c, the estimate lags by exactly

        F - F_hat = c Ts (1/a - 1/2)

    The first sample and a sample with reset adopt v and set F_hat to 0. While enable is false, u, F_hat, u_sat and all
    states are 0. While track is true, v_hat is such that u = u_track, within the limits; with gain = 0 it is not
    changed.

    Limits: with v_noise = 0, the estimate is dead-beat: F_hat is the mean force in the last interval, with the noise of
    the difference of two samples times m/Ts. With a wrong mass, F_hat contains the difference of the inertia forces.
    Full compensation with F_hat can cause hunting if friction decreases with velocity. u_min must not exceed u_max.
    """
    new = starts_now(reset, running)
    span = elapsed(missed, Ts)
    a = 1.0 / (1.0 + (v_noise / F_size * m / span) ** 2)
    slope = gain * (m / span * a)
    kept = if_else(new, v, v_hat + span / m * u_prev)
    predicted = carried(track, clip(u_track, u_min, u_max), -slope * v, slope, kept)
    residual = a * (v - predicted)
    return {
        **limited(SX(0.0), -m / span * residual, gain, enable, u_min, u_max, track, u_track),
        "v_hat": if_else(enable, predicted + residual, 0.0),
        "running": enable,
        "missed": SX(0.0),
    }
