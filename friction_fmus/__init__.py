"""Friction models and compensators as FMI 2.0 and 3.0 FMUs.

The public names of `harness` are here too: ``from friction_fmus import FmuPart, System, fmu, plot, study, sweep``.
"""

import sys
from importlib.machinery import PathFinder
from importlib.util import module_from_spec
from pathlib import Path
from typing import TYPE_CHECKING

if "harness" not in sys.modules:  # the package beside this one, not a file harness.py in the working folder
    _spec = PathFinder.find_spec("harness", [str(Path(__file__).parents[1])])
    if _spec is not None and _spec.loader is not None:
        sys.modules["harness"] = module_from_spec(_spec)
        _spec.loader.exec_module(sys.modules["harness"])

from friction_fmus import harness
from friction_fmus.errors import BuildError, FrictionError, UnknownNameError
from friction_fmus.version import VERSION
from harness.extras import MODELS, lazy_names

if TYPE_CHECKING:
    from harness import *  # noqa: F403, I001

    from friction_fmus import study
    from friction_fmus.blocks.catalogue import Block, catalogue, find
    from friction_fmus.export.block_fmu import build, build_record, fmu
    from friction_fmus.identification import identify
else:
    __getattr__, __dir__ = lazy_names(__name__)


def _model(name: str) -> Path:
    from friction_fmus.export.block_fmu import fmu

    return fmu(name)


MODELS.append(_model)

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
    "study",
    *(name for name in harness.__all__ if name not in ("BuildError", "UnknownNameError")),
]
