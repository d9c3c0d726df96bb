"""What the file of a friction model says of its identification from a record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from friction_fmus.blocks.arithmetic import names_in
from friction_fmus.blocks.macros import table
from friction_fmus.errors import FrictionError, nearest

NOT_IDENTIFIED: Final = "none"
"""The method of a model that a record of motion and force does not identify."""

SEEN: Final = ("level", "peak", "viscous", "stiffness", "damping", "speed", "distance")
"""Names in the start of a parameter: what a look at the data tells of the friction, see `identification.Traits`."""

MEASURED: Final[Mapping[str, str]] = {
    "slow": "slow constant velocities of both directions around it",
    "fast": "constant velocities up to the largest speed",
    "sliding": "sliding at constant velocity in both directions",
    "small": "motions to and fro that are smaller than the presliding distance",
    "small_fast": "small motions to and fro at a higher frequency",
    "loops": "reversals with many samples over the presliding distance",
    "rest": "break-aways after rests of different length",
    "accelerations": "accelerations in both directions",
    "directions": "the same speeds in both directions",
    "swinging": "sliding with a velocity that swings about a mean one",
}
"""Experiments that determine a parameter."""


@dataclass(frozen=True)
class Fitted:
    """A parameter that is identified.

    Attributes
    ----------
    start : str
        Where the search starts, an expression of `SEEN`.
    experiment : str
        What to measure if the parameter is poorly identifiable, of `MEASURED`.
    """

    start: str
    experiment: str

    @property
    def measure(self) -> str:
        """What to measure, in words."""
        return MEASURED[self.experiment]


@dataclass(frozen=True)
class Identified:
    """How a friction model is identified, where its ports, features and names of parameters do not tell.

    Attributes
    ----------
    method : str
        A module of `friction_fmus.identification.methods`, or `NOT_IDENTIFIED`; empty: inverse or output error,
        depending on whether the block has states.
    fits : mapping of str to Fitted
        Parameters that are identified although their names do not say so, or from another start.
    state, size : str
        First state, whose value at the beginning of the record is identified as well, and an expression of its size
        in steady sliding; both empty if no state is.
    """

    method: str = ""
    fits: Mapping[str, Fitted] = field(default_factory=dict)
    state: str = ""
    size: str = ""


def identified(code: str) -> Identified:
    """Return what the macro IDENTIFIED of a C file says; nothing if there is none.

    Raises
    ------
    FrictionError
        A row is not understood.
    """
    method, state, size = "", "", ""
    fits = {}
    for kind, arguments in table(code, "IDENTIFIED", ("FIT", "METHOD", "SLIDING")):
        match kind, arguments:
            case "FIT", (name, start, experiment):
                fits[name] = _checked(name, Fitted(start, experiment))
            case "METHOD", (method,):
                pass
            case "SLIDING", (state, size):
                names_in(size)
            case _:
                raise FrictionError(f"IDENTIFIED has the row {kind}({', '.join(arguments)}), which is not understood")
    return Identified(method, fits, state, size)


def _checked(name: str, fit: Fitted) -> Fitted:
    if fit.experiment not in MEASURED:
        raise FrictionError(f"FIT({name}) names {fit.experiment!r}{nearest(fit.experiment, MEASURED)}")
    if unknown := sorted(names_in(fit.start) - set(SEEN)):
        raise FrictionError(f"FIT({name}) starts at {fit.start!r}; {unknown[0]} is none of {', '.join(SEEN)}")
    return fit
