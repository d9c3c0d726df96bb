"""What a motion asks of a friction model, and what is known asks of a compensator: rows of the decision tables.

Which block meets a need stands in the file of the block.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Motion:
    """A row of the decision table of friction models.

    Attributes
    ----------
    name : str
        What a model says in NEEDS if it is the one to begin with.
    amplitude, speed, reversals : str
        The motion, in words.
    shows, without : frozenset of str
        Features that a model must have, and those that it need not have and is left out for.
    found : str
        Page and section that shows why.
    """

    name: str
    amplitude: str
    speed: str
    reversals: str
    shows: frozenset[str]
    found: str
    without: frozenset[str] = frozenset({"mass inside", "random"})


@dataclass(frozen=True)
class Question:
    """A need beyond the motion: what a model says in NEEDS, what the need is, and what the model must have."""

    name: str
    need: str
    shows: frozenset[str] = frozenset()
    inputs: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Situation:
    """A row of the decision table of compensators.

    Attributes
    ----------
    name : str
        What a compensator says in its ``needs``, with its place in the row.
    known : str
        What is known and measured, in words.
    signals : frozenset of str
        Inputs that are at hand.
    model : frozenset of str
        What the compensator carries of the friction, of `KNOWLEDGE`.
    found : str
        Page and section that shows what it reaches.
    first : int
        Places of the compensators to begin with; those behind are other choices.
    """

    name: str
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
        "any",
        "far above vs, all the time",
        "none",
        words(""),
        "effects.md#friction-draws-a-glitch-at-each-quadrant-of-a-circle",
        STATIC | {"Stribeck"},
    ),
    Motion(
        "through rest",
        "above 100",
        "from rest through vs",
        "one after the other",
        words("Stribeck"),
        "effects.md#what-a-compensator-gains-depends-on-the-amplitude",
        STATIC,
    ),
    Motion(
        "near presliding",
        "1 to 100",
        "from rest through vs",
        "one after the other",
        words("presliding, Stribeck, lag"),
        "effects.md#what-a-compensator-gains-depends-on-the-amplitude",
    ),
    Motion(
        "presliding",
        "below 1",
        "below vs",
        "one after the other",
        words("presliding"),
        "claims.md#dahls-loops-coincide-at-any-rate-lugres-do-not",
    ),
    Motion(
        "nested presliding",
        "below 1",
        "below vs",
        "inside one another",
        words("presliding, nonlocal memory"),
        "claims.md#lugre-forgets-reversal-points-maxwellslip-and-gms-remember-them",
    ),
    Motion(
        "nested and sliding",
        "below 1 and above",
        "from rest through vs",
        "inside one another",
        words("presliding, nonlocal memory, Stribeck, lag"),
        "effects.md#in-presliding-feedforward-needs-a-model-with-memory",
    ),
    Motion(
        "held under vibration",
        "below 1, held for long",
        "at rest, shaken",
        "vibration on a constant force",
        words("presliding, drift-free, Stribeck"),
        "claims.md#lugre-drifts-under-a-bias-with-vibration-elastoplastic-does-not",
    ),
)

QUESTIONS = (
    Question("stick-slip", "stick-slip of an axis that is pulled slowly", words("Stribeck")),
    Question("frictional lag", "friction that follows changes of the speed late", words("lag")),
    Question("dwell", "break-away that grows with the time at rest", words("dwell")),
    Question("real stop", "a mass that really stops and stays", words("drift-free, mass inside")),
    Question("known forces", "friction at rest from the known forces on the mass", words("needs force")),
    Question("changing normal force", "a normal force that changes during the run", inputs=words("Fn")),
    Question("random", "friction that varies at random along the path", words("random")),
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
        "curve ahead",
        "the reference, a curve over speed; amplitudes far above x_p",
        words("rd, rdd"),
        words("static"),
        "effects.md#friction-draws-a-glitch-at-each-quadrant-of-a-circle",
    ),
    Situation(
        "presliding ahead",
        "the reference, a model with presliding; amplitudes near x_p and below",
        FORWARD,
        words("presliding"),
        "effects.md#in-presliding-feedforward-needs-a-model-with-memory",
        first=2,
    ),
    Situation(
        "presliding in feedback",
        "no reference in advance; velocity, a model with presliding",
        FEEDBACK,
        words("presliding"),
        "effects.md#an-observer-of-friction-in-feedback-is-behind-feedforward-by-a-share-of-a-sample",
    ),
    Situation(
        "curve in feedback",
        "no reference in advance; velocity, a curve over speed",
        FEEDBACK,
        words("static"),
        "effects.md#over-compensation-makes-a-limit-cycle",
    ),
    Situation(
        "force and velocity",
        "no model; velocity, and the force that was applied",
        words("v, u_prev, f_prev"),
        words("none"),
        "effects.md#an-observer-of-friction-is-as-good-as-its-lag-is-short",
    ),
    Situation(
        "force and encoder",
        "no model; an encoder, and the force that was applied",
        words("r, rd, rdd, x, u_prev"),
        words("none"),
        "effects.md#a-kalman-filter-finds-friction-without-a-model-of-it",
        first=2,
    ),
    Situation(
        "uncertain model",
        "a model that is some 10 % off, and a disturbance observer behind it",
        FORWARD | words("v, u_prev, f_prev"),
        words("presliding, none"),
        "effects.md#friction-feedforward-and-a-disturbance-observer-together-beat-either-of-them-unless-the-model-is-exact",
        first=2,
    ),
    Situation(
        "changing load",
        "a model at one load; the load or the lubrication changes",
        words("r, rd, rdd, x, v, u_prev"),
        words("presliding, static"),
        "effects.md#adaptation-takes-up-a-step-of-the-load",
        first=2,
    ),
    Situation(
        "bound only",
        "no more than a bound of the friction",
        words("r, rd, rdd, x, v, f"),
        words("none"),
        "effects.md#an-implicit-sliding-mode-does-not-chatter",
        first=2,
    ),
    Situation(
        "trials",
        "the same motion again and again, each time from rest",
        words("r, x"),
        words("none"),
        "effects.md#learning-takes-friction-out-of-a-motion-that-is-repeated",
    ),
    Situation(
        "periods",
        "the same motion again and again, without a pause",
        words("r, x"),
        words("none"),
        "effects.md#a-repetitive-controller-takes-what-is-periodic-out-of-the-error-quadrant-glitches-included",
    ),
    Situation(
        "hunting",
        "positioning: PID hunts around the goal",
        words("r, rd, rdd, x, v, f"),
        words("none"),
        "effects.md#an-integral-that-jumps-where-the-error-changes-sign-ends-the-hunting",
    ),
    Situation(
        "stiction error",
        "positioning: the axis stays off its goal",
        words("r, x, v, f"),
        words("static, presliding, none"),
        "effects.md#short-pulses-of-force-remove-an-error-that-a-pd-controller-leaves",
    ),
    Situation(
        "varying along the axis",
        "friction and cogging that vary along the axis",
        FEEDBACK,
        words("static"),
        "effects.md#learned-forces-tell-friction-from-cogging",
    ),
    Situation(
        "reference only",
        "a drive that takes nothing but a reference",
        words("r, rd, rdd, f"),
        words("none"),
        "effects.md#a-prefilter-of-the-reference-does-what-feedforward-does",
        first=2,
    ),
)
