"""What a condition says of a set of numbers."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Condition:
    """One condition, evaluated.

    Attributes
    ----------
    name : str
        Which condition it is.
    ok : bool
        Whether it holds.
    value, bound : float
        What was compared, in SI units; the texts say which way.
    wrong : str
        What is wrong, with the numbers; also of a condition that holds, as if it did not.
    why : str
        What happens then.
    change : str
        What to change.
    source : str
        Where the condition comes from.
    """

    name: str
    ok: bool
    value: float
    bound: float
    wrong: str
    why: str
    change: str
    source: str
