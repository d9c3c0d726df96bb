"""Comparison of the compensators on the identified axis: alone, and feedforward together with an estimator."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import islice
from math import inf, pi
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np

from friction_fmus.axis.loop_assembly import block
from friction_fmus.axis.servo import GAINS, Compensator, Servo
from friction_fmus.blocks.axis_units import Words
from friction_fmus.blocks.catalogue import find, summary_of
from friction_fmus.errors import FrictionError
from friction_fmus.study.compensators import (
    INTEGRAL,
    INTEGRAL_SUMMARY,
    TABLE,
    TABLE_SUMMARY,
    AxisKnowledge,
    Candidate,
    buildable,
    candidates,
    tuned_to,
    within_range,
)
from friction_fmus.study.config import Compensation
from friction_fmus.study.evaluation import (
    BAND,
    AxisBench,
    Case,
    Evaluation,
    Scheme,
    cases,
    evaluate,
)
from friction_fmus.study.loop_conditions import loop_conditions
from friction_fmus.study.margins import margins_of
from friction_fmus.study.recommendation import (
    AS_MEASURED,
    FEEDFORWARD,
    extremes,
    ladder,
    nominal,
    rank,
    recommend,
    within_worth,
)
from friction_fmus.study.steps import Step
from friction_fmus.study.study_result import CompensatorResult, Limits, Picture, Recommendation, Rung
from harness.storage.toml_file import read_toml

COST_TABLE: Final = Path(__file__).with_name("cycles.toml")


# Cost of the laws on a Cortex-M4F, from a table that ``benchmarks/cycles.py`` writes.
#
# The table makes the ranking independent of the machine of the study and of the tools that are installed on it.


@dataclass(frozen=True)
class LawCost:
    """Cost of one law with its default parameters."""

    cycles: float  # estimated cycles of one sample
    flash: float  # size of the code with the library functions that it calls [bytes]


def cost_of(law: str) -> LawCost | None:
    """Return the cost of a law; None if the table does not contain it, as for controllers written in C."""
    return LawCost(0.0, 0.0) if law == INTEGRAL.name else _table().get(law)


@cache
def _table() -> dict[str, LawCost]:
    return {name: LawCost(float(row["cycles"]), float(row["flash"])) for name, row in read_toml(COST_TABLE).items()}


SCALES: Final = tuple(float(2.0**power) for power in np.arange(4.0, -4.1, -0.5))
"""Factors of the bandwidth of `AxisKnowledge`, largest first; the first one within the limits gives the largest."""

SHARES: Final = (1.0, 0.7, 0.5, 0.25)  # bandwidths that are tried, in parts of the largest possible one


def trials(
    candidate: Candidate,
    known: AxisKnowledge,
    speed: float,
    limits: Limits,
    gains: Sequence[float],
) -> list[Scheme]:
    """Return the trials of a compensator that keep the limits; empty if there are none."""
    servo, plant = known.servo, known.plant

    def with_gain(gain: float) -> Scheme:
        margins = margins_of(servo, plant, speed, candidate.compensator, candidate.kind, gain)
        return Scheme(servo, gain, None, candidate.compensator, margins=margins)

    def with_scale(scale: float) -> Scheme:
        scaled = replace(known, scale=scale)
        bandwidth = candidate.bandwidth(scaled)
        if candidate == INTEGRAL:
            feedback = with_integral(servo, 2.0 * pi * bandwidth)
            return Scheme(feedback, 1.0, bandwidth, margins=margins_of(feedback, plant, speed))
        compensator = tuned_to(candidate, scaled)
        margins = margins_of(servo, plant, speed, compensator, candidate.kind)
        return Scheme(servo, 1.0, bandwidth, compensator, margins=margins)

    if candidate == TABLE:
        return [Scheme(servo, margins=margins_of(servo, plant, speed), table=True)]
    if not candidate.has_bandwidth:
        return [each for each in map(with_gain, gains) if limits.kept_by(each.margins)]
    # scales beyond the cap of the bandwidth give the same compensator
    cap = candidate.bandwidth(replace(known, scale=SCALES[0]))
    scales = [scale for scale in SCALES[1:] if candidate.bandwidth(replace(known, scale=scale)) < cap]

    def possible(scheme: Scheme) -> bool:
        inside = scheme.compensator is None or within_range(scheme.compensator)
        inside = inside and (scheme.bandwidth or 0.0) <= limits.band
        return inside and limits.kept_by(scheme.margins)

    largest = next((scale for scale in scales if possible(with_scale(scale))), None)
    if largest is None:
        return []
    # a slower estimator can have a higher sensitivity peak
    return [each for share in SHARES if possible(each := with_scale(share * largest))]


def with_integral(servo: Servo, rate: float) -> Servo:
    """Return the servo with an integral action whose corner frequency, Ki/Kp or ki/kv, is `rate` [rad/s]."""
    first, second, third = GAINS[servo.law]
    over = servo.gains[first] if servo.law == "PID" else servo.gains[second]
    return replace(servo, gains={**servo.gains, third: rate * over})


FIRST: Final = 2  # number of compensators that are run on other axes before the others are compared with them
JOINED: Final = 3  # number of the best feedforwards, and of the best estimators, that are combined with each other

ESTIMATORS: Final = ("estimator", "integral action")
"""Kinds of compensators that are combined with a feedforward: they compensate what it leaves."""

WITH_TABLE: Final = ("feedforward", *ESTIMATORS, "feedforward with estimator", "feedforward with integral action")
"""Kinds of compensators whose best one is also tried with the table over position."""

CLEAR: Final = 1.05
"""Ratio of the value of a violated condition to its bound above which it counts: the axis is not known better.

