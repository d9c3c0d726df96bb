"""Which conditions the documentation of a block quotes, and what it says of them."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Mapping
from types import MappingProxyType

_LOOP = ("routh", "sampled", "loop_poles", "stick_slip_free", "break_away")
_INTEGRAL = (*_LOOP, "hunting")
_ESTIMATOR = ("loop_poles", "disturbance_observer")
_FEEDFORWARD = ("overcompensation", "inertia")
_MEASURED = ("overcompensation",)

QUOTED: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "PID": (*_INTEGRAL, "dead_band"),
        "CascadePPI": _INTEGRAL,
        "ResetPID": _LOOP,
        "ModelledOutputKarnopp": (*_LOOP, "overcompensation"),
        "ExtendedStateObserver": (*_ESTIMATOR, "break_away"),
        "ImplicitSlidingMode": ("loop_poles", "sliding_gain", "break_away"),
        "ImplicitSuperTwisting": ("loop_poles", "super_twisting", "super_twisting_rate", "break_away"),
        "AdaptiveSlidingMode": (*_LOOP, "adaptation"),
        "AdaptiveLuGre": (*_LOOP, "adaptation", "fed_back_stiffness", "overcompensation", "explicit_observer"),
        "ANDFC": (*_LOOP, "adaptation", "fed_back_stiffness", "overcompensation", "explicit_observer"),
        "CoulombFeedforward": _FEEDFORWARD,
        "KarnoppFeedforward": _FEEDFORWARD,
        "DahlFeedforward": _FEEDFORWARD,
        "StaticFeedforward": _FEEDFORWARD,
        "LuGreFeedforward": _FEEDFORWARD,
        "ElastoPlasticFeedforward": _FEEDFORWARD,
        "GMSFeedforward": _FEEDFORWARD,
        "LeuvenFeedforward": _FEEDFORWARD,
        "ModifiedLeuvenFeedforward": _FEEDFORWARD,
        "InverseDynamics": _FEEDFORWARD,
        "DeadZoneFeedforward": (*_FEEDFORWARD, "loop_poles"),
        "DiscreteInverse": ("preview",),
        "Prefilter": ("prefilter", "prefilter_match"),
        "PreviewPrefilter": ("prefilter", "prefilter_match"),
        "StaticFeedback": _MEASURED,
        "TustinFeedback": _MEASURED,
        "LuGreObserver": ("injection", "fed_back_stiffness", "overcompensation", "explicit_observer"),
        "ElastoPlasticEstimator": ("fed_back_stiffness", "overcompensation"),
        "DisturbanceObserver": _ESTIMATOR,
        "KalmanFriction": _ESTIMATOR,
        "PredictiveFilter": _ESTIMATOR,
        "LocalFunctionEstimator": _ESTIMATOR,
        "Dither": ("dither_stroke", "dither_frequency"),
        "ImpulsiveControl": ("pulses",),
        "IterativeLearning": ("contraction",),
        "RepetitiveController": ("contraction",),
        "Actuator": ("loop_poles", "break_away"),
        "Belt": ("belt",),
        "Cogging": ("cogging",),
        "Encoder": ("encoder_count", "loop_poles"),
        "TwoMass": ("loop_poles",),
    }
)
"""Block -> functions of `friction_fmus.conditions`, as the doctor evaluates them where the block is used."""


def quotes(block: str) -> tuple[tuple[str, str], ...]:
    """The conditions of a block: name of the function, and the first sentence of its docstring.

    Parameters
    ----------
    block : str
        Name of a block of the library; another one has no conditions.
    """
    functions = importlib.import_module("friction_fmus.conditions")
    found = []
    for name in QUOTED.get(block, ()):
        text = inspect.getdoc(getattr(functions, name)) or ""
        found.append((name, " ".join(text.split("\n\n")[0].split())))
    return tuple(found)
