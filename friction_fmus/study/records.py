"""Parts of the result of a study: models, conditions, files and curves, as plain data.

The classes are frozen and contain only numbers, strings, tuples and mappings. Numbers are in SI units, or in the units
in `StudyResult.units` for a rotary axis. A missing number is None, never NaN.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from friction_fmus.identification import Array

Numbers: TypeAlias = tuple[float, ...]


@dataclass(frozen=True)
class IdentifiedParameter:
    """Identified parameter."""

    name: str
    """Name in the block; M is the moved mass and OF the force offset of the drive."""
    value: float
    """Estimate, in `unit`."""
    standard_error: float | None
    """Standard error, in `unit`; None if the parameter was fixed."""
    unit: str
    """Unit; "1" for a dimensionless parameter."""
    meaning: str
    """Description."""
    published: float | None = None
    """Value in the literature, or the true value for a simulated record, in `unit`."""
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

    rms: float
    """Root mean square of simulated minus measured, in `unit`."""
    percent: float
    """Residual in percent of the root mean square of the measured signal."""
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
    method: str = ""
    """Identification method; empty if the model was not identified."""
    parameters: tuple[IdentifiedParameter, ...] = ()
    """Identified parameters."""
    train: Fit | None = None
    validation: Fit | None = None
    """Residuals on the training and the validation data."""
    closed_loop: tuple[Fit, ...] = ()
    """Residuals of position and force of the co-simulated servo; empty without a servo."""
    aic: float | None = None
    bic: float | None = None
    """Information criteria; lower is better."""
    rank: int | None = None
    """Rank by validation, 1 is best; None if the model was not identified."""
    warnings: tuple[str, ...] = ()
    """Warnings of the identification."""
    reason: str = ""
    """Reason why the model was not identified; empty if it was."""
    seconds: float = 0.0
    """Elapsed time of the identification [s]."""
    simulations: int = 0
    """Number of simulations of the model."""
    position: PositionPart | None = None
    """Force over position; None if it does not improve the prediction."""


@dataclass(frozen=True)
class Curve:
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
    data: Mapping[str, Curve]
    """Decimated measurements, by name."""
    models: Mapping[str, Curve]
    """Decimated curves of the models, by name of the block."""


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
    """Finding that limits how far the result of a study can be trusted."""

    name: str
    """Stable name, such as ``wrong-gains``."""
    what: str
    """Description with numbers, in one sentence."""
    change: str
    """Proposed change, in one sentence."""
    stops: bool
    """Whether the result must not be used: nothing is ranked that depends on the finding, and no FMU is written."""


@dataclass(frozen=True)
class ServoCheck:
    """Comparison of the servo as configured with the recorded drive force."""

    residual: Fit | None = None
    """Recorded force minus command of the servo for the recorded reference and position; None if not compared."""
    allowed: float = 0.0
    """Residual up to which the servo reproduces the record, in percent of the rms force."""
    findings: tuple[StudyFinding, ...] = ()
    """Reasons for a larger residual."""
    gains: tuple[IdentifiedParameter, ...] = ()
    """Gains estimated from the record; empty if those of the configuration reproduce it."""
    recorded: Curve | None = None
    commanded: Curve | None = None
    """Force over time: as recorded, and as the servo commands it."""
    reason: str = ""
    """Reason why the servo was not compared; empty if it was."""


@dataclass(frozen=True)
class WrittenFile:
    """File written by a study: path relative to its folder, separated by /, and description."""

    path: str
    what: str


POINTS: Final = 1500
"""Approximate number of points of a stored curve over time."""


def thinned(x: Array, y: Array, points: int = POINTS) -> Curve:
    """Return a decimated curve with the minimum and maximum of each interval, so that peaks are kept."""
    width = -(-2 * len(y) // points)
    if width <= 2:
        return Curve(tuple(x.tolist()), tuple(y.tolist()))
    kept: list[int] = [0]
    for begin in range(0, len(y), width):
        interval = y[begin : begin + width]
        kept += sorted({begin + int(np.argmin(interval)), begin + int(np.argmax(interval))})
    places = np.unique([*kept, len(y) - 1])
    return Curve(tuple(x[places].tolist()), tuple(y[places].tolist()))
