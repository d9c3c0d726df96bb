"""Sections of the report. Each has a module with PLACE, TITLE and ``content(study)``, and a template ``name.html``."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, cast

from friction_fmus.study.result import StudyResult


class Section(Protocol):
    """Interface of the module of a section."""

    PLACE: int
    TITLE: str

    def content(self, study: StudyResult) -> Mapping[str, Any]:
        """Return the values that the template needs in addition to ``study``."""


def sections() -> dict[str, Section]:
    """Return the sections by name, in the order of ``PLACE``."""
    names = [path.stem for path in Path(__file__).parent.glob("[a-z]*.py")]
    found = {name: cast(Section, import_module(f"{__name__}.{name}")) for name in names}
    return dict(sorted(found.items(), key=lambda item: item[1].PLACE))
