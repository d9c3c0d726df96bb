"""Friction models and compensators as FMUs of FMI 2.0 and 3.0."""

from typing import TYPE_CHECKING

from friction_fmus import harness
from friction_fmus.blocks.catalogue import Block, catalogue, find
from friction_fmus.errors import BuildError, FrictionError, UnknownNameError
from friction_fmus.version import VERSION
from harness.lazy import lazy_names

if TYPE_CHECKING:
    from friction_fmus.fmi.package import build, build_record, fmu
    from friction_fmus.identification import identify
else:
    __getattr__, __dir__ = lazy_names(
        __name__,
        {
            "friction_fmus.identification": ["identify"],
            "friction_fmus.fmi.package": ["build", "build_record", "fmu"],
        },
    )

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
    "harness",
    "identify",
]
