"""Files of the study."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from friction_fmus.study.result import StudyResult

PLACE = 70
TITLE = "Files"


def content(study: StudyResult) -> Mapping[str, Any]:
    """Return no values: the template only needs the study."""
    return {}
