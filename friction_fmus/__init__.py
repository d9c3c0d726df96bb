"""Friction models and compensators as FMI 2.0 co-simulation FMUs."""

from friction_fmus.catalogue import Block, catalogue, find
from friction_fmus.errors import BuildError, FrictionError, UnknownNameError
from friction_fmus.package import build, build_record, fmu
from friction_fmus.version import VERSION

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
]
