"""Mutants of input files: what each command answers to damaged ones.

    mutants.py COUNT [KIND ...]            COUNT mutants of each kind, all kinds by default
    mutants.py --replay KIND NUMBER        one of them again, with what it prints
    --keep FOLDER                          where the failing ones are stored, by default ./mutants
    --first NUMBER                         the first number, 0 by default

Each mutant is made from its kind and number and given to the command in a process that was forked after all imports. It
may succeed or be refused in one sentence; a traceback, more than 20 s of processor time (a hang) and a signal (a crash)
are failures, and the status is 1 then.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from mutant_kinds import KINDS, Kind, prepare

OUTCOMES = ("ok", "sentence", "traceback", "hang", "crash")
CPU_LIMIT, WALL_LIMIT = 20.0, 240.0
MEMORY = 8 << 30
BATCH = 50


@dataclass
class Worker:
    """A forked process, the mutants that it still has to try, and since when it is at the first of them."""

    kind: str
    numbers: list[int]
    process: int
    pipe: int
    text: str = ""
    began: float = field(default_factory=time.monotonic)
    spent: float = 0.0


def seconds_of(process: int) -> float:
    """Processor time of a process and of its children that have ended."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:
        return 0.0
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


@contextlib.contextmanager
def printed_to(path: Path) -> Iterator[None]:
    """All that this process and its children print, also from C."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = os.dup(1), os.dup(2)
    with path.open("wb") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
    try:
        yield
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        for number, own in enumerate(kept, 1):
            os.dup2(own, number)
            os.close(own)


def attempt(kind: Kind, folder: Path) -> tuple[str, str]:
    """What the command makes of the files in a folder, and its last words."""
    log = folder.with_name(f"{folder.name}.log")
    with printed_to(log):
        try:
            status = kind.action(folder)
        except SystemExit as error:
            status = error.code
        except BaseException:
            traceback.print_exc()
            status = None
    text = log.read_text(encoding="utf-8", errors="replace")
    log.unlink()
    said = [line for line in text.splitlines() if line.startswith("friction-fmus: ")]
    if status is None or "Traceback (most recent call last)" in text:
        return "traceback", text[-3000:]
    if status == 0:
        return "ok", ""
    if status == 1 or (status == 2 and len(said) == 1 and text.rstrip().endswith(said[0].rstrip())):
        return "sentence", text[-300:]
    return "traceback", f"status {status}, and not one sentence:\n{text[-3000:]}"


def write(kind: Kind, number: int, folder: Path) -> None:
    """The files of a mutant, or the valid ones for a negative number."""
    for name, content in kind.mutant(number).items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def work(worker_pipe: int, kind: Kind, numbers: Sequence[int], place: Path) -> None:
    """Try mutants in this process, and say of each one what happened."""
    os.setsid()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for number in numbers:
        folder = place / f"{kind.name}-{number}"
        write(kind, number, folder)
        os.chdir(folder)
        outcome, text = attempt(kind, folder)
        os.chdir(place)
        shutil.rmtree(folder, ignore_errors=True)
        os.write(worker_pipe, (json.dumps([number, outcome, text]) + "\n").encode())
    os._exit(0)


def start(kind: str, numbers: Sequence[int], place: Path) -> Worker:
    """A worker for these mutants."""
    reading, writing = os.pipe()
    process = os.fork()
    if process == 0:
        os.close(reading)
        try:
            work(writing, KINDS[kind], numbers, place)
        finally:
            os._exit(99)
    os.close(writing)
    return Worker(kind, list(numbers), process, reading)


class Campaign:
    """Mutants of several kinds in workers side by side.

    Attributes
    ----------
    counts : dict of str to Counter
        Kind -> how often each outcome.
    failures : list of (str, int, str, str)
        Kind, number, outcome and last words.
    slack : float
        Multiple of the limits of time: the valid files come first, and compile what the cache keeps for the mutants.
    """

    def __init__(self, place: Path, keep: Path, workers: int, tell: Callable[[str], None] = lambda _: None) -> None:
        self.place, self.keep, self.workers, self.tell, self.total, self.slack = place, keep, workers, tell, 0, 1.0
        self.counts: dict[str, Counter[str]] = {}
        self.failures: list[tuple[str, int, str, str]] = []
        self._running: list[Worker] = []

    def run(self, kinds: Sequence[str], numbers: Sequence[int]) -> None:
        """Try all of them."""
        self.counts, self.total = {kind: Counter() for kind in kinds}, len(numbers)
        batches = [(kind, numbers[i : i + BATCH]) for kind in kinds for i in range(0, len(numbers), BATCH)]
        while batches or self._running:
            while batches and len(self._running) < self.workers:
                self._running.append(start(*batches.pop(0), self.place))
            ready, _, _ = select.select([worker.pipe for worker in self._running], [], [], 1.0)
            for worker in list(self._running):
                if worker.pipe in ready:
                    data = os.read(worker.pipe, 1 << 16)
                    worker.text += data.decode()
                    self._listen(worker)
                    if not data:
                        batches[:0] = self._ended(worker, "crash")
                        continue
                spent = seconds_of(worker.process) - worker.spent
                if spent > self.slack * CPU_LIMIT or time.monotonic() - worker.began > self.slack * WALL_LIMIT:
                    os.killpg(worker.process, signal.SIGKILL)
                    batches[:0] = self._ended(worker, "hang")

    def _listen(self, worker: Worker) -> None:
        *lines, worker.text = worker.text.split("\n")
        for line in lines:
            number, outcome, text = json.loads(line)
            self._note(worker.kind, number, outcome, text)
            worker.numbers.remove(number)
            worker.began, worker.spent = time.monotonic(), seconds_of(worker.process)

    def _ended(self, worker: Worker, outcome: str) -> list[tuple[str, Sequence[int]]]:
        """Note what a process died of; the mutants that it has left."""
        self._running.remove(worker)
        os.close(worker.pipe)
        _, status = os.waitpid(worker.process, 0)
        if not worker.numbers:
            return []
        code = os.waitstatus_to_exitcode(status)
        why = signal.Signals(-code).name if code < 0 else f"the process ended with status {code}"
        self._note(worker.kind, worker.numbers[0], outcome, why)
        return [(worker.kind, worker.numbers[1:])] if worker.numbers[1:] else []

    def _note(self, kind: str, number: int, outcome: str, text: str) -> None:
        self.counts[kind][outcome] += 1
        if outcome not in ("ok", "sentence"):
            self.failures.append((kind, number, outcome, text))
            store(kind, number, f"{outcome}\n{text}\n", self.keep)
        if self.counts[kind].total() == self.total:
            self.tell(row(kind, self.counts[kind]))


def row(kind: str, counts: Counter[str]) -> str:
    """A row of the table, in Markdown."""
    return f"| {kind} | {counts.total()} | {' | '.join(str(counts[outcome]) for outcome in OUTCOMES)} |"


def store(kind: str, number: int, why: str, folder: Path) -> None:
    """The files of a failing mutant, and what it ended with."""
    own = folder / f"{kind}-{number}"
    shutil.rmtree(own, ignore_errors=True)
    write(KINDS[kind], number, own)
    (own / "why.txt").write_text(why, encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("count", type=int, nargs="?", default=30)
    parser.add_argument("kinds", nargs="*", metavar="KIND")
    parser.add_argument("--replay", nargs=2, metavar=("KIND", "NUMBER"))
    parser.add_argument("--keep", type=Path, default=Path("mutants"))
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)))
    options = parser.parse_intermixed_args()
    with tempfile.TemporaryDirectory(prefix="mutants-") as name:
        place = Path(name)
        prepare(place)
        if options.replay:
            kind, number = KINDS[options.replay[0]], int(options.replay[1])
            folder = options.keep.resolve() / f"{kind.name}-{number}"
            write(kind, number, folder)
            os.chdir(folder)
            print(folder, kind.action(folder))
            return 0
        kinds = options.kinds or list(KINDS)
        valid = Campaign(place, options.keep.resolve(), options.workers)
        valid.slack = 10.0
        valid.run(kinds, [-1])
        if refused := [kind for kind, counts in valid.counts.items() if not counts["ok"]]:
            print(f"the valid files are refused: {', '.join(refused)}\n{valid.failures}")
            return 2
        print(f"| kind | mutants | {' | '.join(OUTCOMES)} |\n|---|{'---|' * (1 + len(OUTCOMES))}", flush=True)
        campaign = Campaign(place, options.keep.resolve(), options.workers, partial(print, flush=True))
        campaign.run(kinds, range(options.first, options.first + options.count))
    for kind, number, outcome, text in campaign.failures:
        print(f"{kind} {number}: {outcome}: {(text.strip().splitlines() or [''])[-1][:200]}")
    return int(bool(campaign.failures))


if __name__ == "__main__":
    sys.exit(main())
