"""Rungs: the same run with other communication steps.

A longer step must not change the system: sampled parts keep their sample times and delays their durations. A part that
is sampled in every second step leaves room for twice the step only. One that is sampled in every step leaves none: the
run is then repeated with half the step.
"""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from typing import Final

import numpy as np

from harness.accuracy.estimate import IRREGULAR, Track, converge
from harness.engine.algorithm import Progress, Recorder
from harness.errors import ExperimentError, HarnessError, Interrupted
from harness.parts.part import Part, StartValue
from harness.parts.series import SeriesPart
from harness.result import Result
from harness.run import Options, Session
from harness.system.assembly import Assembly
from harness.system.experiment import COUPLING_TOLERANCE, LOOP_TOLERANCE, STEP_TOLERANCE, Experiment
from harness.system.wire import Delay, DropOut, Manipulator, Noise, Wire

COARSER: Final = (Fraction(2), Fraction(4))
TWICE: Final = (Fraction(2),)
FINER: Final = (Fraction(1, 2),)

FEWEST_STEPS: Final = 8
"""Fewest communication steps of a run whose accuracy can be told."""


@dataclass(frozen=True)
class Scaled:
    """A system whose sampled parts and delays count steps of another length; see `Assembly`."""

    name: str
    parts: Mapping[str, Part]
    wires: Sequence[Wire]
    start: Mapping[str, StartValue]
    strict: bool
    experiment: Experiment | None


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
    """Provide the system and the experiment with a step of so many times the given one.

    The run ends with the last whole step; its recorded rows are about as far apart as those of the given experiment,
    or in every step if that has one in every step and ``dense`` is true. The parts are shared with the given system.
    """
    sampled = [part for part in system.parts.values() if _keeps_time(part)]
    every = [part.every for part in sampled]
    wires = [replace(wire, delay=int(wire.delay / ratio)) for wire in system.wires]
    ticks = int(experiment.ticks / ratio)
    step = experiment.step * float(ratio)
    other = replace(
        experiment,
        step=step,
        stop=experiment.stop if ticks * ratio == experiment.ticks else experiment.start + ticks * step,
        decimate=1 if dense and experiment.decimate == 1 else rows_apart(experiment, ratio),
        manipulators=tuple(_scaled(each, ratio) for each in experiment.manipulators),
        coupling_tolerance=scaled_tolerance(experiment, float(ratio)) if experiment.master == "adaptive" else None,
        step_tolerance=scaled_step_tolerance(experiment, float(ratio)),
        loop_tolerance=scaled_loop_tolerance(experiment, float(ratio)),
    )
    scaled = Scaled(system.name, system.parts, wires, system.start, system.strict, system.experiment)
    try:
        for part, count in zip(sampled, every, strict=True):
            part.every = int(count / ratio)
        yield scaled, other
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


def scaled_tolerance(experiment: Experiment, ratio: float) -> float:
    """Return the coupling tolerance with which the inner steps of adaptive grow as the communication step does."""
    return min(max((experiment.coupling_tolerance or COUPLING_TOLERANCE) * ratio**2, 1e-12), 1e-2)


def scaled_loop_tolerance(experiment: Experiment, ratio: float) -> float:
    """Return the loop tolerance that grows like the error of a single step of newton, whose order is 2."""
    return min(max((experiment.loop_tolerance or LOOP_TOLERANCE) * ratio**3, 1e-14), 1e-2)


def scaled_step_tolerance(experiment: Experiment, ratio: float) -> float:
    """Return the step tolerance with which the pieces of divided steps grow as the communication step does."""
    return min(max((experiment.step_tolerance or STEP_TOLERANCE) * ratio**2, 1e-6), 0.5)


_LOG = logging.getLogger("harness")


@dataclass(frozen=True)
class Repetition:
    """A run with another step."""

    ratio: Fraction
    """Its step, relative to that of the run to be judged."""
    start: float
    step: float
    """Start of both runs, and step of the run in question [s]."""
    recorder: Recorder
    """What it has recorded."""

    def track(self, name: str) -> Track:
        """One variable of the run."""
        stride = self.ratio * self.recorder.decimate
        return Track(self.ratio, stride, self.start, self.step * float(stride), self.recorder.column(name))


