"""Wires that change their values: gain, offset, units, delay, and manipulators, in every master."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from harness_parts import SIGMA0, bristle, mass
from python_engine import run_in_python
from scipy.linalg import expm

from harness import (
    AlgebraicLoopError,
    Bias,
    CallablePart,
    Delay,
    DropOut,
    Experiment,
    ExperimentError,
    FmuPart,
    Freeze,
    Manipulator,
    Noise,
    Override,
    Port,
    System,
    SystemFileError,
    UnitError,
    WireError,
)
from harness.run import run
from harness.system.wire import Wire

BuildFmu = Callable[..., Path]
MASTERS = ("jacobi", "gauss-seidel", "newton", "adaptive")
STEP = 0.1


def counter(name: str = "clock", sampled: bool = False) -> CallablePart:
    """y = t at the end of a step."""
    return CallablePart(name, lambda t, u, x: t, [], ["y"], sampled=sampled)


def sink(unit: str | None = None, every: int = 1) -> CallablePart:
    """Remembers what it is given at the beginning of a step."""
    port = Port("u", unit)
    return CallablePart("sink", lambda t, u, x: u[0], [port], ["y"], sampled=True, every=every)


def received(manipulators: list[Manipulator], ticks: int = 10, every: int = 1, **wire: float) -> np.ndarray:
    """What a sampled part gets at t = 0, 0.1, ... from the ramp y = t."""
    system = System([counter(), sink(every=every)], [Wire("clock.y", "sink.u", **wire)])  # type: ignore[arg-type]
    result = system.run(stop=ticks * STEP, step=STEP, manipulators=manipulators)
    return np.asarray(result["sink.y"].values[1:])


TIMES = np.arange(10) * STEP


def test_the_ramp_itself() -> None:
    np.testing.assert_allclose(received([]), TIMES)


def test_override_and_bias_are_at_work_in_their_span_only() -> None:
    inside = (TIMES > 0.25) & (TIMES < 0.55)
    np.testing.assert_allclose(received([Override("sink.u", 7.0, start=0.3, stop=0.6)]), np.where(inside, 7.0, TIMES))
    np.testing.assert_allclose(received([Bias("sink.u", 7.0, start=0.3, stop=0.6)]), TIMES + 7.0 * inside)


def test_freeze_keeps_the_last_value() -> None:
    expected = np.where((TIMES > 0.25) & (TIMES < 0.55), 0.2, TIMES)
    np.testing.assert_allclose(received([Freeze("sink.u", start=0.3, stop=0.6)]), expected)
    np.testing.assert_allclose(received([Freeze("sink.u")]), 0.0 * TIMES)


@pytest.mark.parametrize("ticks", [1, 2, 4])
def test_delay_of_a_wire_and_of_a_manipulator(ticks: int) -> None:
    expected = np.concatenate((np.zeros(ticks), TIMES[: 10 - ticks]))
    np.testing.assert_allclose(received([Delay("sink.u", ticks)]), expected)
    np.testing.assert_allclose(received([], delay=ticks), expected)
    np.testing.assert_allclose(
        received([Delay("sink.u", ticks, start=0.5)]), np.where(TIMES > 0.45, TIMES - ticks * STEP, TIMES)
    )


@pytest.mark.parametrize("ticks", [1, 2, 4])
def test_an_initial_value_until_the_delay_has_passed(ticks: int) -> None:
    """A value of the output: gain and offset apply to it."""
    expected = np.concatenate((np.full(ticks, -0.7), TIMES[: 10 - ticks]))
    np.testing.assert_allclose(received([], delay=ticks, initial=-0.7), expected)
    found = received([], delay=ticks, initial=-0.7, gain=2.0, offset=1.0)
    np.testing.assert_allclose(found, 2.0 * expected + 1.0)
    np.testing.assert_allclose(received([Delay("sink.u", ticks)], initial=-0.7, delay=ticks), expected)


@pytest.mark.parametrize("master", MASTERS)
def test_the_first_row_has_the_initial_value(master: str, tmp_path: Path) -> None:
    """y = 3 u + t of parts that act at once, u = y one step earlier: y(0) = 3 * 0.5, then y(k) = 3 y(k-1) + t."""
    law = CallablePart("law", lambda t, u, x: 3.0 * u[0] + t, ["u"], ["y"])
    with System([law], [Wire("law.y", "law.u", delay=1, initial=0.5)]) as system:
        found = system.run(stop=0.3, step=STEP, master=master)["law.y"].to_numpy()
    expected = [1.5]
    for k in (1, 2, 3):
        expected.append(3.0 * expected[-1] + k * STEP)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("wire", "word"),
    [
        (Wire("clock.y", "sink.u", initial=1.0), "has an initial value but no delay"),
        (Wire("clock.y", "sink.u", delay=1, initial=float("nan")), "give a finite number"),
        (Wire("clock.y", "sink.u", delay=1, initial=float("inf")), "give a finite number"),
    ],
)
def test_initial_values_without_effect_are_errors(wire: Wire, word: str) -> None:
    with pytest.raises(WireError, match=word):
        System([counter(), sink()], [wire])


def test_noise_is_white_normal_and_reproducible() -> None:
    n = 4000
    noise = received([Noise("sink.u", 0.5, seed=3)], ticks=n) - np.arange(n) * STEP
    np.testing.assert_array_equal(noise, received([Noise("sink.u", 0.5, seed=3)], ticks=n) - np.arange(n) * STEP)
    other = received([Noise("sink.u", 0.5, seed=4)], ticks=n) - np.arange(n) * STEP
    # bounds of four standard deviations of mean, variance and correlations
    assert abs(noise.mean()) < 4 * 0.5 / np.sqrt(n)
    assert abs(noise.std() / 0.5 - 1.0) < 4 / np.sqrt(2 * n)
    assert abs(np.mean(noise[1:] * noise[:-1])) < 4 * 0.25 / np.sqrt(n)
    assert abs(np.mean(noise * other)) < 4 * 0.25 / np.sqrt(n)


def test_drop_out_holds_the_last_value_that_arrived() -> None:
    n, p = 4000, 0.3
    got = np.round(received([DropOut("sink.u", p, seed=1)], ticks=n) / STEP).astype(int)
    lost = got != np.arange(n)
    assert abs(lost.mean() - p) < 4 * np.sqrt(p * (1 - p) / n)
    expected = np.maximum.accumulate(np.where(lost, 0, np.arange(n)))
    np.testing.assert_array_equal(got, expected)
    np.testing.assert_allclose(received([DropOut("sink.u", 0.0)]), TIMES)


def test_drop_out_of_a_slow_part_loses_whole_samples() -> None:
    """A part that samples every third tick keeps the value of its last sample, not one from in between."""
    got = np.round(received([DropOut("sink.u", 0.5, seed=2)], ticks=300, every=3) / STEP).astype(int)
    assert set(np.mod(got, 3)) == {0}
    assert 30 < np.sum(np.diff(got) > 0) < 70


def test_manipulators_act_one_after_the_other() -> None:
    order = [Bias("sink.u", 1.0), Override("sink.u", 5.0), Bias("sink.u", 0.25)]
    np.testing.assert_allclose(received(order), np.full(10, 5.25))
    # a frozen value takes on no bias again and again
    np.testing.assert_allclose(received([Freeze("sink.u", start=0.3), Bias("sink.u", 1.0)])[3:], np.full(7, 1.2))
    np.testing.assert_allclose(received([Bias("sink.u", 1.0), Freeze("sink.u", start=0.3)])[3:], np.full(7, 1.2))


def test_gain_offset_and_units() -> None:
    def value(source: Port, target: Port, **wire: float) -> float:
        parts = [CallablePart("a", lambda t, u, x: 3.0, [], [source]), sink(target.unit)]
        system = System(parts, [Wire("a.y", "sink.u", **wire)])
        return float(system.run(stop=1.0, step=1.0)["sink.y"][-1])

    plain = Port("y")
    assert value(plain, plain, gain=2.0, offset=-1.0) == 5.0
    assert value(plain, plain, gain=0.0, offset=4.0) == 4.0
    assert value(Port("y", "mm"), Port("u", "m")) == pytest.approx(0.003, rel=1e-15)
    assert value(Port("y", "degC"), Port("u", "K")) == pytest.approx(276.15, rel=1e-15)
    assert value(Port("y", "rev"), Port("u", "deg"), gain=0.5, offset=1.0) == pytest.approx(541.0, rel=1e-15)
    with pytest.raises(UnitError):
        value(Port("y", "mm"), Port("u", "N"), gain=2.0)
    with pytest.raises(WireError, match="give finite numbers"):
        value(plain, plain, gain=float("inf"))
    with pytest.raises(WireError, match="integer number of communication steps"):
        value(plain, plain, delay=-1)


@pytest.mark.parametrize("master", MASTERS)
def test_gains_around_a_loop_cancel(master: str) -> None:
    """Force in kN and velocity in mm/s, with a sign turned twice: the same motion as with plain wires."""

    def oscillator(unit: str, gain: float) -> System:
        other = CallablePart("other", lambda t, u, x: u[0], [Port("u", "N")], [Port("y", unit)])
        wires = [Wire("mass.v", "bristle.v", gain=-2.0), Wire("bristle.F", "other.u"), Wire("other.y", "mass.F", gain)]
        if unit == "N":
            wires[0] = Wire("mass.v", "bristle.v")
        return System([mass(v0=1.0), bristle(), other], wires)

    plain, scaled = oscillator("N", 1.0), oscillator("kN", -0.5e-3)
    settings = {"stop": 0.05, "step": 1e-4, "master": master}
    np.testing.assert_allclose(
        scaled.run(**settings)["mass.x"], plain.run(**settings)["mass.x"], atol=1e-12 / 1e-5, rtol=1e-9
    )


def servo(build_fmu: BuildFmu, wires: list[Wire]) -> System:
    parts = [FmuPart("profile", build_fmu("Profile")), FmuPart("pid", build_fmu("PID"))]
    parts += [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("LuGre"))]
    start = {"pid.Ts": 1e-3, "pid.Kp": 400.0, "pid.Kd": 40.0, "pid.rd": 0.0, "pid.rdd": 0.0, "pid.v": 0.0}
    return System(parts, ["profile.r -> pid.r", "mass.x -> pid.x", "friction.F -> mass.F_friction", *wires], start)


ALL = (
    Bias("pid.x", 1e-4, start=0.1),
    Noise("pid.x", 1e-6, seed=7),
    DropOut("mass.F_drive", 0.2, start=0.2, stop=0.4),
    Freeze("friction.v", start=0.45, stop=0.5),
    Delay("mass.F_drive", 3),
    Override("pid.r", 0.01, start=0.55),
)


@pytest.mark.parametrize("master", ["jacobi", "gauss-seidel"])
def test_engine_and_python_agree_to_the_last_bit(build_fmu: BuildFmu, master: str) -> None:
    wires = [Wire("pid.u", "mass.F_drive", gain=0.9, offset=0.01), Wire("mass.v", "friction.v", delay=2)]
    experiment = Experiment(stop=0.6, step=1e-3, master=master, manipulators=ALL, record=("*", "mass.F_drive", "pid.x"))
    with servo(build_fmu, wires) as system:
        one, other = run(system, experiment), run_in_python(system, experiment)
    for name in one:
        np.testing.assert_array_equal(one[name], other[name])
    assert np.ptp(one["pid.x"].values) > 0.0


def test_override_breaks_a_stiff_loop_at_its_time() -> None:
    """Newton: until 5 ms the bristle acts, then nothing: the mass keeps its velocity."""
    system = System([mass(v0=1.0), bristle()], ["mass.v -> bristle.v", "bristle.F -> mass.F"])
    result = system.run(stop=0.01, step=1e-4, master="newton", manipulators=[Override("mass.F", 0.0, start=0.005)])
    damping = float(np.sqrt(SIGMA0) + 0.4)
    exact = expm(np.array([[0.0, 1.0], [-SIGMA0, -damping]]) * 0.005) @ [0.0, 1.0]
    times = result["time"].values
    v = np.interp(0.005, times, result["mass.v"].values)
    assert v == pytest.approx(exact[1], abs=2e-3)
    np.testing.assert_allclose(result["mass.v"].values[times > 0.00501], v, rtol=1e-9)


def test_delay_opens_an_algebraic_loop() -> None:
    """a = b / 2 + 1 with the b of the tick before."""
    a = CallablePart("a", lambda t, u, x: 0.5 * u[0] + 1.0, ["u"], ["y"])
    b = CallablePart("b", lambda t, u, x: u[0], ["u"], ["y"])
    with pytest.raises(AlgebraicLoopError, match="or use the master newton"):
        System([a, b], ["a.y -> b.u", "b.y -> a.u"]).run(stop=1.0, step=0.1)
    opened = System([a, b], ["a.y -> b.u", Wire("b.y", "a.u", delay=1)])
    for settings in ({"order": ["a", "b"]}, {"order": ["b", "a"]}, {"master": "newton"}):
        result = opened.run(stop=1.0, step=0.1, **settings)
        np.testing.assert_allclose(result["a.y"].values[1:], 0.5 * result["b.y"].values[:-1] + 1.0, rtol=1e-12)
        assert result["a.y"].values[-1] == pytest.approx(2.0, rel=0.05)


def test_algebraic_loop_is_solved_at_the_start_and_by_newton() -> None:
    """y = cos(y), whose solution is 0.739085...; and y = t - y^3."""
    a = CallablePart("a", lambda t, u, x: np.cos(u[0]), ["u"], ["y"])
    b = CallablePart("b", lambda t, u, x: u[0], ["u"], ["y"])
    result = System([a, b], ["a.y -> b.u", "b.y -> a.u"]).run(stop=0.5, step=0.1, master="newton")
    np.testing.assert_allclose(result["b.y"], 0.7390851332151607, rtol=1e-9)
    c = CallablePart("a", lambda t, u, x: t - u[0] ** 3, ["u"], ["y"])
    result = System([c, b], ["a.y -> b.u", "b.y -> a.u"]).run(stop=2.0, step=0.1, master="newton")
    y = result["b.y"].values
    np.testing.assert_allclose(y + y**3, result["time"].values, atol=1e-6)
    d = CallablePart("a", lambda t, u, x: u[0] ** 2 + 1.0, ["u"], ["y"])
    with pytest.raises(AlgebraicLoopError, match="no start values satisfy the algebraic loop through"):
        System([d, b], ["a.y -> b.u", "b.y -> a.u"]).run(stop=0.5, step=0.1, master="newton")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Override("sink.u", float("nan")), "give a finite number"),
        (lambda: Bias("sink.u", 1.0, start=2.0, stop=1.0), "give a start before the stop"),
        (lambda: Noise("sink.u", -1.0), "give 0 or more"),
        (lambda: DropOut("sink.u", 1.5), "give 0 to 1"),
        (lambda: DropOut("sink.u", 0.5, seed=-1), "give an integer"),
        (lambda: Delay("sink.u", 0), "give an integer from 1 to"),
        (lambda: received([Override("sink.y", 1.0)]), "name a connected input"),
    ],
)
def test_refused(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ExperimentError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_system_file_keeps_wires_and_manipulators(build_fmu: BuildFmu, tmp_path: Path) -> None:
    wires = [Wire("pid.u", "mass.F_drive", gain=0.9, offset=0.01), Wire("mass.v", "friction.v", delay=2, initial=0.1)]
    with servo(build_fmu, wires) as system:
        system.experiment = Experiment(stop=0.1, step=1e-3, master="jacobi", extrapolation=2, manipulators=ALL)
        system.to_toml(tmp_path / "system.toml")
    with System.from_toml(tmp_path / "system.toml") as again:
        assert again.wires == system.wires
        assert again.experiment == system.experiment
    text = (tmp_path / "system.toml").read_text()
    for old, new, message in [
        ('kind = "bias"', 'kind = "bais"', "kind = 'bais'; give one of override, .*did you mean 'bias'"),
        (", value = 0.0001", "", "a bias has no value"),
        ("value = 0.0001", 'value = "x"', "a bias has value = 'x'; give a number"),
        ("gain = 0.9", "gaim = 0.9", "the connection .* 'gaim'; did you mean 'gain'"),
        ("delay = 2", "delay = 2.5", "the connection .* delay = 2.5; give an integer"),
    ]:
        assert old in text
        (tmp_path / "wrong.toml").write_text(text.replace(old, new, 1))
        with pytest.raises(SystemFileError, match=message):
            System.from_toml(tmp_path / "wrong.toml")
