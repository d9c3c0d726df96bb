"""How a friction model is identified from a record, as declared in its file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from friction_fmus.blocks.arithmetic import names_in
from friction_fmus.blocks.contact import Friction, friction_of
from friction_fmus.blocks.macros import table
from friction_fmus.errors import FrictionError, nearest

NOT_IDENTIFIED: Final = "none"
"""Method of a model that cannot be identified from motion and force."""

SEEN: Final = ("level", "peak", "viscous", "stiffness", "damping", "speed", "distance")
"""Names in the start value of a parameter: properties of the measured friction, see `identification.Traits`."""

MEASURED: Final[Mapping[str, str]] = {
    "slow": "slow constant velocities around it in both directions",
    "fast": "constant velocities up to the largest speed",
    "sliding": "sliding at constant velocity in both directions",
    "small": "oscillating motion with amplitudes below the presliding distance",
    "small_fast": "small oscillating motion at a higher frequency",
    "loops": "reversals with many samples in the presliding distance",
    "rest": "break-aways after different dwell times",
    "accelerations": "accelerations in both directions",
    "directions": "the same speeds in both directions",
    "swinging": "sliding with a velocity that oscillates about a mean",
}
"""Experiments that determine a parameter, as texts."""


@dataclass(frozen=True)
class Fitted:
    """How a parameter is identified."""

    start: str
    """Start value of the search, an expression of the names in `SEEN`."""
    experiment: str
    """Key in `MEASURED` of the experiment to run if the parameter is poorly identifiable."""
    held: bool = False
    """Whether the parameter keeps its default value unless the user gives a start value or bounds: it is correlated
    with others, or most records do not show its effect."""

    @property
    def measure(self) -> str:
        """The experiment as a text."""
        return MEASURED[self.experiment]


@dataclass(frozen=True)
class Identified:
    """How the file of a block says that the block is identified."""

    method: str = ""
    """A module of `friction_fmus.identification.methods`, or `NOT_IDENTIFIED`; empty: inverse or output error,
    depending on whether the block has states."""
    fits: Mapping[str, Fitted] = field(default_factory=dict)
    """How each parameter is identified, by name without index and without the suffix ``_neg`` of v < 0."""
    state: str = ""
    size: str = ""
    """First state, whose initial value is identified as well, and an expression for its magnitude in steady sliding;
    both empty if no initial state is identified."""


_CONTACT: Final[Mapping[str, Fitted]] = {
    "coulomb": Fitted("level", "sliding"),
    "static": Fitted("peak", "slow"),
    "viscous": Fitted("viscous", "fast"),
    "stribeck": Fitted("0.1 * speed", "slow"),
    "exponent": Fitted("2", "slow", held=True),
    "stiffness": Fitted("stiffness", "small"),
    "damping": Fitted("damping", "small_fast"),
}
"""How a parameter is identified that is an attribute of `Friction` by itself."""


def identified(code: str) -> Identified:
    """Return how the macros CONTACT and IDENTIFIED of a C file say that the block is identified."""
    method, state, size = "", "", ""
    friction = friction_of(code) or Friction()
    fits = {name: fit for role, fit in _CONTACT.items() if (name := getattr(friction, role)).isidentifier()}
    for kind, arguments in table(code, "IDENTIFIED", ("FIT", "HELD", "METHOD", "SLIDING")):
        match kind, arguments:
            case "FIT" | "HELD", (name, start, experiment):
                fits[name] = _checked(kind, name, Fitted(start, experiment, kind == "HELD"))
            case "METHOD", (method,):
                pass
            case "SLIDING", (state, size):
                names_in(size)
            case _:
                raise FrictionError(f"IDENTIFIED has the malformed row {kind}({', '.join(arguments)})")
    return Identified(method, fits, state, size)


def _checked(kind: str, name: str, fit: Fitted) -> Fitted:
    if fit.experiment not in MEASURED:
        raise FrictionError(
            f"{kind}({name}) names the unknown experiment {fit.experiment!r}{nearest(fit.experiment, MEASURED)}"
        )
    if unknown := sorted(names_in(fit.start) - set(SEEN)):
        raise FrictionError(f"{kind}({name}) starts at {fit.start!r}; {unknown[0]} is not one of {', '.join(SEEN)}")
    return fit
