"""Conditions under which position control and friction compensation work, as functions of SI numbers.

Each function returns a `Condition`: whether it holds, the two numbers compared, and, if it is violated, what is wrong,
why, and what to change. ``friction-fmus doctor`` evaluates the conditions on a system, see docs/conditions.md.
"""

from .chain import DrivenPlant, PathDynamics, SampledLaw, chain, loop_poles, on_bristles, one_mass, two_masses
from .compensation import (
    adaptation,
    break_away,
    inertia,
    injection,
    overcompensation,
    prefilter,
    prefilter_match,
    preview,
    sliding_gain,
    super_twisting,
)
from .condition import Condition
from .coupling import contact_step, longest_step, output_delay, sample_step
from .learning import contraction, learning_filter, sampled_sensitivity
from .mechanics import belt, cogging, cogging_slope, critical_speed, encoder_count, fed_back_stiffness, pulled_mass
from .position_loop import (
    closed_loop,
    dead_band,
    dither_frequency,
    dither_stroke,
    expected_slip,
    hunting,
    pulses,
    routh,
    sampled,
    slide,
    slide_in_loop,
    steepest_fall,
    stick_slip_free,
    turned_friction,
)

__all__ = [
    "Condition",
    "DrivenPlant",
    "PathDynamics",
    "SampledLaw",
    "adaptation",
    "belt",
    "break_away",
    "chain",
    "closed_loop",
    "cogging",
    "cogging_slope",
    "contact_step",
    "contraction",
    "critical_speed",
    "dead_band",
    "dither_frequency",
    "dither_stroke",
    "encoder_count",
    "expected_slip",
    "fed_back_stiffness",
    "hunting",
    "inertia",
    "injection",
    "learning_filter",
    "longest_step",
    "loop_poles",
    "on_bristles",
    "one_mass",
    "output_delay",
    "overcompensation",
    "prefilter",
    "prefilter_match",
    "preview",
    "pulled_mass",
    "pulses",
    "routh",
    "sample_step",
    "sampled",
    "sampled_sensitivity",
    "slide",
    "slide_in_loop",
    "sliding_gain",
    "steepest_fall",
    "stick_slip_free",
    "super_twisting",
    "turned_friction",
    "two_masses",
]
