"""Sweeps: parameter sets, results, workers that die, and folders that are gone on with."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import forkserver
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.dataset
import pytest
from sweep_systems import ONE_TICK, counted, log_of, picky, root
from thorough import nightly, some

import harness.parts.fmi2
from harness import (
    CallablePart,
    Experiment,
    FmuPart,
    OutputError,
    Parameter,
    ParameterSet,
    Port,
    StartValueError,
    SweepError,
    System,
    UnitError,
    UnknownNameError,
    grid,
    latin_hypercube,
    read_samples,
    read_ssv,
    read_sweep,
    sobol,
    sweep,
    write_ssv,
)
from harness.sweeps import pools, worker
from harness.sweeps.worker import Job, close_runners, run_chunk

BuildFmu = Callable[..., Path]
LOCAL = ["serial", "threads", "processes"]


def numbers(n: int, **more: float) -> list[dict[str, float]]:
    return [{"p.number": k, **{f"p.{name}": value for name, value in more.items()}} for k in range(n)]


class StopAt:
    """A progress that interrupts the sweep like Ctrl-C."""

    def __init__(self, most: int) -> None:
        self.most = most

    def update(self, done: int, total: int) -> None:
        if done >= self.most:
            raise KeyboardInterrupt


# ---- parameter sets -----------------------------------------------------------------------------------------------


def test_grid_has_all_combinations_with_the_last_name_fastest() -> None:
    assert grid({"a.x": [1, 2], "b.y": np.linspace(0.0, 1.0, 3), "master": ["jacobi"]}) == [
        {"a.x": x, "b.y": y, "master": "jacobi"} for x in (1, 2) for y in (0.0, 0.5, 1.0)
    ]


def test_latin_hypercube_has_one_point_in_every_stratum_on_its_scale() -> None:
    points = latin_hypercube({"a.x": (-1.0, 3.0), "a.y": (1e-4, 1e4)}, 40, seed=7, log=["a.y"])
    x = (np.array([point["a.x"] for point in points]) + 1.0) / 4.0
    y = (np.log10([point["a.y"] for point in points]) + 4.0) / 8.0
    for column in (x, y):
        assert sorted(np.floor(40 * column)) == list(range(40))
    assert points == latin_hypercube({"a.x": (-1.0, 3.0), "a.y": (1e-4, 1e4)}, 40, seed=7, log=["a.y"])
    assert points != latin_hypercube({"a.x": (-1.0, 3.0), "a.y": (1e-4, 1e4)}, 40, seed=8, log=["a.y"])


def test_sobol_points_lie_one_in_each_elementary_box() -> None:
    """The first 16 points of the sequence in two dimensions are a (0, 4, 2)-net: also after Owen's scrambling."""
    points = sobol({"a.x": (0.0, 1.0), "a.y": (0.0, 1.0)}, 16, seed=3)
    xy = np.array([[point["a.x"], point["a.y"]] for point in points])
    for columns in (1, 2, 4, 8, 16):
        boxes = np.floor(xy * [columns, 16 / columns])
        assert len({tuple(box) for box in boxes}) == 16


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sobol({"a.x": (0, 1)}, 100, seed=0), "give a power of 2 such as 128"),
        (lambda: latin_hypercube({"a.x": (2, 1)}, 4, seed=0), "bounds of a.x are 2 and 1"),
        (lambda: latin_hypercube({"a.x": (0, 1)}, 4, seed=0, log=["a.x"]), "give positive bounds"),
        (lambda: latin_hypercube({"a.x": (0, 1)}, 4, seed=0, log=["a.y"]), "a.y has a logarithmic scale but no bounds"),
        (lambda: latin_hypercube({"a.x": (0, 1)}, 0, seed=0), "give 1 or more"),
        (lambda: latin_hypercube({}, 3, seed=0), "nothing is varied"),
        (lambda: grid({"a.x": [None]}), "cannot be swept"),
        (lambda: sweep(System([]), []), "at least one parameter set"),
        (lambda: sweep(System([]), [{"a.x": 1.0}, {"a.x": "one"}]), "types float and str"),
    ],
)
def test_senseless_parameter_sets_are_refused(make: Callable[[], object], message: str) -> None:
    with pytest.raises(SweepError, match=message):
        make()


