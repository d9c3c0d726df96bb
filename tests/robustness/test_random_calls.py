"""Random sequences of calls, on every block: no crash, the statuses of the standard, no change by a refused call."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path

import pytest
from call_machine import run

from friction_fmus import catalogue


class Elsewhere:
    """A process that may crash, replaced when it has."""

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None

    def run(self, fmu: Path, trace: Path, examples: int) -> None:
        self._pool = self._pool or ProcessPoolExecutor(1, mp_context=get_context("spawn"))
        try:
            self._pool.submit(run, fmu, trace, examples).result(timeout=120)
        except BrokenProcessPool:
            self.end()
            pytest.fail(f"the process crashed at the end of these calls:\n{trace.read_text()}")

    def end(self) -> None:
        if self._pool:
            self._pool.shutdown(wait=True, cancel_futures=True)
        self._pool = None


@pytest.fixture(scope="module")
def elsewhere() -> Iterator[Elsewhere]:
    made = Elsewhere()
    yield made
    made.end()


@pytest.mark.parametrize("name", catalogue())
def test_random_calls(name: str, build_fmu: Callable[..., Path], elsewhere: Elsewhere, tmp_path: Path) -> None:
    elsewhere.run(build_fmu(name), tmp_path / "calls.txt", 12)
