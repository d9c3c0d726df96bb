"""Friction in terms of the conditions, and the meaning of a block's parameters in these terms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from friction_fmus.blocks.arithmetic import Numbers, evaluate, is_known, names_in
from friction_fmus.blocks.macros import table
from friction_fmus.errors import FrictionError

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
    vs: float | None = None
    """Stribeck velocity [m/s]; with None or 0, static friction acts at rest only."""
    delta: float = 2.0
    """Stribeck exponent."""

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
class Contact:
    """The friction of an axis."""

    levels: tuple[Level, Level]
    """Forward and backward."""
    stiffness: float = 0.0
    damping: float = 0.0
    """Stiffness and damping of the contact at rest [N/m, N.s/m], proportional to the normal force; stiffness 0 if
    rigid."""
    viscous: float = 0.0
    """Viscous coefficient that also acts at rest [N.s/m]."""

    def loaded(self, load: float) -> Contact:
        """Return the contact under another normal force, which does not affect viscous friction."""
        forward, backward = (replace(level, Fc=load * level.Fc, Fs=load * level.Fs) for level in self.levels)
        return Contact((forward, backward), load * self.stiffness, load * self.damping, self.viscous)


@dataclass(frozen=True)
class Friction:
    """Friction of a block as expressions of its parameters, see `friction_fmus.blocks.arithmetic`.

    If the parameter ``asymmetric`` is true, backward motion uses the parameters whose names end in ``_neg``.

    Attributes
    ----------
    coulomb, static : str
        Coulomb and static friction; an empty static friction equals the Coulomb friction.
    viscous : str
        Viscous coefficient in sliding.
    stribeck, exponent : str
        Stribeck velocity and exponent; without a velocity, static friction acts at rest only.
    falls : str
        Whether the block has this Stribeck curve; 0 for another shape.
    stiffness, damping, viscous_at_rest : str
        Stiffness, damping proportional to the normal force, and viscous coefficient of the contact at rest.
    """

    coulomb: str = "0"
    static: str = ""
    viscous: str = "0"
    stribeck: str = ""
    exponent: str = "2"
    falls: str = "1"
    stiffness: str = "0"
    damping: str = "0"
    viscous_at_rest: str = "0"

    def __post_init__(self) -> None:
        """Raise an error for a text that is not an expression."""
        for text in vars(self).values():
            if text:
                names_in(text)

    def level(self, values: Numbers) -> Level:
        """Return the friction in forward motion; parameters without a value count as absent."""

        def value(text: str, otherwise: float) -> float:
            return float(evaluate(text, values)) if text and is_known(text, values) else otherwise

        Fc = value(self.coulomb, 0.0)
        vs = value(self.stribeck, 0.0) if self.stribeck and value(self.falls, 1.0) else None
        return Level(Fc, value(self.static, Fc), value(self.viscous, 0.0), vs, value(self.exponent, 2.0))

    def levels(self, values: Numbers) -> tuple[Level, Level]:
        """Return the friction in forward and in backward motion."""
        backward = values
        if values.get("asymmetric"):
            backward = {name: values.get(f"{name}_neg", value) for name, value in values.items()}
        return self.level(values), self.level(backward)

    def contact(self, values: Numbers) -> Contact:
        """Return the friction in sliding and at rest."""
        at_rest = (self.stiffness, self.damping, self.viscous_at_rest)
        return Contact(self.levels(values), *(float(evaluate(text, values)) for text in at_rest))


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
