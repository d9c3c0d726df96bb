"""Cogging and position-dependent friction, identified beside a friction model, on axes computed in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from contacts import Array, noise
from thorough import landing, nightly

from friction_fmus.data import load_emps
from friction_fmus.identification import LINEAR, ROTARY, AxisUnits, Record, identify
from friction_fmus.identification.fit.position import HELPS, NODES
from friction_fmus.identification.fit.scores import independent_samples

TRUE = {"M": 20.0, "Fc": 8.0, "Fv": 30.0, "OF": 1.0}
TS = 2e-3
T = TS * np.arange(12_000)


def cogging(x: Array) -> Array:
    """Over the travel of 0.1 m, on average 0."""
    found: Array = 1.5 * np.sin(2.0 * np.pi * x / 0.02)
    return found


def added_friction(x: Array) -> Array:
    found: Array = np.cos(2.0 * np.pi * x / 0.04)
    return found


def axis(size: float = 1.0, scale: float = 1.0, units: AxisUnits = LINEAR) -> Record:
    """Strokes over the whole travel at changing speeds, with the forces of a map times `size`."""
    phase = 2.0 * np.pi * (0.45 * T + np.sin(2.0 * np.pi * 0.037 * T))
    rate = 2.0 * np.pi * (0.45 + 2.0 * np.pi * 0.037 * np.cos(2.0 * np.pi * 0.037 * T))
    q, v = 0.05 * (1.0 - np.cos(phase)), 0.05 * rate * np.sin(phase)
    a = np.gradient(v, TS)
    force = TRUE["M"] * a + TRUE["Fc"] * np.sign(v) + TRUE["Fv"] * v + TRUE["OF"] + noise(5, len(T), 0.3)
    force += size * (added_friction(q) * np.sign(v) - cogging(q))
    return Record("axis", T, q=scale * q, force=force, units=units)


@pytest.fixture(scope="module")
def record() -> Record:
    return axis()


@landing
def test_the_map_is_found_beside_the_parameters(record: Record) -> None:
    train, validation = record.window(0.0, 14.0), record.window(14.0, 24.0)
    result = identify("Stiction", train, validation=validation, position_map=True)
    plain = identify("Stiction", train, validation=validation)
    assert result.position is not None
    assert result.validation is not None
    assert plain.validation is not None
    assert result.position.validation_without == plain.validation
    # what remains is the noise, of which the filter leaves about a tenth of the power
    assert result.validation.rms < 0.2
    assert plain.validation.rms > 1.0
    for name, value in TRUE.items():
        assert result.parameters[name].value == pytest.approx(value, rel=0.03), name
    table = result.position.table
    x = table.grid.begin + table.grid.spacing * np.arange(table.grid.nodes)
    assert np.sqrt(np.mean(np.square(table.cogging - cogging(x)))) < 0.1
    assert np.sqrt(np.mean(np.square(table.friction - added_friction(x)))) < 0.1
    assert sum(table.cogging) == pytest.approx(0.0, abs=1e-9)
    assert sum(table.friction) == pytest.approx(0.0, abs=1e-9)
    # 5 periods of the cogging need more nodes than the smallest tables have
    assert NODES[2] < table.grid.nodes <= 64
    assert result.position.crossed < 0.2 * result.position.crossed_without
    # the criteria count the coefficients: BIC - AIC is (log n - 2) for each
    each = np.log(independent_samples([result.measured])) - 2.0
    counts = [(found.bic - found.aic) / each for found in (result, plain)]
    assert counts[0] - counts[1] == pytest.approx(2.0 * (table.grid.nodes - 1), rel=1e-9)
    # predictions along a record without a force contain the map as well
    free = result.predict(replace(validation, force=None))
    with_force = result.predict(validation)
    np.testing.assert_allclose(free, with_force, atol=1e-9)
    difference = free - plain.predict(validation)
    expected = added_friction(validation.column("q")) * np.sign(np.gradient(validation.column("q"))) - cogging(
        validation.column("q")
    )
    assert np.corrcoef(difference, expected)[0, 1] > 0.97


@nightly
def test_validation_data_do_not_choose_the_map(record: Record) -> None:
    train = record.window(0.0, 14.0)
    first, second = (
        identify("Stiction", train, validation=record.window(*window), position_map=True)
        for window in ((14.0, 16.0), (20.0, 24.0))
    )
    assert first.position is not None
    assert second.position is not None
    assert first.position.table == second.position.table


@nightly
def test_an_axis_without_such_forces_gets_no_map() -> None:
    plain = identify("Stiction", axis(size=0.0))
    result = identify("Stiction", axis(size=0.0), position_map=True)
    assert result.position is None
    assert result.values() == plain.values()


@landing
def test_a_small_force_over_position_must_help_by_a_third() -> None:
    """3 % of the map changes the error by less than `HELPS`."""
    assert identify("Stiction", axis(size=0.03), position_map=True).position is None
    assert HELPS > 0.6


@nightly
def test_an_axis_that_turns_further_than_once_gets_a_periodic_map() -> None:
    """A turn for 0.04 m, which both forces repeat; over 0.1 m they need more nodes than over a turn."""
    turns = axis(scale=2.0 * np.pi / 0.04, units=ROTARY)
    result = identify("Stiction", turns.window(0.0, 14.0), validation=turns.window(14.0, 24.0), position_map=True)
    assert result.position is not None
    assert result.validation is not None
    assert result.position.table.grid.periodic
    assert result.position.table.grid.nodes <= 16
    assert result.validation.rms < 0.2
    angle = 2.0 * np.pi * np.arange(8) / 8.0
    expected = 1.5 * np.sin(2.0 * angle)
    np.testing.assert_allclose(result.position.table.force(angle, 0.0 * angle), expected, atol=0.25)


def test_a_record_without_position_gets_none(record: Record) -> None:
    v = np.gradient(record.column("q"), TS)
    result = identify("Stiction", Record("v", T, v=v, force=record.force), position_map=True)
    assert result.position is None


@landing
def test_emps_is_predicted_to_two_percent_on_data_not_fitted() -> None:
    """An independent table for each direction, fitted to the first half, left 2.1 % (4.1 % without)."""
    record = load_emps()
    train, validation = record.window(0.0, 12.5), record.window(12.5, 24.84)
    result = identify("Stiction", train, validation=validation, position_map=True)
    assert result.validation is not None
    assert result.validation.relative_percent <= 2.1
