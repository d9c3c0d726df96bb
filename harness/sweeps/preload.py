"""What a process does of which the workers are forked: load all that a run needs, so that none of them has to."""

from contextlib import suppress

from harness import *  # noqa: F403 - the names are imported when they are used, here all at once
from harness import CallablePart, HarnessError, System
from harness.sweeps.worker import Runner

with suppress(HarnessError, OSError):  # a run says what is wrong
    System([CallablePart("preload", lambda t, u, x: t, outputs=["t"])]).run(stop=1.0, step=1.0)

__all__ = ["Runner"]
