"""The exceptions of the package. Each message states in one sentence what is wrong, where, and what to do."""

from __future__ import annotations

from collections.abc import Iterable

from harness.errors import BuildError, FrictionError, UnknownNameError, closest

__all__ = ["BuildError", "FrictionError", "UnknownNameError", "did_you_mean"]


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return a hint for a misspelt name; empty if no name is similar."""
    found = closest(name, names)
    return f" (did you mean {found}?)" if found else ""


class IdentificationError(FrictionError):
    """Base class of the errors of identification."""


class RecordError(IdentificationError):
    """Record that cannot be read or used."""


class ExcitationError(IdentificationError):
    """Record without the motion that the parameters need."""


class FitError(IdentificationError):
    """Invalid setup of a fit, or simulation with an unusable result."""
