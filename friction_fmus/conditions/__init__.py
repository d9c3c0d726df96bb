"""Conditions under which position control and friction compensation work, as functions of SI numbers.

Each function returns a `Condition`: whether it holds, the two numbers compared, and, if it is violated, what is wrong,
why, and what to change. ``friction-fmus doctor`` evaluates the conditions on a system, see docs/conditions.md.
"""

from .axis import belt, cogging, cogging_slope, encoder_count, fed_back_stiffness
from .chain import DrivenPlant, PathDynamics, SampledLaw, chain, loop_poles, on_bristles, one_mass, two_masses
from .compensation import (
    disturbance_loop,
    disturbance_observer,
    explicit_observer,
    inertia,
    injection,
    overcompensation,
)
from .compensators import (
    adaptation,
    break_away,
    prefilter,
    prefilter_match,
    preview,
    sliding_gain,
    super_twisting,
    super_twisting_rate,
)
from .condition import Condition
from .coupling import contact_step, longest_step, output_delay, sample_step
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
    turned_friction,
)
from .pulled import critical_speed, pulled_mass
from .quoted import quotes
from .shaking import dither_frequency, dither_stroke, pulses, slide, slide_in_loop

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
    "disturbance_loop",
    "disturbance_observer",
    "dither_frequency",
    "dither_stroke",
    "encoder_count",
    "expected_slip",
    "explicit_observer",
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
    "process_sensitivity",
    "pulled_mass",
    "pulses",
    "quotes",
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
    "super_twisting_rate",
    "turned_friction",
    "two_masses",
]
