"""PositionMap against scipy's cubic Hermite splines, and the axis that it acts on."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.interpolate import CubicHermiteSpline
from thorough import nightly

from friction_fmus import fmu
from friction_fmus.axis.position_map import Grid, PositionMap
from friction_fmus.axis.servo import AxisPlant, Servo, Trajectory
from friction_fmus.axis.servo_loop import closed_loop, run_loop
from friction_fmus.blocks.catalogue import source_folder
from friction_fmus.errors import BuildError
from friction_fmus.study.data import build_reference
from harness import Drive, FmuPart

Array = NDArray[np.float64]

RANDOM = np.random.default_rng(3)
COGGING, FRICTION = RANDOM.normal(size=(2, 9))
LINE = PositionMap(Grid(-0.02, 0.01, 9), tuple(COGGING.tolist()), tuple(FRICTION.tolist()), 2e-3)
TURN = replace(LINE, grid=Grid(-0.02, 0.01, 9, periodic=True))


def forces(table: PositionMap, x: Array, v: Array, **start: float) -> Array:
    """Force of the FMU; the output after a step belongs to the inputs before it."""
    drive = Drive(FmuPart("map", table.fmu()))
    inputs = {"x": np.append(x, 0.0), "v": np.append(v, 0.0)}
    found: Array = drive.run(inputs, ["F_position"], 1e-3, start={**table.start, **start})[1:, 0]
    drive.close()
    return found


def spline(values: Array) -> CubicHermiteSpline:
    """Slopes by central differences, and by one interval at the ends."""
    return CubicHermiteSpline(-0.02 + 0.01 * np.arange(9), values, np.gradient(values, 0.01))


def test_both_parts_are_cubic_splines_over_position() -> None:
    x = RANDOM.uniform(-0.02, 0.06, 300)
    v = RANDOM.normal(0.0, 2e-3, 300)
    expected = spline(COGGING)(x) - spline(FRICTION)(x) * np.tanh(v / 2e-3)
    np.testing.assert_allclose(forces(LINE, x, v), expected, atol=1e-13)
    np.testing.assert_allclose(LINE.force(x, v), expected, atol=1e-13)


def test_the_default_map_is_the_ripple_that_its_header_names() -> None:
    text = (source_folder() / "plants" / "map.h").read_text(encoding="utf-8")
    cogging, friction = np.array(re.findall(r"^ *{([-\d.]+), ([-\d.]+)},$", text, re.M), dtype=float).T
    turns = np.arange(25) * 0.003 / 0.072
    np.testing.assert_allclose(cogging, np.sin(2.0 * np.pi * 3.0 * turns), atol=6e-7)
    np.testing.assert_allclose(friction, 0.4 * np.cos(2.0 * np.pi * turns), atol=6e-7)
    drive = Drive(FmuPart("map", fmu("PositionMap")))
    inputs = {"x": np.array([0.003, 0.0]), "v": np.array([-1.0, 0.0])}
    found, begin = drive.run(inputs, ["F_position", "x_begin"], 1e-3)[1]
    drive.close()
    assert begin == 0.0
    assert found == pytest.approx(np.sqrt(0.5) + 0.4 * np.cos(np.pi / 12.0), abs=1e-5)


def test_outside_of_the_table_its_ends_hold() -> None:
    x = np.array([-1e300, -1.0, 0.07, 1e300])
    ends = COGGING[[0, 0, -1, -1]]
    np.testing.assert_allclose(forces(LINE, x, 0.0 * x), ends, atol=1e-14)
    np.testing.assert_allclose(LINE.force(x, 0.0 * x), ends, atol=1e-14)


def test_a_periodic_table_repeats_itself() -> None:
    x = RANDOM.uniform(-0.02, 0.06, 100)
    v = np.full(100, 1.0)
    for turns in (-3, 0, 7):
        np.testing.assert_allclose(forces(TURN, x + turns * 0.09, v), TURN.force(x, v), atol=1e-12)
    # between the last node and the first, it goes through both
    ends = np.array([0.06, 0.07])
    np.testing.assert_allclose(TURN.force(ends, 0.0 * ends), COGGING[[8, 0]], atol=1e-13)


def test_cogging_is_conservative_and_friction_dissipates() -> None:
    """There and back over the table, cogging does no work; friction does twice its integral."""
    work = {}
    for name, table in (
        ("cogging", replace(LINE, friction=(0.0,) * 9)),
        ("friction", replace(LINE, cogging=(0.0,) * 9)),
    ):
        x = np.linspace(-0.02, 0.06, 40_001)
        there, back = forces(table, x, np.full(x.size, 1.0)), forces(table, x, np.full(x.size, -1.0))
        work[name] = np.trapezoid(there - back, x)
    assert work["cogging"] == pytest.approx(0.0, abs=1e-15)
    assert work["friction"] == pytest.approx(-2.0 * quad(spline(FRICTION), -0.02, 0.06)[0], rel=1e-6)


def test_start_values_scale_and_shift() -> None:
    x = RANDOM.uniform(-0.02, 0.06, 20)
    expected = 3.0 + 2.0 * spline(COGGING)(x) - 0.5 * spline(FRICTION)(x)
    found = forces(LINE, x, np.full(20, 1.0), F0=3.0, cogging_gain=2.0, friction_gain=0.5)
    np.testing.assert_allclose(found, expected, atol=1e-13)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"cogging": (0.0,) * 8}, "8 values of cogging"),
        ({"friction": (np.nan,) * 9}, "not finite"),
        ({"v_sign": 0.0}, "v_sign of 0"),
    ],
)
def test_a_table_that_is_wrong_is_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(BuildError, match=message):
        replace(LINE, **change)  # type: ignore[arg-type]


@nightly
@pytest.mark.parametrize("friction", ["Stribeck", "LuGre"])
def test_a_constant_table_on_an_axis_is_an_offset(friction: str, tmp_path: Path) -> None:
    """2 N forward, for a rigid and for an elastic contact; the table acts one step of 0.25 ms late."""
    T = 1e-3 * np.arange(801.0)
    r = 4e-3 * (1.0 - np.cos(2.0 * np.pi * T))
    reference = build_reference(T, r, tmp_path, "Reference")
    trajectory = Trajectory(reference, len(T), 0.0, 0.0)
    servo = Servo("PID", {"Kp": 12e3, "Kd": 190.0, "Ki": 0.0}, 1e-3, 20.0)
    constant = PositionMap(Grid(-0.01, 0.01, 4), (2.0,) * 4, (0.0,) * 4, 1e-3)
    paths = []
    for plant in (
        AxisPlant(friction, {"Fc": 1.0, "Fs": 1.5}, 1.0, -2.0),
        AxisPlant(friction, {"Fc": 1.0, "Fs": 1.5}, 1.0, 0.0, constant),
    ):
        with closed_loop(servo, plant, trajectory) as system:
            paths.append(run_loop(system).q)
    np.testing.assert_allclose(paths[1], paths[0], atol=2e-6)
