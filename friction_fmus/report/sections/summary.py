"""Summary: the best model, the recommended compensator and its tracking error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from friction_fmus.report.views import NONE
from friction_fmus.study.result import StudyResult

PLACE = 10
TITLE = "Summary"


def content(study: StudyResult) -> Mapping[str, Any]:
    """Return the values that the template needs in addition to the study."""
    return {
        "best": next((row for row in study.models if row.rank == 1), None),
        "without": next((row for row in study.compensators if row.name == NONE), None),
    }
