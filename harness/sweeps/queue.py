"""Which runs are done next, and in how large chunks."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Sequence
from time import monotonic
from typing import Final

from harness.sweeps.worker import Outcome

TRIES: Final = 3
"""So many workers may die in a run before it counts as failed."""


class Queue:
    """The runs that are still to be given out.

    A chunk takes half a second, or 2 % of the time that the sweep has taken so far, and 10 s at most: that is what is
    lost when everything is killed, and the number of files stays small. Towards the end chunks get smaller, so that
    the workers end together.

    Parameters
    ----------
    runs : iterable of int
        Their numbers.
    most : int
        Largest number of runs in a chunk.
    """

    def __init__(self, runs: Iterable[int], most: int) -> None:
        """Begin to count the time."""
        self._runs = deque(runs)
        self._most = most
        self._again: deque[list[int]] = deque()
        self._deaths: Counter[int] = Counter()
        self._seconds: float | None = None
        self._begin = monotonic()

    @property
    def left(self) -> bool:
        """Whether there is anything to be given out."""
        return bool(self._runs or self._again)

    def take(self, workers: int) -> list[int]:
        """The runs of the next chunk."""
        if self._again:
            return self._again.popleft()
        size = 1.0
        if self._seconds is not None:
            span = min(10.0, max(0.5, 0.02 * (monotonic() - self._begin)))
            size = max(0.05 / self._seconds, min(span / self._seconds, len(self._runs) / (2 * workers)))
        count = min(max(1, int(size)), self._most, len(self._runs))
        return [self._runs.popleft() for _ in range(count)]

    def note(self, outcomes: Sequence[Outcome]) -> None:
        """Learn from what has been done how long a run takes."""
        if outcomes:
            self._seconds = max(1e-6, sum(outcome.wall_time for outcome in outcomes) / len(outcomes))

    def give_back(self, chunk: Sequence[int]) -> list[Outcome]:
        """Take back a chunk whose worker died, in halves: one of its runs may be what kills.

        Returns
        -------
        list of Outcome
            A run that has been alone with its worker when it died, too often.
        """
        if len(chunk) > 1:
            half = len(chunk) // 2
            self._again += [list(chunk[:half]), list(chunk[half:])]
            return []
        (run,) = chunk
        self._deaths[run] += 1
        if self._deaths[run] < TRIES:
            self._again.append([run])
            return []
        return [Outcome(run, error=f"{TRIES} worker processes died in this run: look for an FMU that crashes")]
