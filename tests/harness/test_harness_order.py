"""Order of execution, loops, time and rates."""

from __future__ import annotations

import numpy as np
import pytest
from harness_parts import bristle, linear, mass, memoryless, plant

from harness import AlgebraicLoopError, CallablePart, ExperimentError, SeriesPart, System, UnknownNameError
from harness.system.graph import propagation_order, stepping_order


def order(parts: list[CallablePart], wires: list[str]) -> list[str]:
    system = System(
        parts, wires, {f"{p.name}.{i.name}": 0.0 for p in parts for i in p.inputs if not _wired(p, i.name, wires)}
    )
    return stepping_order(system.parts, system.wires)


def _wired(part: CallablePart, port: str, wires: list[str]) -> bool:
    return any(wire.endswith(f"> {part.name}.{port}") for wire in wires)


def test_servo_loop_whatever_the_order_of_declaration() -> None:
    parts = [
        memoryless("quantiser", ["x"], ["y"]),
        memoryless("friction", ["v"], ["F"]),
        plant("mass", ["u", "F"], ["x", "v"]),
        memoryless("controller", ["r", "y", "v"], ["u"], sampled=True),
        memoryless("estimator", ["y"], ["v"], sampled=True),
        memoryless("reference", [], ["r"]),
    ]
    wires = [
        "reference.r -> controller.r",
        "quantiser.y -> estimator.y",
        "quantiser.y -> controller.y",
        "estimator.v -> controller.v",
        "controller.u -> mass.u",
        "mass.v -> friction.v",
        "friction.F -> mass.F",
        "mass.x -> quantiser.x",
    ]
    assert order(parts, wires) == ["estimator", "controller", "mass", "quantiser", "friction", "reference"]
    found = order(parts[::-1], wires)
    assert found[:3] == ["estimator", "controller", "mass"]
    assert set(found[3:]) == {"quantiser", "friction", "reference"}


def test_source_comes_before_what_reads_it_directly() -> None:
    parts = [memoryless("friction", ["v"], ["F"]), plant("mass"), memoryless("sine", [], ["v"])]
    assert order(parts, ["sine.v -> friction.v", "friction.F -> mass.u"]) == ["mass", "sine", "friction"]


def accelerated(v: float) -> CallablePart:
    """A mass of 1 kg with its velocity, and its acceleration, which depends directly on the force."""
    return CallablePart(
        "body",
        lambda t, u, x: [x[0], u[0]],
        ["F"],
        ["v", "a"],
        advance=lambda t, h, u, x: x + h * u[0],
        state=[v],
        dependencies={"v": (), "a": ("F",)},
    )


def test_ring_of_parts_that_is_no_loop_of_variables_begins_at_the_state() -> None:
    body = accelerated(1.0)
    parts = [memoryless("display", ["a"], ["y"]), memoryless("friction", ["v"], ["F"]), body]
    wires = ["body.v -> friction.v", "friction.F -> body.F", "body.a -> display.a"]
    assert order(parts, wires)[0] == "body"
    result = System(parts, wires).run(stop=0.0, step=1.0)
    # at the start time everything is consistent: a = F = v = 1
    assert {str(name): float(value[0]) for name, value in result.data_vars.items()} == {
        "display.y": 1.0,
        "friction.F": 1.0,
        "body.v": 1.0,
        "body.a": 1.0,
    }


def test_sampled_source_before_a_sampled_part_with_state() -> None:
    delay = CallablePart("delay", lambda t, u, x: x, ["u"], ["y"], state=[0.0], dependencies={"y": ()}, sampled=True)
    assert order([delay, memoryless("source", [], ["y"], sampled=True)], ["source.y -> delay.u"]) == ["source", "delay"]


def test_algebraic_loop_is_named() -> None:
    parts = [memoryless("a", ["u"], ["y"]), memoryless("b", ["u"], ["y"])]
    with pytest.raises(AlgebraicLoopError, match=r"algebraic loop a\.y -> b\.u -> b\.y -> a\.u -> a\.y: ") as caught:
        System(parts, ["a.y -> b.u", "b.y -> a.u"]).run(stop=1.0, step=0.1)
    assert "\n" not in str(caught.value)


def test_algebraic_loop_of_one_part_with_itself() -> None:
    with pytest.raises(AlgebraicLoopError, match=r"a\.y -> a\.u -> a\.y"):
        System([memoryless("a", ["u"], ["y"])], ["a.y -> a.u"]).run(stop=1.0, step=0.1)


def test_algebraic_loop_among_sampled_parts() -> None:
    parts = [memoryless("a", ["u"], ["y"], sampled=True), memoryless("b", ["u"], ["y"], sampled=True)]
    for master in ("jacobi", "newton"):
        with pytest.raises(AlgebraicLoopError, match="algebraic loop "):
            System(parts, ["a.y -> b.u", "b.y -> a.u"]).run(stop=1.0, step=0.1, master=master)


def test_state_or_sampler_opens_the_loop() -> None:
    System([plant("a"), memoryless("b", ["u"], ["y"])], ["a.y -> b.u", "b.y -> a.u"])
    sampled = System(
        [memoryless("a", ["u"], ["y"], sampled=True), memoryless("b", ["u"], ["y"])], ["a.y -> b.u", "b.y -> a.u"]
    )
    assert len(sampled.run(stop=1.0, step=0.5)["time"]) == 3


