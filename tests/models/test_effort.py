"""A long communication step that is cheap is taken."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest
from shell.instance import OK, Instance, load
from thorough import nightly


def test_a_fault_that_is_loaded_slowly_is_followed_over_years(build_fmu: Callable[..., Path]) -> None:
    """No block moves before the driver has gone by 1: the step is a closed form however long it is."""
    with Instance(load(build_fmu("BurridgeKnopoff"))) as run:
        run.initialise(nu=1e-9, spread=0.0)
        run.step(0.0, 9e8)
        assert run.get1("F") == pytest.approx(0.9, rel=1e-12)


@nightly
def test_a_fault_slips_many_times_in_a_long_step(build_fmu: Callable[..., Path]) -> None:
    """1000 s at the start values: the driver goes by 10, so each block has slipped by about as much."""
    with Instance(load(build_fmu("BurridgeKnopoff"))) as run:
        run.initialise()
        run.step(0.0, 1e3)
        assert run.get1("avalanches") > 100
        assert run.get1("F") == pytest.approx(10.0 - run.get1("x"), abs=1e-9)


def test_a_tip_that_is_pulled_slowly_takes_a_whole_period_at_once(build_fmu: Callable[..., Path]) -> None:
    """E0 = 0: after 1e6 s at 1 um/s the spring has the drag m damping v."""
    with Instance(load(build_fmu("PrandtlTomlinson"))) as run:
        run.initialise(v=1e-6, E0=0.0)
        assert run.call("DoStep", 0.0, 1e6, 1) == OK
        assert run.get1("F") == pytest.approx(2e-6, rel=1e-6)


@pytest.mark.parametrize(("name", "path"), [("GenericAsperity", 0.9), ("Bristle", 0.9)])
def test_a_slider_that_goes_far_is_followed(build_fmu: Callable[..., Path], name: str, path: float) -> None:
    with Instance(load(build_fmu(name))) as run:
        run.initialise(v=path)
        run.step(0.0, 1.0)
        assert math.isfinite(run.get1("F"))
