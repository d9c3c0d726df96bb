"""What cannot become a composite FMU is refused in one sentence, and nothing is written."""

from __future__ import annotations

import math
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from zipfile import ZipFile

import pytest
from thorough import nightly

from friction_fmus import fmu
from friction_fmus.cli.inputs import open_system
from harness import AlgebraicLoopError, Bias, CallablePart, Experiment, FmuPart, HarnessError, System, Wire

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"inputs": ["mass.F_drive", "mass.F_drive"]}, ["mass.F_drive", "listed twice"]),
        ({"inputs": ["mass.F_friction"]}, ["mass.F_friction", "driven by friction.F"]),
        ({"inputs": ["mass.F_drve"]}, ["F_drve", "F_drive"]),
        ({"inputs": ["axis.F"]}, ["no part 'axis'"]),
        ({"outputs": ["mass.x", "mass.x"]}, ["mass.x", "listed twice"]),
        ({"outputs": ["friction.Fs"]}, ["friction.Fs", "not an output"]),
        ({"outputs": ["friction.Q*"]}, ["friction.Q*", "in outputs"]),
        ({"outputs": ["friction.q"]}, ["'q'", "in outputs"]),
        ({"inputs": "mass.F_drive"}, ["inputs", "list of names"]),
        ({"name": "2nd axis"}, ["2nd axis", "letters"]),
        ({"master": "jacobi"}, ["jacobi", "newton or adaptive"]),
        ({"platforms": ["os2"]}, ["os2"]),
        ({"step": 0.0}, ["step"]),
        ({"step": "1e-3"}, ["step", "positive number"]),
        ({"fmi": 1}, ["fmi1", "fmi2, fmi3"]),
        ({"name": "part_LuGre"}, ["part_LuGre", "another name"]),
    ],
)
def test_wrong_options(tmp_path: Path, options: dict[str, object], words: list[str]) -> None:
    with open_system(EXAMPLES / "stick_slip.toml") as system, pytest.raises(HarnessError) as caught:
        system.to_fmu(tmp_path / "axis.fmu", **options)  # type: ignore[arg-type]
    check(str(caught.value), words, tmp_path)


def check(message: str, words: list[str], folder: Path) -> None:
    assert all(word in message for word in words), message
    assert "\n" not in message
    assert not (folder / "axis.fmu").exists()


def test_the_file_is_an_fmu_and_no_part_of_the_system(tmp_path: Path) -> None:
    """A slip such as ``compose axis.toml -o axis.toml`` must not replace the system file."""
    shutil.copy(EXAMPLES / "stick_slip.toml", tmp_path / "axis.toml")
    with open_system(tmp_path / "axis.toml") as system, pytest.raises(HarnessError, match=r"ends in \.fmu"):
        system.to_fmu(tmp_path / "axis.toml")
    part = FmuPart("mass", shutil.copy(fmu("Mass"), tmp_path / "mass.fmu"))
    with System([part], [], REST, STEPS) as system, pytest.raises(HarnessError, match="is the part 'mass'"):
        system.to_fmu(tmp_path / "mass.fmu")
    assert (tmp_path / "axis.toml").read_bytes() == (EXAMPLES / "stick_slip.toml").read_bytes()
    assert (tmp_path / "mass.fmu").read_bytes() == fmu("Mass").read_bytes()


@pytest.mark.parametrize(
    ("start", "words"),
    [
        ({"mass.m": -1.0}, ["mass", "-1", "[1e-12, inf]"]),
        ({"mass.v_support": math.nan}, ["mass", "v_support = nan"]),
    ],
)
def test_start_values_that_a_part_rejects(tmp_path: Path, start: dict[str, float], words: list[str]) -> None:
    with open_system(EXAMPLES / "stick_slip.toml") as system, pytest.raises(HarnessError) as caught:
        system.with_start(start).to_fmu(tmp_path / "axis.fmu")
    check(str(caught.value), words, tmp_path)


