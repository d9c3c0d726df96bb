"""A run that is interrupted and goes on in another process, bit by bit the same; and runs in step with the clock."""

from __future__ import annotations

import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from harness_parts import mass
from thorough import nightly

from harness import (
    Bias,
    CallablePart,
    Delay,
    DropOut,
    Experiment,
    ExperimentError,
    FmuPart,
    Noise,
    Part,
    Port,
    Result,
    SeriesPart,
    SweepError,
    System,
    sweep,
)
from harness.system.wire import Wire

BuildFmu = Callable[..., Path]
MASTERS = ("jacobi", "gauss-seidel", "newton", "adaptive")
MANIPULATORS = (
    Bias("pid.x", 1e-4, start=0.1),
    Noise("pid.x", 1e-6, seed=7),
    DropOut("mass.F_drive", 0.2, start=0.2, stop=0.4),
    Delay("mass.F_drive", 3),
)


def servo(build_fmu: BuildFmu) -> System:
    """Everything that has a state: FMUs, delays, a slow sampled part."""
    names = ("Profile", "PID", "Mass", "LuGre", "ElastoPlastic")
    profile, pid, body, friction, spare = (FmuPart(name.lower(), build_fmu(name)) for name in names)
    estimate = FmuPart("estimate", build_fmu("Differentiator"), every=3)
    wires = ["profile.r -> pid.r", "mass.x -> pid.x", "lugre.F -> mass.F_friction", "mass.x -> estimate.x"]
    wires += [
        Wire("pid.u", "mass.F_drive", delay=2, initial=0.1),
        "mass.v -> lugre.v",
        Wire("mass.v", "elastoplastic.v", 0.5),
    ]
    start = {"pid.Ts": 1e-3, "pid.Kp": 400.0, "pid.Kd": 40.0, "pid.rd": 0.0, "pid.rdd": 0.0, "pid.v": 0.0}
    return System([profile, pid, body, friction, spare, estimate], wires, {**start, "estimate.Ts": 3e-3})


def same(whole: Result, second: Result) -> None:
    at = np.searchsorted(whole["time"].values, float(second["time"].values[0]))
    for name in whole:
        np.testing.assert_array_equal(second[name].values, whole[name].values[at:], err_msg=str(name))


@pytest.mark.parametrize("master", MASTERS)
@pytest.mark.parametrize("interruption", [0.25, 0.301])
def test_the_rest_is_the_same(build_fmu: BuildFmu, tmp_path: Path, master: str, interruption: float) -> None:
    settings = {"step": 1e-3, "master": master, "manipulators": MANIPULATORS, "decimate": 2}
    with servo(build_fmu) as system:
        whole = system.run(stop=0.6, **settings)
        first = system.run(stop=interruption, checkpoint=tmp_path / "state", **settings)
        second = system.run(stop=0.6, resume=tmp_path / "state", **settings)
    for name in whole:
        np.testing.assert_array_equal(first[name].values, whole[name].values[: len(first["time"])])
    same(whole, second)
    assert float(second["time"].values[0]) == pytest.approx(interruption, abs=1.1e-3)


@pytest.mark.parametrize("order", [1, 2])
def test_extrapolation_remembers(build_fmu: BuildFmu, tmp_path: Path, order: int) -> None:
    settings = {"step": 1e-3, "master": "jacobi", "extrapolation": order}
    with servo(build_fmu) as system:
        whole = system.run(stop=0.1, **settings)
        system.run(stop=0.05, checkpoint=tmp_path / "state", **settings)
        same(whole, system.run(stop=0.1, resume=tmp_path / "state", **settings))


SCRIPT = """
import sys
from harness import System, save_result
with System.from_toml(sys.argv[1]) as system:
    save_result(system.run(stop=0.6, step=1e-3, master="newton", resume=sys.argv[2]), sys.argv[3])
"""


@nightly
def test_another_process_goes_on(build_fmu: BuildFmu, tmp_path: Path) -> None:
    with servo(build_fmu) as system:
        system.to_toml(tmp_path / "system.toml")
        whole = system.run(stop=0.6, step=1e-3, master="newton")
        system.run(stop=0.2, step=1e-3, master="newton", checkpoint=tmp_path / "state")
    files = [str(tmp_path / name) for name in ("system.toml", "state", "rest.parquet")]
    subprocess.run([sys.executable, "-c", SCRIPT, *files], check=True, timeout=60)
    rest = pd.read_parquet(tmp_path / "rest.parquet")
    at = np.searchsorted(whole["time"].values, 0.2 - 1e-9)
    for name in whole:
        np.testing.assert_array_equal(rest[name].to_numpy(), whole[name].values[at:])


