"""Rungs: the same run with other communication steps.

A longer step must not change the system: sampled parts keep their sample times and delays their durations. A part that
is sampled in every second step leaves room for twice the step only. One that is sampled in every step leaves none: the
run is then repeated with half the step. A continuous part that steps every N communication steps goes on to do so: how
long its inputs are held is part of the error.
"""

import logging
import math
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Final

import numpy as np

from harness.accuracy.error_estimate import Track
from harness.engine.algorithm import Progress, Recorder
from harness.engine.defect import inaccurate
from harness.errors import ExperimentError, HarnessError, Interrupted
from harness.masters import find_master
from harness.parts.part import Part
from harness.parts.series import SeriesPart
from harness.run import Options, Session
from harness.system.assembly import Assembly, assembled
from harness.system.experiment import COUPLING_TOLERANCE, LIMITS, LOOP_TOLERANCE, STEP_TOLERANCE, Experiment
from harness.system.wire import Delay, DropOut, Manipulator, Noise

if TYPE_CHECKING:
    from harness.result import Result

COARSER: Final = (Fraction(2), Fraction(4))
TWICE: Final = (Fraction(2),)
FINER: Final = (Fraction(1, 2),)

FEWEST_STEPS: Final = 8  # fewest communication steps of a run whose accuracy can be told


def ratios(system: Assembly, experiment: Experiment) -> tuple[Fraction, ...]:
    """Return the steps of the other runs over the step of this one: 2 and 4, or what the sample times leave of them."""
    for each in experiment.manipulators:
        if isinstance(each, (Noise, DropOut)):
            raise ExperimentError(
                f"the {each} draws a random number in each step, so that a run with another step is another run: "
                "remove it, or run without accuracy"
            )
    if experiment.ticks < FEWEST_STEPS:
        raise ExperimentError(
            f"a run of {experiment.ticks} steps is too short to tell its accuracy: use a step of at most "
            f"{(experiment.stop - experiment.start) / FEWEST_STEPS:.6g} s"
        )
    counts = step_counts(system, experiment)
    return next((given for given in (COARSER, TWICE) if all(count % given[-1] == 0 for count in counts)), FINER)


def step_counts(system: Assembly, experiment: Experiment) -> list[int]:
    """Return the sample times and delays of a system, in communication steps."""
    counts = [part.every for part in system.parts.values() if _keeps_time(part)]
    counts += [wire.delay for wire in system.wires if wire.delay]
    return counts + [each.ticks for each in experiment.manipulators if isinstance(each, Delay)]


def _keeps_time(part: Part) -> bool:
    """Return whether the sample time of a part is a property of the system; a record has times of its own."""
    return part.sampled and not isinstance(part, SeriesPart)


@contextmanager
def rung(
    system: Assembly, experiment: Experiment, ratio: Fraction, *, dense: bool = False
) -> Iterator[tuple[Assembly, Experiment]]:
    """Provide the system and the experiment with a multiple of the given step."""
    # The run ends with the last whole step; its recorded rows are about as far apart as those of the given experiment,
    # or in every step if that has one in every step and ``dense`` is true. The parts are shared with the given system.
    sampled = [part for part in system.parts.values() if _keeps_time(part)]
    every = [part.every for part in sampled]
    wires = [replace(wire, delay=int(wire.delay / ratio)) for wire in system.wires]
    ticks = int(experiment.ticks / ratio)
    step = experiment.step * float(ratio)
    adapts = find_master(experiment.master).adapts
    other = replace(
        experiment,
        step=step,
        stop=experiment.stop if ticks * ratio == experiment.ticks else experiment.start + ticks * step,
        decimate=1 if dense and experiment.decimate == 1 else rows_apart(experiment, ratio),
        manipulators=tuple(_scaled(each, ratio) for each in experiment.manipulators),
        coupling_tolerance=scaled_tolerance(experiment, "coupling_tolerance", float(ratio)) if adapts else None,
        step_tolerance=scaled_tolerance(experiment, "step_tolerance", float(ratio)),
        loop_tolerance=scaled_tolerance(experiment, "loop_tolerance", float(ratio)),
    )
    try:
        for part, count in zip(sampled, every, strict=True):
            part.every = int(count / ratio)
        yield assembled(system, wires=wires), other
    finally:
        for part, count in zip(sampled, every, strict=True):
            part.every = count


def rows_apart(experiment: Experiment, ratio: Fraction) -> int:
    """Return from how many steps of such a run to the next a row is recorded."""
    return max(1, int(experiment.decimate / ratio))


def of_equal_end(experiment: Experiment, given: Sequence[Fraction]) -> tuple[Fraction, ...]:
    """Return these ratios, or half of the step if one of their runs has its last row at another time than the given."""
    last = experiment.ticks // experiment.decimate * experiment.decimate

    def ends_there(ratio: Fraction) -> bool:
        many = rows_apart(experiment, ratio)
        return int(experiment.ticks / ratio) // many * many * ratio == last

    return tuple(given) if all(map(ends_there, given)) else FINER


