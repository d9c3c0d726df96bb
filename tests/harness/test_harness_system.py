"""What can be wrong with a system, and what the message then says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from harness_parts import bristle, mass, memoryless, plant

from harness import (
    BaseUnit,
    CallablePart,
    Experiment,
    ExperimentError,
    HarnessError,
    Port,
    StartValueError,
    System,
    UnconnectedError,
    UnitError,
    UnknownNameError,
    WireError,
)

WIRES = ["bristle.F -> mass.F", "mass.v -> bristle.v"]


def test_unconnected_inputs_are_all_named() -> None:
    parts = [memoryless("a", ["p", "q"], ["y"]), plant("b", ["u", "w"])]
    with pytest.raises(UnconnectedError, match=r"a\.q, b\.w are not connected and have no start value: .*constant"):
        System(parts, ["b.y -> a.p", "a.y -> b.u"])


def test_constant_is_a_connection() -> None:
    result = System([memoryless("a", ["u"], ["y"])], start={"a.u": 2.5}).run(stop=1.0, step=1.0, record=["*", "a.u"])
    np.testing.assert_array_equal(result["a.y"], [2.5, 2.5])
    np.testing.assert_array_equal(result["a.u"], [2.5, 2.5])


def test_input_driven_twice() -> None:
    with pytest.raises(WireError, match=r"mass\.F is driven twice, by bristle\.F and by mass\.v"):
        System([mass(), bristle()], [*WIRES, "mass.v -> mass.F"])


def test_input_driven_by_a_wire_and_a_constant() -> None:
    with pytest.raises(WireError, match=r"mass\.F is driven twice, by bristle\.F and by the start value 1\.0"):
        System([mass(), bristle()], WIRES, {"mass.F": 1.0})


@pytest.mark.parametrize(
    ("wire", "message"),
    [
        ("mas.v -> bristle.v", "there is no part 'mas' (in connection mas.v -> bristle.v): did you mean 'mass'?"),
        ("mass.V2 -> bristle.v", "'mass' has no 'V2' among its outputs"),
        (
            "mass.v -> bristle.w",
            "'bristle' has no 'w' among its inputs (in connection mass.v -> bristle.w): known are v",
        ),
    ],
)
def test_unknown_names_suggest_the_nearest(wire: str, message: str) -> None:
    with pytest.raises(UnknownNameError) as caught:
        System([mass(), bristle()], [wire])
    assert message in str(caught.value)


def test_wire_in_the_wrong_direction() -> None:
    with pytest.raises(WireError, match=r"mass\.F is one of the inputs of 'mass'"):
        System([mass(), bristle()], ["mass.F -> bristle.v"])


@pytest.mark.parametrize("wire", ["mass.v", "mass.v - bristle.v", "mass.v -> bristle.v -> mass.F", "v -> bristle.v"])
def test_malformed_wire(wire: str) -> None:
    with pytest.raises(WireError, match="write it as"):
        System([mass(), bristle()], [wire])


def test_unit_mismatch_shows_both_units() -> None:
    with pytest.raises(UnitError, match=r"mass\.x is in m \[m\] but bristle\.v is in m/s \[m\.s-1\]"):
        System([mass(), bristle()], ["mass.x -> bristle.v", "bristle.F -> mass.F"])


def wired(output: Port, input_: Port) -> System:
    source = CallablePart("s", lambda t, u, x: 1.0, [], [output])
    return System(
        [source, CallablePart("t", lambda t, u, x: u[0], [input_], ["y"])], [f"s.{output.name} -> t.{input_.name}"]
    )


def test_other_quantities_are_refused() -> None:
    with pytest.raises(UnitError, match=r"mm \[0\.001 \* m\] but .* is in degC \[K \+ 273\.15\]"):
        wired(Port("x", "mm"), Port("x", "degC"))


def test_same_unit_under_another_name() -> None:
    wired(Port("F", "N"), Port("F", "kg.m/s2"))
    wired(
        Port("x", "furlong", base=BaseUnit((0, 1, 0, 0, 0, 0, 0, 0), 201.168)),
        Port("x", "fl", base=BaseUnit((0, 1, 0, 0, 0, 0, 0, 0), 201.168)),
    )


def test_units_that_nobody_knows() -> None:
    """A port without a unit fits any; of two names that differ, both must be known."""
    wired(Port("F"), Port("F", "N"))
    wired(Port("F", "spam"), Port("F", "spam"))
    for units in (("spam", "eggs"), ("spam", "N"), ("N", "spam")):
        with pytest.raises(UnitError, match=r"F is in 'spam', which is not a known unit: .*connection s\.F -> t\.F"):
            wired(*(Port("F", unit) for unit in units))


def test_types_may_widen_but_not_narrow() -> None:
    wired(Port("n", type="Integer"), Port("x"))
    wired(Port("b", type="Boolean"), Port("n", type="Integer"))
    with pytest.raises(WireError, match=r"s\.x is Real but t\.n is Integer"):
        wired(Port("x"), Port("n", type="Integer"))


def test_unknown_start_value() -> None:
    with pytest.raises(UnknownNameError, match=r"'mass' has no input or parameter 'm'"):
        System([mass(), bristle()], WIRES, {"mass.m": 1.0})
    with pytest.raises(UnknownNameError, match=r"no part 'maß'"):
        System([mass(), bristle()], WIRES, {"maß.F": 1.0})
    with pytest.raises(StartValueError, match=r"mass\.x is computed"):
        System([mass(), bristle()], WIRES, {"mass.x": 1.0})


def test_start_value_that_is_no_number() -> None:
    with pytest.raises(StartValueError, match=r"mass\.F is 'much', which is not a number"):
        System([mass()], start={"mass.F": "much"}).run(stop=1.0, step=1.0)


def test_names_of_parts() -> None:
    with pytest.raises(HarnessError, match="two parts are called 'mass'"):
        System([mass(), mass()])
    with pytest.raises(HarnessError, match=r"'a\.b' cannot be the name of a part"):
        System([mass("a.b")])


def test_dependencies_name_existing_ports() -> None:
    with pytest.raises(UnknownNameError, match="'a' has no output 'yy'"):
        CallablePart("a", lambda t, u, x: 0.0, ["u"], ["y"], dependencies={"yy": ()})
    with pytest.raises(UnknownNameError, match="'a' has no input 'w'"):
        CallablePart("a", lambda t, u, x: 0.0, ["u"], ["y"], dependencies={"y": ("w",)})


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"stop": 1.0, "step": 0.0}, "the step is 0.0 s"),
        ({"stop": 1.0, "step": -0.1}, "the step is -0.1 s"),
        ({"stop": 1.0, "step": math.nan}, "step is nan"),
        ({"stop": math.inf, "step": 0.1}, "stop is inf"),
        ({"stop": 1.0, "step": 0.1, "start": math.nan}, "start is nan"),
        ({"stop": 1.0, "step": 0.1, "start": 2.0}, "stops at 1.0 s before it starts at 2.0 s"),
        ({"stop": 1.0, "step": 0.3}, "use a step of 0.333333333333 s or stop at 0.9 s"),
        ({"stop": 1.0, "step": 0.1, "decimate": 0}, "decimate is 0"),
    ],
)
def test_experiment_that_makes_no_sense(settings: dict[str, float], message: str) -> None:
    with pytest.raises(ExperimentError) as caught:
        Experiment(**settings)  # type: ignore[arg-type]
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("stop", "step", "ticks"), [(10.0, 1 / 60, 600), (1.0, 1e-3 / 3, 3000), (0.3, 0.1, 3), (0.0, 0.1, 0)]
)
def test_awkward_steps_that_divide_the_span(stop: float, step: float, ticks: int) -> None:
    assert Experiment(stop=stop, step=step).ticks == ticks


def test_run_without_times() -> None:
    with pytest.raises(ExperimentError, match="has no experiment: give stop and step"):
        System([mass()], start={"mass.F": 0.0}).run(stop=1.0)


def test_run_changes_the_default_experiment() -> None:
    system = System([mass()], start={"mass.F": 0.0}, experiment=Experiment(stop=1.0, step=0.25, master="jacobi"))
    assert system.run().sizes["time"] == 5
    shorter = system.run(stop=0.5)
    assert shorter.sizes["time"] == 3
    assert shorter.attrs["master"] == "jacobi"


def test_with_start_changes_a_copy() -> None:
    system = System([mass()], start={"mass.F": 0.0}, experiment=Experiment(stop=1.0, step=0.5))
    pushed = system.with_start({"mass.F": -2.0})
    assert float(system.run()["mass.v"][-1]) == 0.0
    assert float(pushed.run()["mass.v"][-1]) == 2.0
