"""Sources of the data and of the blocks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from friction_fmus.blocks.catalogue import catalogue
from friction_fmus.study.result import StudyResult

PLACE = 90
TITLE = "Citations"


def content(study: StudyResult) -> Mapping[str, Any]:
    """Return the values that the template needs in addition to the study."""
    return {"sources": sources(study)}


def sources(study: StudyResult) -> list[tuple[str, str]]:
    """Return name and source of each block of the catalogue used by the study."""
    known = catalogue()
    names = [row.name for row in study.models if row.rank is not None] + [
        row.name for row in study.compensators if row.applies
    ]
    return [(name, known[name].source) for name in dict.fromkeys(names) if name in known]
