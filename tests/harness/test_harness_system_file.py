"""Systems as TOML files."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from harness_parts import mass

from harness import (
    Bias,
    Delay,
    Experiment,
    FmuPart,
    HarnessError,
    SeriesPart,
    System,
    SystemFileError,
    Wire,
)

TEXT = """
name = "bench"
wires = [
    "force.F -> p.u",
]

[parts.force]
record = "force.csv"

[parts.p]
fmu = "probe.fmu"
every = 2

[parts.p.start]
gain = 2
n = 3
b = true
label = "left \\"axis\\""

[experiment]
stop = 1
step = 0.25
master = "jacobi"
record = ["p.x", "p.y"]
"""


@pytest.fixture
def folder(probe: Path) -> Path:
    (probe.parent / "force.csv").write_text("time [s],F [N]\n0,1\n2,1\n")
    return probe.parent


def write(folder: Path, text: str) -> Path:
    path = folder / "system.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_read_and_run(folder: Path) -> None:
    with System.from_toml(write(folder, TEXT)) as system:
        assert system.name == "bench"
        assert system.experiment == Experiment(stop=1.0, step=0.25, master="jacobi", record=("p.x", "p.y"))
        assert system.parts["p"].every == 2
        result = system.run()
    np.testing.assert_array_equal(result["p.y"], np.full(5, 2.0))
    np.testing.assert_array_equal(result["p.x"], [0, 0, 0.5, 0.5, 1.0])


def test_round_trip(folder: Path) -> None:
    (folder / "sub").mkdir()
    with System.from_toml(write(folder, TEXT)) as system:
        system.to_toml(folder / "sub" / "copy.toml")
        with System.from_toml(folder / "sub" / "copy.toml") as copy:
            assert (copy.name, copy.wires, copy.start) == (system.name, system.wires, system.start)
            assert copy.experiment == system.experiment
            assert copy.run().identical(system.run())
            copy.to_toml(folder / "sub" / "again.toml")
    assert (folder / "sub" / "again.toml").read_text() == (folder / "sub" / "copy.toml").read_text()


def test_round_trip_of_everything_else(folder: Path) -> None:
    parts = [
        FmuPart("p", folder / "probe.fmu", model="Probe"),
        SeriesPart.from_csv("force", folder / "force.csv", interpolation="previous", beyond="hold"),
    ]
    experiment = Experiment(
        start=-1.0, stop=1e300, step=1e299, decimate=2, tolerance=1e-6, order=("p", "force"), record=(), master="jacobi"
    )
    system = System(
        parts, ["force.F -> p.u"], {"p.n": 1, "p.b": False, "p.gain": 1e-300}, Experiment(stop=1.0, step=0.1)
    )
    system.experiment = Experiment(**{**vars(experiment), "stop": 9.0, "step": 1.0, "record": ("p.*",)})
    system.to_toml(folder / "all.toml")
    copy = System.from_toml(folder / "all.toml", resolve=lambda name: folder / f"{name.lower()}.fmu")
    assert copy.experiment == system.experiment
    assert copy.start == system.start
    assert isinstance(copy.parts["p"], FmuPart) and copy.parts["p"].model == "Probe"
    series = copy.parts["force"]
    assert isinstance(series, SeriesPart) and (series.interpolation, series.beyond) == ("previous", "hold")


def test_models_are_resolved(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def resolve(name: str) -> Path:
        asked.append(name)
        return folder / "probe.fmu"

    System.from_toml(write(folder, TEXT.replace('fmu = "probe.fmu"', 'model = "Probe"')), resolve).close()
    assert asked == ["Probe"]
    monkeypatch.setattr("harness.system.system_file.MODELS", [])
    with pytest.raises(SystemFileError, match="model 'Probe', but no function resolves models"):
        System.from_toml(folder / "system.toml")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("name =", "nmae =", "'nmae'; did you mean 'name'"),
        ("every = 2", "evry = 2", "part 'p' .*'evry'; did you mean 'every'"),
        ("master =", "mastre =", r"\[experiment\] .*'mastre'; did you mean 'master'"),
        ("every = 2", "every = 2.5", "part 'p' .* every = 2.5; give an integer"),
        ('fmu = "probe.fmu"', "", "part 'p' .* has no source"),
        ('fmu = "probe.fmu"', 'fmu = "probe.fmu"\nrecord = "force.csv"', "has fmu and record"),
        ('fmu = "probe.fmu"', "fmu = 3", "part 'p' .* fmu = 3; give a text"),
        ('"force.F -> p.u",', "1,", "1 among the wires in .* is not a connection"),
        ("stop = 1\n", "", "has no stop"),
        ("stop = 1\n", 'stop = "one"\n', "stop = 'one'; give a number"),
        ("stop = 1\n", "stop = 1\ndecimate = 1.5\n", "decimate = 1.5; give an integer"),
        ('record = ["p.x", "p.y"]', 'record = "p.x"', "record = 'p.x'; give a list"),
        ("gain = 2", "gain = [2]", r"\[parts.p.start\] .* gain = .* give a number"),
        ("[parts.force]\n", "[parts]\nq = 1\n[parts.force]\n", "part 'q' .* is 1, not a table"),
        ("name =", "name = = ", "cannot be read as TOML"),
    ],
)
def test_what_is_not_understood(folder: Path, old: str, new: str, message: str) -> None:
    assert old in TEXT
    with pytest.raises(SystemFileError, match=message) as caught:
        System.from_toml(write(folder, TEXT.replace(old, new, 1)))
    assert "\n" not in str(caught.value)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(SystemFileError, match=r"cannot be read .* give the path"):
        System.from_toml(tmp_path / "none.toml")


def test_wrong_system_in_a_right_file(folder: Path) -> None:
    with pytest.raises(HarnessError, match="did you mean 'force'"):
        System.from_toml(write(folder, TEXT.replace("force.F ->", "forc.F ->")))


def test_what_has_no_place_in_a_file(tmp_path: Path, make_fmu: Callable[..., Path]) -> None:
    for system in (System([mass()], start={"mass.F": 0.0}), System([SeriesPart("s", [0.0], {"x": [1.0]})])):
        with pytest.raises(SystemFileError, match="cannot be written"):
            system.to_toml(tmp_path / "out.toml")
    assert list(tmp_path.iterdir()) == []


def test_parts_and_ports_with_unusual_names(folder: Path, make_fmu: Callable[..., Path]) -> None:
    path = make_fmu(('name="gain"', 'name="k[1]"'), name="odd.fmu")
    start = {"my part.k[1]": 0.5, "my part.u": 1.0, "my part.n": 0, "my part.b": True}
    with System([FmuPart("my part", path)], start=start) as system:
        system.to_toml(folder / "odd.toml")
    with System.from_toml(folder / "odd.toml") as copy:
        assert copy.start == start
        assert float(copy.run(stop=1.0, step=1.0)["my part.y"][0]) == 0.5


@pytest.mark.parametrize("suffix", ["toml", "ssp"])
def test_scalars_of_numpy_are_written_as_numbers(build_fmu: Callable[..., Path], tmp_path: Path, suffix: str) -> None:
    faults = (Bias("pid.x", np.float64(1e-3), start=np.float64(0.5)), Delay("mass.F_drive", np.int64(2)))  # type: ignore[arg-type]
    experiment = Experiment(
        stop=np.float64(1.0),
        step=np.float32(0.125),  # type: ignore[arg-type]
        decimate=np.int64(2),  # type: ignore[arg-type]
        tolerance=np.float64(1e-6),
        manipulators=faults,
    )
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("pid", build_fmu("PID"), every=np.int64(2))]  # type: ignore[arg-type]
    wires = [
        Wire("mass.x", "pid.x", gain=np.float64(2.0), offset=np.float32(0.5), delay=np.int64(1)),  # type: ignore[arg-type]
        "pid.u -> mass.F_drive",
    ]
    start = {"pid.Kp": np.float64(30.0), "mass.m": np.float32(0.5), "pid.r": 0.0, "mass.F_friction": 0.0}
    start |= dict.fromkeys(("pid.rd", "pid.rdd", "pid.v"), 0.0)
    with System(parts, wires, start, experiment) as system:
        getattr(system, f"to_{suffix}")(tmp_path / f"system.{suffix}")
    if suffix == "ssp":
        with zipfile.ZipFile(tmp_path / "system.ssp") as archive:
            assert b"np." not in archive.read("SystemStructure.ssd")
    with getattr(System, f"from_{suffix}")(tmp_path / f"system.{suffix}") as found:
        assert found.experiment == Experiment(1.0, 0.125, decimate=2, tolerance=1e-6, manipulators=faults)
        assert found.wires[0] == Wire("mass.x", "pid.x", gain=2.0, offset=0.5, delay=1)
        assert found.parts["pid"].every == 2
        assert (found.start["pid.Kp"], found.start["mass.m"]) == (30.0, 0.5)
