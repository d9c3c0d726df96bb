"""Sliders that simulate the axis again in the browser, and a picture without them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from friction_fmus.study.result import StudyResult

PLACE = 17
TITLE = "What if the axis changes"


def content(study: StudyResult) -> Mapping[str, Any]:
    """Return nothing: the panel is not part of the study."""
    return {}
