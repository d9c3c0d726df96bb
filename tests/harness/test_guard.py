"""FMUs in this process that change what belongs to all of it: put back, and said which one it was."""

from __future__ import annotations

import ctypes
import locale
import os
import platform
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from thorough import nightly, some

from harness import CallablePart, Drive, FmuPart, HarnessError, PartError, Result, System
from harness.compiling.engine_library import library

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the probe calls POSIX functions")

X86 = platform.machine() == "x86_64"
NAMES = {
    "rounding": "the rounding mode",
    "tiny": "the treatment of denormal numbers",
    "x87": "the precision of the x87 unit",
    "directory": "the working directory",
    "locale": "the locale",
}
FLOATS = ("rounding", "tiny", "x87") if X86 else ("rounding",)
ALL = (*FLOATS, "directory", "locale")
SAMPLES = {"u": 3.0, "n": 4, "b": True}


def surroundings() -> tuple[int, str, str]:
    return library().engine_float_control(), str(Path.cwd()), locale.setlocale(locale.LC_ALL)


@pytest.fixture(autouse=True)
def everything_is_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.chdir(tmp_path)
    chosen = locale.setlocale(locale.LC_ALL)
    try:
        locale.setlocale(locale.LC_ALL, "C.UTF-8")
    except locale.Error:
        pytest.skip("there is no second locale")
    before = surroundings()
    yield
    assert surroundings() == before
    locale.setlocale(locale.LC_ALL, chosen)


def system_with(name: str, probe: Path, **start: float) -> System:
    """The FMU beside one whose results show how numbers are rounded: x grows by 0.1 u, y = u / 3 in a way."""
    parts = [FmuPart("victim", probe), FmuPart(name, probe)]
    values = {f"victim.{key}": value for key, value in SAMPLES.items()} | {"victim.u": 0.1, "victim.gain": 1.0 / 3.0}
    values |= {f"{name}.{key}": value for key, value in (SAMPLES | start).items()}
    return System(parts, start=values)


def victim(result: Result) -> list[bytes]:
    return [result[name].to_numpy().tobytes() for name in ("victim.x", "victim.y")]


def closed_form(steps: int) -> list[float]:
    """The state of the victim as the processor of this thread adds it up, rounded to nearest."""
    x = [0.0]
    for _ in range(steps):
        x.append(x[-1] + 0.1 * 0.1)
    return x


@pytest.mark.parametrize("when", ["birth", "start", "end"])
@pytest.mark.parametrize("what", ALL)
def test_a_change_before_or_after_the_steps(
    what: str, when: str, probe: Path, caplog: pytest.LogCaptureFixture
) -> None:
    name = f"{what}_{when}"
    before = surroundings()
    with system_with(name, probe) as system:
        result = system.run(stop=10.0, step=0.1)
        assert surroundings() == before
    assert result["victim.x"].to_numpy().tolist() == closed_form(100)
    assert caplog.messages == [
        f"part '{name}' changed {NAMES[what]} of the whole process, now restored: "
        "correct the FMU; the command check names the call"
    ]


