"""Friction models and compensators as FMI 2.0 co-simulation FMUs."""

from typing import TYPE_CHECKING

from friction_fmus.catalogue import Block, catalogue, find
from friction_fmus.errors import BuildError, FrictionError, UnknownNameError
from friction_fmus.package import build, build_record, fmu
from friction_fmus.version import VERSION

if TYPE_CHECKING:
    from friction_fmus.identification import identify

__version__ = VERSION

__all__ = [
    "Block",
    "BuildError",
    "FrictionError",
    "UnknownNameError",
    "build",
    "build_record",
    "catalogue",
    "find",
    "fmu",
    "identify",
]


def __getattr__(name: str) -> object:
    """Load identification, which takes scipy's optimisers, when it is asked for."""
    if name == "identify":
        from friction_fmus.identification import identify

        return identify
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
