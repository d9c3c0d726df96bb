"""Parts of the result of a study: models, conditions, files and curves, as plain data.

The classes are frozen and contain only numbers, strings, tuples and mappings. Numbers are in SI units, or in the units
in `StudyResult.units` for a rotary axis. A missing number is None, never NaN.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

Numbers: TypeAlias = tuple[float, ...]


@dataclass(frozen=True)
class IdentifiedParameter:
    """Identified parameter.

    Attributes
    ----------
    name : str
        Name in the block; M is the moved mass and OF the force offset of the drive.
    value : float
        Estimate, in `unit`.
    standard_error : float or None
        Standard error, in `unit`; None if the parameter was fixed.
    unit : str
        Unit; "1" for a dimensionless parameter.
    meaning : str
        Description.
    published : float or None
        Value in the literature, or the true value for a simulated record, in `unit`.
    weak : str
        Reason why the parameter is poorly identifiable, and what to measure; empty if it is well determined.
    noise_error : float or None
        Part of the standard error that is due to noise, in `unit`; None if the parts are not known.
    """

    name: str
    value: float
    standard_error: float | None
    unit: str
    meaning: str
    published: float | None = None
    weak: str = ""
    noise_error: float | None = None

    @property
    def determined(self) -> bool:
        """Whether the noise of the record determines the parameter to better than its value."""
        error = self.standard_error if self.noise_error is None else self.noise_error
        return self.standard_error is not None and error is not None and error < abs(self.value)


@dataclass(frozen=True)
class Fit:
    """Residual of a simulated signal.

    Attributes
    ----------
    rms : float
        Root mean square of simulated minus measured, in `unit`.
    percent : float
        Residual in percent of the root mean square of the measured signal.
    signal, unit : str
        Name and unit of the signal.
    """

    rms: float
    percent: float
    signal: str
    unit: str


@dataclass(frozen=True)
class PositionPart:
    """Force over position that was identified together with a friction model.

    Attributes
    ----------
    nodes, spacing : int, float
        Number of nodes of the table and their distance.
    cogging, friction : float
        Rms values of cogging and position-dependent friction over the table.
    train_without, validation_without : Fit or None
        Residuals of the model without this force.
    """

    nodes: int
    spacing: float
    cogging: float
    friction: float
    train_without: Fit | None
    validation_without: Fit | None


@dataclass(frozen=True)
class ModelResult:
    """Result of one friction model.

    Attributes
    ----------
    name, summary : str
        Name of the block and its description.
    method : str
        Identification method; empty if the model was not identified.
    parameters : tuple of IdentifiedParameter
        Identified parameters.
    train, validation : Fit or None
        Residuals on the training and the validation data.
    closed_loop : tuple of Fit
        Residuals of position and force of the co-simulated servo; empty without a servo.
    aic, bic : float or None
        Information criteria; lower is better.
    rank : int or None
        Rank by validation, 1 is best; None if the model was not identified.
    warnings : tuple of str
        Warnings of the identification.
    reason : str
        Reason why the model was not identified; empty if it was.
    seconds : float
        Elapsed time of the identification [s].
    simulations : int
        Number of simulations of the model.
    position : PositionPart or None
        Force over position; None if it does not improve the prediction.
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
    position: PositionPart | None = None


@dataclass(frozen=True)
class Curve:
    """Points of a line or scatter plot; x and y have the same length."""

    x: Numbers
    y: Numbers


@dataclass(frozen=True)
class Picture:
    """Curves in one pair of axes.

    Attributes
    ----------
    x_label, y_label : str
        Quantities of the axes.
    x_unit, y_unit : str
        Units of the axes.
    data : mapping of str to Curve
        Decimated measurements, by name.
    models : mapping of str to Curve
        Decimated curves of the models, by name of the block.
    """

    x_label: str
    y_label: str
    x_unit: str
    y_unit: str
    data: Mapping[str, Curve]
    models: Mapping[str, Curve]


@dataclass(frozen=True)
class ConditionResult:
    """Condition evaluated for the recommended servo; the texts are empty if it holds."""

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
class StudyFinding:
    """Finding that limits how far the result of a study can be trusted.

    Attributes
    ----------
    name : str
        Stable name, such as ``wrong-gains``.
    what : str
        Description with numbers, in one sentence.
    change : str
        Proposed change, in one sentence.
    stops : bool
        Whether the result must not be used: nothing is ranked that depends on the finding, and no FMU is written.
    """

    name: str
    what: str
    change: str
    stops: bool


@dataclass(frozen=True)
class ServoCheck:
    """Comparison of the servo as configured with the recorded drive force.

    Attributes
    ----------
    residual : Fit or None
        Recorded force minus command of the servo for the recorded reference and position; None if not compared.
    allowed : float
        Residual up to which the servo reproduces the record, in percent of the rms force.
    findings : tuple of StudyFinding
        Reasons for a larger residual.
    gains : tuple of IdentifiedParameter
        Gains estimated from the record; empty if those of the configuration reproduce it.
    recorded, commanded : Curve or None
        Force over time: as recorded, and as the servo commands it.
    reason : str
        Reason why the servo was not compared; empty if it was.
    """

    residual: Fit | None = None
    allowed: float = 0.0
    findings: tuple[StudyFinding, ...] = ()
    gains: tuple[IdentifiedParameter, ...] = ()
    recorded: Curve | None = None
    commanded: Curve | None = None
    reason: str = ""


@dataclass(frozen=True)
class WrittenFile:
    """File written by a study: path relative to its folder, separated by /, and description."""

    path: str
    what: str
