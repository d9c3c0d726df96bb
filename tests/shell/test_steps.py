"""Times and step sizes: a step lands on t + h, and a step that cannot be is refused."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest
from shell.instance import ERROR, OK, Instance, Library, load
from thorough import some

AWKWARD = (1.0 / 60.0, 1e-3 / 3.0, 0.1, 7e-5)


@pytest.mark.parametrize("h", some(AWKWARD, AWKWARD[:2]))
def test_time_is_exactly_t_plus_h(instance: Instance, h: float) -> None:
    t = 0.3
    instance.initialise(start=t)
    assert instance.get1("time") == t
    for _ in range(200):
        instance.step(t, h)
        t = t + h
        assert instance.get1("time") == t


@pytest.mark.parametrize("h", AWKWARD)
def test_a_master_that_multiplies_instead_of_adding_is_followed(instance: Instance, h: float) -> None:
    """k h and the sum of h differ by rounding: the time becomes that of the master each step."""
    instance.initialise()
    for k in range(300):
        instance.step(k * h, h)
        assert instance.get1("time") == k * h + h


def test_steps_that_differ_by_rounding_are_accepted(instance: Instance) -> None:
    instance.initialise(stop=0.3)
    instance.step(0.0, 0.1 - 1e-16)
    instance.step(0.1, 0.1 + 1e-16)
    instance.step(0.2 - 1e-16, 0.09999999999999998)
    instance.step(0.3 - 1e-16, 1e-17)
    assert instance.get1("time") == pytest.approx(0.3, abs=1e-15)


def test_a_step_beyond_the_stop_time_is_an_error(instance: Instance) -> None:
    instance.initialise(start=1.0, stop=2.0)
    instance.step(1.0, 1.0)
    before = instance.everything(), instance.serialised()
    assert instance.call("DoStep", 2.0, 0.5, 1) == ERROR
    assert b"stop time" in instance.messages[-1][3]
    assert (instance.everything(), instance.serialised()) == before


@pytest.mark.parametrize("rounding", [0.0, 1e-16, 4e-15])
def test_the_last_step_may_pass_the_stop_time_by_rounding(instance: Instance, rounding: float) -> None:
    instance.initialise(stop=1.0)
    instance.step(0.0, 0.9)
    instance.step(0.9, 0.1 + rounding)


@pytest.mark.parametrize(
    ("t", "h"),
    [
        (0.0, 0.0),
        (0.0, -0.1),
        (0.5, 0.1),
        (-0.5, 0.1),
        (0.0, math.nan),
        (math.nan, 0.1),
        (0.0, math.inf),
        (0.0, -math.inf),
    ],
)
def test_impossible_steps_are_errors_and_change_nothing(instance: Instance, t: float, h: float) -> None:
    instance.initialise()
    before = instance.everything(), instance.serialised()
    assert instance.call("DoStep", t, h, 1) == ERROR
    assert instance.messages[-1][1:3] == (ERROR, "logStatusError")
    assert (instance.everything(), instance.serialised()) == before
    instance.step(0.0, 0.1)


@pytest.mark.parametrize(
    ("name", "output"),
    some([("ElastoPlastic", "F"), ("GMS", "F"), ("LuGre", "F"), ("SwitchMass", "v")], [("ElastoPlastic", "F")]),
)
def test_a_tolerance_of_the_experiment_is_honoured(build_fmu: Callable[..., Path], name: str, output: str) -> None:
    """A coarse one gives another result, within a margin of it; a finer one less, and none the finest."""
    library, found = load(build_fmu(name)), {}
    ramped = {"ElastoPlastic": "v", "GMS": "v", "LuGre": "v", "SwitchMass": "F_load"}[name]
    size = 1.0 if ramped == "F_load" else 4e-3
    for tolerance in (1e-3, 1e-6, 1e-13, None):
        with Instance(library) as run:
            run.initialise(tolerance=tolerance)
            found[tolerance] = []
            for k, (begin, end) in enumerate([(0.1, 1.0), (1.0, 0.1), (0.1, 0.4), (0.4, -1.0), (-1.0, -0.1)]):
                h = 0.4 if ramped == "F_load" else 0.02
                run.set({ramped: size * begin})
                assert run.input_derivatives({ramped: size * (end - begin) / h}) == OK
                run.step(h * k, h)
                found[tolerance].append(run.get1(output))
    errors = {t: max(abs(a - b) for a, b in zip(F, found[1e-13], strict=True)) for t, F in found.items()}
    assert 0.05 > errors[1e-3] > errors[1e-6] > errors[None]
    assert errors[1e-6] < 1e-4 and errors[None] < 1e-8


def test_a_later_start_time_is_the_first_point(library: Library, instance: Instance) -> None:
    instance.initialise(start=5.0)
    assert instance.get1("time") == 5.0
    instance.step(5.0, 0.1)
    assert instance.get1("time") == 5.1


TS = 2e-3
IMPORTERS = {
    "sums the steps": lambda t, k: (t, TS),
    "multiplies": lambda t, k: (UNIX + k * TS, TS),
    "passes differences": lambda t, k: (UNIX + k * TS, (UNIX + (k + 1) * TS) - (UNIX + k * TS)),
}
UNIX = 1.7e9
"""[s] A start whose rounding is 1.2e-4 of the sampling time; the sum of the steps is a sampling time off at the end."""


@pytest.mark.parametrize("importer", IMPORTERS.values(), ids=IMPORTERS)
def test_each_step_takes_its_sample_at_large_times(
    build_fmu: Callable[..., Path], importer: Callable[[float, int], tuple[float, float]]
) -> None:
    """The difference of two samples of a position that moves by Ts in each step is Ts, so the velocity is 1."""
    with Instance(load(build_fmu("Differentiator"))) as run:
        count = 23_000 if importer is IMPORTERS["sums the steps"] else 2000
        run.initialise(start=UNIX, stop=UNIX + count * TS, Ts=TS, window=1, v0=1.0)
        t = UNIX
        for k in range(count):
            t, h = importer(t, k)
            run.set({"x": TS * k})
            run.step(t, h)
            t += h
            assert k % 10 or run.get1("v") == pytest.approx(1.0, abs=1e-6), k


def test_each_step_takes_its_sample_if_rounding_of_the_time_is_as_large(build_fmu: Callable[..., Path]) -> None:
    """Two steps of 0.4 us in a row add 0.48 us each to a Unix time; only the steps can be counted."""
    with Instance(load(build_fmu("Differentiator"))) as run:
        run.initialise(start=UNIX, Ts=4e-7, window=1, v0=1.0)
        t = UNIX
        for k in range(20):
            run.set({"x": 4e-7 * k})
            run.step(t, 4e-7)
            t += 4e-7
            assert run.get1("v") == pytest.approx(1.0, abs=1e-6), k


def test_samples_follow_the_time_of_an_importer_with_rounded_steps(build_fmu: Callable[..., Path]) -> None:
    """Steps in single precision are 1.5e-8 too long; the times are right, so each step takes one sample."""
    with Instance(load(build_fmu("Differentiator"))) as run:
        run.initialise(Ts=0.1, window=1, v0=1.0)
        for k in range(1000):
            run.set({"x": 0.1 * k})
            run.step(k * 0.1, 0.1 * (1.0 + 1.5e-8))
            assert run.get1("v") == pytest.approx(1.0, abs=1e-6), k
