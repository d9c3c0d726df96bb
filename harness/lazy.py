"""Public names of a package that are imported when they are first used, so that the package itself loads fast."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module


def lazy_names(
    package: str, modules: Mapping[str, Sequence[str]]
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return the functions ``__getattr__`` and ``__dir__`` of a package (PEP 562).

    A public name that is also the name of a submodule has to be imported by the package as usual: importing the
    submodule would otherwise set the attribute to the module.

    Parameters
    ----------
    package : str
        Name of the package, which has ``__all__``.
    modules : mapping of str to sequence of str
        Module -> names that it defines.

    Returns
    -------
    getter : callable
        Imports a name and sets it as an attribute of the package, so that it is called once for each name.
    lister : callable
        The names in ``__all__``.
    """
    homes = {name: module for module, names in modules.items() for name in names}

    def getter(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(homes[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    def lister() -> list[str]:
        return sorted(sys.modules[package].__all__)

    return getter, lister
