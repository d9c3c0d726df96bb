"""The result of a study as plain data: everything shown in the report, in the terminal and in `study.json`."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from friction_fmus.identification import AxisUnits
from friction_fmus.listings import study_html, study_text
from friction_fmus.study.compensator_records import (
    CompensatorResult,
    Corner,
    Limits,
    LoopMargins,
    Metrics,
    Recommendation,
    Rung,
    Trial,
)
from friction_fmus.study.ranking import Weights
from friction_fmus.study.records import (
    ConditionResult,
    Curve,
    Fit,
    IdentifiedParameter,
    ModelResult,
    Picture,
    ServoCheck,
    StudyFinding,
    WrittenFile,
)


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
    weights : Weights
        Weights of the figures in the ranking.
    compensators : tuple of CompensatorResult
        "none" first, then compensators by rank, then those that do not apply.
    recommendation : Recommendation
        Recommended compensator.
    doctor : tuple of ConditionResult
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
    weights: Weights
    compensators: tuple[CompensatorResult, ...]
    recommendation: Recommendation
    doctor: tuple[ConditionResult, ...]
    files: tuple[WrittenFile, ...]
    command: str
    versions: Mapping[str, str]
    seconds: float
    servo_check: ServoCheck = field(default_factory=ServoCheck)
    findings: tuple[StudyFinding, ...] = ()

    @property
    def trusted(self) -> bool:
        """Whether no finding forbids to use the result."""
        return not any(finding.stops for finding in self.findings)

    def __repr__(self) -> str:
        """Return a summary in one line."""
        return study_text(self)

    def _repr_html_(self) -> str:
        """Return recommendation, models and compensators as HTML, for a notebook."""
        return study_html(self)

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
        return json.dumps(plain(asdict(self)), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def plain(content: Any) -> Any:
    """Return content for JSON, with None for numbers that are not finite."""
    if isinstance(content, Mapping):
        return {key: plain(value) for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [plain(value) for value in content]
    if isinstance(content, float) and not math.isfinite(content):
        return None
    return content


__all__ = [
    "CompensatorResult",
    "ConditionResult",
    "Corner",
    "Curve",
    "Fit",
    "IdentifiedParameter",
    "Limits",
    "LoopMargins",
    "Metrics",
    "ModelResult",
    "Picture",
    "Recommendation",
    "Rung",
    "ServoCheck",
    "StudyFinding",
    "StudyResult",
    "Trial",
    "WrittenFile",
    "plain",
]
