"""How the study uses a law or controller as a compensator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from friction_fmus.blocks.arithmetic import names_in
from friction_fmus.blocks.macros import table
from friction_fmus.errors import FrictionError, nearest

KINDS: Final = ("feedforward", "model feedback", "estimator", "dither", "learning", "controller", "other")
"""Kinds of compensators."""


@dataclass(frozen=True)
class Use:
    """Use of a law or controller as a compensator that is added to a servo.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    models : tuple of str
        Friction models in order of preference; the law gets the parameters of the first identified one, by name. Empty
        if it needs no model.
    renamed : mapping of str to str
        Parameters of the law that have another name in the model: model name to law name.
    tuned : mapping of str to str
        Expressions for further parameters, in terms of the model's parameters and of known data of the axis, see
        `friction_fmus.study.compensators.AxisKnowledge`. ``W[i]`` stands for all elements of a vector.
    output : str
        The output that is added to the force of the servo.
    never : str
        A sentence that explains why the law is excluded from the comparison; empty if it is not excluded.
    period : str
        Parameter for the period of the reference in samples; empty if the reference need not be periodic.
    """

    kind: str
    models: tuple[str, ...] = ()
    renamed: Mapping[str, str] = field(default_factory=dict)
    tuned: Mapping[str, str] = field(default_factory=dict)
    output: str = "u"
    never: str = ""
    period: str = ""

    def __post_init__(self) -> None:
        """Raise an error for an unknown kind or a text that is not an expression."""
        if self.kind not in KINDS:
            raise FrictionError(f"{self.kind!r} is not a kind of compensator{nearest(self.kind, KINDS)}")
        for text in self.tuned.values():
            names_in(text)


REPLACES_SERVO: Final = Use(
    "controller", never="It replaces the feedback controller and cannot be compared at the same feedback gains."
)
"""Use of a law that closes the position loop itself."""

SHAPES_REFERENCE: Final = Use(
    "other",
    never="It applies a feedforward force by way of the reference, for servos without a force input.",
)
"""Use of a law that shapes the reference."""


def use_of(code: str) -> Use | None:
    """Return the use that the macro USE of a C file declares, or None without this macro."""
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
