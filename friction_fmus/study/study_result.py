"""The result of a study as plain data: everything shown in the report, in the terminal and in `study.json`.

The classes are frozen and contain only numbers, strings, tuples and mappings. Numbers are in SI units, or in the units
in `StudyResult.units` for a rotary axis. A missing number is None, never NaN.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Final, TypeAlias

import numpy as np

from friction_fmus.export.identified_axis import IdentifiedAxis
from friction_fmus.identification import Array, AxisUnits
from friction_fmus.listings import plain, study_html, study_text

Numbers: TypeAlias = tuple[float, ...]


@dataclass(frozen=True)
class IdentifiedParameter:
    """Identified parameter."""

    name: str  # name in the block; M is the moved mass and OF the force offset of the drive
    value: float  # estimate, in `unit`
    standard_error: float | None  # standard error, in `unit`; None if the parameter was fixed
    unit: str  # unit; "1" for a dimensionless parameter
    meaning: str  # description
    published: float | None = None  # value in the literature, or the true value for a simulated record, in `unit`
    weak: str = ""
    """Reason why the parameter is poorly identifiable, and what to measure; empty if it is well determined."""
    noise_error: float | None = None
    """Part of the standard error that is due to noise, in `unit`; None if the parts are not known."""

    @property
    def determined(self) -> bool:
        """Whether the noise of the record determines the parameter to better than its value."""
        error = self.standard_error if self.noise_error is None else self.noise_error
        return self.standard_error is not None and error is not None and error < abs(self.value)


@dataclass(frozen=True)
class Fit:
    """Residual of a simulated signal."""

    rms: float  # root mean square of simulated minus measured, in `unit`
    percent: float  # residual in percent of the root mean square of the measured signal
    signal: str
    unit: str
    """Name and unit of the signal."""


@dataclass(frozen=True)
class PositionPart:
    """Force over position that was identified together with a friction model."""

    nodes: int
    spacing: float
    """Number of nodes of the table and their distance."""
    cogging: float
    friction: float
    """Rms values of cogging and position-dependent friction over the table."""
    train_without: Fit | None
    validation_without: Fit | None
    """Residuals of the model without this force."""


@dataclass(frozen=True)
class ModelResult:
    """Result of one friction model."""

    name: str
    summary: str
    """Name of the block and its description."""
    method: str = ""  # identification method; empty if the model was not identified
    parameters: tuple[IdentifiedParameter, ...] = ()  # identified parameters
    train: Fit | None = None
    validation: Fit | None = None
    """Residuals on the training and the validation data."""
    closed_loop: tuple[Fit, ...] = ()
    """Residuals of position and force of the co-simulated servo; empty without a servo."""
    aic: float | None = None
    bic: float | None = None
    """Information criteria; lower is better."""
    rank: int | None = None  # rank by validation, 1 is best; None if the model was not identified
    warnings: tuple[str, ...] = ()  # warnings of the identification
    reason: str = ""  # reason why the model was not identified; empty if it was
    seconds: float = 0.0  # elapsed time of the identification [s]
    simulations: int = 0  # number of simulations of the model
    position: PositionPart | None = None  # force over position; None if it does not improve the prediction


@dataclass(frozen=True)
class StudyCurve:
    """Points of a line or scatter plot; x and y have the same length."""

    x: Numbers
    y: Numbers


@dataclass(frozen=True)
class Picture:
    """Curves in one pair of axes."""

    x_label: str
    y_label: str
    """Quantities of the axes."""
    x_unit: str
    y_unit: str
    """Units of the axes."""
    data: Mapping[str, StudyCurve]  # decimated measurements, by name
    models: Mapping[str, StudyCurve]  # decimated curves of the models, by name of the block


@dataclass(frozen=True)
class ConditionResult:
    """Condition evaluated for the recommended servo; the texts are empty if it holds."""

    name: str
    ok: bool
    wrong: str = ""
    why: str = ""
    change: str = ""
    source: str = ""
    value: float | None = None
    bound: float | None = None


@dataclass(frozen=True)
class StudyFinding:
    """Finding that limits how far the result of a study can be trusted."""

    name: str  # stable name, such as ``wrong-gains``
    what: str  # description with numbers, in one sentence
    change: str  # proposed change, in one sentence
    stops: bool = False
    """Whether the result must not be used: nothing is ranked that depends on the finding, and no FMU is written."""


@dataclass(frozen=True)
class ServoCheck:
    """Comparison of the servo as configured with the recorded drive force."""

    residual: Fit | None = None
    """Recorded force minus command of the servo for the recorded reference and position; None if not compared."""
    allowed: float = 0.0  # residual up to which the servo reproduces the record, in percent of the rms force
    findings: tuple[StudyFinding, ...] = ()  # reasons for a larger residual
    gains: tuple[IdentifiedParameter, ...] = ()
    """Gains estimated from the record; empty if those of the configuration reproduce it."""
    recorded: StudyCurve | None = None
    commanded: StudyCurve | None = None
    """Force over time: as recorded, and as the servo commands it."""
    reason: str = ""  # reason why the servo was not compared; empty if it was


@dataclass(frozen=True)
class WrittenFile:
    """File written by a study: path relative to its folder, separated by /, and description."""

    path: str
    what: str


POINTS: Final = 1500  # approximate number of points of a stored curve over time


def curve(x: Array, y: Array) -> StudyCurve:
    """Return a curve through points."""
    return StudyCurve(tuple(x.tolist()), tuple(y.tolist()))


def thinned(x: Array, y: Array, points: int = POINTS) -> StudyCurve:
    """Return a decimated curve with the minimum and maximum of each interval, so that peaks are kept."""
    width = -(-2 * len(y) // points)
    if width <= 2:
        return curve(x, y)
    kept: list[int] = [0]
    for begin in range(0, len(y), width):
        interval = y[begin : begin + width]
        kept += sorted({begin + int(np.argmin(interval)), begin + int(np.argmax(interval))})
    places = np.unique([*kept, len(y) - 1])
    return curve(x[places], y[places])


@dataclass(frozen=True)
class Metrics:
    """Metrics of one run of the servo, including its start."""

    rms: float
    largest: float
    """Root mean square and maximum of the tracking error, reference minus position, in `units.position`."""
    effort: float  # root mean square of the drive force, in `units.force`
    effort_high: float  # root mean square of the drive force above the bandwidth of the loop, in `units.force`
    variation: float  # total variation of the drive force over the duration, in `units.force` per second
    settling: float | None = None
    """Median time after a reversal until the error stays within the band of the study [s]; None without reversals."""
    chatter: float | None = None
    """Root mean square of the drive force above the bandwidth of the loop while the reference rests, in `units.force`;
    None if it does not rest."""
    rms_bound: float | None = None
    """Bound of the numerical error of `rms`; None for a run that was not repeated with another step."""


@dataclass(frozen=True)
class LoopMargins:
    """Smallest margins of a loop over its operating points: sliding and, if the contact is elastic, rest."""

    Ms: float | None  # peak of the sensitivity function; None if the loop is unstable
    phase: float | None  # phase margin [deg]; None if the loop gain is nowhere 1
    delay: float | None  # delay margin [samples]; None if the loop gain is nowhere 1
    resonance: float = 0.0
    """Frequency above which the loop tolerates a lightly damped resonance of the plant [Hz]: damping ratio 2 %, and a
    load of half the mass of the motor."""


@dataclass(frozen=True)
class Limits:
    """Limits on the margins of every loop that is compared."""

    Ms: float = 2.0  # largest peak of the sensitivity function
    delay: float = 1.5  # smallest delay margin [samples]
    band: float = inf
    """Band in which the record supports the plant, or the lowest declared resonance [Hz]: the largest bandwidth of an
    estimator."""
    resonance: float = inf  # frequency above which every loop must tolerate a resonance [Hz]

    def relaxed(self, alone: LoopMargins) -> Limits:
        """Return the limits that the servo alone keeps: a compensator must not make worse what already exceeds them."""
        return Limits(
            max(self.Ms, inf if alone.Ms is None else alone.Ms),
            self.delay if alone.delay is None else min(self.delay, alone.delay),
            self.band,
            max(self.resonance, alone.resonance),
        )

    def kept_by(self, margins: LoopMargins | None) -> bool:
        """Return whether a loop is stable and within the limits; a loop without known margins counts as such."""
        if margins is None:
            return True
        slack = 1.0 + 1e-9
        return (
            margins.Ms is not None
            and margins.Ms <= slack * self.Ms
            and (margins.delay is None or slack * margins.delay >= self.delay)
            and margins.resonance <= slack * self.resonance
        )


@dataclass(frozen=True)
class Trial:
    """Run with one value of the tuned parameter."""

    gain: float  # gain of the compensation
    bandwidth: float | None
    """Bandwidth of an estimator, or corner frequency of integral action [Hz]; None if the compensator has none."""
    margins: LoopMargins | None  # margins of the loop; None if the compensator cannot be linearised
    metrics: Metrics | None  # metrics; None if the run failed
    failure: str = ""  # reason why the run failed


@dataclass(frozen=True)
class Corner:
    """Run on an axis that differs from the identified one."""

    name: str  # description of the difference
    metrics: Metrics | None  # metrics; None if the run failed
    failure: str = ""  # reason why the run failed
    counts: bool = True
    """Whether the run is part of the worst case; an extra delay beyond the demanded delay margin is not."""


@dataclass(frozen=True)
class CompensatorResult:
    """Result of one compensator."""

    name: str
    summary: str
    """Name of the law, or of feedforward and estimator joined by " + ", and its description; the entry "none" is the
    servo without compensation."""
    kind: str
    """"none", "integral action", "feedforward", "model feedback", "estimator", "feedforward with estimator",
    "feedforward with integral action", "table over position" (alone or with others), "dither", "learning", or
    "controller"."""
    applies: bool  # whether the compensator was co-simulated
    reason: str = ""  # reason why it does not apply or why all runs failed; otherwise empty
    model: str = ""  # friction model whose identified parameters the law uses; empty if it uses none
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Parameters that were set; the others have their start values."""
    gain: float | None = None  # best gain up to 1
    bandwidth: float | None = None  # best bandwidth [Hz], as in `Trial`
    metrics: Metrics | None = None  # metrics of the best trial
    margins: LoopMargins | None = None  # margins of the best trial
    trials: tuple[Trial, ...] = ()  # runs over the tuned parameter
    corners: tuple[Corner, ...] = ()  # runs of the best trial on other axes
    worst: float | None = None
    best: float | None = None
    """Largest and smallest `rms` of `metrics` and of the corners that count."""
    untried: bool = False  # whether it was not run on other axes, as another one is better there than this one here
    cycles: float | None = None
    flash: float | None = None
    """Estimated cycles of one sample and size of the C code on a Cortex-M4F [bytes]; None without C code."""
    rank: int | None = None  # rank, 1 is best; None if the compensator does not apply
    improves: bool = False  # whether it reduces the tracking error, also in every corner that counts
    error: StudyCurve | None = None
    """Reference minus position over time of the best trial [s, units.position]; decimated with all extremes kept."""


