"""The rows of the result of a study: models, compensators, findings, files and curves, as plain data.

Every class here is frozen and holds numbers, texts, tuples and mappings only. Numbers are in SI units or in the units
that `StudyResult.units` names; a number that does not exist is None, never NaN.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

Numbers: TypeAlias = tuple[float, ...]


@dataclass(frozen=True)
class IdentifiedParameter:
    """One identified parameter.

    Attributes
    ----------
    name : str
        As in the block; M is the moved mass and OF the offset of the drive.
    value : float
        Estimate, in `unit`.
    standard_error : float or None
        In `unit`; None where the parameter was given, not estimated.
    unit : str
        Unit, "1" without.
    meaning : str
        What it is.
    published : float or None
        Value in the literature or, of a synthetic record, the true one, in `unit`.
    weak : str
        Why the record hardly determines it, and what to measure; empty: it is well determined.
    """

    name: str
    value: float
    standard_error: float | None
    unit: str
    meaning: str
    published: float | None = None
    weak: str = ""


@dataclass(frozen=True)
class Fit:
    """How well a model reproduces a signal.

    Attributes
    ----------
    rms : float
        Root mean square of simulated minus measured, in `unit`.
    percent : float
        The same in percent of the root mean square of the signal.
    signal, unit : str
        Which signal, in which unit.
    """

    rms: float
    percent: float
    signal: str
    unit: str


@dataclass(frozen=True)
class ModelResult:
    """One friction model.

    Attributes
    ----------
    name, summary : str
        Name of the block and what it is.
    method : str
        How it was identified; empty if it was not.
    parameters : tuple of IdentifiedParameter
        What was found.
    train, validation : Fit or None
        On the samples that were fitted, and on those that were not.
    closed_loop : tuple of Fit
        Of the co-simulated servo against the record: position and force; empty without a servo.
    aic, bic : float or None
        Information criteria, lower is better.
    rank : int or None
        1 is the best validated one; None if it was not identified.
    warnings : tuple of str
        What else to know.
    reason : str
        Why it was not identified; empty if it was.
    seconds : float
        Time the identification took.
    simulations : int
        Number of simulations of the model.
    """

    name: str
    summary: str
    method: str = ""
    parameters: tuple[IdentifiedParameter, ...] = ()
    train: Fit | None = None
    validation: Fit | None = None
    closed_loop: tuple[Fit, ...] = ()
    aic: float | None = None
    bic: float | None = None
    rank: int | None = None
    warnings: tuple[str, ...] = ()
    reason: str = ""
    seconds: float = 0.0
    simulations: int = 0


@dataclass(frozen=True)
class Curve:
    """A line or a cloud of points, to be drawn; x and y have the same length."""

    x: Numbers
    y: Numbers


@dataclass(frozen=True)
class Picture:
    """Curves in one pair of axes.

    Attributes
    ----------
    x_label, y_label : str
        Quantity of the axes.
    x_unit, y_unit : str
        Their units.
    data : mapping of str to Curve
        Measured, by name; decimated.
    models : mapping of str to Curve
        Of the models, by name of the block; decimated.
    """

    x_label: str
    y_label: str
    x_unit: str
    y_unit: str
    data: Mapping[str, Curve]
    models: Mapping[str, Curve]


@dataclass(frozen=True)
class Metrics:
    """What one run of the servo is judged by; without its first samples, in which the axis catches up.

    Attributes
    ----------
    rms, largest : float
        Root mean square and largest magnitude of reference minus position, in `units.position`.
    effort : float
        Root mean square of the drive force, in `units.force`.
    effort_high : float
        Root mean square of the part of it above the bandwidth of the loop, in `units.force`.
    """

    rms: float
    largest: float
    effort: float
    effort_high: float


@dataclass(frozen=True)
class GainPoint:
    """One gain of the compensation: its metrics, or why there are none (the run failed or diverged)."""

    gain: float
    metrics: Metrics | None
    failure: str = ""


@dataclass(frozen=True)
class Corner:
    """One corner of the mismatch: friction and mass of the axis are these factors times what was identified."""

    friction: float
    mass: float
    metrics: Metrics | None
    failure: str = ""


@dataclass(frozen=True)
class CompensatorResult:
    """One compensator.

    Attributes
    ----------
    name, summary : str
        Name of the law and what it is; the row named "none" is the servo without compensation.
    kind : str
        "none", "feedforward", "model feedback", "estimator", "dither", "learning", or "controller".
    applies : bool
        Whether it was co-simulated.
    reason : str
        Why not, or what went wrong in all runs; else empty.
    model : str
        Friction model whose identified parameters it has; empty where it needs none.
    parameters : mapping of str to float
        Parameters that were set; the others have the start values of the block.
    gain : float or None
        The best gain up to 1.
    metrics : Metrics or None
        At that gain.
    sweep : tuple of GainPoint
        Over the gain.
    corners : tuple of Corner
        At the best gain, under mismatch.
    worst : float or None
        Largest `rms` of the metrics and of all corners.
    best : float or None
        Smallest `rms` of the same.
    cost_ns : float or None
        Time of one sample on the machine of the study [ns].
    rank : int or None
        1 is the best; None if it does not apply.
    pays : bool
        Whether it makes the error smaller, also in the worst corner.
    noisy : bool
        Whether it loads the drive with much more high-frequency force than the servo alone.
    error : Curve or None
        Reference minus position over time at the best gain [s, units.position]; decimated to its extremes, so that
        nothing is lost in a zoomed plot.
    """

    name: str
    summary: str
    kind: str
    applies: bool
    reason: str = ""
    model: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)
    gain: float | None = None
    metrics: Metrics | None = None
    sweep: tuple[GainPoint, ...] = ()
    corners: tuple[Corner, ...] = ()
    worst: float | None = None
    best: float | None = None
    cost_ns: float | None = None
    rank: int | None = None
    pays: bool = False
    noisy: bool = False
    error: Curve | None = None


@dataclass(frozen=True)
class Recommendation:
    """What to do.

    Attributes
    ----------
    name : str
        Recommended compensator; "none" if no compensation pays; empty if none was tried.
    reason : str
        Two sentences.
    gain : float or None
        Its gain.
    runner_up : str
        Second best; empty if there is none that pays.
    runner_up_reason : str
        One sentence on how it differs.
    """

    name: str
    reason: str
    gain: float | None = None
    runner_up: str = ""
    runner_up_reason: str = ""


@dataclass(frozen=True)
class ConditionResult:
    """One condition of the recommended servo; texts are empty where it holds."""

    parts: tuple[str, ...]
    name: str
    ok: bool
    wrong: str = ""
    why: str = ""
    change: str = ""
    source: str = ""
    value: float | None = None
    bound: float | None = None


@dataclass(frozen=True)
class WrittenFile:
    """A file of the study: path relative to its folder with /, and what it is."""

    path: str
    what: str
