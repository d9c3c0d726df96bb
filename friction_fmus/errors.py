"""The exceptions of the package. Each message states in one sentence what is wrong, where, and what to do."""

import re
from collections.abc import Iterable, Sequence
from typing import Final

from harness.errors import BuildError, FrictionError, UnknownNameError, closest

__all__ = ["BuildError", "FrictionError", "UnknownNameError", "did_you_mean"]


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return a hint for a misspelt name; empty if no name is similar."""
    found = closest(name, names)
    return f" (did you mean {found}?)" if found else ""


_COMMANDS: Final = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")


def visible(text: str) -> str:
    """Return a text with escapes for the characters that a terminal would obey: names in files may contain them."""
    return _COMMANDS.sub(lambda found: repr(found[0])[1:-1], text)


class IdentificationError(FrictionError):
    """Base class of the errors of identification."""


class RecordError(IdentificationError):
    """Record that cannot be read or used."""


class AmbiguousColumnsError(RecordError):
    """Data file whose columns can be read in more than one way, or in none."""

    def __init__(self, message: str, choices: Sequence[tuple[str, str]] = ()) -> None:
        """Keep the values of ``--columns`` that fit, with their reasons."""
        super().__init__(message)
        self.choices = choices


class ExcitationError(IdentificationError):
    """Record without the motion that the parameters need."""


class FitError(IdentificationError):
    """Invalid setup of a fit, or simulation with an unusable result."""