def test_parameter_sets_from_files(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("mass.m, pid.on, master\n2, true, jacobi\n0.5,,\n")
    assert read_samples([tmp_path / "a.csv"]) == [{"mass.m": 2, "pid.on": True, "master": "jacobi"}, {"mass.m": 0.5}]
    (tmp_path / "b.csv").write_text("mass.m,mass.k\n2\n")
    with pytest.raises(SweepError, match=r"row 2 of .*b\.csv has 1 cells instead of 2"):
        read_samples([tmp_path / "b.csv"])
    (tmp_path / "c.csv").write_text("mass.m,mass.k, mass.m\n2,1,3\n")
    with pytest.raises(SweepError, match=r"two columns of .*c\.csv are called 'mass\.m'"):
        read_samples([tmp_path / "c.csv"])
    with pytest.raises(SweepError, match="no known format"):
        read_samples([tmp_path / "a.xlsx"])


def test_parameter_sets_with_units_are_converted(build_fmu: BuildFmu, tmp_path: Path) -> None:
    for name, m in (("light", 500.0), ("heavy", 4000.0)):
        parameters = {"mass.m": Parameter(m, "g"), "mass.F_drive": Parameter(3.0)}
        write_ssv(ParameterSet(name, parameters), tmp_path / f"{name}.ssv")
    samples = [*read_samples([tmp_path / "light.ssv", tmp_path / "heavy.ssv"]), read_ssv(tmp_path / "light.ssv")]
    start = {"mass.F_drive": 0.0, "mass.F_friction": 0.0}
    with System([FmuPart("mass", build_fmu("Mass"))], start=start, experiment=ONE_TICK) as system:
        result = sweep(system, samples, measure="final(mass.v)", executor="serial")
        system.to_ssp(tmp_path / "system.ssp")
    np.testing.assert_allclose(result["mass.m"], [0.5, 4.0, 0.5], rtol=1e-15)
    np.testing.assert_allclose(result["final(mass.v)"], [6.0, 0.75, 6.0], rtol=1e-12)
    archived = sweep(tmp_path / "system.ssp", samples, measure="final(mass.v)", executor="serial", experiment=ONE_TICK)
    np.testing.assert_array_equal(archived["final(mass.v)"], result["final(mass.v)"])


@pytest.fixture
def mass_and_gms(build_fmu: BuildFmu) -> Iterator[System]:
    start = {"mass.F_drive": 0.0, "mass.F_friction": 0.0, "gms.v": 0.0}
    with System([FmuPart("mass", build_fmu("Mass")), FmuPart("gms", build_fmu("GMS"))], start=start) as system:
        yield system


@pytest.mark.parametrize(("unit", "v0"), [("in/s", 2.54), ("kmh", 100 / 3.6), ("mm/s", 0.1)])
def test_common_units_of_a_parameter(mass_and_gms: System, unit: str, v0: float) -> None:
    changed = mass_and_gms.with_parameters({"mass.v0": Parameter(100.0, unit)})
    assert changed.start["mass.v0"] == pytest.approx(v0)


@pytest.mark.parametrize(
    ("parameter", "error", "message"),
    [
        ({"mass.v0": Parameter(100.0, "furlong/s")}, UnitError, r"mass\.v0 is in 'furlong/s', which is not a known"),
        ({"mass.v0": Parameter(100.0, "rpm")}, UnitError, "measure different quantities"),
        ({"mass.m": Parameter(100.0, "lbf")}, UnitError, "measure different quantities"),
        ({"gms.k[1]": Parameter(100.0, "N/mm", shape=(3,))}, StartValueError, r"gms\.k has 10 elements, but is given"),
    ],
)
def test_parameters_that_do_not_fit(
    mass_and_gms: System, parameter: dict[str, Parameter], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        mass_and_gms.with_parameters(parameter)
    with pytest.raises(error, match=message):
        sweep(mass_and_gms, [parameter], executor="serial", experiment=ONE_TICK)


# ---- results ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("executor", LOCAL)
def test_mass_under_a_constant_force(build_fmu: BuildFmu, tmp_path: Path, executor: str) -> None:
    samples = grid({"mass.m": [0.5, 1.0, 2.0, 4.0], "stop": [0.5, 1.0], "step": [0.125]})
    start = {"mass.F_drive": 3.0, "mass.F_friction": 0.0}
    with System([FmuPart("mass", build_fmu("Mass"))], start=start, experiment=ONE_TICK) as system:
        measures = ["final(mass.x)", "max(mass.v)", "rms(mass.v)", "mean(mass.v)", "min(mass.a)", "max_abs(mass.F_ext)"]
        result = sweep(system, samples, measure=measures, output=tmp_path, executor=executor, workers=2)
    assert list(result["error"]) == [""] * 8
    a, t = 3.0 / result["mass.m"], result["stop"]
    np.testing.assert_allclose(result["final(mass.x)"], 0.5 * a * t**2, rtol=1e-12)
    np.testing.assert_allclose(result["max(mass.v)"], a * t, rtol=1e-12)
    # of v = a k h, k = 0 ... n: the sum of the k^2 is n (n + 1) (2 n + 1) / 6
    n = t / 0.125
    np.testing.assert_allclose(result["rms(mass.v)"], a * 0.125 * np.sqrt(n * (2 * n + 1) / 6), rtol=1e-12)
    np.testing.assert_allclose(result["mean(mass.v)"], 0.5 * a * t, rtol=1e-12)
    np.testing.assert_allclose(result["min(mass.a)"], a, rtol=1e-12)
    np.testing.assert_allclose(result["max_abs(mass.F_ext)"], 3.0, rtol=1e-12)
    assert result["mass.m"].attrs["units"] == "kg"
    assert list(result["run"]) == list(range(8))
    # as others read it
    for table in (pd.read_parquet(tmp_path), pyarrow.dataset.dataset(tmp_path).to_table().to_pandas()):
        table = table.sort_values("run")
        np.testing.assert_array_equal(table["final(mass.x)"], result["final(mass.x)"])
        np.testing.assert_array_equal(table["stop"], result["stop"])


@pytest.mark.parametrize("block", ["LuGre", "Bristle", "Leuven"])
def test_reset_instances_give_what_new_ones_give_to_the_last_bit(
    build_fmu: BuildFmu, tmp_path: Path, block: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Friction with random numbers and with stacks of memory, in a loop with a sampled controller."""
    made: list[str] = []
    instantiate = harness.parts.fmi2.Instance.__init__

    def count(self: harness.parts.fmi2.Instance, library: object, archive: object, name: str) -> None:
        made.append(name)
        instantiate(self, library, archive, name)  # type: ignore[arg-type]

    monkeypatch.setattr(harness.parts.fmi2.Instance, "__init__", count)
    parts = {"profile": "Profile", "pid": "PID", "mass": "Mass", "friction": block}
    wires = [f"profile.{name} -> pid.{name}" for name in ("r", "rd", "rdd")]
    wires += ["mass.x -> pid.x", "mass.v -> pid.v", "pid.u -> mass.F_drive"]
    wires += ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
    samples = [{"mass.m": m, "pid.Kp": kp} for m, kp in ((1.0, 1e4), (1.3, 2e4), (0.7, 1e4), (1.0, 1e4))]
    experiment = Experiment(stop=0.1, step=1e-4)
    with System([FmuPart(name, build_fmu(model)) for name, model in parts.items()], wires) as system:
        sweep(system, samples, output=tmp_path, executor="serial", experiment=experiment, keep=["*"])
        runs = Counter(name for name in made if name in parts)
        assert runs == dict.fromkeys(parts, 3)  # the first, one to compare with, the one of all other runs
        kept = pyarrow.dataset.dataset(tmp_path / "_trajectories").to_table().to_pandas()
        for run, values in enumerate(samples):
            fresh = system.with_start(values).run(stop=0.1, step=1e-4)
            trajectory = kept[kept["run"] == run]
            for name in fresh.data_vars:
                assert trajectory[name].to_numpy().tobytes() == fresh[name].to_numpy().tobytes(), (run, name)


@pytest.mark.parametrize("honest", [False, True])
def test_fmu_that_cannot_be_reset_gets_new_instances(
    probe: Path, monkeypatch: pytest.MonkeyPatch, honest: bool
) -> None:
    """fmi2Reset of the probe does nothing and says fmi2OK; an honest FMU would say fmi2Error."""
    if honest:
        monkeypatch.setattr(harness.parts.fmi2.Instance, "reset", lambda self: False)
    start = {"p.u": 0.0, "p.n": 4, "p.b": True}
    with System([FmuPart("p", probe)], start=start, experiment=Experiment(stop=2.0, step=0.25)) as system:
        result = sweep(system, grid({"p.u": [1.0, 3.0, -2.0]}), measure="final(p.x)", executor="serial")
    np.testing.assert_array_equal(result["final(p.x)"], 2.0 * result["p.u"])


def test_instance_that_failed_is_not_used_again(probe: Path) -> None:
    start = {"p.n": 4, "p.b": True, "p.u": 1.0}
    samples = [{"p.fail_time": 9.0}, {"p.fail_time": 0.6}, {"p.fail_time": 9.0, "p.gain": -1.0}, {"p.fail_time": 9.0}]
    with System([FmuPart("p", probe)], start=start, experiment=Experiment(stop=1.0, step=0.25)) as system:
        result = sweep(system, samples, measure="final(p.x)", executor="serial")
    np.testing.assert_array_equal(result["final(p.x)"], [1.0, np.nan, np.nan, 1.0])
    good, failed, refused, last = (str(text) for text in result["error"].to_numpy())
    assert good == last == ""
    assert failed.startswith("part 'p' failed in fmi2DoStep at t = 0.5 s: it returned Error")
    assert "rejected the start value -1.0 of gain" in refused


def test_failing_runs_are_rows(tmp_path: Path) -> None:
    samples = [{**sample, "p.fail": int(sample["p.number"] < 2)} for sample in numbers(5)]
    result = sweep(counted(tmp_path), samples, measure=root, output=tmp_path / "out", executor="processes", workers=1)
    assert [str(error) for error in result["error"].to_numpy()] == [
        "ValueError: number 0 is out of order",
        "ValueError: number 1 is out of order",
        *[""] * 3,
    ]
    np.testing.assert_array_equal(result["root"], [np.nan, np.nan, 2.0, 3.0, 4.0])
    # the files of the runs before the first measure have its column too
    assert all("root" in pyarrow.dataset.dataset(file).schema.names for file in (tmp_path / "out").glob("runs-*"))


def test_measures_that_fail_or_change_their_names_are_errors_of_their_runs(tmp_path: Path) -> None:
    result = sweep(counted(tmp_path), numbers(5), measure=picky, executor="serial")
    np.testing.assert_array_equal(result["root"], [0.0, 1.0, np.nan, np.nan, 4.0])
    assert "the measures are called other but were root in an earlier run" in str(result["error"][2].item())
    assert "the measure sweep_systems.picky failed with ZeroDivisionError: no three" in str(result["error"][3].item())


def test_warnings_of_a_run_stand_in_its_row(caplog: pytest.LogCaptureFixture) -> None:
    """A mass and a spring that exchange stale values blow up: harness.engine.defect says so once in a run."""
    spring = CallablePart(
        "spring", lambda t, u, x: 1e3 * x[0], ["v"], ["F"], advance=lambda t, h, u, x: x + h * u, state=[0.01]
    )
    mass = CallablePart(
        "mass",
        lambda t, u, x: x,
        ["F"],
        ["v"],
        advance=lambda t, h, u, x: x - h * u,
        state=[0.0],
        dependencies={"v": ()},
    )
    system = System([mass, spring], ["mass.v -> spring.v", "spring.F -> mass.F"])
    experiment = Experiment(stop=1.0, step=0.05, master="jacobi")
    result = sweep(system, [{"step": 0.05}, {"step": 1e-4}], executor="serial", experiment=experiment)
    rough, fine = (str(text) for text in result["warnings"].to_numpy())
    assert "the result is wrong" in rough
    assert fine == ""
    assert not caplog.records
    assert logging.getLogger("harness").propagate


def test_system_that_is_copied_runs_as_the_first(build_fmu: BuildFmu) -> None:
    import pickle

    with System([FmuPart("f", build_fmu("LuGre"))], start={"f.v": 1e-3}) as system:
        copy = pickle.loads(pickle.dumps(system))
        with copy:
            assert copy.run(stop=0.1, step=1e-3).identical(system.run(stop=0.1, step=1e-3))


# ---- folders ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("executor", LOCAL)
def test_interrupted_sweep_goes_on_where_it_stopped(tmp_path: Path, executor: str) -> None:
    arguments = {"measure": root, "output": tmp_path / "out", "executor": executor, "workers": 2}
    with pytest.raises(KeyboardInterrupt):
        sweep(counted(tmp_path), numbers(20, wait=0.02), **arguments, progress=StopAt(5))
    done = read_sweep(tmp_path / "out")
    assert 5 <= done.sizes["run"] < 20
    result = sweep(counted(tmp_path), numbers(20, wait=0.02), **arguments)
    np.testing.assert_array_equal(result["root"], np.arange(20.0))
    times = Counter(number for number, _ in log_of(tmp_path))
    assert sorted(times) == list(range(20))
    assert all(times[int(run)] == 1 for run in done["run"])


def test_sweep_that_is_done_does_nothing_more(tmp_path: Path) -> None:
    for _ in range(2):
        result = sweep(counted(tmp_path), numbers(6), measure=root, output=tmp_path / "out", executor="serial")
        assert result.sizes["run"] == 6
    assert len(log_of(tmp_path)) == 6


@nightly
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="what lives is read from /proc")
def test_killed_sweep_loses_nothing_and_leaves_no_process(tmp_path: Path) -> None:
    """kill -9 of the process that does the sweep; its workers end by themselves."""
    program = (
        "import sys; from pathlib import Path; from sweep_systems import *; from harness import sweep\n"
        "if __name__ == '__main__':\n"
        "    samples = [{'p.number': k, 'p.wait': 0.02} for k in range(60)]\n"
        "    folder = Path(sys.argv[1])\n"
        "    sweep(counted(folder), samples, measure=root, output=folder / 'out', workers=2)\n"
    )
    (tmp_path / "program.py").write_text(program)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    command = [sys.executable, str(tmp_path / "program.py"), str(tmp_path)]
    process = subprocess.Popen(command, env=environment)
    while len(list((tmp_path / "out").glob("runs-*"))) < 3 or len(log_of(tmp_path)) < 12:
        assert process.poll() is None
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    done = set(read_sweep(tmp_path / "out")["run"].to_numpy())
    assert 3 <= len(done) < 60
    deadline = time.monotonic() + 10.0
    while any(alive(worker) for _, worker in log_of(tmp_path)):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    result = sweep(
        counted(tmp_path), numbers(60, wait=0.02), measure=root, output=tmp_path / "out", executor="threads", workers=4
    )
    np.testing.assert_array_equal(result["root"], np.arange(60.0))
    times = Counter(number for number, _ in log_of(tmp_path))
    assert all(times[int(run)] == 1 for run in done)
    # what was under way: a chunk for each of two workers, of half a second or less
    assert sum(times.values()) - 60 <= 2 * 0.5 / 0.02


def alive(process: int) -> bool:
    """Whether it runs; a dead one may stay in the table until somebody asks for its status."""
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"


def test_folder_of_another_sweep_is_refused(tmp_path: Path) -> None:
    out = tmp_path / "out"
    sweep(counted(tmp_path), numbers(3), measure=root, output=out, executor="serial")
    with pytest.raises(SweepError, match="out contains another sweep, which differs in samples: give another folder"):
        sweep(counted(tmp_path), numbers(3, wait=0.001), measure=root, output=out, executor="serial")
    with pytest.raises(SweepError, match="differs in measures:"):
        sweep(counted(tmp_path), numbers(3), measure="final(p.y)", output=out, executor="serial")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.tex").touch()
    with pytest.raises(SweepError, match="other contains files but no sweep"):
        sweep(counted(tmp_path), numbers(3), measure=root, output=tmp_path / "other", executor="serial")
    with pytest.raises(SweepError, match="contains no sweep"):
        read_sweep(tmp_path / "other")


def test_folder_without_a_finished_run_is_free_for_another_sweep(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        sweep(counted(tmp_path), numbers(3), output=tmp_path / "out", executor="serial", progress=StopAt(0))
    result = sweep(counted(tmp_path), numbers(4), measure=root, output=tmp_path / "out", executor="serial")
    assert result.sizes["run"] == 4


def test_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match=r"cannot make the folder .*file"):
        sweep(counted(tmp_path), numbers(3), output=tmp_path / "file", executor="serial")


def test_changed_fmu_is_another_sweep(build_fmu: BuildFmu, tmp_path: Path) -> None:
    for fc in (1.0, 1.1):
        path = build_fmu("LuGre", Fc=fc, Fs=1.5)
        with System([FmuPart("f", path)], start={"f.v": 1e-3}, experiment=ONE_TICK) as system:
            if fc == 1.0:
                sweep(system, grid({"f.vs": [1e-3]}), output=tmp_path, executor="serial")
                continue
            with pytest.raises(SweepError, match="differs in system:"):
                sweep(system, grid({"f.vs": [1e-3]}), output=tmp_path, executor="serial")


def test_two_processes_do_not_write_to_one_folder(tmp_path: Path) -> None:
    fcntl = pytest.importorskip("fcntl")
    (tmp_path / "out").mkdir()
    with (tmp_path / "out" / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with pytest.raises(SweepError, match="another process is running the sweep"):
            sweep(counted(tmp_path), numbers(3), measure=root, output=tmp_path / "out", executor="serial")


# ---- workers ------------------------------------------------------------------------------------------------------


def test_killed_worker_loses_no_run(tmp_path: Path) -> None:
    """Run 7 kills its process once, run 12 always."""
    samples = [{**sample, "p.kill": {7: 1, 12: 2}.get(int(sample["p.number"]), 0)} for sample in numbers(20)]
    result = sweep(counted(tmp_path), samples, measure=root, executor="processes", workers=2)
    np.testing.assert_array_equal(result["root"], [np.nan if k == 12 else k for k in range(20)])
    errors = {k: str(text) for k, text in enumerate(result["error"].to_numpy()) if text}
    assert errors == {12: "3 worker processes died in this run: check whether an FMU crashes"}
    assert len({process for _, process in log_of(tmp_path)}) >= 5


@nightly
def test_script_without_a_guard_is_told_so(tmp_path: Path) -> None:
    """Every worker would begin the sweep once more, and fails in that."""
    program = (
        "import sys; from pathlib import Path; from sweep_systems import *; from harness import sweep\n"
        "sweep(counted(Path(sys.argv[1])), [{'p.number': 1}], measure=root, workers=1)\n"
    )
    (tmp_path / "program.py").write_text(program)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    command = [sys.executable, str(tmp_path / "program.py"), str(tmp_path)]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 1
    assert "call sweep below if __name__ == '__main__'" in run.stderr


@pytest.mark.parametrize(
    ("system", "options", "message"),
    [
        (None, {"measure": lambda result: {"y": 1.0}}, "measure .*lambda.* cannot be sent to another process"),
        (
            lambda: System([]),
            {"experiment": ONE_TICK, "measure": root},
            "function that makes the system cannot be sent",
        ),
        (None, {"executor": "cloud"}, "'cloud' is not an executor of sweeps"),
        (None, {"workers": 0}, "give 1 or more"),
        (None, {"measure": "rms p.y"}, "'rms p.y' is not a measure"),
        (None, {"measure": []}, "measures nothing"),
        (None, {"keep": ["*"]}, "no folder"),
    ],
)
def test_what_cannot_be_swept_is_refused(
    tmp_path: Path, system: object, options: dict[str, object], message: str
) -> None:
    with pytest.raises(SweepError, match=message):
        sweep(system or counted(tmp_path), [{"stop": 1.0}], **options)  # type: ignore[arg-type]


def test_unknown_names_are_refused_before_anything_runs(tmp_path: Path) -> None:
    for samples, options, message in [
        ([{"p.nubmer": 1}], {}, "did you mean 'number'"),
        ([{"p.number": 1}, {"q.number": 1}], {}, "'q'"),
        (
            [{"stopp": 1.0}],
            {},
            "'stopp' is neither a variable 'part.port' nor a setting of the experiment: did you mean 'stop'",
        ),
        ([{"p.number": 1}], {"measure": "rsm(p.y)"}, "no measure 'rsm': did you mean 'rms'"),
        ([{"p.number": 1}], {"measure": "rms(p.z)"}, "no variable 'z'"),
        ([{"p.number": 1}], {"keep": ["q.*"], "output": tmp_path / "out"}, "no output matches"),
    ]:
        with pytest.raises((SweepError, UnknownNameError), match=message):
            sweep(counted(tmp_path), samples, executor="serial", **options)  # type: ignore[arg-type]
    assert not (tmp_path / "log").exists()


def test_system_of_lambdas_goes_with_the_serial_executor_only() -> None:
    system = System(
        [CallablePart("p", lambda t, u, x: 2 * u[0], ["u"], ["y"])], experiment=ONE_TICK, start={"p.u": 0.0}
    )
    samples = grid({"p.u": [1.0, 2.0]})
    np.testing.assert_array_equal(sweep(system, samples, executor="serial")["final(p.y)"], [2.0, 4.0])
    with pytest.raises(SweepError, match="cannot be copied for several workers"):
        sweep(system, samples, executor="threads")


@nightly
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="resident memory is read from /proc")
def test_memory_does_not_grow_from_run_to_run(build_fmu: BuildFmu) -> None:
    resident = []

    class Meter:
        def update(self, done: int, total: int) -> None:
            pages = int(Path("/proc/self/statm").read_text().split()[1])
            resident.append((done, pages * os.sysconf("SC_PAGE_SIZE") / 1e6))

    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("LuGre"))]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
    samples = latin_hypercube({"mass.m": (0.5, 2.0)}, 2000, seed=1)
    with System(parts, wires, {"mass.F_drive": 2.0}) as system:
        experiment = Experiment(stop=0.5, step=1e-3)
        sweep(system, samples, executor="serial", experiment=experiment, progress=Meter())
    early = next(size for done, size in resident if done >= 600)
    assert resident[-1][1] - early < 3.0


# ---- dask ---------------------------------------------------------------------------------------------------------


@nightly
def test_dask_cluster_and_a_worker_of_it_that_is_killed(build_fmu: BuildFmu, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        samples = [{**sample, "p.kill": int(sample["p.number"] == 7)} for sample in numbers(30, wait=0.01)]
        result = sweep(counted(tmp_path), samples, measure=root, output=tmp_path / "out", executor=client)
        np.testing.assert_array_equal(result["root"], np.arange(30.0))
        assert len({process for _, process in log_of(tmp_path)} - {os.getpid()}) >= 2

        start = {"mass.F_drive": 3.0, "mass.F_friction": 0.0}
        with System([FmuPart("mass", build_fmu("Mass"))], start=start, experiment=ONE_TICK) as system:
            result = sweep(system, grid({"mass.m": [1.0, 2.0, 4.0]}), measure="final(mass.x)", executor=client)
        np.testing.assert_allclose(result["final(mass.x)"], 1.5 / result["mass.m"], rtol=1e-12)


@nightly
@pytest.mark.skipif("forkserver" not in multiprocessing.get_all_start_methods(), reason="needs a fork server")
@pytest.mark.parametrize("when", some(["before", "while the first worker starts"], ["before"]))
def test_a_fork_server_that_is_killed(when: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The killed one took the sweep along with an EOFError or a ConnectionRefusedError; a new one is started."""
    server: Any = forkserver
    server.ensure_running()
    killed: list[int] = []
    connect = server.connect_to_new_process

    def kill() -> None:
        if not killed:
            killed.append(server._forkserver._forkserver_pid)
            os.kill(killed[0], signal.SIGKILL)

    def killing(fds: object) -> object:
        ends = connect(fds)
        kill()
        return ends

    if when == "before":
        kill()
    monkeypatch.setattr(server, "connect_to_new_process", killing)
    result = sweep(counted(tmp_path), numbers(2), workers=1)
    assert killed
    assert server._forkserver._forkserver_pid != killed[0]
    assert set(result["error"].to_numpy()) == {""}


def test_workers_that_cannot_be_started_are_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise EOFError("unexpected EOF")

    monkeypatch.setattr(pools, "_PAUSES", (0.0, 0.0))
    monkeypatch.setattr(pools, "_Slot", refuse)
    with pytest.raises(SweepError, match=r"no worker process .* \(unexpected EOF\): use fewer workers"):
        sweep(counted(tmp_path), numbers(2), workers=1)


def test_nan_in_an_integer_is_null_in_the_trajectories(tmp_path: Path) -> None:
    """The other runs of the same file have integers."""
    port = Port("y", type="Integer")
    part = CallablePart("p", lambda t, u, x: u[0] if u[0] > 0.0 else np.nan, ["u"], [port])
    with System([part], start={"p.u": 0.0}, experiment=ONE_TICK) as system:
        samples = [{"p.u": value} for value in (1.0, 0.0, 2.0)]
        table = sweep(system, samples, output=tmp_path / "out", executor="serial", keep=["p.y"])
    assert list(table["error"].to_numpy()) == ["", "", ""]
    kept = pyarrow.dataset.dataset(tmp_path / "out" / "_trajectories").to_table().sort_by("run")
    assert kept["p.y"].to_pylist() == [1, 1, None, None, 2, 2]
    assert kept.schema.field("p.y").type == "int64"


# ---- workers of a cluster -----------------------------------------------------------------------------------------


def chunk_of(tmp_path: Path, wait: float) -> tuple[Job, list[tuple[int, Any]]]:
    job = Job(f"key of {tmp_path}", counted(tmp_path), ONE_TICK, ())
    return job, [*enumerate(numbers(3, wait=wait))]


def test_a_system_that_runs_is_closed_after_its_run(tmp_path: Path) -> None:
    """Ctrl-C in a sweep on a cluster closed it at once, which ended the worker with a segmentation fault."""
    job, chunk = chunk_of(tmp_path, 0.5)
    with ThreadPoolExecutor() as pool:
        found = pool.submit(run_chunk, job, chunk)
        while not (tmp_path / "log").exists():
            time.sleep(0.01)
        close_runners(job.key)
        assert [key for key in worker._runners if key[0] == job.key]
        assert [outcome.run for outcome in found.result()] == [0]
    assert not [key for key in worker._runners if key[0] == job.key]
    assert run_chunk(job, chunk) == []


def test_a_system_that_nobody_uses_is_closed(tmp_path: Path) -> None:
    """The process of the sweep may have been killed."""
    job, chunk = chunk_of(tmp_path, 0.0)
    assert [outcome.error for outcome in run_chunk(job, chunk, idle=0.2)] == [None, None, None]
    assert [key for key in worker._runners if key[0] == job.key]
    deadline = time.monotonic() + 20.0
    while [key for key in worker._runners if key[0] == job.key] and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not [key for key in worker._runners if key[0] == job.key]
    assert len(run_chunk(job, chunk, idle=0.2)) == 3
    close_runners(job.key)


@pytest.mark.parametrize("fault", [OSError("Timed out trying to connect"), RuntimeError("cannot schedule"), "closed"])
def test_a_scheduler_that_is_gone(tmp_path: Path, fault: Exception | str) -> None:
    class Client:
        """What a sweep calls, without an answer."""

        status = fault if isinstance(fault, str) else "running"

        def get_executor(self, **_: object) -> Client:
            return self

        def nthreads(self) -> None:
            assert isinstance(fault, Exception)
            raise fault

        def shutdown(self, *, wait: bool) -> None:
            raise ConnectionError("gone")

    pytest.importorskip("distributed")
    with pytest.raises(SweepError, match=r"lost the dask scheduler \(.*\): start it again"):
        sweep(counted(tmp_path), numbers(3), measure=root, executor=Client())


def test_a_cluster_without_workers_is_told_once(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A restart of the workers may lose them all."""
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(pools, "LOOK", 0.0)
    with (
        distributed.LocalCluster(n_workers=0, processes=False, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        pool = pools.DaskPool(client)
        assert [pool.capacity() for _ in range(3)] == [2, 2, 2]
        assert [record.message for record in caplog.records if "no worker" in record.message] == [
            "the dask cluster has no worker: the sweep waits for one; start workers, or press Ctrl-C"
        ]
        cluster.scale(1)
        client.wait_for_workers(1, timeout=60)
        assert pool.capacity() >= 2
        assert pool._worked is not None
