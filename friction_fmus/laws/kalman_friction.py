"""Friction force as a random walk, estimated by a Kalman filter."""

from __future__ import annotations

from casadi import SX, if_else

from friction_fmus.law import (
    DAMPING,
    FORCE,
    LENGTH,
    MASS,
    NO_UNIT,
    STIFFNESS,
    TIME,
    VELOCITY,
    Command,
    Input,
    Output,
    Parameter,
    SampleTime,
    State,
    law,
)
from friction_fmus.law_parts.estimators import compensation, starts_now


@law(
    "KalmanFriction",
    "Friction estimated as a random walk by a Kalman filter, and compensated",
    source="Ray, Ramasubramanian, Townsend, Control Engineering Practice 9(2), 2001",
    Ts=1e-3,
    outputs={
        "u": Output(FORCE, "compensation force gain F_hat, within u_min and u_max"),
        "F_hat": Output(FORCE, "estimated friction force, positive where it opposes a positive velocity"),
        "u_sat": Output(NO_UNIT, "active limit: -1 lower, +1 upper, 0 none"),
    },
)
def kalman_friction(
    x: SX = Input(LENGTH, 0.0, "measured position"),
    v: SX = Input(VELOCITY, 0.0, "measured velocity, of use with gains L and as start value", optional=True),
    u_prev: SX = Input(FORCE, 0.0, "force that was applied since the last sample, after all limits"),
    enable: SX = Command(True, "false: u = 0, F_hat = 0 and the filter at its start"),
    reset: SX = Command(False, "true: the filter starts anew from the measured position"),
    x_hat: SX = State(LENGTH, 0.0, "estimated position", nominal=1e-3),
    v_hat: SX = State(VELOCITY, 0.0, "estimated velocity", nominal=1e-2),
    F_walk: SX = State(FORCE, 0.0, "estimated friction force"),
    running: SX = State(NO_UNIT, 0.0, "1 after the first sample"),
    gain: SX = Parameter(NO_UNIT, 1.0, "share of the friction that is compensated", min=0.0, max=1.0),
    m: SX = Parameter(MASS, 1.0, "moving mass", min=1e-12),
    K_x: SX = Parameter(NO_UNIT, 0.609465573922024, "correction of the position by a position residual"),
    K_v: SX = Parameter("1/s", 281.35870550942354, "correction of the velocity by a position residual"),
    K_F: SX = Parameter(STIFFNESS, -64944.374672806414, "correction of the force by a position residual"),
    L_x: SX = Parameter(TIME, 0.0, "correction of the position by a velocity residual"),
    L_v: SX = Parameter(NO_UNIT, 0.0, "correction of the velocity by a velocity residual"),
    L_F: SX = Parameter(DAMPING, 0.0, "correction of the force by a velocity residual"),
    u_min: SX = Parameter(FORCE, -1000.0, "lower limit of u"),
    u_max: SX = Parameter(FORCE, 1000.0, "upper limit of u"),
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """Kalman filter of a mass with an unknown friction force that walks at random.

        x_p = x_hat + Ts v_hat + Ts^2/(2 m) (u_prev - F_walk)
        v_p = v_hat + Ts/m (u_prev - F_walk)
        x_hat  = x_p    + K_x (x - x_p) + L_x (v - v_p)
        v_hat  = v_p    + K_v (x - x_p) + L_v (v - v_p)
        F_walk = F_walk + K_F (x - x_p) + L_F (v - v_p)
        F_hat  = F_walk,   u = clip(gain F_hat, u_min, u_max)

    Ray, Ramasubramanian, Townsend: Adaptive friction compensation using extended Kalman-Bucy filter friction
    estimation, Control Engineering Practice 9(2), 2001 (only its abstract was read); the equations are those of the
    steady-state Kalman filter in sampled time. There is no friction model: what is estimated is every force on the
    mass but u_prev.

    Use it with the gains of `friction_fmus.design.kalman_friction_gains`, which solves the Riccati equation for a mass,
    a sample time, the noise of the encoder and the speed at which the force walks; the start values are its result
    for 1 kg, 1 ms, an encoder step of 1 um and 0.03 N per sample. With L_x = L_v = L_F = 0 the position alone is
    measured. u goes to the input f of a position controller; u_prev is the force after all limits, so that nothing
    winds up when the actuator saturates. In a system file the wire to u_prev needs a delay.

    For a friction force that grows at the rate c and no velocity measurement the filtered estimate lags by

        F - F_hat = c (m |K_v/K_F| - Ts/2)

    exactly. The first sample, and a sample with reset, take x and v over (v = 0 if it is not connected) and set
    F_hat to 0. While enable is false u, F_hat, u_sat and all states are 0.

    Limits: the gains belong to one m and one Ts; other values of either bias the estimate and may make the filter
    unstable. A wrong mass puts the missing inertia force into F_hat. At a reversal the estimate is late by about the
    time constant of the filter. F_hat fed back in full is an integral action: with static friction above Coulomb
    friction it can hunt. u_min must not exceed u_max.
    """
    new = starts_now(reset, running)
    force = (u_prev - F_walk) / m
    x_p = if_else(new, x, x_hat + Ts * v_hat + Ts**2 / 2.0 * force)
    v_p = if_else(new, v, v_hat + Ts * force)
    dx, dv = x - x_p, v - v_p
    F_hat = if_else(new, 0.0, F_walk) + K_F * dx + L_F * dv
    return {
        **compensation(F_hat, gain, u_min, u_max, enable),
        "x_hat": if_else(enable, x_p + K_x * dx + L_x * dv, 0.0),
        "v_hat": if_else(enable, v_p + K_v * dx + L_v * dv, 0.0),
        "F_walk": if_else(enable, F_hat, 0.0),
        "running": enable,
    }
