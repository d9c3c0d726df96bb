"""Conditions under which position control and friction compensation work, as functions of SI numbers.

Each function returns a `Condition`: whether it holds, the two numbers compared, and, if it is violated, what is wrong,
why, and what to change. A study evaluates them for the loop of an axis, see docs/conditions.md.
"""

from .chain import DrivenPlant, PathDynamics, SampledLaw, chain, loop_poles, on_bristles, one_mass, two_masses
from .compensation import (
    break_away,
    contraction,
    fed_back_stiffness,
    learning_filter,
    overcompensation,
    sampled_sensitivity,
)
from .condition import Condition
from .position_loop import (
    closed_loop,
    dither_stroke,
    encoder_count,
    expected_slip,
    hunting,
    routh,
    steepest_fall,
    stick_slip_free,
)

__all__ = [
    "Condition",
    "DrivenPlant",
    "PathDynamics",
    "SampledLaw",
    "break_away",
    "chain",
    "closed_loop",
    "contraction",
    "dither_stroke",
    "encoder_count",
    "expected_slip",
    "fed_back_stiffness",
    "hunting",
    "learning_filter",
    "loop_poles",
    "on_bristles",
    "one_mass",
    "overcompensation",
    "routh",
    "sampled_sensitivity",
    "steepest_fall",
    "stick_slip_free",
    "two_masses",
]
