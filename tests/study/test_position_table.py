"""The force over position as a feedforward: what the table takes away, and what an estimator sees of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from thorough import nightly, some

from friction_fmus.axis.position_map import Grid, PositionMap
from friction_fmus.axis.servo import AxisPlant, Compensator, Servo, Trajectory
from friction_fmus.axis.servo_loop import closed_loop, run_loop
from friction_fmus.identification import Array
from friction_fmus.study.compensators import TABLE, AxisKnowledge, candidates
from friction_fmus.study.data import build_reference
from friction_fmus.study.evaluation import AxisBench, Scheme, evaluate
from friction_fmus.study.study_files import export_recommended
from harness import System

T = 1e-3 * np.arange(1001.0)
R = 4e-3 * (1.0 - np.cos(2.0 * np.pi * T))
SERVO = Servo("PID", {"Kp": 12e3, "Kd": 190.0, "Ki": 0.0}, 1e-3, 20.0)
OBSERVER = Compensator("DisturbanceObserver", "F_hat", {"m": 1.0, "fc": 20.0})
FLAT = AxisPlant("Stribeck", {"Fc": 1.0, "Fs": 1.5}, 1.0)
NODES = 65
RIPPLE = tuple(2.0 * np.sin(2.0 * np.pi * np.linspace(0.0, 4.0, NODES)))  # 2 N, four periods over 12 mm
COGGING = replace(FLAT, position=PositionMap(Grid(-2e-3, 12e-3 / (NODES - 1), NODES), RIPPLE, (0.0,) * NODES, 1e-3))


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_reference(T, R, tmp_path_factory.mktemp("reference"), "Reference")


def path(reference: Path, plant: AxisPlant, table: PositionMap | None, compensator: Compensator | None) -> Array:
    trajectory = Trajectory(reference, len(T), 0.0, 0.0, motion=True, table=table)
    with closed_loop(SERVO, plant, trajectory, compensator) as system:
        return run_loop(system).q


@pytest.mark.parametrize("compensator", some([None, OBSERVER], [None]), ids=some(["alone", "estimator"], ["alone"]))
def test_a_constant_table_takes_a_constant_force_away(reference: Path, compensator: Compensator | None) -> None:
    """The axis then moves as without both, and an estimator sees neither; the plant's force acts one step late."""
    constant = PositionMap(Grid(-0.01, 0.01, 4), (2.0,) * 4, (0.0,) * 4, 1e-3)
    expected = path(reference, FLAT, None, compensator)
    uncompensated = path(reference, replace(FLAT, position=constant), None, compensator)
    compensated = path(reference, replace(FLAT, position=constant), constant, compensator)
    np.testing.assert_allclose(compensated, expected, atol=2e-6)
    assert np.max(np.abs(uncompensated - expected)) > 1e-5


@pytest.mark.parametrize(
    "compensator", some([None, OBSERVER], [OBSERVER]), ids=some(["alone", "estimator"], ["estimator"])
)
def test_the_table_of_a_ripple_leaves_the_error_of_the_smooth_axis(
    reference: Path, compensator: Compensator | None
) -> None:
    """Up to the distance between position and reference: 0.1 mm on a period of 3 mm changes the force by a fifth."""
    smooth = path(reference, FLAT, None, compensator)
    left = path(reference, COGGING, COGGING.position, compensator) - smooth
    before = path(reference, COGGING, None, compensator) - smooth
    assert np.std(left) < 0.25 * np.std(before)


def test_the_candidate_needs_an_identified_table() -> None:
    (with_table,) = candidates([TABLE.name], AxisKnowledge(SERVO, COGGING, {}))
    (without,) = candidates([TABLE.name], AxisKnowledge(SERVO, FLAT, {}))
    assert with_table.applies
    assert not without.applies
    assert "position" in without.reason


@nightly
def test_the_exported_table_repeats_the_run(reference: Path, tmp_path: Path) -> None:
    bench = AxisBench(SERVO, COGGING, Trajectory(reference, len(T), 0.0, 0.0, motion=True), R)
    scheme = Scheme(SERVO, compensator=OBSERVER, table=True)
    found = evaluate(bench, [scheme], ())
    assert found.metrics is not None
    written = export_recommended(tmp_path, bench, scheme, "test", "", None)
    assert "recommended/PositionMap.fmu" in {file.path for file in written}
    with System.from_ssp(tmp_path / "recommended" / "axis.ssp") as system:
        error = R - run_loop(system).q[: len(R)]
    assert np.sqrt(np.mean(np.square(error))) == pytest.approx(found.metrics.rms, rel=1e-5)
    text = (tmp_path / "recommended" / "README.md").read_text(encoding="utf-8")
    assert "| `force.u2` | -1.0 × `table.F_position` | 0 |" in text
    assert "| `table.x` | `reference.r` | 0 |" in text
