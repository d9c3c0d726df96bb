"""A master that is more than a list of operations, as the engine sees it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from harness.errors import HarnessError


class Algorithm(ABC):
    """Data of a master in C, attached to an engine."""

    @abstractmethod
    def begin(self) -> None:
        """Begin a run at the start values of the plan; attach the data to the engine."""

    @abstractmethod
    def memory(self) -> dict[str, np.ndarray[Any, Any]]:
        """Return the values kept from step to step for a checkpoint, as views of the data."""

    def report(self) -> dict[str, str | float]:
        """Log warnings about the run that has ended, and return its attributes."""
        return {}

    def failure(self, number: int, time: float) -> HarnessError:
        """Return the error for a tick that has no solution."""
        return HarnessError(f"the master found no solution at t = {time:.12g} s; use a shorter step")
