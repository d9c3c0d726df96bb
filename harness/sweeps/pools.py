"""Where the runs of a sweep are executed: in processes, in threads, in this thread, or on a dask cluster."""

import logging
import multiprocessing
import os
import shutil
import signal
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from importlib.machinery import PathFinder
from multiprocessing.context import BaseContext
from pathlib import Path
from time import monotonic, sleep
from types import ModuleType
from typing import Any, Final, Protocol, TypeAlias

from harness.errors import SweepError
from harness.processors import available
from harness.storage.files import ScratchFolder, reason
from harness.sweeps.samples import Sample
from harness.sweeps.worker import Job, Outcome, close_runners, run_chunk
from harness.workers import end_with_parent

_LOG = logging.getLogger("harness")

Chunk: TypeAlias = Sequence[tuple[int, Sample]]
Outcomes: TypeAlias = "Future[list[Outcome]]"

# pauses before each attempt to start a worker process, as a killed fork server takes time to end [s]
_PAUSES: Final = (0.0, 0.1, 0.3, 1.0, 3.0)
IDLE: Final = 60.0  # time after which a worker of a cluster closes a system that is not used [s]
LOOK: Final = 10.0  # longest time between two looks at the workers [s]


class Pool(Protocol):
    """Workers that execute chunks of runs; a future that fails with one of the ``losses`` has lost its worker."""

    losses: tuple[type[BaseException], ...]

    def capacity(self) -> int:
        """Number of chunks that should be in progress."""

    def submit(self, job: Job, chunk: Chunk) -> Outcomes:
        """Start a chunk; call it only while fewer than `capacity` chunks are in progress."""

    def close(self, job: Job) -> None:
        """End all work, including chunks in progress."""


class SerialPool:
    """Execution of one chunk after the other in this thread."""

    losses: tuple[type[BaseException], ...] = ()

    def capacity(self) -> int:
        """One."""
        return 1

    def submit(self, job: Job, chunk: Chunk) -> Outcomes:
        """Execute the chunk."""
        future: Outcomes = Future()
        future.set_result(run_chunk(job, chunk))
        return future

    def close(self, job: Job) -> None:
        """Close the system."""
        close_runners(job.key)


class ThreadPool:
    """Threads of this process, each with its own system."""

    losses: tuple[type[BaseException], ...] = ()

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._executor = ThreadPoolExecutor(workers, "sweep")
        self._stop = threading.Event()

    def capacity(self) -> int:
        """One chunk per thread."""
        return self._workers

    def submit(self, job: Job, chunk: Chunk) -> Outcomes:
        """Pass the chunk to a free thread."""
        return self._executor.submit(run_chunk, job, chunk, self._stop.is_set)

    def close(self, job: Job) -> None:
        """Wait for the runs in progress."""
        self._stop.set()
        self._executor.shutdown(cancel_futures=True)
        close_runners(job.key)


class ProcessPool:
    """Processes on this machine, each with its own executor, so that a process that dies does not affect the others."""

    losses: tuple[type[BaseException], ...] = (BrokenExecutor,)

    def __init__(self, workers: int) -> None:
        # not fork, which copies locks that other threads may be holding
        # the fork server's socket is in the temporary folder, and its path may have at most 107 characters
        serves = "forkserver" in multiprocessing.get_all_start_methods() and len(tempfile.gettempdir()) < 70
        serves = serves and not _is_shadowed()
        context = multiprocessing.get_context("forkserver" if serves else "spawn")
        if serves:
            context.set_forkserver_preload(["__main__", "harness.sweeps.preload", *_imported_by_main()])
        self._folder = ScratchFolder()
        self._scratch = self._folder.name
        try:
            self._slots = [_new_slot(context, self._scratch) for _ in range(workers)]
        except BaseException:
            self._folder.cleanup()
            raise
        self._failed_starts = 0

    def capacity(self) -> int:
        """One chunk per process."""
        return len(self._slots)

    def submit(self, job: Job, chunk: Chunk) -> Outcomes:
        """Pass the chunk to a free process, and replace a process that has died."""
        index, slot = next((i, slot) for i, slot in enumerate(self._slots) if slot.free)
        if slot.lost:
            self._failed_starts = 0 if slot.started else self._failed_starts + 1
            if self._failed_starts == 2:
                raise SweepError(
                    "the worker processes of the sweep die during start-up: call sweep below "
                    "if __name__ == '__main__', or use the executor 'threads'"
                )
            slot.end()
            slot = self._slots[index] = _new_slot(slot.context, self._scratch)
        return slot.submit(job, chunk)

    def close(self, job: Job) -> None:
        """End the processes and remove their temporary files."""
        for slot in self._slots:
            slot.end()
        self._folder.cleanup()


