"""The rule by which compensators are ranked, on made-up metrics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from friction_fmus.axis.servo import AxisPlant, Servo, Trajectory
from friction_fmus.blocks.axis_units import SLIDING
from friction_fmus.study import comparison
from friction_fmus.study.comparison import tuned
from friction_fmus.study.compensators import AxisKnowledge
from friction_fmus.study.config import Compensation
from friction_fmus.study.evaluation import AxisBench, Case, Evaluation, Scheme
from friction_fmus.study.recommendation import extremes, ladder, largest_step, rank, recommend, shown
from friction_fmus.study.steps import Step
from friction_fmus.study.study_result import CompensatorResult, Corner, Limits, LoopMargins, Metrics

SERVO = Servo("PID", {"Kp": 1.0, "Kd": 1.0, "Ki": 0.0}, 1e-3, 1.0)


def row(
    name: str,
    rms: float,
    corners: tuple[float | None, ...] = (),
    high: float = 1.0,
    cycles: float | None = 100.0,
    Ms: float = 1.5,
    counts: bool = True,
) -> CompensatorResult:
    """A compensator with these errors [m], on the identified axis and in the cases."""

    def metrics(error: float) -> Metrics:
        return Metrics(error, 2.0 * error, 10.0, high, 50.0)

    found = tuple(
        Corner("case", None if error is None else metrics(error), counts=counts) for error in corners or (rms, rms)
    )
    return CompensatorResult(
        name, "", "feedforward", True, gain=1.0, metrics=metrics(rms), margins=LoopMargins(Ms, 40.0, 3.0),
        corners=found, cycles=cycles,
    )  # fmt: skip


def without(rms: float = 100e-6, corners: tuple[float | None, ...] = (120e-6, 80e-6)) -> CompensatorResult:
    none = row("none", rms, corners)
    return extremes(none, none)


def ranked(*rows: CompensatorResult, none: CompensatorResult | None = None) -> list[CompensatorResult]:
    return rank(none or without(), rows)


def order(*rows: CompensatorResult, none: CompensatorResult | None = None) -> list[str]:
    return [found.name for found in ranked(*rows, none=none)]


def test_the_smaller_error_in_the_worst_case_comes_first() -> None:
    assert order(row("exact", 1e-6, (30e-6, 30e-6)), row("robust", 10e-6, (12e-6, 12e-6))) == ["robust", "exact"]


def test_an_error_within_5_percent_is_equivalent_and_fewer_blocks_come_first() -> None:
    assert order(row("one + two", 10e-6), row("one", 10.5e-6)) == ["one", "one + two"]
    assert order(row("one + two", 10e-6), row("one", 10.6e-6)) == ["one + two", "one"]


def test_equivalence_is_to_the_best_one_and_does_not_pass_on() -> None:
    """10.4 um are within 5 % of 10 um, and 10.8 um within 5 % of 10.4 um only."""
    assert order(row("a + b + c", 10e-6), row("a + b", 10.4e-6), row("a", 10.8e-6)) == ["a + b", "a + b + c", "a"]


def test_errors_below_that_of_the_model_do_not_decide() -> None:
    """With 50 um of the model, 10 and 15 um become 51 and 52.2 um, which are within 5 %."""
    rows = [row("one + two", 10e-6), row("one", 15e-6)]
    assert [each.name for each in rank(without(), rows, 50e-6)] == ["one", "one + two"]
    assert [each.name for each in rank(without(), rows, 10e-6)] == ["one + two", "one"]


def test_of_as_many_blocks_the_better_one_comes_first_whatever_the_model() -> None:
    rows = [row("cheap", 15e-6, cycles=10.0), row("dear", 10e-6, cycles=900.0), row("one + two", 9e-6)]
    assert [each.name for each in rank(without(), rows, 50e-6)] == ["dear", "cheap", "one + two"]


def test_the_force_that_cancels_friction_does_not_count() -> None:
    assert order(row("quiet", 11.5e-6), row("loud", 10e-6, high=2.0)) == ["loud", "quiet"]


def test_of_two_alike_the_cheaper_comes_first_and_one_without_code_last() -> None:
    rows = row("dear", 10e-6, cycles=2000.0), row("cheap", 10e-6), row("unknown", 10e-6, cycles=None)
    assert order(*rows) == ["cheap", "dear", "unknown"]


def test_one_that_does_harm_in_a_case_is_no_improvement() -> None:
    better, worse = ranked(row("harms", 1e-6, (1e-6, 79e-6)), row("helps", 70e-6))
    assert (better.name, better.improves) == ("helps", True)
    assert (worse.name, worse.improves) == ("harms", False)  # 79 um are less than 5 % below 80 um


def test_one_that_fails_in_a_case_is_no_improvement() -> None:
    first, second = ranked(row("fails", 1e-6, (1e-6, None)), row("holds", 90e-6, (90e-6, 70e-6)))
    assert [first.name, second.name] == ["holds", "fails"]
    assert second.worst is None


def test_a_case_that_does_not_count_does_not_matter() -> None:
    (found,) = ranked(row("law", 1e-6, (1e-6, None), counts=False))
    assert found.improves
    assert found.worst == 1e-6


def test_a_case_in_which_the_servo_alone_fails_does_not_count() -> None:
    (found,) = ranked(row("law", 10e-6, (20e-6, None)), none=without(corners=(120e-6, None)))
    assert found.improves
    assert found.worst == 20e-6


def test_those_that_do_not_apply_come_last_and_have_no_rank() -> None:
    other = CompensatorResult("other", "", "controller", False, "It replaces the feedback controller.")
    found = ranked(other, row("law", 10e-6))
    assert [(each.name, each.rank) for each in found] == [("law", 1), ("other", None)]


@pytest.mark.parametrize(
    ("Ms", "delay", "kept"), [(1.9, 3.0, True), (2.1, 3.0, False), (1.9, 1.4, False), (None, 3.0, False)]
)
def test_limits(Ms: float | None, delay: float, kept: bool) -> None:
    assert Limits(2.0, 1.5).kept_by(LoopMargins(Ms, 40.0, delay)) == kept
    assert Limits(2.0, 1.5).kept_by(None)


def test_a_loop_that_does_not_tolerate_a_resonance_above_the_band_is_not_kept() -> None:
    limits = Limits(2.0, 1.5, band=20.0, resonance=20.0)
    assert limits.kept_by(LoopMargins(1.5, 40.0, 3.0, resonance=19.0))
    assert not limits.kept_by(LoopMargins(1.5, 40.0, 3.0, resonance=30.0))
    assert limits.relaxed(LoopMargins(1.5, 40.0, 3.0, resonance=30.0)) == Limits(2.0, 1.5, 20.0, 30.0)


def test_a_servo_that_exceeds_the_limits_sets_them() -> None:
    relaxed = Limits(2.0, 1.5).relaxed(LoopMargins(3.0, 10.0, 0.8))
    assert relaxed == Limits(3.0, 0.8)
    assert Limits(2.0, 1.5).relaxed(LoopMargins(1.6, 40.0, 4.0)) == Limits(2.0, 1.5)


def metrics_of(rms: float) -> Metrics:
    return Metrics(rms, 2.0 * rms, 10.0, 1.0, 50.0)


def test_the_ladder_names_the_step_that_reduces_the_error_most() -> None:
    none = without()
    law = row("A", 10e-6)
    rungs = ladder(metrics_of(1e-3), True, none, ranked(law))
    assert [(rung.title, rung.metrics.rms) for rung in rungs] == [
        ("as measured", 1e-3),
        ("with velocity and acceleration feedforward", 100e-6),
        ("with friction feedforward", 10e-6),
    ]
    step = largest_step(rungs)
    assert step is not None
    assert (step[0].title, step[1].title) == ("as measured", "with velocity and acceleration feedforward")
    assert largest_step(rungs[1:2]) is None


def test_a_rung_that_is_hardly_better_is_no_improvement() -> None:
    """The threshold is 5 %; a later rung is compared with the best before it."""
    rows = ranked(row("A", 10e-6), replace(row("B", 9.8e-6), kind="estimator"))
    rungs = ladder(metrics_of(100.2e-6), True, without(), rows)
    assert [rung.title for rung in rungs] == [
        "as measured",
        "with velocity and acceleration feedforward (no improvement)",
        "with friction feedforward",
        "with an estimator (no improvement)",
    ]
    step = largest_step(rungs)
    assert step is not None
    assert step == (rungs[1], rungs[2])


def test_the_reason_has_the_numbers() -> None:
    none = without()
    rows = ranked(row("A", 10e-6, (20e-6, 15e-6)), row("B", 30e-6))
    found = recommend(none, rows, ladder(metrics_of(1e-3), True, none, rows), SLIDING)
    assert (found.name, found.gain, found.runner_up) == ("A", 1.0, "B")
    assert found.reason.startswith("Today the axis tracks to 1 mm rms. The largest improvement comes with velocity")
    assert found.reason.endswith(".")
    for number in ("100 µm", "10 µm", "20 µm", "120 µm", "sensitivity peak of 1.50", "100 cycles"):
        assert number in found.reason
    assert "30 µm" in found.runner_up_reason


def test_no_compensation_can_be_the_answer() -> None:
    none = without()
    found = recommend(none, ranked(row("A", 99e-6, (130e-6, 90e-6))), (), SLIDING)
    assert found.name == "none"
    assert found.gain is None
    assert "100 µm" in found.reason
    assert "130 µm" in found.reason


def test_nothing_is_recommended_where_nothing_could_be_tried() -> None:
    none = without()
    assert recommend(none, [], (), SLIDING).name == ""


def test_a_compensator_that_violates_a_condition_is_named() -> None:
    none = without()
    found = recommend(none, ranked(row("B", 30e-6)), (), SLIDING, {"A": "buzz: the axis buzzes"})
    assert found.name == "B"
    assert found.reason.endswith("A ranks higher, but violates a condition (buzz: the axis buzzes).")
    objections = {"A": "buzz: at 1 Hz", "C": "delay: of 2 ms", "D": "buzz: at 2 Hz", "E": "buzz: at 3 Hz"}
    found = recommend(none, ranked(row("B", 30e-6)), (), SLIDING, objections)
    assert "A, D and E rank higher, but violate a condition (buzz: at 1 Hz). C ranks higher" in found.reason


@pytest.mark.parametrize(
    ("value", "text"),
    [(1.5, "1.5 m"), (2.5e-3, "2.5 mm"), (8.254e-5, "82.5 µm"), (5.9e-8, "59 nm"), (0.0, "0 nm")],
)
def test_lengths_are_readable(value: float, text: str) -> None:
    assert shown(value, "m") == text


@pytest.mark.parametrize(("unexplained", "certain"), [(0.0, True), (0.1, False)])
def test_an_objection_needs_an_axis_that_is_known_so_well(unexplained: float, certain: bool) -> None:
    """9 % of over-compensation are not certain with a model that leaves 10 % of the force."""
    plant = AxisPlant("Viscous", {"Fv": 0.0}, 1.0)
    bench = AxisBench(SERVO, plant, Trajectory(Path(), 2, 0.0, 0.0), np.zeros(2), unexplained=unexplained)
    assert comparison.clear(bench, 1.09, 1.0) == certain
    assert comparison.clear(bench, -1.0, 1.0)


def untried(name: str, rms: float) -> CompensatorResult:
    return replace(row(name, rms), corners=())


def test_what_was_not_run_in_other_cases_follows_in_the_order_of_its_error() -> None:
    rows = [
        untried("b", 40e-6),
        row("tried", 10e-6, (30e-6, 20e-6)),
        untried("a", 35e-6),
        row("fails", 1e-6, (None, 2e-6)),
    ]
    assert order(*rows) == ["tried", "a", "b", "fails"]
    done = recommend(without(), ranked(*rows), (), SLIDING)
    assert (done.name, done.runner_up) == ("tried", "a")
    assert done.runner_up_reason.startswith("a reaches 35 µm rms. ")


def test_only_what_can_be_the_best_is_run_in_other_cases(monkeypatch: pytest.MonkeyPatch) -> None:
    """The worst case of the second, 15 um, excludes all above it: a worst case is at least the error here."""
    monkeypatch.setattr(comparison, "_violated", lambda *_: {})
    errors = {"one": (4e-6, 90e-6), "two": (6e-6, 15e-6), "three": (12e-6, 14e-6), "four": (20e-6, 21e-6)}
    rows = {name: untried(name, here) for name, (here, _) in errors.items()}
    scheme, there, runs = Scheme(SERVO), without().corners, []
    found = {name: Evaluation(scheme, each.metrics, (), (), None) for name, each in rows.items()}

    def run(steps: Sequence[Step]) -> list[Evaluation]:
        names = [step.name.removeprefix("cases-") for step in steps]
        runs.append(names)
        metrics = [(rows[name].metrics, row(name, 0.0, (errors[name][1],) * len(there)).corners) for name in names]
        return [Evaluation(scheme, own, (), corners, None) for own, corners in metrics]

    plant = AxisPlant("Viscous", {"Fv": 0.0}, 1.0)
    bench = AxisBench(SERVO, plant, Trajectory(Path(), 2, 0.0, 0.0), np.zeros(2))
    contest = comparison._Contest(bench, (Case("a"), Case("b")), run, without(), rows, found)
    contest.run_cases()
    assert runs == [["one", "two"], ["three"]]
    assert [each.name for each in contest.ranked()][:2] == ["three", "two"]


def test_the_only_compensator_is_recommended_although_it_violates_a_condition(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(comparison, "_violated", lambda _, scheme: {} if scheme.compensator is None else {"buzz": "x"})

    def run(steps: Sequence[Step]) -> list[object]:
        found: list[object] = []
        for step in steps:
            if step.function is comparison.built:
                found.append(step.name)
                continue
            given = step.arguments
            scheme = Scheme(SERVO, compensator=given[0].compensator) if step.function is tuned else given[1][0]
            metrics = metrics_of(1e-4 if scheme.compensator is None else 1e-5)
            there = () if step.function is tuned else tuple(Corner(case.name, metrics) for case in given[2])
            found.append(Evaluation(scheme, metrics, (), there, None))
        return found

    plant = AxisPlant("Viscous", {"Fv": 10.0}, 10.0)
    known = AxisKnowledge(SERVO, plant, {"Stribeck": {"Fc": 10.0, "Fs": 12.0, "vs": 1e-2, "Fv": 10.0, "delta": 1.0}})
    bench = AxisBench(SERVO, plant, Trajectory(Path(), 2, 0.0, 0.0), np.sin(2e-3 * np.arange(2000.0)))
    wanted = Compensation(compensators=("StaticFeedforward",))
    assert comparison.compare(bench, known, wanted, run).recommendation.name == "StaticFeedforward"