def _scaled(manipulator: Manipulator, ratio: Fraction) -> Manipulator:
    return replace(manipulator, ticks=int(manipulator.ticks / ratio)) if isinstance(manipulator, Delay) else manipulator


_GROWTH: Final = {  # default, and the power of the step with which the tolerance grows
    "coupling_tolerance": (COUPLING_TOLERANCE, 2),  # the inner steps of adaptive grow as the communication step does
    "step_tolerance": (STEP_TOLERANCE, 2),  # so do the pieces of divided steps
    "loop_tolerance": (LOOP_TOLERANCE, 3),  # as the error of a single step of newton, whose order is 2
}


def scaled_tolerance(experiment: Experiment, name: str, ratio: float) -> float:
    """Return a tolerance for a multiple of the given step."""
    (default, power), (_, least, most) = _GROWTH[name], LIMITS[name]
    return min(max(float(getattr(experiment, name) or default) * ratio**power, float(least)), float(most))


_LOG = logging.getLogger("harness")


@dataclass(frozen=True)
class Repetition:
    """A run with another step."""

    ratio: Fraction  # its step, relative to that of the run to be judged
    start: float  # start of both runs [s]
    step: float  # step of the run in question [s]
    recorder: Recorder  # what it has recorded

    def track(self, name: str) -> Track:
        """One variable of the run."""
        stride = self.ratio * self.recorder.decimate
        return Track(self.ratio, stride, self.start, self.step * float(stride), self.recorder.column(name))


def repeated(system: Assembly, experiment: Experiment, options: Options) -> "tuple[Result, list[Repetition]]":
    """Run a system, and again with other steps."""
    if options.resume or options.checkpoint:
        raise ExperimentError(
            "the accuracy of a run that is continued or saved for continuation cannot be told: run it as a whole"
        )
    if options.events:
        raise ExperimentError("the accuracy of a run with two rows at events cannot be told: run it without events")
    given = ratios(system, experiment)
    shares = _shares(options.progress, (Fraction(1), *given))
    result = Session(system, experiment, replace(options, progress=next(shares, None))).run(system.start).result()
    try:
        return result, others(system, experiment, given, shares)
    except Interrupted as interrupted:
        interrupted.result = result
        raise


def others(
    system: Assembly,
    experiment: Experiment,
    given: Sequence[Fraction],
    shares: Iterator[Progress] | None = None,
    *,
    dense: bool = False,
) -> list[Repetition]:
    """Repeat a run with these steps up to the first that fails, or with half of the step if all of them fail."""
    found: list[Repetition] = []
    for ratio in given:
        run = _again(system, experiment, ratio, Options(progress=next(shares, None) if shares else None), dense)
        if run is None:
            break
        found.append(run)
    return found if found or given == FINER else others(system, experiment, FINER, dense=dense)


def by_newton(
    system: Assembly, experiment: Experiment, runs: Sequence[Repetition], *, dense: bool = False
) -> Repetition | None:
    """Repeat a run of an explicit master with newton, at the longest of the given steps; None if it says nothing."""
    if find_master(experiment.master).implicit or not system.wires:
        return None
    ratio = max(Fraction(1), *(run.ratio for run in runs))
    run = _again(system, replace(experiment, master="newton", extrapolation=0, order=()), ratio, Options(), dense)
    return None if run is None or inaccurate(run.recorder.attributes) else run


def _again(
    system: Assembly, experiment: Experiment, ratio: Fraction, options: Options, dense: bool
) -> Repetition | None:
    with rung(system, experiment, ratio, dense=dense) as (scaled, other), _silent():
        try:
            recorder = Session(scaled, other, options).run(system.start)
        except HarnessError:
            return None
    return Repetition(ratio, experiment.start, experiment.step, recorder)


@contextmanager
def _silent() -> Iterator[None]:
    """Drop the warnings of this thread: they are about a run that nobody has asked for."""
    thread = threading.get_ident()

    def passes(record: logging.LogRecord) -> bool:
        return record.thread != thread

    _LOG.addFilter(passes)
    try:
        yield
    finally:
        _LOG.removeFilter(passes)


class _Share:
    """The progress of one of several runs, as part of the whole."""

    def __init__(self, progress: Progress, before: float, share: float) -> None:
        self._progress, self._before, self._share = progress, before, share

    def update(self, done: int, total: int) -> None:
        """Report the progress of all runs in thousandths."""
        self._progress.update(math.floor(1000.0 * (self._before + self._share * done / max(total, 1)) + 1e-6), 1000)


def _shares(progress: Progress | None, given: Sequence[Fraction]) -> Iterator[Progress]:
    """Yield the progress of each run; longer steps take less time."""
    if progress is None:
        return
    work = np.array([1.0 / float(ratio) for ratio in given])
    ends = np.cumsum(work) / work.sum()
    for end, share in zip(ends, work / work.sum(), strict=True):
        yield _Share(progress, float(end - share), float(share))
