"""What does not run with README's command: what a landing adds (``LANDING=1``, `.ci/run`), and each night (``THOROUGH=1``)."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from typing import TypeVar

import pytest

_T = TypeVar("_T")
THOROUGH = bool(os.environ.get("THOROUGH"))
LANDING = bool(os.environ.get("LANDING"))

nightly = pytest.mark.nightly
"""Marks tests and parameters that run each night only."""

landing = pytest.mark.landing
"""Marks tests and parameters that run beside those of `slow` before a change lands, but not with README's command."""


def some(every: Sequence[_T], chosen: Sequence[_T]) -> Sequence[_T]:
    """Return all cases each night, and the chosen ones otherwise."""
    return every if THOROUGH else chosen


def few(examples: int) -> int:
    """Return that many examples of a property each night, and a sixth of them otherwise, at least 10."""
    return examples if THOROUGH else min(examples, max(10, examples // 6))


def slowness() -> float:
    """Return how much slower this machine is just now than one on which the loop below takes 0.25 s, at least 1.

    The processor time of the same work differs by a factor of 2.5 on shared machines.
    """
    begin = time.process_time()
    total = 0
    for i in range(3_000_000):
        total += i * i
    return max(1.0, (time.process_time() - begin) / 0.25)