@dataclass(frozen=True)
class Rung:
    """Rung of the ladder from the axis as measured to the best compensation."""

    title: str  # what the servo has on this rung
    name: str  # compensator of this rung, "none" for the servo alone; empty for the axis as measured
    metrics: Metrics  # metrics


@dataclass(frozen=True)
class Recommendation:
    """Recommendation of a study."""

    name: str  # recommended compensator; "none" if no compensator improves the axis; empty if none was simulated
    reason: str  # reasons in a few sentences
    gain: float | None = None  # gain of the recommended compensator
    runner_up: str = ""  # second-best compensator; empty if no other one improves the axis
    runner_up_reason: str = ""  # metrics of the second-best compensator in one sentence
    next_steps: tuple[str, ...] = ()  # what to set in the drive, one or two sentences each
    cautions: tuple[str, ...] = ()  # what to rule out before, and what to measure, one or two sentences each


@dataclass(frozen=True, repr=False)
class StudyResult:
    """Result of a study, from the record to the recommendation.

    Numbers are in SI units, or in `units` for a rotary axis. A missing number is None, never NaN.

    Attributes
    ----------
    name : str
        Name of the record.
    citation : str
        Citation of the data; empty if none was given.
    units : AxisUnits
        Units of position, velocity, force, inertia and viscous friction.
    overview : mapping of str to str
        Descriptions of record, servo and settings, by topic.
    record : tuple of Picture
        Measured and simulated signals over time: position and reference, velocity, force, friction; decimated with all
        extremes kept.
    friction : Picture or None
        Friction over velocity: points of the record, curves of the models.
    turn : Picture or None
        Simulated tracking error around a reversal: recommended, as measured, and with velocity and acceleration
        feedforward.
    hysteresis : Picture or None
        Friction over displacement: points of the record, loops of the models.
    residuals : tuple of Picture
        Force residual of the co-simulated servo over velocity and over position, by model.
    models : tuple of ModelResult
        Friction models by rank, then those not identified.
    plant : str
        Friction model of the axis in the co-simulation; empty if no compensator was simulated.
    no_compensation : str
        Reason why no compensator was simulated; empty otherwise.
    ladder : tuple of Rung
        Rungs from the axis as measured to the best compensation.
    limits : Limits or None
        Limits on the margins of the compared loops; None if no compensator was simulated.
    compensators : tuple of CompensatorResult
        "none" first, then compensators by rank, then those that do not apply.
    recommendation : Recommendation
        Recommended compensator.
    conditions : tuple of ConditionResult
        Conditions of the servo with the recommended compensator, violated ones first.
    files : tuple of WrittenFile
        Written files.
    command : str
        Command that repeats the study.
    versions : mapping of str to str
        Versions, by name of the program or library.
    seconds : float
        Elapsed time of the study [s].
    servo_check : ServoCheck
        Comparison of the servo as configured with the recorded drive force.
    findings : tuple of StudyFinding
        All findings that limit how far the result can be trusted, those of `servo_check` first.
    axes : tuple of IdentifiedAxis
        Identified axes by rank, for the targets of ``friction-fmus export``; empty if the result must not be used.
    """

    name: str
    citation: str
    units: AxisUnits
    overview: Mapping[str, str]
    record: tuple[Picture, ...]
    friction: Picture | None
    hysteresis: Picture | None
    residuals: tuple[Picture, ...]
    models: tuple[ModelResult, ...]
    plant: str
    no_compensation: str
    ladder: tuple[Rung, ...]
    limits: Limits | None
    compensators: tuple[CompensatorResult, ...]
    recommendation: Recommendation
    conditions: tuple[ConditionResult, ...]
    files: tuple[WrittenFile, ...]
    command: str
    versions: Mapping[str, str]
    seconds: float
    servo_check: ServoCheck = field(default_factory=ServoCheck)
    findings: tuple[StudyFinding, ...] = ()
    turn: Picture | None = None
    axes: tuple[IdentifiedAxis, ...] = ()

    @property
    def trusted(self) -> bool:
        """Whether no finding forbids to use the result."""
        return not any(finding.stops for finding in self.findings)

    @property
    def known_as(self) -> str:
        """What the known values of parameters are: those of the simulated axis, or published ones."""
        return "published" if self.citation else "true"

    __repr__ = study_text
    _repr_html_ = study_html

    def compensator(self, name: str) -> CompensatorResult:
        """Return the result of a compensator.

        Parameters
        ----------
        name : str
            Name of the compensator, or "none".

        Returns
        -------
        CompensatorResult
            Its metrics and rank.

        Raises
        ------
        KeyError
            If the study has no such compensator.
        """
        for row in self.compensators:
            if row.name == name:
                return row
        raise KeyError(f"The study has no compensator {name!r}.")

    def model(self, name: str) -> ModelResult:
        """Return the result of a friction model.

        Parameters
        ----------
        name : str
            Name of the model.

        Returns
        -------
        ModelResult
            Its parameters and residuals.

        Raises
        ------
        KeyError
            If the study has no such model.
        """
        for row in self.models:
            if row.name == name:
                return row
        raise KeyError(f"The study has no model {name!r}.")

    def to_json(self) -> str:
        """Return the result as indented JSON, as in `study.json`.

        Returns
        -------
        str
            JSON text, with null for missing numbers.
        """
        return json.dumps(plain(self), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
