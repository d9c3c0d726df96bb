"""The same run with other communication steps, one after the other."""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from harness.accuracy.estimate import Track
from harness.accuracy.rungs import FINER, ratios, rung
from harness.engine.tap import Progress, Recorder
from harness.errors import ExperimentError, HarnessError, Interrupted
from harness.result import Result
from harness.run import Options, Session
from harness.system.assembly import Assembly
from harness.system.experiment import Experiment

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
        return result, others(system, experiment, given, shares, native=options.native)
    except Interrupted as interrupted:
        interrupted.result = result
        raise


def others(
    system: Assembly,
    experiment: Experiment,
    given: Sequence[Fraction],
    shares: Iterator[Progress] | None = None,
    *,
    native: bool = True,
    dense: bool = False,
) -> list[Repetition]:
    """Repeat a run with these steps up to the first that fails, or with half of the step if all of them fail."""
    found: list[Repetition] = []
    for ratio in given:
        progress = next(shares, None) if shares else None
        with rung(system, experiment, ratio, dense=dense) as (scaled, other), _silent():
            try:
                session = Session(scaled, other, Options(progress=progress, native=native))
                found.append(Repetition(ratio, experiment.start, experiment.step, session.run(system.start)))
            except HarnessError:
                break
    return found if found or given == FINER else others(system, experiment, FINER, native=native, dense=dense)


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
