"""Elements of hysteresis from computed loops, and the tribometer's record."""

from __future__ import annotations

import time

import numpy as np
import pytest
from contacts import maxwell_force, noise, reversals
from thorough import THOROUGH, landing

from friction_fmus import identify
from friction_fmus.data import load_tribometer
from friction_fmus.identification import FitError, Identification, Record
from friction_fmus.identification.fit.contact_model import contact_model
from friction_fmus.identification.fit.simulation_data import prepare
from friction_fmus.identification.methods.hysteresis import HysteresisGrid, coarse, fit_grid

STEP = 1e-3
STIFFNESS = np.array([4e4, 2e4, 1e4])
LEVEL = np.array([0.6, 0.8, 1.0])


def identify_hysteresis(record: Record, points: int = 20) -> HysteresisGrid:
    """The distribution of stiffness over break-away distance."""
    segment = prepare(record, contact_model("MaxwellSlip", record.units), "friction")
    return fit_grid(segment, 1.0, coarse(segment, points), viscous=False)


def loops(begin: tuple[float, ...] = (0.0, 0.0, 0.0), size: float = 0.0) -> Record:
    q = reversals(2000, 2e-4)
    force = maxwell_force(q, STIFFNESS, LEVEL, np.array(begin))
    return Record("loops", STEP * np.arange(2000), q=q, friction=force + noise(1, 2000, size))


def test_twenty_grid_points_follow_a_smooth_hysteresis_within_one_percent_in_a_fifth_of_a_second() -> None:
    # a continuous distribution of elements, none of them on the grid
    q = reversals(5000, 1e-4)
    distance = np.geomspace(2e-6, 6e-5, 200)
    k = 1e3 * np.exp(-distance / 2e-5)
    record = Record(
        "smooth", STEP * np.arange(5000), q=q, friction=maxwell_force(q, k, k * distance, 0.3 * k * distance)
    )
    identify_hysteresis(record)
    begin = time.process_time()
    grid = identify_hysteresis(record, points=20)
    assert not THOROUGH or time.process_time() - begin < 0.2
    assert grid.relative_percent < 1.0
    assert len(grid.distance) == 20 and np.all(grid.stiffness >= 0.0)
    assert np.sum(grid.stiffness) == pytest.approx(np.sum(k), rel=0.05)


def test_the_elements_of_a_loop_are_found_with_their_initial_force() -> None:
    begin = (-0.3, 0.2, 0.9)
    result = identify("MaxwellSlip", loops(begin, 0.005), fixed={"N": 3})
    assert result.method == "hysteresis"
    for i in range(3):
        assert result.values()[f"k[{i + 1}]"] == pytest.approx(STIFFNESS[i], rel=0.01)
        assert result.values()[f"W[{i + 1}]"] == pytest.approx(LEVEL[i], rel=0.01)
    assert sum(e.value for e in result.initial.values()) == pytest.approx(sum(begin), abs=0.03)
    assert result.train.rms < 0.006
    assert result.values()["N"] == 3


def test_the_number_of_elements_follows_from_the_data() -> None:
    result = identify("MaxwellSlip", loops(size=0.005))
    assert 3 <= result.values()["N"] <= 6
    assert result.train.rms == pytest.approx(0.005, rel=0.1)


def test_gms_shares_its_elements_and_names_what_the_loop_leaves_open() -> None:
    result = identify("GMS", loops(size=0.005), fixed={"N": 3})
    values = result.values()
    assert sum(values[f"alpha[{i}]"] for i in (1, 2, 3)) == pytest.approx(1.0)
    assert values["Fc"] == pytest.approx(np.sum(LEVEL), rel=0.02)
    assert result.train.rms == pytest.approx(0.005, rel=0.2)
    assert "vs" in result.weak


@pytest.mark.parametrize("fixed", [{"N": 0}, {"N": 11}, {"N": 2.5}, {"k[1]": 1e4}])
def test_elements_cannot_be_given_and_their_number_is_whole(fixed: dict[str, float]) -> None:
    with pytest.raises(FitError, match=r"N = |outside|cannot be fixed"):
        identify("MaxwellSlip", loops(), fixed=fixed)


def tribometer(model: str, **fixed: float) -> Identification:
    record = load_tribometer()
    return identify(model, record.window(60.0, 90.0), fixed=fixed, validation=record.window(120.0, 150.0))


def test_dahl_follows_the_tribometer_with_exponent_one() -> None:
    plain, with_offset = tribometer("Dahl", n=1.0, OF=0.0), tribometer("Dahl", n=1.0)
    assert plain.signal == "mu" and plain.train.samples == 6000
    assert plain.train.relative_percent < 12.2
    assert with_offset.train.relative_percent < 11.3
    assert plain.validation is not None and plain.validation.relative_percent < 13.0


def test_dahl_with_a_free_exponent_follows_the_tribometer_with_the_offset_of_the_sensor() -> None:
    result = tribometer("Dahl")
    assert result.train.relative_percent < 6.4
    assert result.validation is not None and result.validation.relative_percent < 6.4
    # without the offset the same law stays above the mark
    assert tribometer("Dahl", OF=0.0).train.relative_percent == pytest.approx(6.6, abs=0.1)


@landing
def test_four_maxwell_elements_follow_the_tribometer() -> None:
    result = tribometer("MaxwellSlip", N=4, OF=0.0)
    assert result.train.relative_percent < 4.4
    assert result.validation is not None and result.validation.relative_percent < 5.5
