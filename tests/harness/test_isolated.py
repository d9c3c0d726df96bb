"""FMUs in processes of their own: the same results, and whatever an FMU does to its process, the harness goes on."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from thorough import nightly

from harness import (
    CallablePart,
    FmuPart,
    HarnessError,
    PartError,
    Port,
    Result,
    StartValueError,
    System,
    SystemFileError,
)

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")

CONSTANTS = {"u": 3.0, "n": 4, "b": True}


def children(parent: int) -> dict[int, str]:
    """Processes that a process started, with their states; Z is a dead one that was not waited for."""
    found = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, owner, *_ = path.read_text().rpartition(")")[2].split()
            if int(owner) == parent:
                found[int(path.parent.name)] = state
    return found


def command(process: int) -> str:
    return Path(f"/proc/{process}/cmdline").read_text()


def seconds(process: int) -> float:
    """Time that a process has computed."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return int(fields[11]) / os.sysconf("SC_CLK_TCK")


@pytest.fixture(autouse=True)
def nothing_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """After each test: no process, no zombie, no temporary file."""
    before = set(children(os.getpid()))
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    yield
    assert set(children(os.getpid())) == before
    assert list(folder.iterdir()) == []


def run_alone(name: str, path: Path, *, timeout: float = 20.0, stop: float = 1.0, **start: float | str):
    values = {f"{name}.{key}": value for key, value in (CONSTANTS | start).items()}
    with System([FmuPart(name, path, isolate=True, timeout=timeout)], start=values) as system:
        return system.run(stop=stop, step=0.25)


def failure(name: str, path: Path, **options: float) -> PartError:
    with pytest.raises(PartError) as caught:
        run_alone(name, path, **options)
    return caught.value


@pytest.mark.parametrize(
    ("name", "end"),
    [
        ("segfault", "its process died of SIGSEGV (Segmentation fault)"),
        ("quit", "its process ended with exit status 3"),
    ],
)
def test_a_step_that_kills_the_process_ends_the_run(name: str, end: str, probe: Path) -> None:
    error = failure(name, probe, fail_time=0.6)
    assert str(error) == f"part '{name}' failed in fmi2DoStep at t = 0.5 s: {end}"
    assert error.result is not None
    np.testing.assert_array_equal(error.result["time"], [0.0, 0.25, 0.5])
    np.testing.assert_array_equal(error.result[f"{name}.x"], [0.0, 0.75, 1.5])


@nightly
@pytest.mark.parametrize(
    ("name", "said"),
    [pytest.param("loop", "", marks=nightly), ("restless", "; it last logged 'still at it [logStatusWarning]'")],
)
def test_a_step_without_end_is_ended_when_the_time_is_over(name: str, said: str, probe: Path) -> None:
    begin = time.monotonic()
    error = failure(name, probe, fail_time=0.6, timeout=2.0)
    assert time.monotonic() - begin < 20.0
    assert str(error) == (
        f"part '{name}' failed in fmi2DoStep at t = 0.5 s: its process did not answer within 2 s and was killed{said}"
    )
    assert error.result is not None
    np.testing.assert_array_equal(error.result[f"{name}.x"], [0.0, 0.75, 1.5])


# what is sampled at 0.75 s is handed over in the same step, by jacobi in the next one
@pytest.mark.parametrize(("master", "end"), [("gauss-seidel", 0.75), ("jacobi", 1.0), ("newton", 0.75)])
def test_an_input_that_kills_the_process(master: str, end: float, probe: Path) -> None:
    source = CallablePart("s", lambda t, u, x: 13.0 if t > 0.6 else t, outputs=["r"], sampled=True)
    start = {"abort.n": 1, "abort.b": False}
    with (
        System([FmuPart("abort", probe, isolate=True), source], ["s.r -> abort.u"], start) as system,
        pytest.raises(PartError) as caught,
    ):
        system.run(stop=2.0, step=0.25, master=master)
    assert str(caught.value) == (
        f"part 'abort' failed in fmi2SetXXX at t = {end:g} s: its process died of SIGABRT (Aborted); "
        "it last logged '13 is too much [logStatusFatal]'"
    )
    assert caught.value.result is not None
    np.testing.assert_array_equal(caught.value.result["time"], np.arange(0.0, end + 0.1, 0.25))


def test_an_fmu_that_dies_at_birth(probe: Path) -> None:
    error = failure("unborn", probe)
    assert str(error) == (
        "part 'unborn' failed in its initialisation at t = 0 s: its process died of SIGSEGV (Segmentation fault)"
    )
    assert error.result is None


