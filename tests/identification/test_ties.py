"""Decisions between equals: the last bits of a decomposition or of an error do not make them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from friction_fmus.identification.fit.estimate import dependent_columns
from friction_fmus.identification.fit.search import SearchResult, covariance
from friction_fmus.identification.methods.hysteresis import HysteresisGrid, with_count
from friction_fmus.study.recommendation import extremes, rank
from friction_fmus.study.study_result import CompensatorResult, Corner, Metrics


@pytest.mark.parametrize("seed", range(20))
def test_of_two_dependences_all_that_take_part_are_named(seed: int) -> None:
    """Columns a, a, b, b, c, each moved by rounding errors, which turn the two last singular vectors at random."""
    random = np.random.default_rng(seed)
    a, b, c = random.normal(size=(3, 50))
    columns = np.column_stack([a, a, b, b, c]) * (1.0 + 1e-16 * random.integers(-3, 4, (50, 5)))
    _, singular, right = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), full_matrices=False)
    turn = random.uniform(0.0, 2.0 * np.pi)
    right[3:] = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ right[3:]
    assert dependent_columns(singular, right, "abcde") == ["a", "b", "c", "d"]


def test_columns_that_are_independent_are_separated() -> None:
    _, singular, right = np.linalg.svd(np.random.default_rng(1).normal(size=(50, 4)), full_matrices=False)
    assert dependent_columns(singular, right, "abcd") == []


@pytest.mark.parametrize("seed", range(5))
def test_a_direction_that_the_residuals_do_not_depend_on_gets_no_variance(seed: int) -> None:
    """Two equal columns of 20 000 rows: J'J has an eigenvalue of rounding errors where it should have 0."""
    random = np.random.default_rng(seed)
    one = random.normal(size=20_000) * np.exp(random.uniform(-9.0, 9.0))
    J = np.column_stack([one, one * (1.0 + 1e-16 * random.integers(-3, 4, one.size)), random.normal(size=one.size)])
    residual = random.normal(size=one.size)
    found = SearchResult(x=np.zeros(3), J=J, residual=residual, converged=True, loss="linear", scale=1.0)
    spread, _ = covariance(found, [one.size])
    # the sum of the two is known to 1/|one|, and each of them to half of that where nothing else is known
    assert np.sqrt(spread[0, 0]) == pytest.approx(0.5 / np.linalg.norm(one), rel=0.05)


def test_of_joins_that_change_the_curve_equally_the_first_one_is_made() -> None:
    """Four equal neighbours, moved by rounding errors: every join of two of them changes nothing."""
    shares = {
        tuple(
            np.round(
                with_count(
                    HysteresisGrid(
                        distance=np.full(4, 1e-5) * (1.0 + 2e-16 * np.random.default_rng(seed).integers(-2, 3, 4)),
                        stiffness=np.full(4, 1e4),
                        initial_force=np.zeros(4),
                        linear={},
                        t=np.zeros(1),
                        measured=np.zeros(1),
                        predicted=np.zeros(1),
                        relative_percent=0.0,
                    ),
                    3,
                )[0],
                3,
            )
        )
        for seed in range(20)
    }
    assert shares == {(2e4, 1e4, 1e4)}


def test_compensators_that_do_the_same_stay_in_one_order() -> None:
    def row(name: str, rms: float) -> CompensatorResult:
        found = Metrics(rms, 2.0 * rms, 10.0, 1.0, 1.0)
        corners = (Corner("heavier", found),)
        return CompensatorResult(name, "", "feedforward", True, gain=1.0, metrics=found, corners=corners, cycles=500.0)

    none = row("none", 1e-4)
    none = replace(extremes(none, none))
    for i in (-2, -1, 0, 1, 2):
        rows = [row("A", 1e-5 + i * np.spacing(1e-5)), row("B", 1e-5)]
        assert [found.name for found in rank(none, rows)] == ["A", "B"]
