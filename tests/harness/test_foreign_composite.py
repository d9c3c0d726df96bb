"""FMUs of other tools inside a composite FMU."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from zipfile import ZipFile

import pytest
from composite.composite_systems import differing, run_composite, run_parts
from foreign_fmus import SOURCES

from harness import Experiment, FmuPart, System
from harness.errors import BuildError


def with_sources(given: Path, path: Path) -> Path:
    """A foreign FMU with its source."""
    with ZipFile(given) as archive, ZipFile(path, "w") as written:
        for member in archive.namelist():
            data = archive.read(member)
            if member == "modelDescription.xml":
                listed = b'><SourceFiles><File name="foreign.c"/></SourceFiles></CoSimulation>'
                data = re.sub(rb"(<CoSimulation [^>]*)/>", rb"\1" + listed, data)
            written.writestr(member, data)
        written.write(SOURCES / "foreign.c", "sources/foreign.c")
    return path


def test_fmus_of_other_tools_with_sources(foreign: Callable[..., Path], tmp_path: Path) -> None:
    """Two FMUs with the same model identifier, which interact in a loop of continuous parts."""
    parts = [
        FmuPart("prey", with_sources(foreign("PREY", states=True), tmp_path / "prey.fmu")),
        FmuPart("predator", with_sources(foreign("PREDATOR", states=True), tmp_path / "predator.fmu")),
    ]
    wires = ["prey.x -> predator.x", "predator.y -> prey.y"]
    with System(parts, wires, experiment=Experiment(stop=2.0, step=0.01)) as system:
        system.to_fmu(tmp_path / "Nature.fmu")
        expected = run_parts(system, 2.0)
    assert differing(run_composite(tmp_path / "Nature.fmu", 2.0, 0.01), expected) == []


def test_an_fmu_that_cannot_save_its_state_is_refused(foreign: Callable[..., Path], tmp_path: Path) -> None:
    part = FmuPart("prey", with_sources(foreign("PREY"), tmp_path / "prey.fmu"))
    system = System([part], experiment=Experiment(stop=2.0, step=0.01))
    with system, pytest.raises(BuildError, match="'prey' cannot save its state"):
        system.to_fmu(tmp_path / "Nature.fmu")
    assert not (tmp_path / "Nature.fmu").exists()
