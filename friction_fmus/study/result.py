"""The result of a study as plain data: all that the report, the terminal and `study.json` show.

Numbers are in SI units or in the units that `StudyResult.units` names; a number that does not exist is None, never NaN.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from friction_fmus.identification import AxisUnits
from friction_fmus.notebook import study_html, study_text
from friction_fmus.study.records import (
    CompensatorResult,
    ConditionResult,
    Corner,
    Curve,
    Fit,
    GainPoint,
    IdentifiedParameter,
    Metrics,
    ModelResult,
    Picture,
    Recommendation,
    WrittenFile,
)


@dataclass(frozen=True, repr=False)
class StudyResult:
    """A study from record to recommendation.

    Attributes
    ----------
    name : str
        Name of the record.
    citation : str
        Whom to cite; empty if nobody was named.
    units : AxisUnits
        Units of position, velocity, force, inertia and viscous friction.
    overview : mapping of str to str
        Record, servo and settings in words: what -> value.
    record : tuple of Picture
        Series over time to plot: position and reference, velocity, force, friction, as far as they were measured, and
        the simulated ones beside them; decimated to their extremes.
    friction : Picture or None
        Friction over velocity: points of the record, curves of the models.
    hysteresis : Picture or None
        Friction over displacement: points of the record, loops of the models.
    models : tuple of ModelResult
        Ranked ones first.
    plant : str
        Friction model of the axis in the co-simulation; empty if there was none.
    no_compensation : str
        Why no compensator was tried; empty if they were.
    servos : mapping of str to Metrics
        The servo without friction compensation: "as measured", and "with motion feedforward" if the compensators were
        compared with that.
    compensators : tuple of CompensatorResult
        "none" first, then ranked ones, then those that do not apply.
    recommendation : Recommendation
        What to do.
    doctor : tuple of ConditionResult
        Conditions of the servo with the recommended compensator, violated ones first.
    files : tuple of WrittenFile
        What was written.
    command : str
        What to type to get all of it again.
    versions : mapping of str to str
        Program or library -> version.
    seconds : float
        Elapsed time of the study.
    """

    name: str
    citation: str
    units: AxisUnits
    overview: Mapping[str, str]
    record: tuple[Picture, ...]
    friction: Picture | None
    hysteresis: Picture | None
    models: tuple[ModelResult, ...]
    plant: str
    no_compensation: str
    servos: Mapping[str, Metrics]
    compensators: tuple[CompensatorResult, ...]
    recommendation: Recommendation
    doctor: tuple[ConditionResult, ...]
    files: tuple[WrittenFile, ...]
    command: str
    versions: Mapping[str, str]
    seconds: float

    def __repr__(self) -> str:
        """Return one line."""
        return study_text(self)

    def _repr_html_(self) -> str:
        """Return recommendation, models and compensators as HTML, for a notebook."""
        return study_html(self)

    def compensator(self, name: str) -> CompensatorResult:
        """Return the row of that name.

        Raises
        ------
        KeyError
            There is none.
        """
        for row in self.compensators:
            if row.name == name:
                return row
        raise KeyError(f"The study has no compensator {name!r}.")

    def model(self, name: str) -> ModelResult:
        """Return the row of that name.

        Raises
        ------
        KeyError
            There is none.
        """
        for row in self.models:
            if row.name == name:
                return row
        raise KeyError(f"The study has no model {name!r}.")

    def to_json(self) -> str:
        """Return the whole as indented JSON, as in `study.json`."""
        return json.dumps(plain(asdict(self)), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def plain(content: Any) -> Any:
    """Return content for JSON: a number that is not finite becomes None."""
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
    "GainPoint",
    "IdentifiedParameter",
    "Metrics",
    "ModelResult",
    "Picture",
    "Recommendation",
    "StudyResult",
    "WrittenFile",
    "plain",
]
