"""Derivatives of a composite FMU against differences of its own outputs."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest
from shell.instance import ERROR, Instance, Library, load

from friction_fmus import fmu
from harness import Experiment, FmuPart, System, Wire


def difference(run: Instance, output: str, name: str, at: float, h: float) -> float:
    values = []
    for value in (at + h, at - h):
        run.set({name: value})
        values.append(run.get1(output))
    run.set({name: at})
    return (values[0] - values[1]) / (2.0 * h)


@pytest.mark.parametrize("output", ["mass.a", "mass.F_ext", "mass.x"])
@pytest.mark.parametrize(("name", "at"), [("mass.F_drive", 0.3), ("mass.v_support", 0.1)])
def test_outputs_by_inputs_between_steps(compose: Callable[[str], Path], output: str, name: str, at: float) -> None:
    with Instance(load(compose("stick_slip"))) as run:
        run.initialise()
        run.step(0.0, 1e-3)
        expected = difference(run, output, name, at, 1e-3)
        assert run.directional([output], {name: 2.0})[0] == pytest.approx(2.0 * expected, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize(("name", "at"), [("mass.v0", 1e-3), ("friction.Fs", 1.4), ("friction.sigma2", 0.5)])
def test_start_values_by_parameters(compose: Callable[[str], Path], name: str, at: float) -> None:
    """The start velocity, here in the Stribeck range, drives the friction force, which drives the acceleration."""
    with Instance(load(compose("stick_slip"))) as run:
        run.setup()
        run.must("EnterInitializationMode")
        run.set({"mass.v0": 1e-3, "friction.z": 1e-5})
        run.set({name: at})
        for output in ("friction.F", "mass.a"):
            expected = difference(run, output, name, at, 1e-4 * at)
            assert expected != 0.0
            assert run.directional([output], {name: 1.0})[0] == pytest.approx(expected, rel=1e-7)
        run.must("ExitInitializationMode")
        run.set({"friction.Fc": 0.9})
        assert run.call("GetDirectionalDerivative", None, 0, None, 0, None, None) == 0


@pytest.mark.parametrize("name", ["mass.x", "mass.v", "friction.F"])
def test_output_derivatives_in_time(smooth: tuple[System, Library], name: str) -> None:
    """Against the difference over two steps of a smooth motion; slopes inside are those of lines over a step."""
    h = 1e-4
    with Instance(smooth[1]) as run:
        run.initialise(**{"mass.F_drive": 1.0, "mass.k": 40.0, "mass.m": 1.0})
        run.step(0.0, 0.2)
        before = run.get1(name)
        run.step(0.2, h)
        (found,) = run.output_derivatives(name)
        run.step(0.2 + h, h)
        assert found == pytest.approx((run.get1(name) - before) / (2.0 * h), rel=3e-3)


@pytest.fixture(scope="module")
def sums(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """a and b read each other at once; d reads c two steps later; sampled stands alone."""
    parts = [*(FmuPart(name, fmu("Sum")) for name in "abcd"), FmuPart("sampled", fmu("SampledSum"))]
    wires = [Wire("a.y", "b.u1", gain=0.5), Wire("b.y", "a.u2", gain=0.4), Wire("c.y", "d.u1", gain=0.5, delay=2)]
    connected = {wire.target for wire in wires}
    start = {f"{part.name}.{port.name}": 0.0 for part in parts for port in part.inputs}
    start = {name: value for name, value in start.items() if name not in connected} | {"sampled.Ts": 1e-2}
    path = tmp_path_factory.mktemp("sums") / "sums.fmu"
    with System(parts, wires, start, Experiment(stop=1.0, step=1e-2)) as system:
        system.to_fmu(path)
    return load(path)


def test_through_an_algebraic_loop(sums: Library) -> None:
    """y = x + 0.5 y + ... : two Sums that read each other; dy/dx = 1/(1 - 0.5 * 0.4)."""
    with Instance(sums) as run:
        run.setup()
        run.must("EnterInitializationMode")
        run.set({"a.u1": 1.0})
        assert run.get("a.y", "b.y") == pytest.approx([1.25, 0.625], rel=1e-12)
        assert run.directional(["a.y", "b.y"], {"a.u1": 1.0}) == pytest.approx([1.25, 0.625], rel=1e-7)
        run.must("ExitInitializationMode")
        run.step(0.0, 1e-2)
        assert run.directional(["a.y", "b.y"], {"a.u1": 2.0}) == pytest.approx([2.5, 1.25], rel=1e-7)


def test_a_delayed_connection_passes_nothing_on(sums: Library) -> None:
    """d.y = 0.5 c.y(t - delay) + d.u2, of which only u2 acts at once; the start follows the first value of c.y."""
    with Instance(sums) as run:
        run.setup()
        run.must("EnterInitializationMode")
        assert run.directional(["c.y", "d.y"], {"c.u1": 1.0}) == pytest.approx([1.0, 0.5], rel=1e-7)
        run.must("ExitInitializationMode")
        for k in range(4):
            run.step(k * 1e-2, 1e-2)
            assert difference(run, "d.y", "c.u1", 0.0, 1e-3) == 0.0
            assert run.directional(["c.y", "d.y"], {"c.u1": 1.0, "d.u2": 3.0}) == pytest.approx([1.0, 3.0], rel=1e-7)
            assert run.directional(["d.y"], {"c.u1": 1.0}) == [0.0]


def test_a_sampled_part_holds_its_outputs_after_the_start(sums: Library) -> None:
    """y = u1 + u2 of the first sample follows its inputs; between samples it is held, so that its derivative is 0."""
    with Instance(sums) as run:
        run.setup()
        run.must("EnterInitializationMode")
        assert run.directional(["sampled.y"], {"sampled.u1": 2.0}) == pytest.approx([2.0], rel=1e-7)
        run.must("ExitInitializationMode")
        run.step(0.0, 1e-2)
        assert run.directional(["sampled.y"], {"sampled.u1": 2.0}) == [0.0]


def test_parts_without_inputs_and_connections(tmp_path: Path) -> None:
    """They exchange no signal. r = offset + A sin(phase) at t = 0, so that dr/dA = sin(phase) and dr/doffset = 1."""
    parts = [FmuPart(name, fmu("Sine")) for name in "ab"]
    with System(parts, start={"a.phase[1]": 0.5}, experiment=Experiment(stop=1.0, step=1e-2)) as system:
        system.to_fmu(tmp_path / "sines.fmu")
    with Instance(load(tmp_path / "sines.fmu")) as run:
        run.setup()
        run.must("EnterInitializationMode")
        found = run.directional(["a.r", "b.r"], {"a.amplitude[1]": 1.0, "a.offset": 2.0, "b.offset": 3.0})
        assert found == pytest.approx([math.sin(0.5) + 2.0, 3.0], rel=1e-7)


def test_wrong_requests_are_errors(compose: Callable[[str], Path]) -> None:
    with Instance(load(compose("stick_slip"))) as run:
        run.initialise()
        with pytest.raises(AssertionError):
            run.directional(["mass.F_drive"], {"mass.F_drive": 1.0})
        with pytest.raises(AssertionError):
            run.directional(["mass.a"], {"mass.m": 1.0})  # parameters are knowns at the start only
        assert run.messages[-1][1] == ERROR
