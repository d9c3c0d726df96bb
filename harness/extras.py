"""Packages that only some functions need, and the extras of ``pip install`` that bring them."""

from __future__ import annotations

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