What the model does not explain of the drive force adds to it."""

LARGEST: Final = 0.5  # largest error of the friction in the cases

RunSteps: TypeAlias = Callable[[Sequence[Step]], Sequence[Any]]


@dataclass(frozen=True)
class Comparison:
    """Result of the comparison."""

    rows: tuple[CompensatorResult, ...]
    """Servo without compensation first, then the compensators by rank, then those that do not apply."""
    ladder: tuple[Rung, ...]  # rungs from the axis as measured to the best compensation
    recommendation: Recommendation  # recommended compensator
    chosen: Scheme  # what is added to the axis according to the recommendation
    limits: Limits  # limits on the margins
    turn: Picture | None = None  # tracking error around a reversal, before and after

    @property
    def recommended(self) -> CompensatorResult:
        """Recommended compensator, or the servo without compensation."""
        return next((row for row in self.rows if row.name == self.recommendation.name), self.rows[0])


def compare(bench: AxisBench, known: AxisKnowledge, wanted: Compensation, run: RunSteps) -> Comparison:
    """Compare the compensators on an axis."""
    servo, motion = bench.servo, bench.trajectory.motion
    alone = margins_of(servo, bench.plant, bench.speed)
    builds = [Step(f"fmu-{name}", built, (name, known.rotary), str) for name in buildable(wanted.compensators)]
    unbounded = bench, [Scheme(servo, margins=alone)], (), False
    first, *_ = run([Step("servo-alone", evaluate, unbounded, Evaluation), *builds])
    if first.metrics is None:
        raise FrictionError(
            f"The simulated servo is unstable even without compensation ({first.reason}); check the gains, Ts and "
            "delay in [servo] and the units of the record."
        )
    bench = replace(bench, band=BAND * first.metrics.largest)
    limits = wanted.limits if alone is None else wanted.limits.relaxed(alone)
    # friction is not known better than the force that the model leaves
    friction = max(wanted.mismatch, min(bench.unexplained, LARGEST)) if wanted.mismatch else 0.0
    tried = cases(servo, (friction, wanted.mass_mismatch), wanted.delays, limits.delay, known.level, known.words)

    as_measured = replace(bench, trajectory=replace(bench.trajectory, motion=False, offset=0.0))
    steps = [
        Step("servo-as-measured", evaluate, (as_measured, [Scheme(servo)], (), False), Evaluation),
        Step("compensator-none", evaluate, (bench, [Scheme(servo, margins=alone)], tried), Evaluation),
    ]
    everything = candidates(wanted.compensators, known)
    applicable = [candidate for candidate in everything if candidate.applies]
    task = bench, known, limits, wanted.gains
    steps += [Step(f"compensator-{c.name}", tuned, (c, *task), Evaluation) for c in applicable]
    plain, without, *evaluations = run(steps)

    found = dict(zip((c.name for c in applicable), evaluations, strict=True))
    none = _row("none", "Servo without friction compensation", "none", "", without)
    rows = {c.name: _candidate_row(c, found.get(c.name), known.words) for c in everything}
    contest = _Contest(bench, tried, run, extremes(none, none), rows, found)
    contest.run_cases()
    contest.join(applicable, known.words)
    if TABLE.name in found:
        contest.add_table(known.words)

    contradicted = contest.contradicted
    while left := [row for row in contest.ranked() if row.name not in contradicted]:
        if not left[0].improves or not (wrong := contest.objection(left[0].name)):
            break
        contradicted[left[0].name] = wrong
        contest.run_cases()
    if not left or not left[0].improves:
        contradicted.clear()
    accepted = [row for row in contest.rows.values() if row.name not in contradicted]
    left = rank(contest.none, accepted, bench.model_error)
    ranked = contest.ranked()
    rungs = ladder(plain.metrics, motion, contest.none, ranked)
    recommendation = recommend(contest.none, left, rungs, known.words, contradicted, bench.model_error)
    chosen = found[recommendation.name].scheme if recommendation.name in found else None
    chosen = Scheme(servo) if chosen is None else chosen
    drawn = {recommendation.name: found.get(recommendation.name), AS_MEASURED: plain}
    drawn |= {FEEDFORWARD: without} if motion else {}
    curves = {name: each.turn for name, each in drawn.items() if each is not None and each.turn is not None}
    turn = Picture("time after the reversal", "tracking error", "s", known.words.m, {}, curves) if curves else None
    return Comparison((contest.none, *ranked), rungs, recommendation, chosen, limits, turn)


@dataclass(eq=False)
class _Contest:
    """Compensators in a comparison: all are run on the identified axis, those that may be the best also on others."""

    bench: AxisBench
    cases: Sequence[Case]
    run: RunSteps
    none: CompensatorResult  # the servo alone
    rows: dict[str, CompensatorResult]
    found: dict[str, Evaluation]
    contradicted: dict[str, str] = field(default_factory=dict)
    """Compensators that are not recommended, with the condition that each violates."""

    def __post_init__(self) -> None:
        """Find the conditions that the servo alone violates."""
        self.before = _violated(self.bench, Scheme(self.bench.servo)).keys()
        self.objection = cache(self._objection)

    def ranked(self) -> list[CompensatorResult]:
        """Return the compensators by rank."""
        return rank(self.none, list(self.rows.values()), self.bench.model_error)

    def _objection(self, name: str) -> str:
        """Return the first condition that a compensator violates and the servo alone does not; empty without one."""
        scheme = self.found[name].scheme
        violated = {} if scheme is None else _violated(self.bench, scheme)
        return next((f"{each}: {wrong}" for each, wrong in violated.items() if each not in self.before), "")

    def run_cases(self) -> None:
        """Run compensators on other axes until every other one is worse here than one of these is there."""
        while self.cases:
            rows = [row for row in self.ranked() if row.metrics is not None and row.name not in self.contradicted]
            best = min((row.worst for row in rows if row.improves and row.worst is not None), default=inf)
            ahead = sorted((row for row in rows if row.untried), key=nominal)
            ahead = ahead[:FIRST] if best == inf else ahead
            ahead = [row for row in ahead if within_worth(best, nominal(row), self.bench.model_error)]
            if not ahead:
                return
            steps = []
            for row in ahead:
                arguments = self.bench, [self.found[row.name].scheme], self.cases
                steps.append(Step(f"cases-{row.name}", evaluate, arguments, Evaluation))
            for row, each in zip(ahead, self.run(steps), strict=True):
                self.found[row.name] = replace(self.found[row.name], metrics=each.metrics, corners=each.corners)
                known = self.rows[row.name]
                self.rows[row.name] = replace(known, metrics=each.metrics, corners=each.corners)

    def join(self, candidates: Sequence[Candidate], u: Words) -> None:
        """Run the best feedforwards with the best estimators, without those that violate a condition."""
        by_name, ranked = {candidate.name: candidate for candidate in candidates}, self.ranked()

        def best(*kinds: str) -> list[Candidate]:
            possible = [row for row in ranked if row.kind in kinds and (row.untried or row.worst is not None)]
            names = (row.name for row in possible if not self.objection(row.name))
            return [by_name[name] for name in islice(names, JOINED)]

        pairs, steps = [(one, other) for one in best("feedforward") for other in best(*ESTIMATORS)], []
        for one, other in pairs:
            law = fixed(self.found[one.name])
            # a feedforward leaves the margins unchanged, so the trials of the estimator keep the limits
            schemes = [replace(scheme, feedforward=law) for scheme in self.found[other.name].schemes]
            steps.append(
                Step(f"compensator-{one.name}-{other.name}", evaluate, (self.bench, schemes, (), False), Evaluation)
            )
        for (one, other), evaluation in zip(pairs, self.run(steps), strict=True):
            self._add(_joined(one, other, evaluation, u), evaluation)
        self.run_cases()

    def add_table(self, u: Words) -> None:
        """Run the best compensator of each kind with the table over position."""
        best = {
            kind: row for row in reversed(self.ranked()) if row.rank is not None and (kind := row.kind) in WITH_TABLE
        }
        steps = []
        for row in best.values():
            scheme = self.found[row.name].scheme
            assert scheme is not None
            # a feedforward leaves the margins unchanged
            arguments = self.bench, [replace(scheme, table=True)], (), False
            steps.append(Step(f"compensator-{row.name}-table", evaluate, arguments, Evaluation))
        for row, evaluation in zip(best.values(), self.run(steps), strict=True):
            self._add(_with_table(row, evaluation, u), evaluation)
        self.run_cases()

    def _add(self, row: CompensatorResult, evaluation: Evaluation) -> None:
        self.rows[row.name], self.found[row.name] = row, evaluation


def _violated(bench: AxisBench, scheme: Scheme) -> dict[str, str]:
    """Return the conditions that an axis clearly violates, by name."""
    violated = [c for c in loop_conditions(bench, scheme) if not c.ok]
    return {c.name: c.wrong for c in violated if c.name not in bench.unsure and clear(bench, c.value, c.bound)}


def clear(bench: AxisBench, value: float, bound: float) -> bool:
    """Return whether a value is beyond its bound by more than the axis is known, as far as their ratio tells it."""
    both = value * bound
    return not np.isfinite(both) or both <= 0.0 or max(value / bound, bound / value) > CLEAR + bench.unexplained


def built(name: str, rotary: bool) -> str:
    """Build the FMU of a law, if it is not in the cache, so that several processes share this work."""
    block(name, rotary)
    return name


def tuned(
    candidate: Candidate,
    bench: AxisBench,
    known: AxisKnowledge,
    limits: Limits,
    gains: Sequence[float],
) -> Evaluation:
    """Tune a compensator within the limits."""
    schemes = trials(candidate, known, bench.speed, limits, gains)
    if not schemes:
        margin = f"Ms at most {limits.Ms:.3g} and a delay margin of at least {limits.delay:.3g} samples"
        if np.isfinite(limits.band):
            margin += (
                f", is in the band of {limits.band:.3g} Hz that the record supports, and tolerates a resonance above"
            )
        tuned_value = "bandwidth" if candidate.has_bandwidth else "gain"
        return Evaluation(None, None, (), (), None, f"No {tuned_value} gives {margin}.")
    return evaluate(bench, schemes, (), False)


def fixed(evaluation: Evaluation) -> Compensator:
    """Return the compensator of the best trial with its gain as a parameter."""
    scheme = evaluation.scheme
    assert scheme is not None
    assert scheme.compensator is not None
    return replace(scheme.compensator, values={**scheme.compensator.values, "gain": scheme.gain})


def _with_table(row: CompensatorResult, evaluation: Evaluation, u: Words) -> CompensatorResult:
    """Return the entry of a compensator to which the table over position was added."""
    table = u.fill(TABLE_SUMMARY)
    name, summary = f"{row.name} + {TABLE.name}", f"{row.summary}; {table[0].lower()}{table[1:]}"
    return _row(name, summary, TABLE.kind, row.model, evaluation)


def _candidate_row(candidate: Candidate, evaluation: Evaluation | None, u: Words) -> CompensatorResult:
    own = {INTEGRAL.name: INTEGRAL_SUMMARY, TABLE.name: u.fill(TABLE_SUMMARY)}
    summary = own[candidate.name] if candidate.name in own else summary_of(find(candidate.name), u)
    if evaluation is None:
        return CompensatorResult(candidate.name, summary, candidate.kind, False, candidate.reason)
    return _row(candidate.name, summary, candidate.kind, candidate.model, evaluation, (candidate.name,))


def _joined(feedforward: Candidate, estimator: Candidate, evaluation: Evaluation, u: Words) -> CompensatorResult:
    second = INTEGRAL_SUMMARY if estimator == INTEGRAL else summary_of(find(estimator.name), u)
    return _row(
        f"{feedforward.name} + {estimator.name}",
        f"{summary_of(find(feedforward.name), u)}; {second[0].lower()}{second[1:]}",
        f"feedforward with {estimator.kind}",
        feedforward.model,
        evaluation,
        (feedforward.name, estimator.name),
    )


def _row(
    name: str, summary: str, kind: str, model: str, evaluation: Evaluation, laws: Sequence[str] = ()
) -> CompensatorResult:
    """Return the entry of a compensator in the result, before it is ranked."""
    scheme = evaluation.scheme
    costs = [cost_of(law) for law in laws]
    return CompensatorResult(
        name,
        summary,
        kind,
        True,
        evaluation.reason,
        model,
        {} if scheme is None else _parameters(scheme),
        scheme.gain if scheme is not None and kind not in ("none", "integral action") else None,
        scheme.bandwidth if scheme is not None else None,
        evaluation.metrics,
        scheme.margins if scheme is not None else None,
        evaluation.trials,
        evaluation.corners,
        cycles=sum(cost.cycles for cost in costs if cost is not None) if None not in costs and costs else None,
        flash=sum(cost.flash for cost in costs if cost is not None) if None not in costs and costs else None,
        error=evaluation.error,
    )


def _parameters(scheme: Scheme) -> Mapping[str, float]:
    """Return the parameters that were set; of two laws, with the name of the law."""
    laws = [law for law in (scheme.feedforward, scheme.compensator) if law is not None]
    if len(laws) == 1:
        return dict(laws[0].values)
    return {f"{law.model}.{name}": value for law in laws for name, value in law.values.items()}
