"""The compiled engine against the same plan in Python, bit by bit."""

from __future__ import annotations

import gc
import signal
import subprocess
import sys
import threading
import weakref
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from harness_parts import bristle, mass, memoryless
from python_engine import run_in_python

from harness import CallablePart, Experiment, FmuPart, PartError, Port, Result, System, Tap
from harness.run import Options, Session, run

BuildFmu = Callable[..., Path]
WIRES = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]


def same(one: Result, other: Result) -> bool:
    return list(one) == list(other) and all(np.array_equal(one[name], other[name]) for name in one)


def servo(build_fmu: BuildFmu) -> System:
    """Sampled controller, sampled velocity estimate every second tick, plant, friction, and a part in Python."""
    return System(
        [
            FmuPart("profile", build_fmu("Profile")),
            FmuPart("pid", build_fmu("PID")),
            FmuPart("estimate", build_fmu("Differentiator"), every=2),
            FmuPart("mass", build_fmu("Mass")),
            FmuPart("friction", build_fmu("LuGre")),
            CallablePart("gain", lambda t, u, x: 1.5 * u[0], ["u"], ["y"]),
        ],
        [
            "profile.r -> pid.r",
            "mass.x -> pid.x",
            "mass.x -> estimate.x",
            "pid.u -> mass.F_drive",
            *WIRES,
            "mass.v -> gain.u",
        ],
        {
            "estimate.Ts": 2e-3,
            "pid.Ts": 1e-3,
            "pid.Kp": 400.0,
            "pid.Kd": 40.0,
            "pid.rd": 0.0,
            "pid.rdd": 0.0,
            "pid.v": 0.0,
        },
    )


@pytest.mark.parametrize("master", ["jacobi", "gauss-seidel"])
@pytest.mark.parametrize("decimate", [1, 7])
def test_engine_and_python_agree_to_the_last_bit(build_fmu: BuildFmu, master: str, decimate: int) -> None:
    experiment = Experiment(stop=0.7, step=1e-3, master=master, decimate=decimate, record=("*", "mass.F_friction"))
    with servo(build_fmu) as system:
        assert same(run(system, experiment), run_in_python(system, experiment))


def test_taps_and_progress_see_the_same_values(build_fmu: BuildFmu) -> None:
    seen: dict[bool, list[tuple[float, float]]] = {True: [], False: []}

    class Counter:
        def __init__(self) -> None:
            self.calls: list[tuple[int, int]] = []

        def update(self, done: int, total: int) -> None:
            self.calls.append((done, total))

    counters = {True: Counter(), False: Counter()}
    with servo(build_fmu) as system:
        experiment = Experiment(stop=0.2, step=1e-3)
        tap, other = (
            Tap(lambda t, values, rows=rows: rows.append((t, float(values[0]))), ("mass.v",), every=3)
            for rows in seen.values()
        )
        run(system, experiment, Options([tap], counters[True]))
        run_in_python(system, experiment, (other,), counters[False])
    assert seen[True] == seen[False]
    assert len(seen[True]) == 200 // 3 + 1
    assert counters[True].calls == counters[False].calls


def test_error_in_a_python_part_arrives_with_its_time() -> None:
    def function(t: float, u: np.ndarray, x: np.ndarray) -> float:
        if t > 0.55:
            raise ValueError("broken")
        return t

    part = CallablePart("part", function, [], ["y"])
    with pytest.raises(PartError, match=r"part 'part' failed in function at t = 0\.6 s: ValueError: broken") as caught:
        System([part]).run(stop=1.0, step=0.1)
    assert caught.value.result is not None
    np.testing.assert_allclose(caught.value.result["part.y"], np.arange(6) * 0.1)


def test_failing_step_of_an_fmu_arrives_with_its_time_and_message(build_fmu: BuildFmu) -> None:
    system = System(
        [CallablePart("pull", lambda t, u, x: 1e300 * t, [], ["F"]), FmuPart("mass", build_fmu("Mass"))],
        ["pull.F -> mass.F_drive"],
        {"mass.m": 1e-9, "mass.F_friction": 0.0},
    )
    with system, pytest.raises(PartError, match=r"part 'mass' failed in fmi2DoStep at t = .*not finite") as caught:
        system.run(stop=1.0, step=0.1, master="jacobi")
    assert caught.value.result is not None