def test_a_part_in_python(tmp_path: Path) -> None:
    part = CallablePart("law", lambda t, u, x: 0.0, ["x"], ["y"])
    system = System([FmuPart("mass", fmu("Mass")), part], ["mass.x -> law.x"], REST, STEPS)
    with system, pytest.raises(HarnessError) as caught:
        system.to_fmu(tmp_path / "axis.fmu")
    check(str(caught.value), ["'law'", "Python", "replace"], tmp_path)


REST = {"mass.F_drive": 0.0, "mass.F_friction": 0.0}
STEPS = Experiment(stop=1.0, step=1e-3)


def changed_mass(folder: Path, change: Callable[[str, bytes], bytes | None], **more: bytes) -> Path:
    """The FMU of Mass with changed members."""
    path = folder / "changed.fmu"
    with ZipFile(fmu("Mass")) as given, ZipFile(path, "w") as written:
        for member in given.namelist():
            data = change(member, given.read(member))
            if data is not None:
                written.writestr(member, data)
        for member, data in more.items():
            written.writestr(member.replace("__", "/"), data)
    return path


def without_sources(member: str, data: bytes) -> bytes | None:
    if member.startswith("sources/"):
        return None
    return data.replace(b'<File name="Mass.c"/>', b"") if member == "modelDescription.xml" else data


def broken(member: str, data: bytes) -> bytes | None:
    return b"int x = ;" + data if member == "sources/Mass.c" else data


@pytest.mark.parametrize(
    ("change", "more", "words"),
    [
        (without_sources, {}, ["'mass'", "no sources"]),
        (lambda m, d: None if m == "sources/Mass.c" else d, {}, ["'mass'", "Mass.c"]),
        (lambda m, d: d, {"resources__table.csv": b"1"}, ["'mass'", "resources"]),
        pytest.param(broken, {}, ["part_Mass.c does not compile"], marks=nightly),
        pytest.param(
            lambda m, d: b"" if m == "sources/Mass.c" else d, {}, ["cannot be linked", "Mass_fmi2"], marks=nightly
        ),
    ],
)
def test_a_part_that_cannot_be_compiled(
    tmp_path: Path,
    change: Callable[[str, bytes], bytes | None],
    more: dict[str, bytes],
    words: list[str],
) -> None:
    part = FmuPart("mass", changed_mass(tmp_path, change, **more))
    with System([part], [], REST, STEPS) as system, pytest.raises(HarnessError) as caught:
        system.to_fmu(tmp_path / "axis.fmu")
    check(str(caught.value), words, tmp_path)


def test_a_loop_that_the_master_cannot_solve(tmp_path: Path) -> None:
    """A sampled law whose output depends on itself at the same sample."""
    part = FmuPart("pid", fmu("PID"))
    start = {f"pid.{port.name}": 0.0 for port in part.inputs if not port.optional}
    with System([part], ["pid.u -> pid.f"], start, STEPS) as system, pytest.raises(HarnessError) as caught:
        system.to_fmu(tmp_path / "axis.fmu")
    check(str(caught.value), ["algebraic loop pid.u -> pid.f -> pid.u", "delay"], tmp_path)


def test_a_loop_of_sampled_composites_is_one_like_that_of_their_parts(tmp_path: Path) -> None:
    """What acts in the same sample is declared: without a delay, one of two sums would read the other a sample late."""
    with System([FmuPart("sum", fmu("SampledSum"))], []) as one:
        one.to_fmu(tmp_path / "sum.fmu", step=1e-3)
    parts = [FmuPart(name, tmp_path / "sum.fmu") for name in "ab"]
    there, back = Wire("a.sum.y", "b.sum.u1"), Wire("b.sum.y", "a.sum.u1", gain=0.5)
    with pytest.raises(AlgebraicLoopError, match=r"a\.sum\.y -> b\.sum\.u1"):
        System(parts, [there, back], {"a.sum.u2": 1.0}).run(0.01, step=1e-3)
    delayed = System(parts, [there, replace(back, delay=1)], {"a.sum.u2": 1.0})
    y = delayed.run(0.004, step=1e-3)["b.sum.y"].to_numpy()
    assert y[2:].tolist() == (1.0 + 0.5 * y[1:-1]).tolist()


