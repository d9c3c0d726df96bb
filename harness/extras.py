"""Packages that only some functions need, and the extras of ``pip install`` that bring them."""

import ast
import re
import sys
from collections import Counter
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from harness.errors import MissingPackageError

_SUBINTERPRETERS = "_interpreters" if sys.version_info >= (3, 13) else "_xxsubinterpreters"
interpreters = import_module(_SUBINTERPRETERS) if find_spec(_SUBINTERPRETERS) else None
if interpreters is not None and interpreters.get_current() != interpreters.get_main():  # before imports that may hang
    raise ImportError(
        "friction-fmus and its harness run in the main interpreter of Python only, as NumPy does: "
        "use threads or processes instead of subinterpreters"
    )

MODELS: list[Callable[[str], Path]] = []
"""Functions that return the FMU of a model by its name; a package with models appends its own."""


@cache
def extra_of(package: str) -> str | None:
    """Return the smallest extra that installs a package; None if none does."""
    from importlib import metadata  # loads slowly, and every command loads this module

    try:
        lines = "\n".join(metadata.requires("friction-fmus") or ())
    except metadata.PackageNotFoundError:
        return None
    found = re.findall(r"^([\w.-]+).*extra == ['\"]([\w-]+)", lines, re.M)
    sizes = Counter(extra for _, extra in found)
    return min((extra for name, extra in found if name == package), key=lambda extra: sizes[extra], default=None)


def missing(package: str, need: str) -> MissingPackageError:
    """Return the error for a package that is not installed; `need` states what needs it."""
    return MissingPackageError(
        f"{package} is not installed; {need}: pip install 'friction-fmus[{extra_of(package)}]'", name=package
    )


def require(package: str, need: str) -> None:
    """Raise MissingPackageError if a package of an extra is not installed."""
    if find_spec(package) is None:
        raise missing(package, need)


def lazy_names(package: str) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` for a package that imports its names for type checkers only (PEP 562)."""
    # A public name that is also the name of a submodule must be imported by the package as usual: otherwise, importing
    # the submodule sets the attribute to the module.
    source = Path(str(sys.modules[package].__file__)).read_text(encoding="utf-8")
    checked = next(
        each for each in ast.parse(source).body if isinstance(each, ast.If) and isinstance(each.test, ast.Name)
    )
    imports = [each for each in checked.body if isinstance(each, ast.ImportFrom)]
    homes = {name.name: str(each.module) for each in imports for name in each.names}
    if everything := homes.pop("*", None):
        homes = dict.fromkeys(import_module(everything).__all__, everything) | homes

    def getter(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        try:
            home = homes[name]
            value = import_module(f"{home}.{name}") if home == package else getattr(import_module(home), name)
        except ModuleNotFoundError as error:
            if not error.name or extra_of(error.name) is None:
                raise
            raise missing(error.name, f"{name} needs it") from error
        setattr(sys.modules[package], name, value)
        return value

    return getter, lambda: sorted(sys.modules[package].__all__)
