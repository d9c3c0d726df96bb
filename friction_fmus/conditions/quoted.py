"""What the documentation of a block says of the conditions that its file names."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Iterable

from friction_fmus.errors import FrictionError, nearest


def quotes(names: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """Return conditions as pairs: name of the function, first sentence of its docstring.

    Parameters
    ----------
    names : iterable of str
        Functions of `friction_fmus.conditions`, as `About.quotes` has them.

    Raises
    ------
    FrictionError
        There is no condition of that name.
    """
    functions = importlib.import_module("friction_fmus.conditions")
    found = []
    for name in names:
        if name not in functions.__all__:
            raise FrictionError(f"There is no condition {name!r} to quote{nearest(name, functions.__all__)}")
        text = inspect.getdoc(getattr(functions, name)) or ""
        found.append((name, " ".join(text.split("\n\n")[0].split())))
    return tuple(found)
