"""Probes of the effects of an FMU on its process: memory, output, settings."""

import gc
import os
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

from .fmi2_library import OK, WARNING, RawLibrary, settings_now, start
from .probe_process import Report, probe

_BLOCK = 0.4  # duration of a block of repetitions [s]
_MOST = 2000
_GROWTH = 1 << 16  # smallest growth in a block of repetitions that counts [bytes]


def _resident() -> int:
    """Return the memory of this process, or its peak if the system tells no more; 0 if unknown [bytes]."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        pass
    if sys.platform == "win32":
        return 0
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def _grows(action: Callable[[], object]) -> float | None:
    """Return the growth per repetition if memory grows in three blocks of them, after one block to settle [bytes]."""
    start, count = perf_counter(), 0
    while count < _MOST and perf_counter() - start < _BLOCK:
        action()
        count += 1
    growth = []
    for _ in range(3):
        gc.collect()
        before = _resident()
        for _ in range(count):
            action()
        growth.append(_resident() - before)
        if growth[-1] < _GROWTH:
            return None
    return min(growth) / count


@probe(several=True)
def memory_of_instances(library: RawLibrary, report: Report) -> None:
    """Check that freed instances leave no memory allocated."""

    def live() -> None:
        with start(library) as run:
            run.initialise().step(library.start_time, library.job["step"])
            run.must("Terminate")

    if growth := _grows(live):
        report(
            "memory-grows",
            f"every instance leaks {growth:.0f} bytes; free all memory in {library.named('FreeInstance')}",
        )


@probe()
def memory_of_steps(library: RawLibrary, report: Report) -> None:
    """Check that a long run needs no more memory than a short one."""
    with start(library) as run:
        run.initialise()
        h, done = library.job["step"], 0

        def step() -> None:
            nonlocal done
            if run.step_status(library.start_time + done * h, h) in (OK, WARNING):
                done += 1

        if growth := _grows(step):
            report("memory-grows", f"every step allocates another {growth:.0f} bytes; free it in the step")


@probe()
def settings(library: RawLibrary, report: Report) -> None:
    """Check that all previous calls have left the settings of the process unchanged."""
    after = settings_now()
    changed = [name for name, value in library.settings.items() if after[name] != value]
    if changed:
        report("process-changed", f"a run changes {' and '.join(changed)}; do not change settings of the process")


@probe()
def messages(library: RawLibrary, report: Report) -> None:
    """Check that messages use the logger and declared categories; the last probe, after all messages."""
    declared = library.job["categories"]
    for name in sorted(library.categories - {""}):
        if declared and name not in declared:
            report("log-category", f"a message is logged in the category {name!r}; list it in LogCategories")
    printed = [name for name in ("stdout", "stderr") if Path(library.job["folder"], name).stat().st_size]
    if printed:
        report("prints", f"the library prints to {' and '.join(printed)}; call the logger of the callbacks")
