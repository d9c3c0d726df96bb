"""Identification from the feedback error: on an axis whose friction is known."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from friction_fmus import FrictionError
from friction_fmus.procedures import FrictionTable, identify_from_feedback
from harness import CallablePart, FmuPart, Port, System

SPEEDS = np.array([5e-4, 1e-3, 2e-3, 1e-2, 5e-2, -1e-3])


def true_friction(v: np.ndarray) -> np.ndarray:
    return np.sign(v) * (1.0 + 0.5 * np.exp(-((v / 1e-3) ** 2))) + 0.4 * v


@pytest.fixture(scope="module")
def axis(build_fmu: Callable[..., Path]) -> Callable[[float, float], System]:
    """A mass with LuGre friction under PD control."""

    def system(speed: float, force: float) -> System:
        reference = CallablePart(
            "reference", lambda t, u, x: [speed * t, speed], [], [Port("r", "m"), Port("rd", "m/s")]
        )
        parts = [reference, FmuPart("pid", build_fmu("PID")), FmuPart("mass", build_fmu("Mass"))]
        parts.append(FmuPart("friction", build_fmu("LuGre")))
        wires = ["reference.r -> pid.r", "reference.rd -> pid.rd", "mass.x -> pid.x", "mass.v -> pid.v"]
        wires += ["pid.u -> mass.F_drive", "mass.v -> friction.v", "friction.F -> mass.F_friction"]
        start = {"pid.Kp": 9e4, "pid.Kd": 600.0, "pid.Ki": 0.0, "pid.m": 0.0, "pid.Ts": 5e-4, "pid.rdd": 0.0}
        return System(parts, wires, start | {"pid.f": force, "mass.v0": speed})

    return system


HOW = {"control": "pid.u", "velocity": "mass.v", "settled": 1.0, "stop": 1.2, "step": 5e-4}


def test_two_passes_find_the_friction_curve(axis: Callable[[float, float], System]) -> None:
    found = identify_from_feedback(axis, SPEEDS, **HOW)
    assert found.levels.shape == (3, 6) and found.feedback.shape == found.ripple.shape == (2, 6)
    assert found.friction == pytest.approx(true_friction(SPEEDS), rel=1e-6)
    assert np.abs(found.feedback[1]).max() < 1e-5
    assert found.ripple.max() < 1e-3
    fit = found.stribeck()
    assert (fit["Fc"], fit["Fs"], fit["vs"], fit["Fv"]) == pytest.approx((1.0, 1.5, 1e-3, 0.4), rel=1e-4)


def test_passes_begin_with_a_table(axis: Callable[[float, float], System]) -> None:
    found = identify_from_feedback(axis, SPEEDS[:2], start=true_friction(SPEEDS[:2]), passes=1, **HOW)
    assert np.abs(found.feedback).max() < 1e-6


def test_speeds_at_which_the_axis_stuck_have_no_friction() -> None:
    table = FrictionTable(np.array([1.0, 2.0]), np.ones((2, 2)), np.zeros((1, 2)), np.array([[1.0, 0.5]]))
    assert np.isnan(table.friction[0]) and table.friction[1] == 1.0
    with pytest.raises(FrictionError, match="without stick-slip at 1 of 2 speeds; measure at four or more"):
        table.stribeck()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"speeds": [0.0, 1.0]}, "a speed is 0 or not a number"),
        ({"speeds": [np.nan]}, "a speed is 0 or not a number"),
        ({"passes": 0}, "passes = 0, settled = 1.0 s, stop = 1.2 s"),
        ({"settled": 1.5}, "settled before stop"),
    ],
)
def test_what_makes_no_sense_is_refused(wrong: dict[str, object], message: str) -> None:
    def never(speed: float, force: float) -> System:
        raise AssertionError("no system is to be made")

    with pytest.raises(FrictionError, match=message):
        identify_from_feedback(never, **({"speeds": SPEEDS} | HOW | wrong))
