"""Friction of an axis in common terms, and the meaning of a block's parameters in these terms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from friction_fmus.blocks.arithmetic import Numbers, evaluate, is_known, names_in
from friction_fmus.blocks.macros import table
from friction_fmus.errors import FrictionError, did_you_mean

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Level:
    """Steady-state friction in one direction: g(v) = Fc + (Fs - Fc) exp(-(v/vs)^delta), and viscous friction."""

    Fc: float
    Fs: float
    viscous: float = 0.0
    """Coulomb and static friction [N], viscous coefficient [N.s/m]."""
    vs: float | None = None  # Stribeck velocity [m/s]; with None or 0, static friction acts at rest only
    delta: float = 2.0  # Stribeck exponent

    def at(self, speeds: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the level g at positive speeds [N]."""
        import numpy as np  # imported here, as every command reads blocks, but few need numpy

        if not self.vs:
            return np.full_like(speeds, self.Fc)
        power = np.exp(
            np.minimum(self.delta * np.log(speeds / self.vs), 10.0)
        )  # the exponential is negligible beyond this
        return self.Fc + (self.Fs - self.Fc) * np.exp(-power)


@dataclass(frozen=True)
class AxisFriction:
    """The friction of an axis."""

    levels: tuple[Level, Level]  # forward and backward
    stiffness: float = 0.0
    damping: float = 0.0
    """Stiffness and damping of the contact at rest [N/m, N.s/m], proportional to the normal force; stiffness 0 if
    rigid."""
    viscous: float = 0.0  # viscous coefficient that also acts at rest [N.s/m]


@dataclass(frozen=True)
class Friction:
    """Friction of a block as expressions of its parameters, see `friction_fmus.blocks.arithmetic`.

    If the parameter ``asymmetric`` is true, backward motion uses the parameters whose names end in ``_neg``.
    """

    coulomb: str = "0"
    static: str = ""
    """Coulomb and static friction; an empty static friction equals the Coulomb friction."""
    viscous: str = "0"  # viscous coefficient in sliding
    stribeck: str = ""
    exponent: str = "2"
    """Stribeck velocity and exponent; without a velocity, static friction acts at rest only."""
    falls: str = "1"  # whether the block has this Stribeck curve; 0 for another shape
    stiffness: str = "0"
    damping: str = "0"
    viscous_at_rest: str = "0"
    """Stiffness, damping proportional to the normal force, and viscous coefficient of the contact at rest."""

    def __post_init__(self) -> None:
        for text in vars(self).values():
            if text:
                names_in(text)

    def level(self, values: Numbers) -> Level:
        """Return the friction in forward motion; parameters without a value count as absent."""
        Fc = _value(self.coulomb, values)
        vs = _value(self.stribeck, values) if self.stribeck and _value(self.falls, values, 1.0) else None
        viscous, exponent = _value(self.viscous, values), _value(self.exponent, values, 2.0)
        return Level(Fc, _value(self.static, values, Fc), viscous, vs, exponent)

    def levels(self, values: Numbers) -> tuple[Level, Level]:
        """Return the friction in forward and in backward motion."""
        backward = values
        if values.get("asymmetric"):
            backward = {name: values.get(f"{name}_neg", value) for name, value in values.items()}
        return self.level(values), self.level(backward)

    def contact(self, values: Numbers) -> AxisFriction:
        """Return the friction in sliding and at rest; parameters without a value count as absent."""
        at_rest = (self.stiffness, self.damping, self.viscous_at_rest)
        return AxisFriction(self.levels(values), *(_value(text, values) for text in at_rest))


def _value(text: str, values: Numbers, otherwise: float = 0.0) -> float:
    return float(evaluate(text, values)) if text and is_known(text, values) else otherwise


_ROWS = {
    "COULOMB": ("coulomb",),
    "STATIC": ("static",),
    "VISCOUS": ("viscous",),
    "STRIBECK": ("stribeck", "exponent", "falls"),
    "STIFFNESS": ("stiffness",),
    "DAMPING": ("damping", "viscous_at_rest"),
}
"""Attributes of `Friction` that the rows of the macro CONTACT set."""


def friction_of(code: str) -> Friction | None:
    """Return the friction that the macro CONTACT of a C file declares, or None without this macro."""
    found: dict[str, str] = {}
    for kind, arguments in table(code, "CONTACT", tuple(_ROWS)):
        if not 1 <= len(arguments) <= len(_ROWS[kind]):
            raise FrictionError(f"CONTACT: {kind} has {len(arguments)} arguments; give 1 to {len(_ROWS[kind])}")
        found |= dict(zip(_ROWS[kind], arguments, strict=False))
    return Friction(**found) if found else None


NOT_IDENTIFIED: Final = "none"  # method of a model that cannot be identified from motion and force

SEEN: Final = ("level", "peak", "viscous", "stiffness", "damping", "speed", "distance")
"""Names in the start value of a parameter: properties of the measured friction, see `identification.Traits`."""

MEASURED: Final[Mapping[str, str]] = {
    "slow": "slow constant velocities around it in both directions",
    "fast": "constant velocities up to the largest speed",
    "sliding": "sliding at constant velocity in both directions",
    "small": "oscillating motion with amplitudes below the presliding displacement",
    "small_fast": "small oscillating motion at a higher frequency",
    "loops": "reversals with many samples in the presliding displacement",
    "rest": "break-aways after different dwell times",
    "accelerations": "accelerations in both directions",
    "directions": "the same speeds in both directions",
    "swinging": "sliding with a velocity that oscillates about a mean",
}
"""Experiments that determine a parameter, as texts."""


@dataclass(frozen=True)
class Fitted:
    """How a parameter is identified."""

    start: str  # start value of the search, an expression of the names in `SEEN`
    experiment: str  # key in `MEASURED` of the experiment to run if the parameter is poorly identifiable
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
            f"{kind}({name}) names the unknown experiment {fit.experiment!r}{did_you_mean(fit.experiment, MEASURED)}"
        )
    if unknown := sorted(names_in(fit.start) - set(SEEN)):
        raise FrictionError(f"{kind}({name}) starts at {fit.start!r}; {unknown[0]} is not one of {', '.join(SEEN)}")
    return fit