def test_start_values_spread_through_a_chain() -> None:
    parts = [memoryless(name, ["u"], ["y"]) for name in "dcba"]
    system = System(parts, ["a.y -> b.u", "b.y -> c.u", "c.y -> d.u"], {"a.u": 7.0})
    assert propagation_order(system.parts, system.wires) == ["a", "b", "c", "d"]
    assert float(system.run(stop=0.0, step=1.0)["d.y"][0]) == 7.0


def test_start_values_that_do_not_settle_are_reported(caplog: pytest.LogCaptureFixture) -> None:
    liar = CallablePart("liar", lambda t, u, x: u[0] + 1.0, ["u"], ["y"], dependencies={"y": ()})
    System([liar], ["liar.y -> liar.u"]).run(stop=0.0, step=1.0)
    assert "the start values of liar.y, liar.u do not settle" in caplog.text


def test_time_is_multiplied_not_accumulated() -> None:
    times: list[float] = []

    def record(t: float, h: float, u: np.ndarray, x: np.ndarray) -> np.ndarray:
        times.append(t)
        return x

    clock = CallablePart("clock", lambda t, u, x: t, [], ["t"], advance=record)
    result = System([clock]).run(start=0.3, stop=1000.3, step=0.1)
    k = np.arange(10001)
    np.testing.assert_array_equal(times, 0.3 + k[:-1] * 0.1)
    np.testing.assert_array_equal(result["time"], 0.3 + k * 0.1)


def rates(sampled: bool, every: int, ticks: int) -> tuple[list[tuple[float, float]], np.ndarray]:
    calls: list[tuple[float, float]] = []

    def advance(t: float, h: float, u: np.ndarray, x: np.ndarray) -> np.ndarray:
        calls.append((t, h))
        return x

    slow = CallablePart("slow", lambda t, u, x: u[0], ["u"], ["y"], advance=advance, sampled=sampled, every=every)
    counter = CallablePart("counter", lambda t, u, x: t, [], ["t"])
    result = System([slow, counter], ["counter.t -> slow.u"]).run(stop=float(ticks), step=1.0)
    return calls, result["slow.y"].to_numpy()


def test_slow_sampled_part_samples_at_the_beginning_of_its_interval_and_holds() -> None:
    calls, y = rates(sampled=True, every=3, ticks=8)
    assert calls == [(0.0, 3.0), (3.0, 3.0), (6.0, 3.0)]
    np.testing.assert_array_equal(y, [0, 0, 0, 0, 3, 3, 3, 6, 6])


def test_slow_continuous_part_is_due_at_the_end_of_its_interval() -> None:
    calls, y = rates(sampled=False, every=2, ticks=5)
    assert calls == [(0.0, 2.0), (2.0, 2.0)]
    # it reads the counter directly, which has already reached the end of the interval
    np.testing.assert_array_equal(y, [0, 0, 2, 2, 4, 4])


@pytest.mark.parametrize("master", ["jacobi", "gauss-seidel"])
def test_everything_at_half_rate_is_the_run_with_twice_the_step(master: str) -> None:
    A, B = np.array([[-1.0]]), np.array([[1.0]])
    C, D = np.array([[1.0]]), np.zeros((1, 1))

    def system(every: int) -> System:
        parts = [linear(name, A, B, C, D, ["u"], ["y"], [1.0]) for name in ("a", "b")]
        for part in parts:
            part.every = every
        return System(parts, ["a.y -> b.u", "b.y -> a.u"])

    slow = system(2).run(stop=2.0, step=0.125, master=master, decimate=2)
    plain = system(1).run(stop=2.0, step=0.25, master=master)
    np.testing.assert_array_equal(slow["a.y"], plain["a.y"])
    np.testing.assert_array_equal(slow["b.y"], plain["b.y"])


def test_order_must_name_every_part_once() -> None:
    system = System([mass(), bristle()], ["bristle.F -> mass.F", "mass.v -> bristle.v"])
    with pytest.raises(ExperimentError, match="does not name bristle"):
        system.run(stop=1.0, step=0.1, order=["mass"])
    with pytest.raises(ExperimentError, match="names a part twice"):
        system.run(stop=1.0, step=0.1, order=["mass", "bristle", "mass"])
    with pytest.raises(UnknownNameError, match=r"no part 'maß'.*in order"):
        system.run(stop=1.0, step=0.1, order=["maß", "bristle"])


def test_rate_must_be_positive() -> None:
    with pytest.raises(ExperimentError, match="every = 0: give"):
        System([mass(every=0)], start={"mass.F": 0.0})


def test_a_held_force_acts_from_its_sample_on_even_if_an_output_depends_on_it_directly() -> None:
    body = accelerated(0.0)
    scale = CallablePart("scale", lambda t, u, x: [2.0 * u[0]], ["a"], ["F"])
    force = SeriesPart("force", [0.0, 1.0, 2.0, 3.0], {"F": [1.0, 10.0, 0.0, 0.0]}, interpolation="previous")
    system = System([body, scale, force], ["force.F -> body.F", "body.a -> scale.a"])
    result = system.run(stop=3.0, step=1.0)
    np.testing.assert_array_equal(result["body.v"], [0.0, 1.0, 11.0, 11.0])
    np.testing.assert_array_equal(result["body.a"], [1.0, 10.0, 0.0, 0.0])
    np.testing.assert_array_equal(result["scale.F"], [2.0, 20.0, 0.0, 0.0])
