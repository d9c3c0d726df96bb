"""Friction as the conditions need it, and what the parameters of a block are in these terms."""

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
    """Friction in steady sliding in one direction: g(v) = Fc + (Fs - Fc) exp(-(v/vs)^delta), and viscous friction.

    Parameters
    ----------
    Fc, Fs, viscous : float
        Coulomb and static friction [N], viscous friction [N.s/m].
    vs : float or None
        Stribeck velocity [m/s]; None: static friction acts at rest only.
    delta : float
        Stribeck exponent.
    """

    Fc: float
    Fs: float
    viscous: float = 0.0
    vs: float | None = None
    delta: float = 2.0

    def at(self, speeds: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the level g at speeds above 0 [N]."""
        import numpy as np  # not at the top: every command reads blocks, and few compute

        if self.vs is None:
            return np.full_like(speeds, self.Fc)
        power = np.exp(np.minimum(self.delta * np.log(speeds / self.vs), 10.0))  # beyond that the curve has fallen
        return self.Fc + (self.Fs - self.Fc) * np.exp(-power)


@dataclass(frozen=True)
class Contact:
    """The friction of an axis.

    Parameters
    ----------
    levels : (Level, Level)
        Forward and backward.
    stiffness, damping : float
        Of the contact at rest [N/m, N.s/m], in proportion to the normal force; stiffness 0: rigid.
    viscous : float
        Viscous friction that acts at rest, too [N.s/m].
    """

    levels: tuple[Level, Level]
    stiffness: float = 0.0
    damping: float = 0.0
    viscous: float = 0.0

    def loaded(self, load: float) -> Contact:
        """The same under another normal force; viscous friction does not depend on it."""
        forward, backward = (replace(level, Fc=load * level.Fc, Fs=load * level.Fs) for level in self.levels)
        return Contact((forward, backward), load * self.stiffness, load * self.damping, self.viscous)


@dataclass(frozen=True)
class Friction:
    """What the parameters of a block are as friction: expressions of them, see `friction_fmus.blocks.arithmetic`.

    Where the parameter ``asymmetric`` is true, a backward motion takes the parameters whose names end in ``_neg``.

    Attributes
    ----------
    coulomb, static : str
        Coulomb and static friction; no static friction: it is the Coulomb friction.
    viscous : str
        Viscous coefficient in sliding.
    stribeck, exponent : str
        Velocity and exponent of the Stribeck curve; no velocity: static friction acts at rest only.
    falls : str
        Whether the block has this Stribeck curve; 0: its shape is another one.
    stiffness, damping, viscous_at_rest : str
        Of the contact at rest: stiffness, damping in proportion to the normal force, and viscous coefficient.
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
        """Refuse what is no expression."""
        for text in vars(self).values():
            if text:
                names_in(text)

    def level(self, values: Numbers) -> Level:
        """Return the friction of a forward motion; parameters without a value count as absent."""

        def value(text: str, otherwise: float) -> float:
            return float(evaluate(text, values)) if text and is_known(text, values) else otherwise

        Fc = value(self.coulomb, 0.0)
        vs = value(self.stribeck, 0.0) if self.stribeck and value(self.falls, 1.0) else None
        return Level(Fc, value(self.static, Fc), value(self.viscous, 0.0), vs, value(self.exponent, 2.0))

    def levels(self, values: Numbers) -> tuple[Level, Level]:
        """Return the friction forward and backward."""
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
"""Row of the macro CONTACT -> attributes of `Friction` that are its arguments."""


def friction_of(code: str) -> Friction | None:
    """Return what the macro CONTACT of a C file says; None if there is none.

    Raises
    ------
    FrictionError
        A row is not understood.
    """
    found: dict[str, str] = {}
    for kind, arguments in table(code, "CONTACT", tuple(_ROWS)):
        if not 1 <= len(arguments) <= len(_ROWS[kind]):
            raise FrictionError(f"CONTACT: {kind} takes 1 to {len(_ROWS[kind])} arguments, not {len(arguments)}")
        found |= dict(zip(_ROWS[kind], arguments, strict=False))
    return Friction(**found) if found else None
