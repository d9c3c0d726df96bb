"""Sections of the report, found by their files: ``name.py`` has PLACE, TITLE and ``content(study)``; ``name.html``."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, cast

from friction_fmus.study.result import StudyResult


class Section(Protocol):
    """What the module of a section has."""

    PLACE: int
    TITLE: str

    def content(self, study: StudyResult) -> Mapping[str, Any]:
        """Return the values of the template beside ``study``."""


def sections() -> dict[str, Section]:
    """Return the sections by name, in the order of their places."""
    names = [path.stem for path in Path(__file__).parent.glob("[a-z]*.py")]
    found = {name: cast(Section, import_module(f"{__name__}.{name}")) for name in names}
    return dict(sorted(found.items(), key=lambda item: item[1].PLACE))
