"""Composite FMUs at length: random systems, threads, platforms, a build by fmpy, cost and size."""

from __future__ import annotations

import os
import shutil
import time
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import fmpy
import numpy as np
import pytest
from composite.composite_systems import check_random_system, random_seed_settings
from fmpy.build import build_platform_binary
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from shell.instance import Instance, load
from thorough import THOROUGH, nightly, some

from friction_fmus.cli.inputs import open_system
from harness import FmuPart, System
from harness.compiling.platforms import PLATFORMS

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = ("axis.x", "axis.v", "friction.F")


@pytest.fixture(scope="module")
def servo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The compensated axis without inputs, each night for all platforms."""
    path = tmp_path_factory.mktemp("servo") / "Servo.fmu"
    with open_system(EXAMPLES / "compensated_axis.toml") as system:
        system.to_fmu(path, inputs=[], platforms=some(["all"], ["native"]))
    return path


@nightly
@seed(20261123)
@settings(random_seed_settings(int(os.environ.get("RANDOM_SYSTEMS", "8"))))
@given(data=st.data())
def test_random_systems(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    check_random_system(tmp_path_factory.getbasetemp(), data)


def run_of(path: Path, steps: int) -> list[float]:
    with Instance(load(path)) as run:
        run.initialise()
        for k in range(steps):
            run.step(k * 0.5e-3, 0.5e-3)
        return run.get(*NAMES)


def test_instances_in_threads_equal_one(servo: Path) -> None:
    expected = run_of(servo, 200)
    with ThreadPoolExecutor(16) as pool:
        found = list(pool.map(lambda _: run_of(servo, 200), range(1600 if THOROUGH else 400)))
    assert all(values == expected for values in found)


@nightly
def test_size_and_platforms(servo: Path) -> None:
    with zipfile.ZipFile(servo) as archive:
        sizes = {entry.filename.split("/")[1]: entry.compress_size for entry in archive.infolist() if is_binary(entry)}
    assert set(sizes) == set(PLATFORMS)
    slices = {name: size / len(PLATFORMS[name].targets) for name, size in sizes.items()}
    assert max(slices.values()) < 150_000, slices


def is_binary(entry: zipfile.ZipInfo) -> bool:
    return entry.filename.startswith("binaries/")


@nightly
def test_a_warm_build_takes_less_than_five_seconds(servo: Path) -> None:
    with open_system(EXAMPLES / "compensated_axis.toml") as system:
        begin = time.process_time()
        system.to_fmu(servo.with_name("Again.fmu"), name="Servo", inputs=[])
        assert time.process_time() - begin < 5.0


@nightly
@pytest.mark.skipif(shutil.which("cmake") is None or shutil.which("cc") is None, reason="builds with cmake and cc")
def test_fmpy_compiles_a_binary_that_works(servo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It computes what our binary does, but for the rounding of what its compiler contracts."""
    monkeypatch.delenv("CC", raising=False)
    folder = Path(fmpy.extract(str(servo), str(tmp_path / "fmu")))
    shutil.rmtree(folder / "binaries")
    (tmp_path / "build").mkdir()
    build_platform_binary(folder, tmp_path / "build")
    ours, theirs = (fmpy.simulate_fmu(str(path), stop_time=0.1) for path in (servo, folder))
    for column in ours.dtype.names:
        np.testing.assert_allclose(theirs[column], ours[column], rtol=1e-7, atol=1e-10)


@nightly
def test_cost_over_the_native_engine(servo: Path) -> None:
    """Processor time of a run of 20 000 steps with the same recorded output, fastest of five in turn."""
    with open_system(EXAMPLES / "compensated_axis.toml") as system, System([FmuPart("one", servo)]) as alone:
        times: dict[str, list[float]] = {"engine": [], "composite": []}
        for _ in range(5):
            for name, one, record in (("engine", system, "axis.x"), ("composite", alone, "one.axis.x")):
                begin = time.process_time()
                one.run(stop=20.0, step=0.5e-3, master="newton", record=[record])
                times[name].append(time.process_time() - begin)
    assert min(times["composite"]) < 1.15 * min(times["engine"]), times