def repeated(system: Assembly, experiment: Experiment, options: Options) -> tuple[Result, list[Repetition]]:
    """Run a system, and again with other steps."""
    if options.resume or options.checkpoint:
        raise ExperimentError(
            "the accuracy of a run that is continued or saved for continuation cannot be told: run it as a whole"
        )
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
        progress = next(shares, None) if shares else None
        with rung(system, experiment, ratio, dense=dense) as (scaled, other), _silent():
            try:
                session = Session(scaled, other, Options(progress=progress))
                found.append(Repetition(ratio, experiment.start, experiment.step, session.run(system.start)))
            except HarnessError:
                break
    return found if found or given == FINER else others(system, experiment, FINER, dense=dense)


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
        """Keep them."""
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


LOOP_SOLVERS: Final = frozenset({"newton", "adaptive"})
"""Masters that solve loops."""

ROUNDING: Final = 1e-9
"""Relative error that rounding leaves in a long run."""

OF_LOOPS: Final = 10.0
"""Relative error of a variable over the tolerance of the loops."""


@dataclass(frozen=True)
class Floor:
    """The relative error that no shorter step reduces."""

    error: float
    """Its size, relative to the range of a variable."""
    source: str
    """The setting or the part that leaves it: ``rounding``, ``loop_tolerance`` or ``tolerance of NAME``."""


def order_of(experiment: Experiment) -> float:
    """Return the order with which the master converges at best.

    The inner steps of adaptive follow from a tolerance, to which their error is not quite proportional: it counts as of
    first order.
    """
    return 2.0 if experiment.master == "newton" or experiment.extrapolation else 1.0


def has_lines(experiment: Experiment) -> bool:
    """Return whether the master passes values as lines instead of held values."""
    return experiment.master in LOOP_SOLVERS or experiment.extrapolation > 0


def floor_of(system: Assembly, experiment: Experiment) -> Floor:
    """Return the error that loops, rounding and solvers inside the parts leave, whichever is largest."""
    found = [Floor(ROUNDING, "rounding")]
    if experiment.master in LOOP_SOLVERS:
        found.append(Floor(OF_LOOPS * (experiment.loop_tolerance or LOOP_TOLERANCE), "loop_tolerance"))
    for name, part in system.parts.items():
        found.append(Floor(part.inner_tolerance(experiment.tolerance), f"tolerance of {name}"))
    return max(found, key=lambda floor: floor.error)


BOUND: Final = ".bound"
"""Suffix of the error bound of a number or a variable."""


def measure_bounds(
    system: Assembly,
    experiment: Experiment,
    measure: Callable[[Recorder], Mapping[str, float]],
    found: Mapping[str, float],
    *,
    dense: bool = False,
) -> dict[str, float]:
    """Return the error bounds of numbers that were found in a run."""
    # numbers of runs that end at different times differ by what happens in between
    runs = others(system, experiment, of_equal_end(experiment, ratios(system, experiment)), dense=dense)
    finer = bool(runs) and runs[0].ratio < 1
    numbers = [found, *(measure(run.recorder) for run in runs)]
    most, noise = order_of(experiment), floor_of(system, experiment).error
    return {
        name + BOUND: number_bound([each[name] for each in numbers], most=most, noise=noise, finer=finer)
        for name in found
    }


def number_bound(values: Sequence[float], *, most: float, noise: float, finer: bool) -> float:
    """Return the error bound of the first number."""
    if len(values) < 2 or not all(map(math.isfinite, values)):
        return math.inf
    size = abs(values[0])
    near, *further = (abs(a - b) for a, b in pairwise(values))
    # numbers that agree by chance prove nothing: the difference that the order predicts counts as well
    near = max([near, *(each / 2.0**most for each in further)])
    far = np.array(further[:1]) if further else None
    how = converge(np.array([near]), far, most, size, noise * size, finer=finer)
    bound = how.factor * near if how.resolved else IRREGULAR * max([near, *further])
    return float(bound + noise * size)
