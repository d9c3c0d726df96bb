"""The servo of a study with a force beside it, against the laws and systems that the study itself simulates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from drive_axis import LAW, rms, study_folder
from thorough import landing

from friction_fmus.axis.servo_loop import accurate, closed_loop
from friction_fmus.export.axis_fit import AxisFit
from friction_fmus.export.identified_axis import IdentifiedAxis, read_axis
from friction_fmus.study.evaluation import AxisBench
from friction_fmus.study.study_files import with_tracking_error


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> tuple[IdentifiedAxis, AxisBench]:
    folder, bench = study_folder(tmp_path_factory.mktemp("study"))
    return read_axis(folder), bench


def test_the_reference_is_that_of_the_study(small: tuple[IdentifiedAxis, AxisBench]) -> None:
    axis, bench = small
    assert axis.loop is not None
    assert axis.loop.motion.r == pytest.approx(bench.r, abs=1e-15)
    assert axis.loop.motion.rd[1:-1] == pytest.approx(np.gradient(bench.r, bench.servo.Ts)[1:-1], abs=1e-9)
    assert axis.loop.sample_time == pytest.approx(bench.servo.Ts)


def test_a_force_acts_as_that_of_a_law_in_the_same_sample(small: tuple[IdentifiedAxis, AxisBench]) -> None:
    """What the law puts out, played back, gives the same error: no sample late, nothing added twice."""
    axis, bench = small
    with closed_loop(bench.servo, bench.plant, bench.trajectory, LAW) as system:
        whole, _ = accurate(with_tracking_error(system))
        assert whole.experiment is not None
        result = whole.run(record=["compensator.u", "axis.x"])
    force = result["compensator.u"].to_numpy()[1:]  # a row has the sampled values of the period that ends there
    error = bench.r - result["axis.x"].to_numpy()[:-1]
    assert axis.loop is not None
    found = axis.loop.error(force + bench.trajectory.offset)
    assert found == pytest.approx(error, abs=1e-6 * rms(error))
    late = axis.loop.error(np.append(0.0, force[:-1]) + bench.trajectory.offset)
    assert rms(late - error) > 0.03 * rms(error)


def test_without_a_force_it_is_the_servo_of_the_study(small: tuple[IdentifiedAxis, AxisBench]) -> None:
    axis, bench = small
    loop = axis.loop
    assert loop is not None
    found = loop.error(np.full(len(bench.r), bench.trajectory.offset))
    assert rms(found) == pytest.approx(loop.fed, rel=1e-6)
    again = loop.error(np.full(len(bench.r), bench.trajectory.offset), loop.motion)
    assert again == pytest.approx(found, abs=1e-3 * rms(found))


def test_the_fit_has_the_least_error_of_its_form(small: tuple[IdentifiedAxis, AxisBench]) -> None:
    """No change of a factor by 3 % reduces the error by more than 1 %."""
    axis, _ = small
    fit = AxisFit(axis)
    known = axis.offset - fit.along
    p = fit.fit(fit.coulomb, known)
    best = fit.tracking(fit.coulomb @ p + known)
    assert axis.loop is not None
    assert axis.loop.fed is not None
    assert best < 0.5 * axis.loop.fed
    for i in range(2):
        for factor in (0.97, 1.03):
            other = np.where(np.arange(2) == i, factor * p, p)
            assert fit.tracking(fit.coulomb @ other + known) > 0.99 * best


@landing
def test_gravity_of_an_arm_is_part_of_the_force(tmp_path: Path) -> None:
    """The study feeds it forward; here, it is that of the table over position."""
    folder, bench = study_folder(tmp_path, arm=True)
    axis = read_axis(folder)
    assert axis.loop is not None
    fit = AxisFit(axis)
    q = fit.motion.r
    assert fit.along == pytest.approx(-0.3 * np.sin(q) - 0.1 * np.cos(q), abs=1e-6)
    found = axis.loop.error(axis.offset - fit.along)
    assert rms(found) == pytest.approx(axis.loop.fed, rel=1e-3)
    assert rms(axis.loop.error(np.full(len(bench.r), axis.offset))) > 2.0 * rms(found)
