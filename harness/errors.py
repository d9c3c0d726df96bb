"""Exceptions of the harness. Each message says in one sentence what is wrong, where, and what to do."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    import xarray as xr


class FrictionError(Exception):
    """Base class of all errors that the user can correct; the message says how."""


class HarnessError(FrictionError):
    """Base class of all errors raised by the harness.

    Attributes
    ----------
    result : xarray.Dataset or None
        What the run had recorded before it failed, including the initial values; None if nothing had been recorded.
    """

    result: xr.Dataset | None = None


class Interrupted(KeyboardInterrupt):
    """A run was interrupted with Ctrl-C.

    Attributes
    ----------
    result : xarray.Dataset or None
        What the run had recorded, as in `HarnessError`.
    """

    result: xr.Dataset | None = None


class FmuError(HarnessError):
    """A file cannot be used as an FMI 2.0 FMU on this machine."""


class UnknownNameError(HarnessError):
    """A part, port, variable, master or key does not exist."""


class WireError(HarnessError):
    """A connection is malformed, joins incompatible types, or drives an input that is already driven."""


class UnconnectedError(HarnessError):
    """At least one input has neither a connection nor a constant."""


class UnitError(HarnessError):
    """The two ends of a connection have units of different quantities."""


class AlgebraicLoopError(HarnessError):
    """Outputs depend on each other directly, without a state in between."""


class StartValueError(HarnessError):
    """A start value does not fit its variable."""


class ExperimentError(HarnessError):
    """A setting of a run, such as its start, stop or step, is invalid."""


class SystemFileError(HarnessError):
    """A system file cannot be read, interpreted or written."""


class SeriesError(HarnessError):
    """A recorded time series cannot be used."""


class OutputError(HarnessError):
    """A result cannot be written."""


class SweepError(HarnessError):
    """A sweep is invalid or does not belong to its folder, or its workers cannot be started."""


class ResultFileError(HarnessError):
    """A file cannot be read as a result."""


class MissingPackageError(HarnessError, ModuleNotFoundError):
    """A package is not installed that comes with an extra, see `harness.extras`."""


class BuildError(HarnessError):
    """C sources do not compile, or the result cannot be packaged."""


ENDED: Final = "it ended the simulation"  # reason for the end of a run that is no failure


class PartError(HarnessError):
    """A part failed during initialisation or during a run.

    Parameters
    ----------
    part : str
        Name of the part.
    function : str
        The function that was called, for example ``fmi2DoStep``.
    reason : str
        The last log message of the part, or the text of the exception that it raised.
    time : float or None
        Communication point [s] of the failure; the simulation loop fills it in if the part does not know it.

    Attributes
    ----------
    ended : float or None
        Time [s] to which a part has come that has ended the simulation.
    """

    def __init__(self, part: str, function: str, reason: str, time: float | None = None) -> None:
        super().__init__(part, function, reason, time)  # all arguments, for pickling
        self.part = part
        self.function = function
        self.reason = reason
        self.time = time
        self.ended: float | None = None

    def __str__(self) -> str:
        """Return one sentence with the part, the function, the time and the reason."""
        when = "" if self.time is None else f" at t = {self.time:.12g} s"
        return f"part '{self.part}' failed in {self.function}{when}: {self.reason}"


def closest(name: str, known: Iterable[str]) -> str | None:
    """Return the known name that is most similar to a misspelt one, or None if none is similar."""
    import difflib  # few commands need it

    lowered = {other.lower(): other for other in known}
    match = difflib.get_close_matches(name.lower(), lowered, n=1, cutoff=0.6)
    return lowered[match[0]] if match else None


def nearest(name: str, known: Iterable[str]) -> str:
    """Return a remedy for a misspelt name: the most similar known name, or a list if none is similar."""
    names = sorted(known)
    if match := closest(name, names):
        return f"did you mean '{match}'?"
    if not names:
        return "none exist"
    shown = ", ".join(names[:12])
    return f"known are {shown}" + (f" and {len(names) - 12} more" if len(names) > 12 else "")


def not_whole(part: str, time: float | None = None) -> PartError:
    """Return the error for a connection that passes a fraction to an Integer input."""
    return PartError(part, "fmi2SetInteger", "an Integer input got a value that is not a 32-bit integer", time)
