"""The archive of a composite FMU: no finding of the check, sources that compile by themselves, no other exports."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import lief
import pytest
from fmpy import read_model_description
from shell.selection import built
from thorough import landing, nightly, some

from friction_fmus import fmu
from friction_fmus.check import check
from friction_fmus.cli.inputs import open_system
from harness import Experiment, FmuPart, System
from harness.compiling.toolchain import header_folder
from harness.errors import BuildError
from harness.plot import plot

EXAMPLES = Path(__file__).parents[2] / "examples"
FUNCTIONS = 44
"""Functions of FMI 2.0 for co-simulation."""


@landing
@pytest.mark.parametrize("name", some(["stick_slip", "compensated_axis"], ["stick_slip"]))
def test_check_finds_nothing(compose: Callable[[str], Path], name: str) -> None:
    assert check(compose(name)) == []


@nightly
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_sources_compile_without_a_warning(compose: Callable[[str], Path], compiler: str, tmp_path: Path) -> None:
    """Zig, a clang, compiles every composite of a test with the same warnings."""
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    path = compose("compensated_axis")
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path)
    units = [f"part_{name}.c" for name in ("Sine", "LuGreFeedforward", "PID", "Mass", "LuGre")]
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-Werror", "-fsyntax-only"]
    done = subprocess.run(
        [compiler, *flags, "-I", str(header_folder()), "compensated_axis.c", *units],
        cwd=tmp_path / "sources",
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")


@landing
@pytest.mark.skipif(sys.platform != "linux", reason="reads an ELF library")
def test_only_the_functions_of_fmi_are_exported(compose: Callable[[str], Path]) -> None:
    with zipfile.ZipFile(compose("stick_slip")) as archive:
        (name,) = (name for name in archive.namelist() if name.startswith("binaries/"))
        library = lief.ELF.parse(list(archive.read(name)))
    assert library is not None
    exported = [str(symbol.name) for symbol in library.exported_symbols]
    assert len(exported) == FUNCTIONS
    assert all(symbol.startswith("fmi2") for symbol in exported)


def test_two_builds_give_the_same_bytes(compose: Callable[[str], Path], tmp_path: Path) -> None:
    assert built("stick_slip", tmp_path).read_bytes() == compose("stick_slip").read_bytes()


def test_units_types_and_limits_are_those_of_the_parts(compose: Callable[[str], Path]) -> None:
    part = FmuPart("axis", compose("stick_slip"))
    variables = {v.name: v for v in read_model_description(str(part.path)).modelVariables}
    stiffness = variables["friction.sigma0"]
    assert (stiffness.unit, stiffness.min, stiffness.variability) == ("N/m", "1e-09", "tunable")
    assert stiffness.declaredType is not None
    assert stiffness.declaredType.quantity == "TranslationalStiffness"
    assert variables["mass.k"].start == "2"  # of the system, not of the block
    assert variables["friction.z"].causality == "local"
    assert [v.name for v in variables.values() if v.causality == "independent"] == ["time"]


@nightly
def test_terminals_that_are_not_connected_inside_remain(tmp_path: Path) -> None:
    """A free mass keeps its flange; the flanges of mass and friction in stick-slip are connected."""
    with open_system(EXAMPLES / "stick_slip.toml") as system:
        system.to_fmu(tmp_path / "connected.fmu")
    start = {"mass.F_drive": 0.0, "mass.F_friction": 0.0}
    with System([FmuPart("mass", fmu("Mass"))], start=start, experiment=Experiment(1.0, 1e-3)) as system:
        system.to_fmu(tmp_path / "free.fmu")
    member = "terminalsAndIcons/terminalsAndIcons.xml"
    with zipfile.ZipFile(tmp_path / "connected.fmu") as archive:
        assert "<Terminal" not in archive.read(member).decode()
    with zipfile.ZipFile(tmp_path / "free.fmu") as archive:
        text = archive.read(member).decode()
    assert 'name="mass.flange"' in text
    assert re.findall(r'variableName="(.*?)"', text) == ["mass.v", "mass.F_friction"]
    assert check(tmp_path / "free.fmu") == []


def test_direct_dependencies_are_those_of_the_loop(compose: Callable[[str], Path]) -> None:
    """The acceleration depends directly on the forces from outside, the position on nothing."""
    part = FmuPart("axis", compose("stick_slip"))
    assert part.dependencies["mass.x"] == frozenset()
    assert {"mass.F_drive", "mass.F_load"} <= part.dependencies["mass.a"]


@nightly
@pytest.mark.filterwarnings("ignore:Glyph")  # a font may lack some
@pytest.mark.parametrize(
    ("mass", "friction"),
    some([("Mässe", "摩擦"), ("a-b", "a_b"), ("$\\foo$", "fr$\\frac{$"), ("a b", "[1]")], [("Mässe", "fr$\\frac{$")]),
)
def test_names_of_parts(tmp_path: Path, mass: str, friction: str) -> None:
    """Parts with names that are no identifiers: no finding in the FMU, and plots show them literally."""
    parts = [FmuPart(mass, fmu("Mass")), FmuPart(friction, fmu("LuGre"))]
    wires = [f"{mass}.v -> {friction}.v", f"{friction}.F -> {mass}.F_friction"]
    path = tmp_path / "Named.fmu"
    with System(parts, wires, start={f"{mass}.F_drive": 2.0}, experiment=Experiment(stop=0.01, step=1e-3)) as system:
        system.to_fmu(path)
        plot(system.run(), tmp_path / "plot.svg")
    assert check(path, static=True) == []


def _mass(monkeypatch: pytest.MonkeyPatch, epoch: str) -> System:
    part = FmuPart("mass", fmu("Mass"))
    monkeypatch.setenv("SOURCE_DATE_EPOCH", epoch)
    start = {"mass.F_drive": 0.0, "mass.F_friction": 0.0}
    return System([part], start=start, experiment=Experiment(stop=0.01, step=1e-3))


@pytest.mark.parametrize("epoch", ["abc", "-1", "99999999999999"])
def test_a_wrong_time_stamp(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, epoch: str) -> None:
    fault = f"SOURCE_DATE_EPOCH is '{epoch}': set it to a number of seconds"
    with _mass(monkeypatch, epoch) as system, pytest.raises(BuildError, match=fault):
        system.to_fmu(tmp_path / "Whole.fmu")


@nightly
def test_times_before_those_of_zip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with _mass(monkeypatch, "0") as system:
        system.to_fmu(tmp_path / "Whole.fmu")
    assert str(read_model_description(tmp_path / "Whole.fmu").generationDateAndTime) == "1970-01-01T00:00:00Z"
