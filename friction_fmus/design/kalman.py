"""Gains of the steady-state Kalman filter of `KalmanFriction`."""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import solve_discrete_are

from friction_fmus.errors import FrictionError


def kalman_friction_gains(
    m: float, Ts: float, position_noise: float, force_step: float, velocity_noise: float | None = None
) -> dict[str, float]:
    """Parameters of the law KalmanFriction from the noise of the measurement and the walk of the force.

    Parameters
    ----------
    m : float
        Moving mass [kg].
    Ts : float
        Sample time [s].
    position_noise : float
        Standard deviation of the measured position [m]; of an encoder with the step q it is q/sqrt(12).
    force_step : float
        Standard deviation of the change of the friction force from sample to sample [N].
    velocity_noise : float, optional
        Standard deviation of the measured velocity [m/s]; without it the velocity is not used.

    Returns
    -------
    dict of str to float
        m, Ts and the gains K_x, K_v [1/s], K_F [N/m], L_x [s], L_v, L_F [N.s/m], by the names of the law's parameters.

    Raises
    ------
    FrictionError
        If an argument is not positive and finite, or if they lie so far apart that the equation has no solution in
        floating point.

    Notes
    -----
    The filter form P C'/(C P C' + R) with P from the discrete algebraic Riccati equation, as in Anderson, Moore:
    Optimal Filtering, 1979, section 4.4.
    """
    values = {"m": m, "Ts": Ts, "position_noise": position_noise, "force_step": force_step}
    if velocity_noise is not None:
        values["velocity_noise"] = velocity_noise
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0.0):
            raise FrictionError(f"kalman_friction_gains: {name} = {value!r} must be positive and finite")

    # position, velocity and force in units of Ts^2/m force_step, Ts/m force_step and force_step
    units = np.array([Ts**2 / m, Ts / m, 1.0]) * force_step
    A = np.array([[1.0, 1.0, -0.5], [0.0, 1.0, -1.0], [0.0, 0.0, 1.0]])
    C = np.eye(3)[: len(values) - 3]
    noise = np.array([position_noise, velocity_noise or 0.0])[: len(C)] / units[: len(C)]
    R = np.diag(noise**2)
    try:
        P = solve_discrete_are(A.T, C.T, np.diag([0.0, 0.0, 1.0]), R)
        K = np.linalg.solve(C @ P @ C.T + R, C @ P).T
        radius = np.abs(np.linalg.eigvals(A - A @ K @ C)).max()
    except np.linalg.LinAlgError:
        radius = np.inf
    if not radius < 1.0:
        raise FrictionError(
            f"kalman_friction_gains: there is no stable filter for {values}; bring the noise and the step of the force "
            "closer together"
        )
    gains = np.zeros((3, 2))
    gains[:, : len(C)] = K * units[:, None] / units[: len(C)]
    names = (("K_x", "L_x"), ("K_v", "L_v"), ("K_F", "L_F"))
    found = {name: float(gains[i, j]) for i, row in enumerate(names) for j, name in enumerate(row)}
    return {"m": m, "Ts": Ts, **found}
