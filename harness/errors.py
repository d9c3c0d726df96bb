"""Exceptions of the harness: each message says in one sentence what was wrong, where, and what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr


class HarnessError(Exception):
    """Base class of all errors raised by the harness.

    Attributes
    ----------
    result : xarray.Dataset or None
        What a run had recorded before it failed, initial values included; None if nothing had been recorded.
    """

    result: xr.Dataset | None = None


class Interrupted(KeyboardInterrupt):
    """A run was ended by Ctrl-C.

    Attributes
    ----------
    result : xarray.Dataset or None
        What it had recorded, as in `HarnessError`.
    """

    result: xr.Dataset | None = None


class FmuError(HarnessError):
    """A file cannot be used as an FMI 2.0 co-simulation FMU on this machine."""


class UnknownNameError(HarnessError):
    """A part, port, variable, master or key does not exist."""


class WireError(HarnessError):
    """A wire is malformed, joins incompatible types, or drives an input that is already driven."""


class UnconnectedError(HarnessError):
    """At least one input has neither a wire nor a constant."""


class UnitError(HarnessError):
    """The two ends of a wire have different units."""


class AlgebraicLoopError(HarnessError):
    """Outputs depend on each other without a state in between."""


class StartValueError(HarnessError):
    """A start value cannot be applied to the variable it is meant for."""


class ExperimentError(HarnessError):
    """Start, stop, step, order or recording of a run make no sense."""


class SystemFileError(HarnessError):
    """A system file cannot be read, understood or written."""


class SeriesError(HarnessError):
    """A recorded time series cannot be used."""


class OutputError(HarnessError):
    """A result cannot be written."""


class SweepError(HarnessError):
    """A sweep makes no sense, does not belong to its folder, or its workers cannot be started."""


class ResultFileError(HarnessError):
    """A file cannot be read as a result."""


class BuildError(HarnessError):
    """C sources that do not compile, or whose result cannot be packaged."""


class PartError(HarnessError):
    """A part failed while it was initialised or run.

    Parameters
    ----------
    part : str
        Name of the part.
    function : str
        What was called, for example ``fmi2DoStep``.
    reason : str
        What happened: the last log message of the part, or the text of the exception it raised.
    time : float or None
        Communication point [s] at which it happened; filled in by the loop where the part does not know it.
    """

    def __init__(self, part: str, function: str, reason: str, time: float | None = None) -> None:
        """Keep the arguments; the text is made when it is asked for."""
        super().__init__(part, function, reason, time)  # all arguments, so that it survives pickling
        self.part = part
        self.function = function
        self.reason = reason
        self.time = time

    def __str__(self) -> str:
        """One sentence with the part, the function, the time and the reason."""
        when = "" if self.time is None else f" at t = {self.time:.12g} s"
        return f"part '{self.part}' failed in {self.function}{when}: {self.reason}"


def nearest(name: str, known: Iterable[str]) -> str:
    """Remedy for a misspelt name: the nearest known one, or the list of all when none is near.

    Parameters
    ----------
    name : str
        The name that was not found.
    known : iterable of str
        The names that exist.

    Returns
    -------
    str
        End of a sentence, for example ``did you mean 'sigma0'?``.
    """
    names = sorted(known)
    lowered = {other.lower(): other for other in names}
    match = difflib.get_close_matches(name.lower(), lowered, n=1, cutoff=0.6)
    if match:
        return f"did you mean '{lowered[match[0]]}'?"
    if not names:
        return "there are none"
    shown = ", ".join(names[:12])
    return f"known are {shown}" + (f" and {len(names) - 12} more" if len(names) > 12 else "")


def not_whole(part: str, time: float | None = None) -> PartError:
    """The error of a wire that carries a fraction to an Integer input."""
    return PartError(part, "fmi2SetInteger", "an Integer input got a value that is not a whole number of 32 bit", time)