@pytest.mark.parametrize("what", ALL)
def test_a_change_while_the_library_is_loaded(
    what: str, probe: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """The working directory is put back with that of fmpy, which changes it as well."""
    monkeypatch.setenv("AT_LOAD", what)
    with System([FmuPart("p", probe)], start={f"p.{key}": value for key, value in SAMPLES.items()}) as system:
        system.run(stop=1.0, step=0.1)
    text = f"part 'p' changed {NAMES[what]} of the whole process"
    assert [text in message for message in caplog.messages] == [True] * (what != "directory")


@pytest.mark.parametrize("what", ALL)
def test_a_change_while_the_library_is_unloaded(
    what: str, probe: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("AT_UNLOAD", what)
    with System([FmuPart("p", probe)], start={f"p.{key}": value for key, value in SAMPLES.items()}) as system:
        system.run(stop=1.0, step=0.1)
    assert f"part 'p' changed {NAMES[what]} of the whole process" in caplog.text


@pytest.mark.parametrize("master", ["jacobi", "gauss-seidel", "newton"])
@pytest.mark.parametrize("fail_time", [0.0, 1234.56])
@pytest.mark.parametrize("what", FLOATS)
def test_floats_that_a_step_changes_end_the_run(what: str, fail_time: float, master: str, probe: Path) -> None:
    name = f"{what}_step"
    with system_with(name, probe, fail_time=fail_time) as system, pytest.raises(PartError) as caught:
        system.run(stop=2000.0, step=0.1, master=master)
    assert caught.value.part == name
    assert f"it changed {NAMES[what]} of the whole process, which affects all parts: correct" in str(caught.value)
    # what was recorded is from before, and not much of it is lost
    assert caught.value.result is not None
    x = caught.value.result["victim.x"].to_numpy().tolist()
    assert x == closed_form(len(x) - 1)
    first = int(fail_time / 0.1)
    assert first - 64 <= len(x) - 1 <= first
    assert caught.value.time == pytest.approx(0.1 * (len(x) - 1), abs=1e-9)


def test_floats_that_are_changed_once(probe: Path) -> None:
    """An FMU in Python stands for one that cannot be made to do it again: all that may have been it are named."""
    once = [True]

    def change(t: float, u: object, x: object) -> float:
        if t > 4.95 and once.pop() if once else False:
            library().engine_set_float_control(library().engine_float_control() | 0x6000)
        return t

    parts = [FmuPart("a", probe), FmuPart("b", probe), CallablePart("c", change, outputs=["y"])]
    start = {f"{part}.{key}": value for part in "ab" for key, value in SAMPLES.items()}
    with System(parts, start=start) as system, pytest.raises(HarnessError) as caught:
        system.run(stop=10.0, step=0.1)
    assert "one of the parts 'a', 'b' failed" in str(caught.value)


@pytest.mark.parametrize("what", ["directory", "locale"])
def test_a_step_that_changes_the_directory_or_the_locale(
    what: str, probe: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    name = f"{what}_step"
    with system_with(name, probe, fail_time=0.5) as system:
        result = system.run(stop=10.0, step=0.1)
    assert result["victim.x"].to_numpy().tolist() == closed_form(100)
    assert f"one of the parts 'victim', '{name}' changed {NAMES[what]} of the whole process" in caplog.text


def test_a_drive(probe: Path, caplog: pytest.LogCaptureFixture) -> None:
    drive = Drive(FmuPart("rounding_step", probe))
    before = surroundings()
    for _ in range(2):
        drive.run({"u": np.ones(10)}, ["y"], 0.1, start={"fail_time": 0.5})
        assert surroundings() == before
    drive.close()


@nightly
def test_a_result_is_where_its_path_says(probe: Path, tmp_path: Path) -> None:
    text = f'[experiment]\nstop = 1.0\nstep = 0.1\n[parts.directory_step]\nfmu = "{probe}"\n'
    text += "start = { u = 1.0, n = 1, b = true, fail_time = 0.5 }\n"
    (tmp_path / "system.toml").write_text(text)
    command = [sys.executable, "-m", "friction_fmus", "run", "system.toml", "-o", "out.csv"]
    run = subprocess.run(command, capture_output=True, text=True, check=False, env=environment())
    assert run.returncode == 0
    assert run.stdout == "wrote out.csv: 4 variables, 11 time points (0 to 1 s)\n"
    assert (tmp_path / "out.csv").is_file()
    assert not Path("/out.csv").exists()


def environment(**more: str) -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])} | more


EXITS: dict[str, dict[str, str]] = {
    **{f"exit_{when}": {} for when in ("birth", "start", "step", "end")},
    "load": {"AT_LOAD": "exit"},
    "unload": {"AT_UNLOAD": "exit"},
}


@pytest.mark.parametrize("name", some([*EXITS], [*EXITS][:1]))
def test_an_fmu_that_ends_the_program(name: str, probe: Path, tmp_path: Path) -> None:
    """With status 0, which looked like success; the command ends with 2, and no file is half-written."""
    text, start = "[experiment]\nstop = 1.0\nstep = 0.1\n", "{ u = 1.0, n = 1, b = true, fail_time = 0.5 }"
    for part in ("other", name)["load" in name :]:  # at load, both would do it
        values = start if part == "exit_step" else start.replace("0.5", "9.0")
        text += f'[parts.{part}]\nfmu = "{probe}"\nstart = {values}\n'
    (tmp_path / "system.toml").write_text(text)
    command = [sys.executable, "-m", "friction_fmus", "run", "system.toml", "-o", "out.csv"]
    run = subprocess.run(command, capture_output=True, text=True, check=False, env=environment(**EXITS[name]))
    assert run.stderr == (
        f"part '{name}' called exit(), which ends the whole program; the run is lost: "
        "correct the FMU; the command check names the call\n"
    )
    assert run.returncode == 2
    assert [path.name for path in tmp_path.iterdir() if "out" in path.name] == []


