"""The exceptions of the package: one sentence with what was wrong, where, and what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from harness.errors import BuildError

__all__ = ["BuildError", "FrictionError", "UnknownNameError", "nearest"]


class FrictionError(Exception):
    """Anything the user can mend; the message says how."""


class UnknownNameError(FrictionError):
    """A model, variable or command that does not exist."""


def nearest(name: str, names: Iterable[str]) -> str:
    """A hint for a misspelt name.

    Parameters
    ----------
    name : str
        What was asked for.
    names : iterable of str
        What there is.

    Returns
    -------
    str
        ``; did you mean X?`` or an empty string.
    """
    candidates = list(names)
    lowered = {candidate.lower(): candidate for candidate in candidates}
    found = difflib.get_close_matches(name.lower(), lowered, n=1, cutoff=0.5)
    return f"; did you mean {lowered[found[0]]}?" if found else ""