def test_python_parts_go_on(tmp_path: Path) -> None:
    force = CallablePart("force", lambda t, u, x: np.sin(40.0 * t), [], ["F"], sampled=True)
    system = System([force, mass(v0=1.0)], ["force.F -> mass.F"])
    whole = system.run(stop=1.0, step=0.01)
    system.run(stop=0.5, step=0.01, checkpoint=tmp_path / "state")
    same(whole, system.run(stop=1.0, step=0.01, resume=tmp_path / "state"))


def test_other_runs_are_refused(build_fmu: BuildFmu, tmp_path: Path) -> None:
    state = tmp_path / "state"
    other = System([mass()], [], {"mass.F": 1.0})
    with servo(build_fmu) as system:
        system.run(stop=0.2, step=1e-3, checkpoint=state)
        for changes, message in [
            ({"step": 2e-3}, "other step: 0.001 instead of 0.002"),
            ({"master": "newton"}, "other master"),
            ({"stop": 0.1}, "is the state at 0.2 s: give a later stop than 0.1"),
            ({"manipulators": MANIPULATORS}, "other manipulators"),
            ({"tolerance": 1e-3}, "other tolerance"),
        ]:
            with pytest.raises(ExperimentError, match=message):
                system.run(**{"stop": 0.3, "step": 1e-3, "resume": state} | changes)
    with pytest.raises(ExperimentError, match="other parts"):
        other.run(stop=0.3, step=1e-3, resume=state)
    (tmp_path / "text").write_text("nothing")
    for path in ("text", "missing"):
        with pytest.raises(ExperimentError, match="cannot read the checkpoint"):
            other.run(stop=0.3, step=1e-3, resume=tmp_path / path)
    with zipfile.ZipFile(state) as archive:
        assert "checkpoint.json" in archive.namelist()


def gain(k: float) -> Callable[..., float]:
    return lambda t, u, x: k * t


class Scaled:
    """A gain as an object."""

    def __init__(self, k: float) -> None:
        self.k = k

    def __call__(self, t: float, u: object, x: object) -> float:
        return self.k * t

    def of(self, t: float, u: object, x: object) -> float:
        return self.k * t


def played(unit: str = "m", interpolation: str = "linear", value: float = 1.0) -> Part:
    return SeriesPart("p", [0.0, 1.0], {"y": [0.0, value]}, {"y": unit}, interpolation=interpolation)  # type: ignore[arg-type]


def called(function: Callable[..., float] = gain(1.0), unit: str = "m", **options: Any) -> Part:  # noqa: B008
    return CallablePart("p", function, [], [Port("y", unit)], **options)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (played(), played(unit="mm")),
        (played(), played(interpolation="previous")),
        (played(), played(value=2.0)),
        (called(), called(unit="mm")),
        (called(), called(sampled=True)),
        (called(), called(gain(2.0))),
        (called(Scaled(1.0)), called(Scaled(2.0))),
        (called(Scaled(1.0).of), called(Scaled(2.0).of)),
        (called(lambda t, u, x: t), called(lambda t, u, x: 2.0 * t)),
    ],
)
def test_a_part_with_other_results_is_another_part(tmp_path: Path, one: Part, other: Part) -> None:
    """Neither a checkpoint nor the folder of a sweep is continued with it."""
    experiment = Experiment(stop=0.5, step=0.1)
    with System([one]) as first, System([other]) as second:
        first.run(stop=0.5, step=0.1, checkpoint=tmp_path / "state")
        sweep(first, [{}], measure="final(p.y)", experiment=experiment, executor="serial", output=tmp_path / "sweep")
        first.run(stop=1.0, step=0.1, resume=tmp_path / "state")
        with pytest.raises(ExperimentError, match="other parts"):
            second.run(stop=1.0, step=0.1, resume=tmp_path / "state")
        with pytest.raises(SweepError, match="differs in system"):
            sweep(
                second, [{}], experiment=experiment, measure="final(p.y)", executor="serial", output=tmp_path / "sweep"
            )


def test_other_start_values_are_refused(tmp_path: Path) -> None:
    """They would be ignored, as the state contains the old ones."""
    System([mass()], [], {"mass.F": 1.0}).run(stop=0.2, step=0.1, checkpoint=tmp_path / "state")
    with pytest.raises(ExperimentError, match="other start values"):
        System([mass()], [], {"mass.F": 2.0}).run(stop=0.4, step=0.1, resume=tmp_path / "state")


@pytest.mark.parametrize("pace", [1.0, 4.0])
def test_pace(pace: float) -> None:
    system = System([mass()], [], {"mass.F": 1.0})
    begin = time.monotonic()
    system.run(stop=0.4, step=1e-3, pace=pace)
    # 30 ms for starting and ending on a busy machine
    assert 0.4 / pace <= time.monotonic() - begin < 0.4 / pace + 0.2
    with pytest.raises(ExperimentError, match="the pace is 0"):
        system.run(stop=0.4, step=1e-3, pace=0.0)
