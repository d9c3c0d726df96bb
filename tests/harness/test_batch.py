"""Copies of a system that are stepped together, against runs of the system one by one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from harness import Batch, CallablePart, FmuPart, HarnessError, Part, SeriesPart, System
from harness.errors import ExperimentError, StartValueError, UnknownNameError
from harness.system.wire import Noise

BuildFmu = Callable[..., Path]
STEP = 1e-4
HELD = 50
MASSES = np.linspace(0.5, 2.0, 40)
OUTPUTS = ("mass.x", "friction.F", "pid.fault")
PARTS = {"pid": "PID", "mass": "Mass", "friction": "LuGre"}
WIRES = (
    *("mass.x -> pid.x", "mass.v -> pid.v", "pid.u -> mass.F_drive"),
    *("mass.v -> friction.v", "friction.F -> mass.F_friction"),
)
ACTIONS = np.random.default_rng(42).uniform(-1e-3, 1e-3, (6, len(MASSES), 1))


@pytest.fixture
def servo(build_fmu: BuildFmu) -> Callable[..., System]:
    def make(*more: Part, wires: tuple[str, ...] = (), **start: float) -> System:
        parts = [*(FmuPart(name, build_fmu(model)) for name, model in PARTS.items()), *more]
        given = {"pid.r": 0.0} if not more else {}
        fixed = {"pid.rd": 0.0, "pid.rdd": 0.0, **given, **start}
        return System(parts, [*WIRES, *wires], fixed, {"stop": len(ACTIONS) * HELD * STEP, "step": STEP})

    return make


@pytest.fixture
def batch(servo: Callable[..., System]) -> Iterator[Batch]:
    with servo() as system, system.batch(40, inputs=["pid.r"], outputs=OUTPUTS, start={"mass.m": MASSES}) as made:
        yield made


def run(servo: Callable[..., System], copy: int, master: str) -> np.ndarray:
    """The outputs of a run with the actions and the mass of a copy."""
    reference = CallablePart(
        "reference", lambda t, u, x: ACTIONS[int(t / (HELD * STEP) + 1e-6), copy], outputs=["r"], sampled=True
    )
    with servo(reference, wires=("reference.r -> pid.r",), **{"mass.m": float(MASSES[copy])}) as system:
        result = system.run(master=master, record=OUTPUTS, decimate=HELD)
        return np.column_stack([result[name].to_numpy()[1:] for name in OUTPUTS])


@pytest.mark.parametrize("master", ["gauss-seidel", "newton"])
def test_a_copy_is_a_run_to_the_last_bit(servo: Callable[..., System], master: str) -> None:
    with (
        servo() as system,
        system.batch(40, inputs=["pid.r"], outputs=OUTPUTS, start={"mass.m": MASSES}, master=master, threads=2) as made,
    ):
        found = np.array([made.step(rows, HELD).copy() for rows in ACTIONS])
        assert not made.failures
        assert made.time.tolist() == 40 * [len(ACTIONS) * HELD * STEP]
    for copy in (0, 33):
        np.testing.assert_array_equal(found[:, copy], run(servo, copy, master))


def test_copies_are_reset_one_by_one_and_with_other_parameters(batch: Batch) -> None:
    first = [batch.step(rows, HELD).copy() for rows in ACTIONS]
    batch.reset([3, 5])
    assert (batch.time == 0.0).tolist() == [copy in (3, 5) for copy in range(40)]
    again = [batch.step(rows, HELD).copy() for rows in ACTIONS]
    same = [np.array_equal([each[copy] for each in first], [each[copy] for each in again]) for copy in range(40)]
    assert same == [copy in (3, 5) for copy in range(40)]

    batch.reset(start={"mass.m": np.full(40, MASSES[5])})
    for rows in ACTIONS:
        batch.step(np.repeat(rows[5:6], 40, axis=0), HELD)
    np.testing.assert_array_equal(batch.values, np.tile(first[-1][5], (40, 1)))


def test_what_fails_is_named_and_the_others_go_on(batch: Batch) -> None:
    batch.step(ACTIONS[0])
    before, rows = batch.values.copy(), ACTIONS[1].copy()
    rows[7] = np.nan
    batch.step(rows, HELD)
    assert {copy: str(error) for copy, error in batch.failures.items()} == {
        7: "the input pid.r is nan: give a finite number"
    }
    assert (batch.values == before).all(axis=1).tolist() == [copy == 7 for copy in range(40)]
    assert batch.time[7] == STEP
    batch.step(ACTIONS[1], HELD)
    assert not batch.failures


@pytest.mark.parametrize("master", ["gauss-seidel", "newton"])
def test_a_step_that_fails_is_not_taken(servo: Callable[..., System], master: str) -> None:
    loads = np.zeros((20, 1))
    with (
        servo() as system,
        system.batch(20, inputs=["mass.F_load"], outputs=["mass.x", "mass.v"], master=master) as batch,
    ):
        batch.step(loads, 10)
        before = batch.values[4].copy()
        loads[4] = 1.7e308  # with a mass of 1 kg, its acceleration; the friction of its velocity is infinite
        batch.step(loads, 10)
        assert list(batch.failures) == [4]
        assert "friction" in str(batch.failures[4]) or "mass" in str(batch.failures[4])
        np.testing.assert_array_equal(batch.values[4], before)
        loads[4] = 0.0
        batch.step(loads, 10)
        batch.reset(np.arange(20) != 4)
        loads[:] = 0.0
        batch.step(loads, 20)
        assert not batch.failures
        np.testing.assert_array_equal(batch.values[5], batch.values[6])


@pytest.mark.parametrize(
    ("call", "kind", "words"),
    [
        (lambda b: b.step(np.zeros((39, 1))), ExperimentError, r"shape \(39, 1\): give \(40, 1\)"),
        (lambda b: b.step(np.zeros(40)), ExperimentError, r"shape \(40,\)"),
        (lambda b: b.step([["a"]] * 40), ExperimentError, "not numbers"),
        (lambda b: b.step(ACTIONS[0] * 1j), ExperimentError, "not numbers"),
        (lambda b: b.reset([1], start={"mass.m": [[1], [1, 2]]}), StartValueError, "mass.m are no array"),
        (lambda b: b.step(ACTIONS[0], 0), ExperimentError, "0 steps"),
        (lambda b: b.reset([40]), ExperimentError, "no copy 40: give indices from 0 to 39"),
        (lambda b: b.reset([-1]), ExperimentError, "no copy -1"),
        (lambda b: b.reset([0.5]), ExperimentError, "give their indices, or a mask of 40"),
        (lambda b: b.reset([True]), ExperimentError, "mask of 40"),
        (lambda b: b.reset([1], start={"mass.k": [1.0]}), UnknownNameError, "mass.k"),
        (lambda b: b.reset([1], start={"mass.m": [1.0, 2.0]}), StartValueError, "mass.m"),
        (lambda b: b.reset([1], start={"mass.m": [-1.0]}), StartValueError, "mass rejected the start value -1.0 of m"),
    ],
)
def test_a_wrong_argument_is_refused_and_changes_nothing(
    batch: Batch, call: Callable[[Batch], object], kind: type[HarnessError], words: str
) -> None:
    batch.step(ACTIONS[0], HELD)
    before = batch.values.copy(), batch.time
    with pytest.raises(kind, match=words):
        call(batch)
    np.testing.assert_array_equal(batch.values, before[0])
    np.testing.assert_array_equal(batch.time, before[1])
    batch.reset([1])
    batch.step(ACTIONS[0], HELD)
    np.testing.assert_array_equal(batch.values[1], before[0][1])


@pytest.mark.parametrize("model", ["LuGre", "Coulomb"])  # the latter keeps in mind how it came to rest
def test_a_copy_does_not_depend_on_the_others(build_fmu: BuildFmu, model: str) -> None:
    forces, speeds = np.random.default_rng(5).normal(scale=2.0, size=(20, 3, 1)), np.linspace(0.0, 0.1, 3)
    springs = np.array([2.0, 0.0, 50.0])
    load = ["mass.F_ext -> friction.F_ext"] if model == "Coulomb" else []
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction", *load]
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu(model))]

    def stepped(copies: list[int]) -> np.ndarray:
        with system.batch(
            len(copies),
            inputs=["mass.F_drive"],
            outputs=["mass.x", "friction.F"],
            start={"mass.v0": speeds[copies], "mass.k": springs[copies]},
            master="newton",
            step=1e-3,
        ) as made:
            return np.array([made.step(rows[copies], 5).copy() for rows in forces])

    with System(parts, wires, {"mass.F_drive": 0.0}) as system:
        together = stepped([0, 1, 2])
        for copy in range(3):
            np.testing.assert_array_equal(together[:, [copy]], stepped([copy]))


def test_a_copy_does_not_know_that_another_one_sticks(build_fmu: BuildFmu) -> None:
    """Their loads jump in each step; some stick, others slip."""
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("Stiction"))]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction", "mass.F_ext -> friction.F_ext"]
    start = {"mass.m": 0.01, "mass.k": 30.0, "mass.d": 0.05, "mass.F_drive": 0.0}
    start |= {"friction.Fc": 1.0, "friction.Fs": 1.6, "friction.Fv": 0.01}
    forces = np.random.default_rng(1).uniform(-4.0, 4.0, (12, 4, 1))

    def stepped(copies: list[int]) -> np.ndarray:
        with system.batch(
            len(copies), inputs=["mass.F_drive"], outputs=["mass.x", "friction.F"], master="newton", step=0.01
        ) as made:
            return np.array([made.step(rows[copies], 1).copy() for rows in forces])

    with System(parts, wires, start) as system:
        together = stepped([0, 1, 2, 3])
        for copy in range(4):
            np.testing.assert_array_equal(together[:, [copy]], stepped([copy]))


def test_inputs_have_the_order_and_the_start_values_that_were_given(servo: Callable[..., System]) -> None:
    starts = np.array([0.0, 1e-3, 2e-3])
    with servo() as system, system.batch(3, inputs=["pid.enable", "pid.r"], outputs=["pid.u"]) as flag_first:
        flag_first.step(np.column_stack([np.ones(3), starts]), 10)
        with system.batch(3, inputs=["pid.r"], outputs=["pid.u"], start={"pid.r": starts}) as batch:
            kp = 12000.0  # of PID.c
            np.testing.assert_allclose(batch.values[:, 0], kp * starts, rtol=1e-12)
            batch.reset()
            batch.step(starts[:, None], 10)
            np.testing.assert_array_equal(batch.values, flag_first.values)


def test_a_batch_without_inputs_names_the_copy_that_fails(servo: Callable[..., System]) -> None:
    loads = np.array([0.0, 1.7e308])
    with servo() as system, system.batch(2, start={"mass.F_load": loads}) as batch:
        batch.step(steps=10)
        assert list(batch.failures) == [1]
        assert batch.time.tolist() == [10 * STEP, 0.0]


def test_start_values_keep_their_fractions_after_integers(servo: Callable[..., System]) -> None:
    with servo() as system, system.batch(2, outputs=["mass.m"], start={"mass.m": [1, 2]}) as batch:
        assert batch.reset([0], start={"mass.m": [1.5]}).tolist() == [[1.5], [2.0]]


def test_a_closed_batch_is_not_stepped(batch: Batch) -> None:
    batch.close()
    for call in (lambda: batch.step(ACTIONS[0]), batch.reset):
        with pytest.raises(HarnessError, match=r"closed: make another one with System\.batch"):
            call()


def test_a_batch_has_no_end_and_no_manipulators(servo: Callable[..., System]) -> None:
    with servo() as system:
        with system.batch(1, outputs=["mass.x"], step=7e-4) as batch:  # which does not divide the run of 0.03 s
            batch.step(steps=1001)
            assert not batch.failures
        system.experiment = replace(system.experiment, manipulators=(Noise("pid.x", sigma=1e-6, seed=1),))
        with pytest.raises(ExperimentError, match="has no manipulators"):
            system.batch(1)


def test_what_cannot_be_in_a_batch_is_named(servo: Callable[..., System], make_fmu: Callable[..., Path]) -> None:
    record = SeriesPart("record", [0.0, 1.0], {"r": [0.0, 1.0]}, {"r": "m"})
    law = CallablePart("law", lambda t, u, x: 0.0, outputs=["r"])
    for part, words in ((record, "'record' is a recorded series: list"), (law, "'law' is a part in Python")):
        with servo(part, wires=(f"{part.name}.r -> pid.r",)) as system, pytest.raises(HarnessError, match=words):
            system.batch(2)
    with System([FmuPart("probe", make_fmu())]) as system, pytest.raises(HarnessError, match="'probe' is no block"):
        system.batch(2, step=STEP)
    with servo() as system:
        for names, words in (
            (["mass.v"], "no input 'mass.v'"),
            (["pid.x"], "driven by mass.x"),
            (2 * ["pid.r"], "twice"),
        ):
            with pytest.raises(HarnessError, match=words):
                system.batch(2, inputs=names)
        with pytest.raises(ExperimentError, match="a batch of 0 copies"):
            system.batch(0)