@nightly
def test_a_program_that_ends_by_itself_says_nothing(probe: Path) -> None:
    """Also while a run is going on in another thread."""
    code = (
        "import sys, threading, time\nfrom harness import FmuPart, System\n"
        f"system = System([FmuPart('p', {str(probe)!r})], start={{'p.u': 1.0, 'p.n': 1, 'p.b': True}})\n"
        "run = lambda: system.run(stop=1e3, step=1.0, pace=1.0)\n"
        "threading.Thread(target=run, daemon=True).start()\ntime.sleep(2.0)\nsys.exit(5)\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, env=environment())
    assert (run.returncode, run.stdout, run.stderr) == (5, "", "")


@nightly
@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "backtrace"), reason="this C library has no backtrace()")
def test_threads_have_guards_of_their_own(probe: Path, make_fmu: Callable[..., Path]) -> None:
    """No part is blamed for what another thread is doing, such as loading a library."""
    code = (
        "import logging, threading\nfrom harness import FmuPart, System\nlogging.basicConfig()\n"
        "def run(k):\n"
        f"    with System([FmuPart(f'p{{k}}', {str(probe)!r})]"
        ", start={f'p{k}.u': 1.0, f'p{k}.n': 1, f'p{k}.b': True}) as system:\n"
        "        system.run(stop=1.0, step=0.1)\n"
        "for _ in range(20):\n"
        "    threads = [threading.Thread(target=run, args=(k,)) for k in range(4)]\n"
        "    [thread.start() for thread in threads]\n    [thread.join() for thread in threads]\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, env=environment())
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")


@pytest.mark.parametrize("who", ["part", "thread"])
def test_python_code_of_the_program_may_change_directory_and_locale(
    who: str, probe: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """No part is blamed, and nothing is undone, not even if an FMU then changes the directory."""
    (tmp_path / "own").mkdir()
    later = []

    def change() -> None:
        os.chdir(tmp_path / "own")
        locale.setlocale(locale.LC_ALL, "C")
        later.append(True)

    def act(t: float, u: object, x: object) -> float:
        if t > 0.45 and not later:
            if who == "part":
                change()
            else:
                thread = threading.Thread(target=change)
                thread.start()
                thread.join()
        return t

    for blamed in ([], ["directory_step"]):
        later.clear()
        os.chdir(tmp_path)
        locale.setlocale(locale.LC_ALL, "C.UTF-8")
        parts = [FmuPart(name, probe) for name in ("victim", *blamed)]
        start = {f"{part.name}.{key}": value for part in parts for key, value in SAMPLES.items()}
        with System([*parts, CallablePart("c", act, outputs=["y"])], start=start) as system:
            start = {"directory_step.fail_time": 5.0} if blamed else {}
            system.with_start(start).run(stop=10.0, step=0.1)
        assert later
        assert Path.cwd() == tmp_path / "own"
        assert locale.setlocale(locale.LC_ALL) == "C"
        assert ("changed the working directory" in caplog.text) is bool(blamed)
        assert "locale" not in caplog.text
    os.chdir(tmp_path)
    locale.setlocale(locale.LC_ALL, "C.UTF-8")


def test_one_system_in_two_threads_is_an_error(probe: Path) -> None:
    """The engine would call one instance of an FMU from both; closing it would unload a running FMU."""
    inside, go_on = threading.Event(), threading.Event()

    def wait(t: float, u: object, x: object) -> float:
        inside.set()
        assert go_on.wait(60.0)
        return t

    start = {f"victim.{key}": value for key, value in SAMPLES.items()}
    with System([FmuPart("victim", probe), CallablePart("c", wait, outputs=["y"])], start=start) as system:
        go_on.set()
        alone = system.run(stop=1.0, step=0.1)
        go_on.clear()
        inside.clear()
        with ThreadPoolExecutor() as pool:
            found = pool.submit(system.run, stop=1.0, step=0.1)
            assert inside.wait(60.0)
            for use in (lambda: system.run(stop=1.0, step=0.1), system.close):
                with pytest.raises(HarnessError, match=r"part '(victim|c)' is in use by another run"):
                    use()
            go_on.set()
            assert found.result().identical(alone)
        system.run(stop=1.0, step=0.1)
