"""A process that may crash, so that a test tells what it did last."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pytest


class Elsewhere:
    """Runs a function of a module in another process, which is replaced when it has crashed.

    Parameters
    ----------
    function : callable
        Its first arguments are an FMU and a file, to which it writes what it is about to do.
    """

    def __init__(self, function: Callable[..., object]) -> None:
        self._function = function
        self._pool: ProcessPoolExecutor | None = None

    def run(self, fmu: Path, trace: Path, *arguments: object) -> Any:
        """What the function returns; a crash fails the test and shows the file."""
        self._pool = self._pool or ProcessPoolExecutor(1, mp_context=get_context("spawn"))
        try:
            return self._pool.submit(self._function, fmu, trace, *arguments).result(timeout=120)
        except BrokenProcessPool:
            self.end()
            pytest.fail(f"the process crashed at the end of this:\n{trace.read_text()}")
        except TimeoutError:
            for process in [*self._pool._processes.values()]:
                process.kill()
            self.end()
            pytest.fail(f"the process did not come back from this:\n{trace.read_text()}")

    def end(self) -> None:
        """Stop the process."""
        if self._pool:
            self._pool.shutdown(wait=True, cancel_futures=True)
        self._pool = None
