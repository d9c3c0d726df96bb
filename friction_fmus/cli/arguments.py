"""Arguments shared by several commands. This module must load fast, so it imports no large libraries."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from friction_fmus.errors import FrictionError
from harness.masters import master_names


def listed(words: Sequence[str]) -> str:
    """Return words as a list for a sentence: ``a, b or c``."""
    return f"{', '.join(words[:-1])} or {words[-1]}"


def parse_assignment(text: str) -> tuple[str, float | bool]:
    """Return name and value of ``NAME=VALUE``, with a number, true or false as value."""
    name, equals, value = text.partition("=")
    if equals and value.strip().lower() in ("true", "false"):
        return name.strip(), value.strip().lower() == "true"
    try:
        number = float(value)
    except ValueError:
        equals = ""
    if not equals:
        raise FrictionError(f"--set {text!r} is not NAME=VALUE; use a number, true or false as VALUE")
    return name.strip(), number


def parse_assignments(texts: Sequence[str] | None) -> dict[str, float | bool]:
    """Return the start values given by all options ``--set NAME=VALUE``."""
    return dict(parse_assignment(text) for text in texts or ())


def add_block(parser: argparse.ArgumentParser) -> None:
    """Add the argument for the name of a block."""
    parser.add_argument("name", metavar="NAME", help="name of a model, or its .c or .py file")


def add_system(parser: argparse.ArgumentParser) -> None:
    """Add the argument for the system file."""
    parser.add_argument("system", type=Path, metavar="SYSTEM", help="system file: .toml or .ssp")


def add_fmi(parser: argparse.ArgumentParser) -> None:
    """Add the options for the platforms and the version of FMI."""
    parser.add_argument(
        "--platform",
        nargs="+",
        default=["native"],
        metavar="PLATFORM",
        help="native (default), all, FMI platform names such as win64, or wasm32 for JavaScript",
    )
    parser.add_argument("--fmi", type=int, choices=(2, 3), default=2, help="version of FMI; default: 2")


def add_master(parser: argparse.ArgumentParser) -> None:
    """Add the option for the master algorithm; the harness validates its name."""
    parser.add_argument("--master", metavar="NAME", help=f"master algorithm: {listed(master_names())}")


def add_allow_inaccurate(parser: argparse.ArgumentParser) -> None:
    """Add the option that ignores results reported as wrong."""
    text = "exit with status 0 instead of 1 if a result is reported as wrong"
    parser.add_argument("--allow-inaccurate", action="store_true", help=text)


def add_workers(parser: argparse._ActionsContainer) -> None:
    """Add the option for the number of worker processes."""
    parser.add_argument("--workers", type=int, metavar="N", help="number of processes; default: number of processors")


def add_scheduler(parser: argparse._ActionsContainer) -> None:
    """Add the option for the address of a dask cluster."""
    parser.add_argument("--scheduler", metavar="tcp://HOST:PORT", help="run on this dask cluster")
