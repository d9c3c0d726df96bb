"""How every block moves in time: it takes steps of any size, and gives the same bits each time."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from shell.instance import DISCARD, ERROR, OK, WARNING, Instance, Library, drive, load, signals
from shell.selection import CONTINUOUS_BLOCKS, of_each_branch
from thorough import some


def real_values(library: Library, instance: Instance) -> dict[str, float]:
    names = library.names(type="Real")
    return dict(zip(names, instance.get(*names), strict=True))


@pytest.mark.parametrize("h", [5e-324, 1e-310, 1e-17, 1e-15, 1e-12])
def test_an_extra_tiny_step_hardly_changes_anything(library: Library, instance: Instance, h: float) -> None:
    instance.initialise(**signals(library, 1, 1)[0])
    instance.step(0.0, 0.01 * (1.0 - 1e-3))
    before = real_values(library, instance)
    instance.step(0.01 * (1.0 - 1e-3), h)
    for name, value in real_values(library, instance).items():
        nominal = float(library.variables[name].nominal or 1.0)
        assert value == pytest.approx(before[name], rel=1e-6, abs=1e-5 * nominal), name


@pytest.mark.parametrize("h", [1.0 / 1024.0, 1.0 / 64.0])  # so that both ways come to the same times
def test_one_step_is_two_half_steps(library: Library, h: float) -> None:
    """With held inputs; sampled blocks take the same samples either way."""
    with Instance(library) as whole, Instance(library) as halves:
        for run in (whole, halves):
            run.initialise()
        for k, inputs in enumerate(signals(library, 1, 40)):
            t = k * h
            for run in (whole, halves):
                run.set(inputs)
            whole.step(t, h)
            halves.step(t, h / 2)
            halves.step(t + h / 2, h / 2)
            for name, one in real_values(library, whole).items():
                nominal = float(library.variables[name].nominal or 1.0)
                assert halves.get1(name) == pytest.approx(one, rel=1e-9, abs=1e-9 * nominal), (name, k)


def test_a_span_may_be_cut_anyhow(library: Library) -> None:
    """Held inputs, steps of random size against a single one."""
    inputs = signals(library, 4, 5)[-1]
    cuts = np.sort(np.random.default_rng(4).uniform(0.0, 0.2, 60))
    with Instance(library) as single, Instance(library) as cut:
        for run in (single, cut):
            run.initialise(**inputs)
        single.step(0.0, 0.2)
        t = 0.0
        for end in (*cuts, 0.2):
            cut.step(t, end - t)
            t = t + (end - t)
        for name, one in real_values(library, single).items():
            nominal = float(library.variables[name].nominal or 1.0)
            assert cut.get1(name) == pytest.approx(one, rel=1e-8, abs=1e-8 * nominal), name


@pytest.mark.parametrize("library", of_each_branch(CONTINUOUS_BLOCKS), indirect=True)
def test_inputs_with_slopes_may_be_cut_anyhow(library: Library) -> None:
    """Linear inputs through a change of sign, over pieces against a single step."""
    ends = signals(library, 5, 1)[0]
    real = library.names("input", type="Real")
    span = 0.01

    def value(name: str, t: float) -> float:
        return ends[name] * (2.0 * t / span - 0.7)

    with Instance(library) as single, Instance(library) as cut:
        for run, pieces in ((single, 1), (cut, 7)):
            run.initialise()
            for k in range(pieces):
                t = span * k / pieces
                run.set({name: value(name, t) for name in real})
                assert run.input_derivatives({name: ends[name] * 2.0 / span for name in real}) == OK
                run.step(t, span / pieces)
        for name in real:
            assert single.get1(name) == pytest.approx(value(name, span), rel=1e-12), "inputs move with the step"
        for name, one in real_values(library, single).items():
            nominal = float(library.variables[name].nominal or 1.0)
            assert cut.get1(name) == pytest.approx(one, rel=1e-7, abs=1e-7 * nominal), name


@pytest.mark.parametrize("size", some([1.0, 1e-200], [1e-200]))
def test_a_reversal_inside_a_step_is_located_whatever_the_size_of_the_input(
    build_fmu: Callable[..., Path], size: float
) -> None:
    """An elastic, perfectly plastic element goes 0.5 N forth, of which it keeps its limit 0.3 N, and 0.5 N back."""
    with Instance(load(build_fmu("MaxwellSlip", **{"N": 1, "k[1]": 1.0 / size, "W[1]": 0.3}))) as run:
        run.initialise(v=size)
        assert run.input_derivatives({"v": -size}) == OK
        run.step(0.0, 2.0)
        assert run.get1("F") == pytest.approx(-0.2, rel=1e-14)


@pytest.mark.parametrize("library", of_each_branch(CONTINUOUS_BLOCKS), indirect=True)
@pytest.mark.parametrize("tiny", [1e-20, 1e-160, 1e-200, 1e-310])
def test_an_input_that_passes_zero_right_away_starts_at_zero(library: Library, tiny: float) -> None:
    """A ramp from almost zero through zero is one from zero: no state is lost where the way there underflows."""
    inputs = signals(library, 8, 5)
    real = library.names("input", type="Real")
    with Instance(library) as passing, Instance(library) as plain:
        for run in (passing, plain):
            run.initialise()
            drive(run, [*inputs, dict.fromkeys(inputs[0], 0.0)], 0.0, 2.0**-9)  # at rest at the end
            t = run.get1("time")
            slopes = {name: 0.3 * (inputs[0][name] or 1e-3) for name in real}
            run.set({name: -tiny * slopes[name] if run is passing else 0.0 for name in real})
            assert run.input_derivatives(slopes) == OK
            run.step(t, 0.01)
        for name, one in real_values(library, plain).items():
            nominal = float(library.variables[name].nominal or 1.0)
            assert passing.get1(name) == pytest.approx(one, rel=1e-9, abs=1e-9 * nominal), name


def test_the_same_run_gives_the_same_bits(library: Library) -> None:
    histories = []
    for _ in range(2):
        with Instance(library) as run:
            run.initialise()
            histories.append(drive(run, signals(library, 6, 100), 0.0, 1e-3))
    assert histories[0] == histories[1]


def test_the_bits_do_not_depend_on_logging_or_on_who_reads(library: Library) -> None:
    inputs = signals(library, 7, 50)
    with Instance(library, logging=False, logger=False) as quiet, Instance(library) as read:
        for run in (quiet, read):
            run.initialise()
        drive(read, inputs, 0.0, 2e-3)
        t = 0.0
        for values in inputs:
            quiet.set(values)
            quiet.step(t, 2e-3)
            t += 2e-3
        assert quiet.everything() == read.everything()


def test_extreme_finite_values_are_computed_or_refused_but_never_give_nan(library: Library) -> None:
    """Whatever is set: a step is done with finite results, or discarded and the instance at its start."""
    names = [
        name
        for name in library.names("input", "parameter", type="Real")
        if library.variables[name].variability != "fixed"
    ]
    for size in (1e308, -1e308, 1e200, 1e-308):
        for chosen in (*([name] for name in names), names):
            with Instance(library) as run:
                run.initialise()
                run.step(0.0, 0.01)
                for name in chosen:
                    run.try_set({name: size})
                status = run.call("DoStep", 0.01, 0.01, 1)
                assert status in (OK, WARNING, DISCARD)
                if status != DISCARD:
                    assert all(map(math.isfinite, real_values(library, run).values())), chosen
                else:
                    assert run.messages[-1][1:3] == (DISCARD, "logStatusDiscard")


def test_nothing_is_printed(library: Library, capfd: pytest.CaptureFixture[str]) -> None:
    with Instance(library) as run:
        assert run.call("DoStep", 0.0, 0.1, 1) == ERROR
        run.initialise()
        run.step(0.0, 0.1)
        assert run.call("DoStep", 0.0, -1.0, 1) == ERROR
    assert capfd.readouterr() == ("", "")
