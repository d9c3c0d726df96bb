"""How the study uses a law or controller as a compensator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from friction_fmus.blocks.arithmetic import names_in
from friction_fmus.blocks.macros import table
from friction_fmus.errors import FrictionError, nearest

KINDS: Final = ("feedforward", "model feedback", "estimator", "dither", "learning", "controller", "other")
"""What compensators are."""


@dataclass(frozen=True)
class Use:
    """How a law or controller is used as a compensator beside a servo.

    Attributes
    ----------
    kind : str
        Of `KINDS`.
    models : tuple of str
        Friction models whose parameters it takes over by name, the first that was identified; empty: none needed.
    renamed : mapping of str to str
        Parameter of the model -> that of the law, where they have other names.
    tuned : mapping of str to str
        Further parameters -> expressions of properties of the axis and of the model's parameters, see
        `friction_fmus.study.compensators.AxisKnowledge`. ``W[i]`` stands for all elements of a vector.
    output : str
        The output that is added to the force of the servo.
    never : str
        Why the law is not compared, a sentence; empty: it is.
    period : str
        Parameter that takes the period of the reference in samples; empty: the reference need not be periodic.
    """

    kind: str
    models: tuple[str, ...] = ()
    renamed: Mapping[str, str] = field(default_factory=dict)
    tuned: Mapping[str, str] = field(default_factory=dict)
    output: str = "u"
    never: str = ""
    period: str = ""

    def __post_init__(self) -> None:
        """Refuse unknown kinds and what is no expression."""
        if self.kind not in KINDS:
            raise FrictionError(f"A compensator is no {self.kind!r}{nearest(self.kind, KINDS)}")
        for text in self.tuned.values():
            names_in(text)


REPLACES_SERVO: Final = Use(
    "controller", never="It replaces the feedback controller, and so cannot be compared at the same feedback gains."
)
"""Use of a law that closes the position loop itself."""

SHAPES_REFERENCE: Final = Use(
    "other",
    never="It passes the force of a feedforward through the reference, for servos without an input for a force.",
)
"""Use of a law that shapes the reference."""


def use_of(code: str) -> Use | None:
    """Return what the macro USE of a C file says; None if there is none.

    Raises
    ------
    FrictionError
        A row is not understood.
    """
    rows = table(code, "USE", ("KIND", "MODELS", "RENAMED", "TUNED", "OUTPUT", "NEVER", "PERIOD"))
    if not rows:
        return None
    single = dict(rows)
    try:
        pairs: dict[str, dict[str, str]] = {"RENAMED": {}, "TUNED": {}}
        for key, arguments in rows:
            if key in pairs:
                name, text = arguments
                pairs[key][name] = text
        (kind,), (output,), (never,), (period,) = (
            single.get(key, (otherwise,))
            for key, otherwise in (("KIND", "other"), ("OUTPUT", "u"), ("NEVER", ""), ("PERIOD", ""))
        )
    except ValueError as error:
        raise FrictionError(f"USE has a row with too few or too many arguments: {single}") from error
    return Use(kind, single.get("MODELS", ()), pairs["RENAMED"], pairs["TUNED"], output, never, period)