def test_an_fmu_that_cannot_be_freed_leaves_the_result_alone(probe: Path, caplog: pytest.LogCaptureFixture) -> None:
    result = run_alone("clinging", probe)
    np.testing.assert_array_equal(result["clinging.x"], 0.75 * np.arange(5))
    assert "part 'clinging' failed in fmi2FreeInstance: its process died of SIGSEGV" in caplog.text


def test_a_system_survives_the_death_of_a_part_and_runs_again(probe: Path) -> None:
    parts = [FmuPart("segfault", probe, isolate=True), FmuPart("calm", probe, isolate=True)]
    start = {f"{part.name}.{key}": value for part in parts for key, value in CONSTANTS.items()}
    with System(parts, start=start) as system:
        with pytest.raises(PartError, match=r"'segfault'.*SIGSEGV"):
            system.with_start({"segfault.fail_time": 0.6}).run(stop=1.0, step=0.25)
        result = system.run(stop=1.0, step=0.25)
    np.testing.assert_array_equal(result["calm.x"], 0.75 * np.arange(5))
    np.testing.assert_array_equal(result["segfault.x"], 0.75 * np.arange(5))


def test_a_process_that_was_killed_from_outside(probe: Path) -> None:
    before = set(children(os.getpid()))
    part = FmuPart("p", probe, isolate=True)
    part.enter_initialisation(0.0, 1.0, None, CONSTANTS)
    (process,) = set(children(os.getpid())) - before
    os.kill(process, signal.SIGKILL)
    with pytest.raises(PartError, match=r"fmi2ExitInitializationMode: its process died of SIGKILL \(Killed\)"):
        part.exit_initialisation()
    part.terminate()
    part.enter_initialisation(0.0, 1.0, None, CONSTANTS)
    calls = part.bind(["u"], ["y"], np.ones(1), np.zeros(1))
    (process,) = set(children(os.getpid())) - before
    os.kill(process, signal.SIGKILL)
    with pytest.raises(PartError, match="the exchange of values: its process died of SIGKILL"):
        calls.get()
    part.close()
    part.close()


def test_isolation_changes_no_bit(probe: Path) -> None:
    """All types, an output that reads its input directly, a ring through a Python part, in two runs."""
    results: dict[str, list[Result]] = {master: [] for master in ("gauss-seidel", "jacobi", "newton")}
    for isolate in (False, True):
        parts = [
            FmuPart("p", probe, isolate=isolate),
            CallablePart(
                "c",
                lambda t, u, x: [np.sin(u[0]) - x[0], round(8 * t), u[1] > 1.0],
                ["x", "y"],
                [Port("r"), Port("i", type="Integer"), Port("b", type="Boolean")],
                advance=lambda t, h, u, x: x + h * u[1],
                state=[1.0],
                dependencies={"r": ["x"], "i": [], "b": ["y"]},
            ),
        ]
        wires = ["c.r -> p.u", "c.i -> p.n", "c.b -> p.b", "p.x -> c.x", "p.y -> c.y"]
        with System(parts, wires, {"p.gain": 1.5}) as system:
            for _ in range(2):
                for master, found in results.items():
                    found.append(system.run(stop=5.0, step=0.125, master=master, record=["*", "p.gain"]))
    for found in results.values():
        assert [result.identical(found[0]) for result in found] == [True] * 4


def test_save_and_restore(probe: Path) -> None:
    part = FmuPart("p", probe, isolate=True)
    part.enter_initialisation(0.0, 1.0, None, {"u": 1.0})
    u, y = np.array([1.0]), np.zeros(2)
    calls = part.bind(["u"], ["y", "x"], u, y)
    part.exit_initialisation()
    calls.step(0.0, 0.5)
    u[0] = 2.0
    calls.set()
    state = part.save()  # with the input 2
    u[0] = 5.0
    calls.set()
    seen = []
    for _ in range(2):
        part.restore(state)
        calls.get()
        seen.append(y.tolist())
        calls.step(0.5, 0.25)
        calls.get()
        seen.append(y.tolist())
    assert seen == [[2.0, 0.5], [2.0, 1.0]] * 2
    assert part.save(state) == state
    part.terminate()
    with pytest.raises(PartError, match="this state belongs to another run"):
        part.restore(state)
    part.close()


def test_a_run_goes_on_in_a_process_of_its_own(build_fmu: Callable[..., Path], tmp_path: Path) -> None:
    """And in this one again, from checkpoints; the friction's bristle is a state that no output shows."""
    settings = {"step": 1e-3, "start": 0.0}

    def system(isolate: bool) -> System:
        parts = [FmuPart(name, build_fmu(name), isolate=isolate) for name in ("Mass", "LuGre")]
        return System(parts, ["Mass.v -> LuGre.v", "LuGre.F -> Mass.F_friction"], {"Mass.F_drive": 2.0})

    with system(False) as here, system(True) as there:
        whole = here.run(stop=0.3, **settings)
        here.run(stop=0.1, checkpoint=tmp_path / "one", **settings)
        there.run(stop=0.2, resume=tmp_path / "one", checkpoint=tmp_path / "two", **settings)
        last = here.run(stop=0.3, resume=tmp_path / "two", **settings)
    for name in whole.data_vars:
        np.testing.assert_array_equal(last[name], whole[name][200:])


