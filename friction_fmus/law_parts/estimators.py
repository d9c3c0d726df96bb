"""What the estimators of friction without a friction model share."""

from __future__ import annotations

from casadi import SX, if_else, logic_not, logic_or

from friction_fmus.expressions import clip, limits


def starts_now(reset: SX, running: SX) -> SX:
    """Whether this sample only takes the measured values over: it is the first one, or reset is true."""
    return logic_or(reset, logic_not(running))


def compensation(estimate: SX, gain: SX, u_min: SX, u_max: SX, enable: SX) -> dict[str, SX]:
    """The outputs u, F_hat and u_sat that compensate a share of an estimated friction force."""
    wanted = gain * estimate
    return {
        "u": if_else(enable, clip(wanted, u_min, u_max), 0.0),
        "F_hat": if_else(enable, estimate, 0.0),
        "u_sat": if_else(enable, limits(wanted, u_min, u_max), 0.0),
    }


def mean_friction(force: SX, m: SX, dv: SX, Ts: SX) -> SX:
    """Mean friction over the last sampling interval, in which the force changed the velocity of a mass by dv."""
    return force - m * dv / Ts
