"""The number of processors this process may use."""

from __future__ import annotations

import os


def available() -> int:
    """Return how many processors this process may use; on a system that does not say, how many the machine has."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
