"""Next steps: what to set in the drive, and what to measure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from friction_fmus.study.result import StudyResult

PLACE = 5
TITLE = "What to do next"


def content(study: StudyResult) -> Mapping[str, Any]:
    """Return the values that the template needs in addition to the study."""
    return {"steps": study.recommendation.next_steps}
