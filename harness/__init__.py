"""Couple FMUs, Python functions and recorded series into closed loops.

A `System` consists of `Part` objects and the connections between them. A master algorithm (``gauss-seidel``,
``jacobi``, ``newton``, ``adaptive``) decides which part is stepped when. A `Tap` reads values during a run. The result
of a run is an `xarray.Dataset` with units.
"""

from typing import TYPE_CHECKING

from harness.errors import (
    AlgebraicLoopError,
    ExperimentError,
    FmuError,
    HarnessError,
    Interrupted,
    MissingPackageError,
    OutputError,
    PartError,
    ResultFileError,
    SeriesError,
    StartValueError,
    SweepError,
    SystemFileError,
    UnconnectedError,
    UnitError,
    UnknownNameError,
    WireError,
)
from harness.extras import lazy_names
from harness.masters import masters
from harness.plot import plot

if TYPE_CHECKING:
    from harness.batch import Batch
    from harness.engine.algorithm import Progress, Tap
    from harness.engine.drive import Drive
    from harness.parts.archive import open_archive
    from harness.parts.callable_part import CallablePart
    from harness.parts.fmu import FmuPart
    from harness.parts.part import Calls, Part, Port
    from harness.parts.series import SeriesPart
    from harness.result import Result, select
    from harness.results import load_result, save_result
    from harness.ssp import Parameter, ParameterSet, read_ssv, write_ssv
    from harness.sweeps import grid, latin_hypercube, read_samples, read_sweep, sobol, sweep
    from harness.system.experiment import Experiment
    from harness.system.plan import Plan
    from harness.system.system import System
    from harness.system.wire import Bias, Delay, DropOut, Freeze, Manipulator, Noise, Override, Wire
    from harness.units import BaseUnit, parse_unit
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "AlgebraicLoopError",
    "BaseUnit",
    "Batch",
    "Bias",
    "CallablePart",
    "Calls",
    "Delay",
    "Drive",
    "DropOut",
    "Experiment",
    "ExperimentError",
    "FmuError",
    "FmuPart",
    "Freeze",
    "HarnessError",
    "Interrupted",
    "Manipulator",
    "MissingPackageError",
    "Noise",
    "OutputError",
    "Override",
    "Parameter",
    "ParameterSet",
    "Part",
    "PartError",
    "Plan",
    "Port",
    "Progress",
    "Result",
    "ResultFileError",
    "SeriesError",
    "SeriesPart",
    "StartValueError",
    "SweepError",
    "System",
    "SystemFileError",
    "Tap",
    "UnconnectedError",
    "UnitError",
    "UnknownNameError",
    "Wire",
    "WireError",
    "grid",
    "latin_hypercube",
    "load_result",
    "masters",
    "open_archive",
    "parse_unit",
    "plot",
    "read_samples",
    "read_ssv",
    "read_sweep",
    "save_result",
    "select",
    "sobol",
    "sweep",
    "write_ssv",
]