def test_a_loop_without_a_solution(tmp_path: Path) -> None:
    """y = y + 1."""
    part = FmuPart("sum", fmu("Sum"))
    start = {f"sum.{port.name}": 1.0 for port in part.inputs if port.name != "u1"}
    with System([part], ["sum.y -> sum.u1"], start, STEPS) as system, pytest.raises(HarnessError) as caught:
        system.to_fmu(tmp_path / "axis.fmu")
    check(str(caught.value), ["algebraic loop through sum.y -> sum.u1", "start values"], tmp_path)


def test_a_reference_must_become_inputs_entirely(tmp_path: Path) -> None:
    with open_system(EXAMPLES / "compensated_axis.toml") as system, pytest.raises(HarnessError) as caught:
        system.to_fmu(tmp_path / "axis.fmu", inputs=["reference.r"])
    check(str(caught.value), ["'reference'", "reference.rd", "list reference.rd"], tmp_path)


def test_manipulators(tmp_path: Path) -> None:
    experiment = Experiment(stop=1.0, step=1e-3, manipulators=(Bias("friction.v", 0.1),))
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu("LuGre"))]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
    with System(parts, wires, {"mass.F_drive": 0.0}, experiment) as system, pytest.raises(HarnessError) as caught:
        system.to_fmu(tmp_path / "axis.fmu")
    check(str(caught.value), ["friction.v", "manipulator", "remove it"], tmp_path)


@nightly
def test_a_system_without_an_experiment_needs_a_step(tmp_path: Path) -> None:
    with System([FmuPart("mass", fmu("Mass"))], [], REST) as system:
        with pytest.raises(HarnessError) as caught:
            system.to_fmu(tmp_path / "axis.fmu")
        check(str(caught.value), ["give a step"], tmp_path)
        system.to_fmu(tmp_path / "given.fmu", step=1e-3)
    assert (tmp_path / "given.fmu").exists()


@nightly
def test_an_input_without_a_start_value_becomes_an_input(tmp_path: Path) -> None:
    """To run such a system is an error; as an FMU it has an input with the start value of the part."""
    text = (EXAMPLES / "stick_slip.toml").read_text(encoding="utf-8").replace("F_drive = 0.0\n", "")
    (tmp_path / "open.toml").write_text(text, encoding="utf-8")
    with pytest.raises(HarnessError, match=r"mass\.F_drive is not connected"):
        open_system(tmp_path / "open.toml")
    command = [sys.executable, "-m", "friction_fmus", "compose", str(tmp_path / "open.toml")]
    done = subprocess.run([*command, "-o", str(tmp_path / "axis.fmu")], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    part = FmuPart("axis", tmp_path / "axis.fmu")
    assert {port.name: port.start for port in part.inputs}["mass.F_drive"] == 0.0


@nightly
def test_the_command(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "friction_fmus", "compose", str(EXAMPLES / "stick_slip.toml")]
    good = [
        *command,
        "-o",
        str(tmp_path / "Axis.fmu"),
        "--inputs",
        "mass.F_drive",
        "--outputs",
        "mass.*",
        "--step",
        "2e-3",
    ]
    done = subprocess.run(good, capture_output=True, text=True, check=False)
    said = "the FMU contains the master newton in place of gauss-seidel; --master chooses\n"
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, str(tmp_path / "Axis.fmu"), said)
    chosen = subprocess.run([*good[:-2], "--master", "newton"], capture_output=True, text=True, check=False)
    assert (chosen.returncode, chosen.stderr) == (0, "")
    part = FmuPart("axis", tmp_path / "Axis.fmu")
    assert [port.name for port in part.inputs] == ["mass.F_drive"]
    assert [port.name for port in part.outputs] == [f"mass.{name}" for name in ("x", "v", "x_support", "a", "F_ext")]
    bad = subprocess.run([*good, "mass.q*"], capture_output=True, text=True, check=False)
    assert bad.returncode != 0
