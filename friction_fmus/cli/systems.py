"""Loading the system file given to a command."""

from __future__ import annotations

from pathlib import Path

from friction_fmus.fmi.package import fmu
from harness import System


def open_system(path: Path) -> System:
    """Return the system in a .toml or .ssp file.

    Raises
    ------
    HarnessError
        If the file is missing or invalid.
    """
    return System.from_ssp(path) if path.suffix.lower() == ".ssp" else System.from_toml(path, resolve=fmu)
