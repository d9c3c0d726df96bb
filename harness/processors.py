"""The number of processors that this process may use."""

import os


def available() -> int:
    """Return the number of processors that this process may use, or of the machine if the system does not tell."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
