"""What a motion asks of a friction model, and what is known asks of a compensator: rows of the decision tables."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Motion:
    """A row of the decision table of friction models.

    Attributes
    ----------
    amplitude, speed, reversals : str
        The motion, in words.
    begin : str
        The model to begin with.
    shows, without : frozenset of str
        Features that a model must have, and those that it need not have and is left out for.
    found : str
        Page and section that shows why.
    """

    amplitude: str
    speed: str
    reversals: str
    begin: str
    shows: frozenset[str]
    found: str
    without: frozenset[str] = frozenset({"mass inside", "random"})


@dataclass(frozen=True)
class Question:
    """A need beyond the motion: what it is, the model to begin with, and what that must have."""

    need: str
    begin: str
    shows: frozenset[str] = frozenset()
    inputs: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Situation:
    """A row of the decision table of compensators.

    Attributes
    ----------
    known : str
        What is known and measured, in words.
    begin, others : tuple of str
        Compensators to begin with, and others.
    signals : frozenset of str
        Inputs that are at hand.
    model : frozenset of str
        What the compensator carries of the friction, of `KNOWLEDGE`.
    found : str
        Page and section that shows what it reaches.
    """

    known: str
    begin: tuple[str, ...]
    others: tuple[str, ...]
    signals: frozenset[str]
    model: frozenset[str]
    found: str


def words(text: str) -> frozenset[str]:
    """Names or features, separated by commas."""
    return frozenset(part.strip() for part in text.split(",") if part.strip())


STATIC = words("presliding, lag, dwell, mass inside, random")

MOTIONS = (
    Motion(
        "any",
        "far above vs, all the time",
        "none",
        "Coulomb",
        words(""),
        "effects.md#friction-draws-a-glitch-at-each-quadrant-of-a-circle",
        STATIC | {"Stribeck"},
    ),
    Motion(
        "above 100",
        "from rest through vs",
        "one after the other",
        "Stribeck",
        words("Stribeck"),
        "effects.md#what-a-compensator-gains-depends-on-the-amplitude",
        STATIC,
    ),
    Motion(
        "1 to 100",
        "from rest through vs",
        "one after the other",
        "LuGre",
        words("presliding, Stribeck, lag"),
        "effects.md#what-a-compensator-gains-depends-on-the-amplitude",
    ),
    Motion(
        "below 1",
        "below vs",
        "one after the other",
        "Dahl",
        words("presliding"),
        "claims.md#dahls-loops-coincide-at-any-rate-lugres-do-not",
    ),
    Motion(
        "below 1",
        "below vs",
        "inside one another",
        "MaxwellSlip",
        words("presliding, nonlocal memory"),
        "claims.md#lugre-forgets-reversal-points-maxwellslip-and-gms-remember-them",
    ),
    Motion(
        "below 1 and above",
        "from rest through vs",
        "inside one another",
        "GMS",
        words("presliding, nonlocal memory, Stribeck, lag"),
        "effects.md#in-presliding-feedforward-needs-a-model-with-memory",
    ),
    Motion(
        "below 1, held for long",
        "at rest, shaken",
        "vibration on a constant force",
        "ElastoPlastic",
        words("presliding, drift-free, Stribeck"),
        "claims.md#lugre-drifts-under-a-bias-with-vibration-elastoplastic-does-not",
    ),
)

QUESTIONS = (
    Question("stick-slip of an axis that is pulled slowly", "LuGre", words("Stribeck")),
    Question("friction that follows changes of the speed late", "LuGre", words("lag")),
    Question("break-away that grows with the time at rest", "SevenParameter", words("dwell")),
    Question("a mass that really stops and stays", "KarnoppMass", words("drift-free, mass inside")),
    Question("friction at rest from the known forces on the mass", "Stiction", words("needs force")),
    Question("a normal force that changes during the run", "LuGre", inputs=words("Fn")),
    Question("friction that varies at random along the path", "Bristle", words("random")),
)

KNOWLEDGE = {
    "presliding": "curve and presliding",
    "static": "curve over speed",
    "none": "none",
}
"""What a compensator carries of the friction, from its parameters."""
REFERENCE = ("r", "rd", "rdd", "jerk", "snap")
MEASURED = ("x", "v", "u_prev", "f_prev")
SWITCHES = ("enable", "reset", "learn", "trial_end")
"""Groups of the inputs of compensators."""

FORWARD = words("r, rd, rdd, Fn")
FEEDBACK = words("r, x, v")

SITUATIONS = (
    Situation(
        "the reference, a curve over speed; amplitudes far above x_p",
        ("StaticFeedforward",),
        ("CoulombFeedforward", "KarnoppFeedforward"),
        words("rd, rdd"),
        words("static"),
        "effects.md#friction-draws-a-glitch-at-each-quadrant-of-a-circle",
    ),
    Situation(
        "the reference, a model with presliding; amplitudes near x_p and below",
        ("LuGreFeedforward", "GMSFeedforward"),
        ("DahlFeedforward", "ElastoPlasticFeedforward", "ModifiedLeuvenFeedforward", "LeuvenFeedforward"),
        FORWARD,
        words("presliding"),
        "effects.md#in-presliding-feedforward-needs-a-model-with-memory",
    ),
    Situation(
        "no reference in advance; velocity, a model with presliding",
        ("LuGreObserver",),
        ("ElastoPlasticEstimator",),
        FEEDBACK,
        words("presliding"),
        "effects.md#an-observer-of-friction-in-feedback-is-behind-feedforward-by-a-share-of-a-sample",
    ),
    Situation(
        "no reference in advance; velocity, a curve over speed",
        ("StaticFeedback",),
        ("TustinFeedback",),
        FEEDBACK,
        words("static"),
        "effects.md#over-compensation-makes-a-limit-cycle",
    ),
    Situation(
        "no model; velocity, and the force that was applied",
        ("DisturbanceObserver",),
        ("PredictiveFilter", "LocalFunctionEstimator"),
        words("v, u_prev, f_prev"),
        words("none"),
        "effects.md#an-observer-of-friction-is-as-good-as-its-lag-is-short",
    ),
    Situation(
        "no model; an encoder, and the force that was applied",
        ("KalmanFriction", "ExtendedStateObserver"),
        (),
        words("r, rd, rdd, x, u_prev"),
        words("none"),
        "effects.md#a-kalman-filter-finds-friction-without-a-model-of-it",
    ),
    Situation(
        "a model that is some 10 % off, and a disturbance observer behind it",
        ("GMSFeedforward", "DisturbanceObserver"),
        ("LuGreFeedforward", "PredictiveFilter", "LocalFunctionEstimator"),
        FORWARD | words("v, u_prev, f_prev"),
        words("presliding, none"),
        "effects.md#friction-feedforward-and-a-disturbance-observer-together-beat-either-of-them-unless-the-model-is-exact",
    ),
    Situation(
        "a model at one load; the load or the lubrication changes",
        ("AdaptiveLuGre", "ANDFC"),
        ("AdaptiveSlidingMode",),
        words("r, rd, rdd, x, v, u_prev"),
        words("presliding, static"),
        "effects.md#adaptation-takes-up-a-step-of-the-load",
    ),
    Situation(
        "no more than a bound of the friction",
        ("ImplicitSlidingMode", "ImplicitSuperTwisting"),
        (),
        words("r, rd, rdd, x, v, f"),
        words("none"),
        "effects.md#an-implicit-sliding-mode-does-not-chatter",
    ),
    Situation(
        "the same motion again and again, each time from rest",
        ("IterativeLearning",),
        (),
        words("r, x"),
        words("none"),
        "effects.md#learning-takes-friction-out-of-a-motion-that-is-repeated",
    ),
    Situation(
        "the same motion again and again, without a pause",
        ("RepetitiveController",),
        (),
        words("r, x"),
        words("none"),
        "effects.md#a-repetitive-controller-takes-what-is-periodic-out-of-the-error-quadrant-glitches-included",
    ),
    Situation(
        "positioning: PID hunts around the goal",
        ("ResetPID",),
        ("PID", "Dither"),
        words("r, rd, rdd, x, v, f"),
        words("none"),
        "effects.md#an-integral-that-jumps-where-the-error-changes-sign-ends-the-hunting",
    ),
    Situation(
        "positioning: the axis stays off its goal",
        ("ImpulsiveControl",),
        ("LuGreObserver", "Dither"),
        words("r, x, v, f"),
        words("static, presliding, none"),
        "effects.md#short-pulses-of-force-remove-an-error-that-a-pd-controller-leaves",
    ),
    Situation(
        "friction and cogging that vary along the axis",
        ("TustinFeedback",),
        (),
        FEEDBACK,
        words("static"),
        "effects.md#learned-forces-tell-friction-from-cogging",
    ),
    Situation(
        "a drive that takes nothing but a reference",
        ("Prefilter", "PreviewPrefilter"),
        (),
        words("r, rd, rdd, f"),
        words("none"),
        "effects.md#a-prefilter-of-the-reference-does-what-feedforward-does",
    ),
)