def test_integer_wire_that_carries_a_fraction_is_refused(make_fmu: Callable[..., Path]) -> None:
    """At the start, when Python sets it, and in a step of the engine."""
    part = FmuPart("probe", make_fmu())
    target = next(port.name for port in part.inputs if port.type == "Integer")
    constants = {"probe.u": 0.0, "probe.b": False}
    for late in (0.0, 0.55):

        def count(t: float, u: np.ndarray, x: np.ndarray, late: float = late) -> float:
            return 0.5 if t >= late else 2.0

        source = CallablePart("count", count, [], [Port("y", type="Integer")])
        system = System([source, part], [f"count.y -> probe.{target}"], constants)
        with pytest.raises(PartError, match="an Integer input got a value that is not a 32-bit integer") as caught:
            system.run(stop=1.0, step=0.1, master="jacobi")
        assert caught.value.time == pytest.approx(0.6 if late else 0.0)


def test_keyboard_interrupt_ends_the_run(build_fmu: BuildFmu) -> None:
    """Ctrl-C arrives although the ticks run in C."""
    with servo(build_fmu) as system:
        timer = threading.Timer(0.3, lambda: signal.raise_signal(signal.SIGINT))
        tap = Tap(lambda t, values: timer.start() if t == 0.0 else None, ("mass.x",), every=10**9)
        before = signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored behind a shell
        try:
            with pytest.raises(KeyboardInterrupt):
                system.run(stop=2000.0, step=1e-3, decimate=1000, taps=[tap])
        finally:
            signal.signal(signal.SIGINT, before)


def test_growing_oscillation_of_a_contact_without_damping_is_warned_of(
    build_fmu: BuildFmu, caplog: pytest.LogCaptureFixture
) -> None:
    """Jacobi feeds the oscillation of a mass that sticks on a GMS contact; Gauss-Seidel, being symplectic, does not."""
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("GMS"))]
    start = {"mass.k": 2.0, "mass.v_support": 0.1, "mass.F_drive": 0.0}
    with System(parts, WIRES, start) as system:
        right = system.run(stop=5.0, step=2.5e-4, record=["mass.v"])
        assert caplog.text == ""
        wrong = system.run(stop=5.0, step=2.5e-4, record=["mass.v"], master="jacobi")
    assert float(abs(wrong["mass.v"]).max()) > 20.0 * float(abs(right["mass.v"]).max())
    assert "the connections friction.F -> mass.F_friction and mass.v -> friction.v drive an undamped" in caplog.text


def test_other_threads_run_beside_the_engine(build_fmu: BuildFmu) -> None:
    """The GIL is free while the ticks run: a thread counts on, several times in every piece."""
    counted, done = [0], threading.Event()

    def count() -> None:
        while not done.wait(1e-3):
            counted[0] += 1

    system = System(
        [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("LuGre"))], WIRES, {"mass.F_drive": 0.5}
    )
    thread = threading.Thread(target=count)
    with system:
        thread.start()
        system.run(stop=1000.0, step=1e-3, decimate=1000)
        done.set()
        thread.join()
    assert counted[0] > 20


def test_two_systems_run_in_two_threads(build_fmu: BuildFmu) -> None:
    results: dict[int, Result] = {}

    def work(number: int) -> None:
        with servo(build_fmu) as system:
            results[number] = system.run(stop=1.0, step=1e-3)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert same(results[0], results[1])


def test_defects_name_the_wire_of_a_loop_that_is_too_stiff(caplog: pytest.LogCaptureFixture) -> None:
    parts = [mass(v0=1e-3), bristle()]
    wires = ["bristle.F -> mass.F", "mass.v -> bristle.v"]
    System(parts, wires).run(stop=0.05, step=1e-4)
    assert not caplog.records
    result = System(parts, wires).run(stop=0.5, step=5e-3)
    assert "bristle.F -> mass.F was held during a step with an error" in caplog.text
    assert "use the master newton or a shorter step" in caplog.text
    assert result.attrs["coupling_error"] > 0.05


