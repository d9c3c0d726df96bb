"""The rule by which compensators are ranked, on made-up metrics."""

from __future__ import annotations

import pytest

from friction_fmus.study.ranking import extremes, rank, recommend, shown
from friction_fmus.study.records import CompensatorResult, Corner, Metrics


def row(
    name: str, rms: float, corners: tuple[float | None, ...] = (), high: float = 1.0, cost: float = 50.0
) -> CompensatorResult:
    """A compensator with these errors [m], as identified and in the corners."""

    def metrics(error: float) -> Metrics:
        return Metrics(error, 2.0 * error, 10.0, high)

    found = tuple(Corner(1.1, 1.0, None if error is None else metrics(error)) for error in corners or (rms, rms))
    return CompensatorResult(name, "", "feedforward", True, gain=1.0, metrics=metrics(rms), corners=found, cost_ns=cost)


def without(rms: float = 100e-6, corners: tuple[float | None, ...] = (120e-6, 80e-6)) -> CompensatorResult:
    none = row("none", rms, corners)
    return extremes(none, none)


def order(*rows: CompensatorResult, none: CompensatorResult | None = None) -> list[str]:
    return [found.name for found in rank(none or without(), rows)]


def test_the_smaller_error_in_the_worst_corner_comes_first() -> None:
    assert order(row("exact", 1e-6, (30e-6, 30e-6)), row("robust", 10e-6, (12e-6, 12e-6))) == ["robust", "exact"]


def test_among_errors_that_are_alike_the_cheaper_one_comes_first() -> None:
    rows = row("dear", 10e-6, cost=200.0), row("cheap", 10.9e-6, cost=20.0), row("far", 11.2e-6, cost=1.0)
    assert order(*rows) == ["cheap", "dear", "far"]


def test_costs_that_differ_by_less_than_a_factor_of_two_do_not_decide() -> None:
    assert order(row("better", 10e-6, cost=90.0), row("cheaper", 10.5e-6, cost=50.0)) == ["better", "cheaper"]


def test_among_errors_that_are_alike_the_quiet_one_comes_before_the_cheaper_one() -> None:
    assert order(row("hissing", 10e-6, high=1.5, cost=1.0), row("quiet", 10.5e-6, cost=99.0)) == ["quiet", "hissing"]


def test_one_that_is_noisy_comes_behind_all_that_are_not() -> None:
    assert order(row("noisy", 1e-6, high=2.1), row("quiet", 60e-6)) == ["quiet", "noisy"]


def test_noise_that_is_small_beside_the_drive_force_does_not_count() -> None:
    none = without()
    silent = Metrics(100e-6, 200e-6, 10.0, 0.01)
    none = CompensatorResult("none", "", "none", True, metrics=silent, corners=none.corners, worst=none.worst)
    (found,) = rank(none, [row("law", 1e-6, high=0.1)])
    assert not found.noisy


def test_one_that_does_harm_in_a_corner_does_not_pay() -> None:
    better, worse = rank(without(), [row("harms", 1e-6, (1e-6, 79e-6)), row("helps", 70e-6)])
    assert (better.name, better.improves) == ("helps", True)
    assert (worse.name, worse.improves) == ("harms", False)  # 79 µm are less than 5 % below 80 µm


def test_one_that_fails_in_a_corner_does_not_pay() -> None:
    first, second = rank(without(), [row("fails", 1e-6, (1e-6, None)), row("holds", 90e-6, (90e-6, 70e-6))])
    assert [first.name, second.name] == ["holds", "fails"]
    assert second.worst is None


def test_a_corner_in_which_the_servo_alone_fails_does_not_count() -> None:
    (found,) = rank(without(corners=(120e-6, None)), [row("law", 10e-6, (20e-6, None))])
    assert found.improves
    assert found.worst == 20e-6


def test_those_that_do_not_apply_come_last_and_have_no_rank() -> None:
    other = CompensatorResult("other", "", "controller", False, "It replaces the feedback controller.")
    found = rank(without(), [other, row("law", 10e-6)])
    assert [(each.name, each.rank) for each in found] == [("law", 1), ("other", None)]


def test_the_reason_is_two_sentences_with_the_numbers() -> None:
    none = without()
    found = recommend(none, rank(none, [row("A", 10e-6, (20e-6, 15e-6)), row("B", 30e-6)]), "m")
    assert (found.name, found.gain, found.runner_up) == ("A", 1.0, "B")
    assert found.reason.count(". ") == 1
    assert found.reason.endswith(".")
    for number in ("100 µm", "10 µm", "20 µm", "120 µm", "50 ns"):
        assert number in found.reason
    assert "30 µm" in found.runner_up_reason


def test_no_compensation_can_be_the_answer() -> None:
    none = without()
    found = recommend(none, rank(none, [row("A", 99e-6, (130e-6, 90e-6))]), "m")
    assert found.name == "none"
    assert found.gain is None
    assert "100 µm" in found.reason
    assert "130 µm" in found.reason


def test_nothing_is_recommended_where_nothing_could_be_tried() -> None:
    none = without()
    assert recommend(none, [], "m").name == ""


@pytest.mark.parametrize(
    ("value", "text"),
    [(1.5, "1.5 m"), (2.5e-3, "2.5 mm"), (8.254e-5, "82.5 µm"), (5.9e-8, "59 nm"), (0.0, "0 nm")],
)
def test_lengths_are_readable(value: float, text: str) -> None:
    assert shown(value, "m") == text
