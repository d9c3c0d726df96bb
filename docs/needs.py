"""The rows of the decision tables: motions for friction models, situations for compensators.

Each row names the blocks that it recommends, best first.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Motion:
    """A row of the decision table of friction models.

    Attributes
    ----------
    name : str
        Name of the row.
    blocks : str
        Recommended models.
    amplitude, speed, reversals : str
        The motion, in words.
    shows, without : frozenset of str
        Features that a model must have, and features that are not needed and exclude a model.
    found : str
        The script in ``examples`` that shows why.
    """

    name: str
    blocks: str
    amplitude: str
    speed: str
    reversals: str
    shows: frozenset[str]
    found: str
    without: frozenset[str] = frozenset({"mass inside", "random"})


@dataclass(frozen=True)
class Question:
    """A need beyond the motion: its name, recommended models, the need in words, and what the model must have."""

    name: str
    blocks: str
    need: str
    shows: frozenset[str] = frozenset()
    inputs: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Situation:
    """A row of the decision table of compensators.

    Attributes
    ----------
    name : str
        Name of the row.
    blocks : str
        Compensators, best first.
    known : str
        What is known and measured, in words.
    signals : frozenset of str
        Available inputs.
    model : frozenset of str
        Kinds of friction model in the compensator, of `KNOWLEDGE`.
    found : str
        The script in ``examples`` that shows what it achieves.
    first : int
        Up to this place compensators are recommended; later places are alternatives.
    """

    name: str
    blocks: str
    known: str
    signals: frozenset[str]
    model: frozenset[str]
    found: str
    first: int = 1


def words(text: str) -> frozenset[str]:
    """Names or features, separated by commas."""
    return frozenset(part.strip() for part in text.split(",") if part.strip())


STATIC = words("presliding, lag, dwell, mass inside, random")

MOTIONS = (
    Motion(
        "sliding",
        "Coulomb",
        "any",
        "always far above vs",
        "none",
        words(""),
        "quadrant_glitches",
        STATIC | {"Stribeck"},
    ),
    Motion(
        "through rest",
        "Stribeck",
        "above 100",
        "from rest through vs",
        "not nested",
        words("Stribeck"),
        "compensators_over_amplitude",
        STATIC,
    ),
    Motion(
        "near presliding",
        "LuGre",
        "1 to 100",
        "from rest through vs",
        "not nested",
        words("presliding, Stribeck, lag"),
        "compensators_over_amplitude",
    ),
    Motion(
        "presliding",
        "Dahl",
        "below 1",
        "below vs",
        "not nested",
        words("presliding"),
        "dahl_rate_independence",
    ),
    Motion(
        "nested presliding",
        "MaxwellSlip",
        "below 1",
        "below vs",
        "nested",
        words("presliding, nonlocal memory"),
        "reversal_memory",
    ),
    Motion(
        "nested and sliding",
        "GMS",
        "below 1 and above",
        "from rest through vs",
        "nested",
        words("presliding, nonlocal memory, Stribeck, lag"),
        "feedforward_in_presliding",
    ),
    Motion(
        "held under vibration",
        "ElastoPlastic",
        "below 1, held under load",
        "at rest, with vibration",
        "small vibration around a constant force",
        words("presliding, drift-free, Stribeck"),
        "drift_under_vibration",
    ),
)

QUESTIONS = (
    Question("stick-slip", "LuGre", "stick-slip of a slowly pulled axis", words("Stribeck")),
    Question("frictional lag", "LuGre", "friction that lags behind the speed", words("lag")),
    Question("dwell", "SevenParameter", "break-away force that grows with the time at rest", words("dwell")),
    Question(
        "real stop",
        "KarnoppMass",
        "positions at rest that must be exact (velocity exactly zero)",
        words("drift-free, mass inside"),
    ),
    Question("known forces", "Stiction", "friction at rest from known forces on the mass", words("needs force")),
    Question("changing normal force", "LuGre", "a normal force that changes during a run", inputs=words("Fn")),
    Question(
        "transmitted force",
        "LoadDependentDahl",
        "friction proportional to the force that a gear transmits",
        inputs=words("F_t"),
    ),
    Question("random", "Bristle", "friction that varies randomly along the path", words("random")),
)

KNOWLEDGE = {
    "presliding": "dynamic",
    "static": "static",
    "none": "none",
}
"""Kinds of friction model in compensators, by their parameters."""
REFERENCE = ("r", "rd", "rdd", "jerk", "snap")
MEASURED = ("x", "v", "u_prev", "f_prev")
SWITCHES = ("enable", "reset", "track", "learn", "trial_end")
"""Groups of the inputs of compensators."""

FORWARD = words("r, rd, rdd, Fn")
FEEDBACK = words("r, x, v")

SITUATIONS = (
    Situation(
        "curve ahead",
        "StaticFeedforward CoulombFeedforward KarnoppFeedforward",
        "reference and friction curve; amplitudes far above x_p",
        words("rd, rdd"),
        words("static"),
        "quadrant_glitches",
    ),
    Situation(
        "presliding ahead",
        "LuGreFeedforward GMSFeedforward DahlFeedforward ElastoPlasticFeedforward ModifiedLeuvenFeedforward "
        "LeuvenFeedforward",
        "reference and presliding model; amplitudes near x_p or below",
        FORWARD,
        words("presliding"),
        "feedforward_in_presliding",
        first=2,
    ),
    Situation(
        "presliding in feedback",
        "LuGreObserver ElastoPlasticEstimator GMSObserver",
        "velocity and presliding model, but no reference in advance",
        FEEDBACK,
        words("presliding"),
        "observer_and_feedforward",
    ),
    Situation(
        "curve in feedback",
        "StaticFeedback TustinFeedback",
        "velocity and friction curve, but no reference in advance",
        FEEDBACK,
        words("static"),
        "over_compensation",
    ),
    Situation(
        "force and velocity",
        "DisturbanceObserver PredictiveFilter LocalFunctionEstimator",
        "velocity and applied force, but no model",
        words("v, u_prev, f_prev"),
        words("none"),
        "observer_lag",
    ),
    Situation(
        "force and encoder",
        "KalmanFriction ExtendedStateObserver",
        "encoder and applied force, but no model",
        words("r, rd, rdd, x, u_prev"),
        words("none"),
        "kalman_filter_as_compensator",
        first=2,
    ),
    Situation(
        "uncertain model",
        "GMSFeedforward DisturbanceObserver LuGreFeedforward PredictiveFilter LocalFunctionEstimator",
        "a model that is about 10 % off, used with a disturbance observer",
        FORWARD | words("v, u_prev, f_prev"),
        words("presliding, none"),
        "cascade_on_a_circle",
        first=2,
    ),
    Situation(
        "changing load",
        "AdaptiveLuGre ANDFC AdaptiveSlidingMode",
        "a model at one load, but load or lubrication changes",
        words("r, rd, rdd, x, v, u_prev"),
        words("presliding, static"),
        "adaptive_normal_force",
        first=2,
    ),
    Situation(
        "bound only",
        "ImplicitSlidingMode ImplicitSuperTwisting",
        "only a bound of the friction",
        words("r, rd, rdd, x, v, f"),
        words("none"),
        "sliding_mode",
        first=2,
    ),
    Situation(
        "trials",
        "IterativeLearning",
        "a repeated motion, each time from rest",
        words("r, x"),
        words("none"),
        "learning_over_trials",
    ),
    Situation(
        "periods",
        "RepetitiveController",
        "a repeated motion without pauses",
        words("r, x"),
        words("none"),
        "repetitive_control",
    ),
    Situation(
        "hunting",
        "ResetPID PID Dither",
        "positioning where PID control hunts around the target",
        words("r, rd, rdd, x, v, f"),
        words("none"),
        "reset_integral",
    ),
    Situation(
        "stiction error",
        "ImpulsiveControl LuGreObserver Dither",
        "positioning where the axis stops short of its target",
        words("r, x, v, f"),
        words("static, presliding, none"),
        "pulses",
    ),
    Situation(
        "varying along the axis",
        "TustinFeedback",
        "friction and cogging that vary along the axis",
        FEEDBACK,
        words("static"),
        "cogging_from_learned_forces",
    ),
    Situation(
        "reference only",
        "Prefilter PreviewPrefilter",
        "only the reference of the drive can be changed",
        words("r, rd, rdd, f"),
        words("none"),
        "prefilter_is_feedforward",
        first=2,
    ),
)

POSITION_LOOP = ("routh", "loop_poles", "stick_slip_free", "hunting", "break_away")
"""Conditions of a position loop."""

CONDITIONS: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(("CascadePPI", "PID"), POSITION_LOOP),
    **dict.fromkeys(
        (
            "DisturbanceObserver",
            "ExtendedStateObserver",
            "KalmanFriction",
            "LocalFunctionEstimator",
            "PredictiveFilter",
            "TwoMass",
        ),
        ("loop_poles",),
    ),
    **dict.fromkeys(
        (
            "CoulombFeedforward",
            "DahlFeedforward",
            "DeadZoneFeedforward",
            "ElastoPlasticFeedforward",
            "GMSFeedforward",
            "InverseDynamics",
            "KarnoppFeedforward",
            "LeuvenFeedforward",
            "LuGreFeedforward",
            "ModifiedLeuvenFeedforward",
            "StaticFeedback",
            "StaticFeedforward",
            "TustinFeedback",
        ),
        ("overcompensation",),
    ),
    **dict.fromkeys(
        ("ElastoPlasticEstimator", "GMSObserver", "LuGreObserver"), ("fed_back_stiffness", "overcompensation")
    ),
    "Dither": ("dither_stroke",),
    "RepetitiveController": ("contraction",),
    **dict.fromkeys(("Differentiator", "Quantiser"), ("encoder_count",)),
}
"""Functions of `friction_fmus.conditions` that say when a block works in a loop, by block."""
