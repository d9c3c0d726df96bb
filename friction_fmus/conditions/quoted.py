"""Conditions as the documentation page of a block quotes them."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Iterable

from friction_fmus.errors import FrictionError, nearest


def quotes(names: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """Return the name and the first sentence of the docstring of each condition.

    Parameters
    ----------
    names : iterable of str
        Functions of `friction_fmus.conditions`, see `About.quotes`.

    Returns
    -------
    tuple of (str, str)
        Pairs of name and sentence.

    Raises
    ------
    FrictionError
        If there is no condition with that name.
    """
    functions = importlib.import_module("friction_fmus.conditions")
    found = []
    for name in names:
        if name not in functions.__all__:
            raise FrictionError(f"There is no condition {name!r} to quote{nearest(name, functions.__all__)}")
        text = inspect.getdoc(getattr(functions, name)) or ""
        found.append((name, " ".join(text.split("\n\n")[0].split())))
    return tuple(found)
