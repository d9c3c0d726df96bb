"""Friction models and compensators as FMI 2.0 co-simulation FMUs."""

from friction_fmus.catalogue import Block, catalogue, find
from friction_fmus.errors import BuildError, FrictionError, UnknownName
from friction_fmus.package import build, build_record
from friction_fmus.version import VERSION as __version__

__all__ = [
    "Block",
    "BuildError",
    "FrictionError",
    "UnknownName",
    "__version__",
    "build",
    "build_record",
    "catalogue",
    "find",
]
