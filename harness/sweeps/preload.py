"""Imports of the process from which workers are forked, so that each worker has them already."""

from contextlib import suppress

from harness import CallablePart, FmuPart, HarnessError, SeriesPart, System
from harness.sweeps.worker import Runner

with suppress(HarnessError, OSError):  # the runs report the error
    System([CallablePart("preload", lambda t, u, x: t, outputs=["t"])]).run(stop=1.0, step=1.0)

__all__ = ["FmuPart", "Runner", "SeriesPart"]
