"""Loading the system file given to a command."""

from __future__ import annotations

from pathlib import Path

from friction_fmus.fmi.package import fmu
from harness import System


def open_system(path: Path, *, open_inputs: bool = False) -> System:
    """Return the system in a .toml or .ssp file."""
    if path.suffix.lower() == ".ssp":
        return System.from_ssp(path)
    return System.from_toml(path, resolve=fmu, open_inputs=open_inputs)
