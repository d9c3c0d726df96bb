"""The exceptions of the package. Each message states in one sentence what is wrong, where, and what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from harness.errors import BuildError

__all__ = ["BuildError", "FrictionError", "UnknownNameError", "nearest"]


class FrictionError(Exception):
    """Base class of errors that the user can correct; the message says how."""


class UnknownNameError(FrictionError):
    """Unknown name of a model, variable or command."""


def nearest(name: str, names: Iterable[str]) -> str:
    """Return a hint for a misspelt name."""
    candidates = list(names)
    lowered = {candidate.lower(): candidate for candidate in candidates}
    found = difflib.get_close_matches(name.lower(), lowered, n=1, cutoff=0.5)
    return f" (did you mean {lowered[found[0]]}?)" if found else ""


class IdentificationError(FrictionError):
    """Base class of the errors of identification."""


class RecordError(IdentificationError):
    """Record that cannot be read or used."""


class ExcitationError(IdentificationError):
    """Record without the motion that the parameters need."""


class FitError(IdentificationError):
    """Invalid setup of a fit, or simulation with an unusable result."""