class _Slot:
    """One worker process."""

    def __init__(self, context: BaseContext, scratch: str) -> None:
        self.context = context
        self._executor = ProcessPoolExecutor(1, context, _prepare_process, (scratch,))
        self._id = self._executor.submit(os.getpid)
        self._future: Outcomes | None = None

    @property
    def free(self) -> bool:
        """Whether no chunk is in progress."""
        return self._future is None or self._future.done()

    @property
    def started(self) -> bool:
        """Whether the process has begun to work."""
        return self._id.done() and self._id.exception() is None

    @property
    def lost(self) -> bool:
        """Whether the process has died."""
        return self._future is not None and self._future.done() and isinstance(self._future.exception(), BrokenExecutor)

    def submit(self, job: Job, chunk: Chunk) -> Outcomes:
        """Start a chunk; only this reveals a process that died while idle."""
        try:
            self._future = self._executor.submit(run_chunk, job, chunk)
        except BrokenExecutor as error:
            self._future = Future()
            self._future.set_exception(error)
        return self._future

    def end(self) -> None:
        """End the process immediately if it is working, as its results are no longer needed."""
        if not self.free and self._id.exception() is None:
            os.kill(self._id.result(), signal.SIGTERM if sys.platform == "win32" else signal.SIGKILL)
        self._executor.shutdown(cancel_futures=True)


def _new_slot(context: BaseContext, scratch: str) -> _Slot:
    """Start a worker process, with a new fork server if the old one has been killed."""
    why = ""
    for pause in _PAUSES:
        sleep(pause)
        try:
            return _Slot(context, scratch)
        except (EOFError, OSError) as error:
            why = str(error)
    raise SweepError(
        f"no worker process of the sweep could be started ({why}): use fewer workers, or the executor 'threads'"
    )


class DaskPool:
    """The workers of a dask cluster."""

    def __init__(self, client: Any) -> None:
        from distributed.scheduler import KilledWorker

        # futures are cancelled by a restart of the workers; their runs are repeated if there is a scheduler
        self.losses: tuple[type[BaseException], ...] = (KilledWorker, CancelledError)
        self._client = client
        self._executor = client.get_executor(pure=False)
        self._worked: float | None = monotonic()

    def capacity(self) -> int:
        """Two chunks per available thread, to hide the communication time."""
        with self._connected():
            threads = int(sum(self._client.nthreads().values()))
        if threads:
            self._worked = monotonic()
        elif self._worked is not None and monotonic() - self._worked > LOOK:
            _LOG.warning("the dask cluster has no worker: the sweep waits for one; start workers, or press Ctrl-C")
            self._worked = None
        return max(2, 2 * threads)

    def submit(self, job: Job, chunk: Chunk) -> Outcomes:
        """Pass the chunk to the scheduler, which assigns it to another worker if one dies."""
        with self._connected():
            future: Outcomes = self._executor.submit(run_chunk, job, chunk, idle=IDLE)
            return future

    def close(self, job: Job) -> None:
        """Cancel chunks in progress and close the systems of the workers, each after its current run."""
        with suppress(Exception):  # without a scheduler, the workers close them when idle
            self._executor.shutdown(wait=False)
            self._client.run(close_runners, job.key, on_error="ignore")  # a worker may just have died

    @contextmanager
    def _connected(self) -> Iterator[None]:
        """Raise a SweepError if the scheduler does not answer."""
        try:
            if self._client.status != "running":
                raise OSError(f"the client is {self._client.status}")
            yield
        except (OSError, RuntimeError, TimeoutError, CancelledError) as error:
            raise SweepError(
                f"the sweep has lost the dask scheduler ({reason(error)}): start it again and connect a new client; a "
                "sweep with an output folder resumes where it stopped"
            ) from error


def make_pool(executor: Any, workers: int | None) -> Pool:
    """Return the requested pool."""
    if workers is not None and workers < 1:
        raise SweepError(f"the number of workers is {workers}: give 1 or more")
    if executor == "serial":
        return SerialPool()
    if executor == "threads":
        return ThreadPool(workers or available())
    if executor == "processes":
        return ProcessPool(workers or available())
    if hasattr(executor, "get_executor"):
        return DaskPool(executor)
    raise SweepError(
        f"{executor!r} is not an executor of sweeps: use 'processes', 'threads', 'serial' or a dask client"
    )


def _is_shadowed() -> bool:
    """Return whether a fork server, which looks into the working folder first, would find another package `harness`."""
    found = PathFinder.find_spec("harness", [str(Path.cwd())])
    return found is not None and found.origin != sys.modules["harness"].__file__


def _imported_by_main() -> list[str]:
    """Return the imports of the main script, which every worker repeats; preloading them saves time."""
    values = vars(sys.modules["__main__"]).values()
    names = {value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", "") for value in values}
    return sorted(str(name) for name in names if name in sys.modules and name not in {"__main__", "builtins"})


def _prepare_process(scratch: str) -> None:
    """Prepare a worker process so that nothing of it outlives its sweep."""
    if hasattr(os, "setpgrp"):
        os.setpgrp()  # Ctrl-C goes to the sweep, which ends its workers
    tempfile.tempdir = scratch
    end_with_parent(partial(shutil.rmtree, scratch, ignore_errors=True))