def test_messages_and_refusals_come_through(probe: Path, caplog: pytest.LogCaptureFixture) -> None:
    start = {f"p.{key}": value for key, value in CONSTANTS.items()} | {"p.fail_time": 0.6, "p.label": "belt"}
    with System([FmuPart("p", probe, isolate=True)], start=start) as system:
        for status, label, level in ((2, "Discard", 30), (3, "Error", 40), (4, "Fatal", 50)):
            caplog.clear()
            with caplog.at_level(logging.DEBUG, "harness"), pytest.raises(PartError) as caught:
                system.with_start({"p.fail_status": status}).run(stop=1.0, step=0.25)
            assert str(caught.value) == (
                f"part 'p' failed in fmi2DoStep at t = 0.5 s: it returned {label} and logged 'belt seized'"
            )
            assert caught.value.result is not None
            assert [(r.name, r.levelno, r.getMessage()) for r in caplog.records] == [
                ("harness.p", level, "belt seized [logStatusError]")
            ]
        with pytest.raises(StartValueError, match=r"rejected the start value -1.0 of gain.*'gain = -1 is below 0'"):
            system.with_start({"p.gain": -1.0}).run(stop=1.0, step=0.25)


@pytest.mark.parametrize("timeout", [0.0, -1.0, float("nan"), float("inf")])
def test_a_timeout_that_makes_no_sense(timeout: float, probe: Path) -> None:
    with pytest.raises(HarnessError, match="give a positive number of seconds"):
        FmuPart("p", probe, isolate=True, timeout=timeout)


@nightly
def test_the_process_ends_with_the_harness(probe: Path, tmp_path: Path) -> None:
    """Even if the harness is killed while the FMU is in an endless loop."""
    program = (
        "from harness import FmuPart, System, Tap\n"
        "start = {'loop.u': 1.0, 'loop.n': 1, 'loop.b': False, 'loop.fail_time': 0.1}\n"
        f"system = System([FmuPart('loop', {str(probe)!r}, isolate=True, timeout=60.0)], start=start)\n"
        "started = Tap(lambda t, values: print('started', flush=True), ())\n"
        "system.run(stop=1.0, step=0.25, taps=[started])\n"
    )
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    with subprocess.Popen([sys.executable, "-c", program], env=environment, stdout=subprocess.PIPE) as harness:
        try:
            assert harness.stdout is not None
            harness.stdout.readline()
            (process,) = (pid for pid in children(harness.pid) if "harness.parts.isolated" in command(pid))
            begin = seconds(process)
            while seconds(process) < begin + 0.3:  # in its loop
                time.sleep(0.05)
        finally:
            harness.kill()
    deadline = time.monotonic() + 20.0
    status = Path(f"/proc/{process}/stat")
    # a dead one is for its new parent to wait for
    while status.exists() and ") Z " not in status.read_text():
        if time.monotonic() > deadline:
            os.kill(process, signal.SIGKILL)
            pytest.fail("the process of the FMU outlived the harness")
        time.sleep(0.05)


def test_isolation_in_a_system_file(make_fmu: Callable[..., Path], tmp_path: Path) -> None:
    make_fmu()
    path = tmp_path / "system.toml"
    path.write_text(
        "[parts.quit]\nfmu = 'probe.fmu'\nisolate = true\ntimeout = 5\n"
        "[parts.quit.start]\nu = 1.0\nn = 1\nb = false\nfail_time = 0.6\n[experiment]\nstop = 1.0\nstep = 0.25\n"
    )
    with System.from_toml(path) as system:
        system.to_toml(tmp_path / "again.toml")
        with pytest.raises(PartError, match="exit status 3"):
            system.run()
    with System.from_toml(tmp_path / "again.toml") as system:
        part = system.parts["quit"]
        assert isinstance(part, FmuPart)
        assert (part.isolate, part.timeout) == (True, 5.0)


@pytest.mark.parametrize("line", ["isolate = 1", "timeout = 'long'", "timeout = true"])
def test_bad_isolation_in_a_system_file(line: str, make_fmu: Callable[..., Path], tmp_path: Path) -> None:
    make_fmu()
    path = tmp_path / "system.toml"
    path.write_text(f"[parts.p]\nfmu = 'probe.fmu'\n{line}\n")
    with pytest.raises(SystemFileError, match=f"part 'p' .* has {line.split()[0]} = "):
        System.from_toml(path)
