"""FMUs of other tools inside a composite FMU."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal
from zipfile import ZipFile

import numpy as np
import pytest
from composite.composite_systems import differing, run_composite, run_parts
from foreign_fmus import SOURCES
from thorough import nightly, some

from harness import Experiment, FmuPart, System
from harness.errors import BuildError


def with_sources(
    given: Path,
    path: Path,
    *,
    before: str = "",
    step: str = "",
    gain: str = "1.0",
    once: bool = False,
    access: str = "fmi2OK",
) -> Path:
    """A foreign FMU with its source; definitions before it, a statement in each step, a factor of a GAIN.

    `access` is the status of reading and setting a value.
    """
    with ZipFile(given) as archive, ZipFile(path, "w") as written:
        for member in archive.namelist():
            data = archive.read(member)
            if member == "modelDescription.xml":
                listed = (
                    b' canBeInstantiatedOnlyOncePerProcess="true"' * once
                    + b'><SourceFiles><File name="foreign.c"/></SourceFiles></CoSimulation>'
                )
                data = re.sub(rb"(<CoSimulation [^>]*)/>", rb"\1" + listed, data)
            written.writestr(member, data)
        text = (SOURCES / "foreign.c").read_text()
        text = text.replace("r[2] * r[1] + r[3]", f"r[2] * r[1] * {gain} + r[3]")
        text = re.sub(r"(v\[i\];[ \\\n]+return )fmi2OK", rf"\1{access}", text)
        text = text.replace("    const double limit", f"    {step}\n    const double limit")
        written.writestr("sources/foreign.c", before + text)
    return path


@nightly
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


@pytest.mark.parametrize("fmi", some([2, 3], [2]))
def test_a_part_that_ends_the_simulation_ends_that_of_the_composite(
    foreign: Callable[..., Path], tmp_path: Path, fmi: Literal[2, 3]
) -> None:
    """After the last whole step, as in the harness: fmi2Terminated, or terminateSimulation of FMI 3.0."""
    part = FmuPart("p", with_sources(foreign("PLANT", states=True, ends=True), tmp_path / "p.fmu"))
    with System([part], start={"p.u": 1.0}, experiment=Experiment(stop=1.0, step=0.1)) as system:
        system.to_fmu(tmp_path / "Whole.fmu", fmi=fmi)
    with System([FmuPart("whole", tmp_path / "Whole.fmu")], start={"whole.p.u": 1.0}) as system:
        found = system.run(stop=1.0, step=0.1, record=["whole.p.x"])
    assert found.attrs["ended"] == "part 'whole' ended the simulation in the step from t = 0.6 s"
    np.testing.assert_allclose(found["whole.p.x"], 1.0 - np.exp(-np.arange(7) * 0.1 / 0.5), rtol=1e-12)


def test_warnings_of_a_part_are_no_errors(foreign: Callable[..., Path], tmp_path: Path) -> None:
    part = FmuPart("p", with_sources(foreign("PLANT", states=True), tmp_path / "p.fmu", access="fmi2Warning"))
    with System([part], start={"p.u": 1.0}, experiment=Experiment(stop=1.0, step=0.1)) as system:
        system.to_fmu(tmp_path / "Whole.fmu")
    found = run_composite(tmp_path / "Whole.fmu", 1.0, 0.1)["p.x"]
    np.testing.assert_allclose(found, 1.0 - np.exp(-np.arange(11) * 0.1 / 0.5), rtol=1e-12)


def test_an_fmu_that_cannot_save_its_state_is_refused(foreign: Callable[..., Path], tmp_path: Path) -> None:
    part = FmuPart("prey", with_sources(foreign("PREY"), tmp_path / "prey.fmu"))
    system = System([part], experiment=Experiment(stop=2.0, step=0.01))
    with system, pytest.raises(BuildError, match="'prey' cannot save its state"):
        system.to_fmu(tmp_path / "Nature.fmu")
    assert not (tmp_path / "Nature.fmu").exists()


COUNTS = {"before": "int shared;\n", "step": "r[3] += h * ++shared;"}
"""A common symbol, which counts steps: after n of them, the sum of h k is h n (n + 1) / 2."""


@nightly
@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        (COUNTS, COUNTS | {"gain": "1"}, (1.55, 2.55)),
        (
            {"before": "__attribute__((weak)) double factor(void) { return 3.0; }\n", "gain": "factor()"},
            {"before": "__attribute__((weak)) double factor(void) { return 5.0; }\n", "gain": "factor()"},
            (3.0, 10.0),
        ),
        ({"before": "static double kept;\n", "step": "kept += h * r[1]; r[3] = kept;", "once": True}, None, (1.1, 2.2)),
        ({"before": "static double kept;\n", "step": "kept += h * r[1]; r[3] = kept;"}, None, (1.1, 2.2)),
    ],
    ids=["common", "weak", "once per process", "static"],
)
def test_parts_share_nothing(
    foreign: Callable[..., Path],
    tmp_path: Path,
    first: dict[str, Any],
    second: dict[str, Any] | None,
    expected: tuple[float, float],
) -> None:
    """y = k u + c of two parts with u = 1 and 2, of which c changes in ten steps of 0.01 s."""
    paths = [with_sources(foreign("GAIN", states=True), tmp_path / "first.fmu", **first)]
    paths += [with_sources(foreign("GAIN", states=True), tmp_path / "second.fmu", **second)] if second else paths
    parts = [FmuPart(name, path) for name, path in zip(("a", "b"), paths, strict=True)]
    start = {"a.u": 1.0, "b.u": 2.0}
    with System(parts, start=start, experiment=Experiment(stop=0.1, step=0.01)) as system:
        system.to_fmu(tmp_path / "Both.fmu")
    found = run_composite(tmp_path / "Both.fmu", 0.1, 0.01)
    assert (found["a.y"][-1], found["b.y"][-1]) == pytest.approx(expected, rel=1e-12)
    once = FmuPart("whole", tmp_path / "Both.fmu").archive.interface.canBeInstantiatedOnlyOncePerProcess
    assert once == bool(first.get("once"))


def test_a_symbol_that_cannot_be_renamed_is_named(foreign: Callable[..., Path], tmp_path: Path) -> None:
    label = {"before": 'int mine __asm__("shared_by_all");\n', "step": "r[3] += h * ++mine;"}
    paths = [with_sources(foreign("GAIN", states=True), tmp_path / f"{name}.fmu", **label) for name in "ab"]
    system = System([FmuPart(path.stem, path) for path in paths], experiment=Experiment(stop=0.1, step=0.01))
    with system, pytest.raises(BuildError, match="'a' and 'b' both define the symbol shared_by_all"):
        system.to_fmu(tmp_path / "Both.fmu")


@nightly
def test_an_included_file_of_this_machine_counts(foreign: Callable[..., Path], tmp_path: Path) -> None:
    """The sources of an FMU may include any file; a change of it is compiled."""
    header = tmp_path / "factor.h"
    given = {"before": f'#include "{header.as_posix()}"\n', "gain": "FACTOR"}
    part = FmuPart("a", with_sources(foreign("GAIN", states=True), tmp_path / "a.fmu", **given))
    found = []
    with System([part], start={"a.u": 1.0}, experiment=Experiment(stop=0.1, step=0.01)) as system:
        for factor in (2.0, 3.0):
            header.write_text(f"#define FACTOR {factor}\n")
            system.to_fmu(tmp_path / "Whole.fmu")
            found.append(run_composite(tmp_path / "Whole.fmu", 0.1, 0.01)["a.y"][-1])
    assert found == [2.0, 3.0]


def test_a_source_that_does_not_compile(foreign: Callable[..., Path], tmp_path: Path) -> None:
    part = FmuPart("a", with_sources(foreign("GAIN", states=True), tmp_path / "a.fmu", gain="unknown"))
    system = System([part], experiment=Experiment(stop=0.1, step=0.01))
    with system, pytest.raises(BuildError, match=r"the FMU of 'a' cannot be .*foreign\.c, line \d+: .*unknown"):
        system.to_fmu(tmp_path / "Whole.fmu")


def test_a_source_in_another_language(foreign: Callable[..., Path], tmp_path: Path) -> None:
    path = with_sources(foreign("GAIN", states=True), tmp_path / "a.fmu")
    with ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with ZipFile(path, "w") as written:
        for name, data in members.items():
            written.writestr(name.replace("foreign.c", "foreign.cpp"), data.replace(b"foreign.c", b"foreign.cpp"))
    system = System([FmuPart("a", path)], experiment=Experiment(stop=0.1, step=0.01))
    with system, pytest.raises(BuildError, match=r"'a' has the source foreign\.cpp, which is not C"):
        system.to_fmu(tmp_path / "Whole.fmu")
