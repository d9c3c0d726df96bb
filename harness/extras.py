"""Packages that only some functions need, and the extras of ``pip install`` that bring them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Final, NamedTuple

from harness.errors import MissingPackageError


class Extra(NamedTuple):
    """An extra, and what needs the package."""

    name: str
    need: str


EXTRAS: Final = {
    "casadi": Extra("build", "compensator laws (build, codegen, doctor, show, study) need it"),
    "cattrs": Extra("study", "the command study needs it"),
    "distributed": Extra("dask", "--scheduler needs it"),
    "mcap": Extra("mcap", "MCAP files (identify, study) need it"),
    "plotly": Extra("study", "the report of the command study needs it"),
    "pyarrow": Extra("parquet", "Parquet files (identify, run, sweep) need it"),
    "ziglang": Extra(
        "build", "a compilation (build, codegen, compose, identify, show, study) needs it or a compiler in CC"
    ),
}
"""Package -> the extra that installs it."""


def missing(package: str) -> MissingPackageError:
    """Return the error for one of `EXTRAS` that is not installed."""
    extra = EXTRAS[package]
    return MissingPackageError(
        f"{package} is not installed; {extra.need}: pip install 'friction-fmus[{extra.name}]'", name=package
    )


def require(*packages: str) -> None:
    """Raise MissingPackageError for the first of some packages of `EXTRAS` that is not installed."""
    for package in packages:
        if find_spec(package) is None:
            raise missing(package)


_SUBINTERPRETERS = "_interpreters" if sys.version_info >= (3, 13) else "_xxsubinterpreters"
interpreters = import_module(_SUBINTERPRETERS) if find_spec(_SUBINTERPRETERS) else None


def require_main_interpreter() -> None:
    """Raise an ImportError in a subinterpreter, where the import of packages written in C may hang."""
    if interpreters is not None and interpreters.get_current() != interpreters.get_main():
        raise ImportError(
            "friction-fmus and its harness run in the main interpreter of Python only, as NumPy does: "
            "use threads or processes instead of subinterpreters"
        )


def lazy_names(
    package: str, modules: Mapping[str, Sequence[str]]
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return the functions ``__getattr__`` and ``__dir__`` for a package (PEP 562).

    A public name that is also the name of a submodule must be imported by the package as usual: otherwise, importing
    the submodule sets the attribute to the module.
    """
    homes = {name: module for module, names in modules.items() for name in names}

    def getter(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        try:
            value = getattr(import_module(homes[name]), name)
        except ModuleNotFoundError as error:
            if error.name not in EXTRAS:
                raise
            raise missing(error.name) from error
        setattr(sys.modules[package], name, value)
        return value

    def lister() -> list[str]:
        return sorted(sys.modules[package].__all__)

    return getter, lister