def test_jumps_of_coulomb_friction_are_no_defect(caplog: pytest.LogCaptureFixture) -> None:
    """A force that jumps at a reversal is late for one step; a mass on a spring with Coulomb friction, 1000 steps a
    period, is right to a few steps."""

    def swing(t: float, h: float, u: np.ndarray, x: np.ndarray) -> list[float]:
        a = -4.0 * x[0] - u[0]
        v = x[1] + h * a
        return [x[0] + h * v, v]

    oscillator = CallablePart(
        "mass", lambda t, u, x: x, ["F"], ["x", "v"], advance=swing, state=[1.0, 0.0], dependencies={"x": (), "v": ()}
    )
    friction = memoryless("friction", ["v"], ["F"])
    friction.function = lambda t, u, x: 0.01 * np.sign(u[0])
    result = System([oscillator, friction], ["mass.v -> friction.v", "friction.F -> mass.F"]).run(
        stop=20.0, step=3e-3 * np.pi / 3.0 / np.pi
    )
    np.testing.assert_allclose(abs(float(result["mass.x"].sel(time=np.pi, method="nearest"))), 0.99, atol=2e-3)
    assert not caplog.records


@pytest.mark.parametrize("master", ["gauss-seidel", "newton"])
def test_the_table_of_a_run_is_freed_without_the_garbage_collector(build_fmu: BuildFmu, master: str) -> None:
    """The callback of the part in Python refers to the engine, which refers to the callback."""
    gc.disable()
    try:
        with servo(build_fmu) as system:
            experiment = Experiment(stop=0.01, step=1e-3, master=master)
            recorder = Session(system, experiment, Options()).run(system.start)
            table = weakref.ref(recorder.rows)
            del recorder
            assert table() is None
    finally:
        gc.enable()


def signalled(when: float = 0.5) -> System:
    """It gets Ctrl-C once."""
    sent: list[float] = []

    def send(t: float, u: object, x: object) -> float:
        if t > when and not sent:
            sent.append(t)
            signal.raise_signal(signal.SIGINT)
        return t

    return System([CallablePart("c", send, outputs=["y"])])


@pytest.mark.parametrize("raises", [False, True])
def test_the_handler_of_the_program_is_called(raises: bool) -> None:
    calls: list[int] = []

    def handle(number: int, frame: object) -> None:
        calls.append(number)
        if raises:
            raise OSError("stop")

    before = signal.signal(signal.SIGINT, handle)
    try:
        with pytest.raises(OSError, match="stop") if raises else nullcontext():
            signalled().run(stop=1.0, step=0.1)
        assert calls == [signal.SIGINT]
        assert signal.getsignal(signal.SIGINT) is handle
    finally:
        signal.signal(signal.SIGINT, before)


def test_an_ignored_signal_stays_ignored() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        assert signalled().run(stop=1.0, step=0.1).sizes["time"] == 11
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_handler_in_c_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """A program that embeds Python may have one, for which Python has None, which `signal.signal` does not take."""
    given: list[object] = []

    def refuse(number: int, handler: object) -> None:
        given.append(handler)
        if handler is None:
            raise TypeError("signal handler must be signal.SIG_IGN, signal.SIG_DFL, or a callable object")

    monkeypatch.setattr(signal, "getsignal", lambda number: None)
    monkeypatch.setattr(signal, "signal", refuse)
    assert System([CallablePart("c", lambda t, u, x: t, outputs=["y"])]).run(stop=1.0, step=0.1).sizes["time"] == 11
    assert given == []


def test_a_subinterpreter_gets_a_reason() -> None:
    """Without it, the import of packages in C hangs."""
    code = (
        "from harness.extras import interpreters\n"
        "interpreters.run_string(interpreters.create(isolated=False), "
        "'try:\\n import harness\\nexcept ImportError as error:\\n print(error, flush=True)')"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert "in the main interpreter of Python only" in found.stdout, found.stderr
