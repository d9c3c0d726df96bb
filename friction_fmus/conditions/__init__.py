"""Conditions under which position control and friction compensation work, as functions of SI numbers.

Each returns a `Condition`: whether it holds, the two numbers that were compared, and what is wrong, why, and what to
change if it does not. ``friction-fmus doctor`` evaluates them on a system, see docs/conditions.md.
"""

from .compensation import (
    disturbance_loop,
    disturbance_observer,
    explicit_observer,
    inertia,
    injection,
    overcompensation,
)
from .condition import Condition
from .coupling import contact_step, fresh, longest_step, sample_step
from .learning import contraction, learning_filter, process_sensitivity, sampled_sensitivity
from .position_loop import (
    closed_loop,
    dead_band,
    expected_slip,
    hunting,
    routh,
    sampled,
    steepest_fall,
    stick_slip_free,
)

__all__ = [
    "Condition",
    "closed_loop",
    "contact_step",
    "contraction",
    "dead_band",
    "disturbance_loop",
    "disturbance_observer",
    "expected_slip",
    "explicit_observer",
    "fresh",
    "hunting",
    "inertia",
    "injection",
    "learning_filter",
    "longest_step",
    "overcompensation",
    "process_sensitivity",
    "routh",
    "sample_step",
    "sampled",
    "sampled_sensitivity",
    "steepest_fall",
    "stick_slip_free",
]
