"""The order of the runs of a sweep and the size of chunks."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Sequence
from time import monotonic
from typing import Final

from harness.sweeps.worker import Outcome

TRIES: Final = 3
"""Number of workers that may die in a run before it counts as failed."""


class Queue:
    """Queue of the remaining runs.

    A chunk takes about 0.5 s or 2 % of the sweep's duration so far, and at most 10 s. This limits the work lost if the
    sweep is killed, and also the number of files. Towards the end, chunks become smaller, so that all workers finish at
    about the same time.
    """

    def __init__(self, runs: Iterable[int], most: int) -> None:
        """Start the clock."""
        self._runs = deque(runs)
        self._most = most
        self._again: deque[list[int]] = deque()
        self._deaths: Counter[int] = Counter()
        self._seconds: float | None = None
        self._begin = monotonic()

    @property
    def left(self) -> bool:
        """Whether runs remain."""
        return bool(self._runs or self._again)

    def take(self, workers: int) -> list[int]:
        """Return the runs of the next chunk."""
        if self._again:
            return self._again.popleft()
        size = 1.0
        if self._seconds is not None:
            span = min(10.0, max(0.5, 0.02 * (monotonic() - self._begin)))
            size = max(0.05 / self._seconds, min(span / self._seconds, len(self._runs) / (2 * workers)))
        count = min(max(1, int(size)), self._most, len(self._runs))
        return [self._runs.popleft() for _ in range(count)]

    def note(self, outcomes: Sequence[Outcome]) -> None:
        """Update the estimated duration of a run."""
        if outcomes:
            self._seconds = max(1e-6, sum(outcome.wall_time for outcome in outcomes) / len(outcomes))

    def give_back(self, chunk: Sequence[int]) -> list[Outcome]:
        """Return a chunk whose worker died to the queue, in halves, to isolate the run that killed it."""
        if len(chunk) > 1:
            half = len(chunk) // 2
            self._again += [list(chunk[:half]), list(chunk[half:])]
            return []
        (run,) = chunk
        self._deaths[run] += 1
        if self._deaths[run] < TRIES:
            self._again.append([run])
            return []
        return [Outcome(run, error=f"{TRIES} worker processes died in this run: check whether an FMU crashes")]
