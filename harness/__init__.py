"""Couples FMI 2.0 co-simulation FMUs, Python functions and recorded series into closed loops.

A `System` is made of `Part` objects and wires; a master (``jacobi``, ``gauss-seidel``) says who steps when; a
`Tap` reads values during a run; the result is an `xarray.Dataset` with units.
"""

from typing import TYPE_CHECKING

from harness.errors import (
    AlgebraicLoopError,
    ExperimentError,
    FmuError,
    HarnessError,
    Interrupted,
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
from harness.lazy import lazy_names
from harness.masters import masters
from harness.plot import plot

if TYPE_CHECKING:
    from harness.archive import open_archive
    from harness.callable_part import CallablePart
    from harness.drive import Drive
    from harness.experiment import Experiment
    from harness.fmu import FmuPart
    from harness.manipulator import Bias, Delay, DropOut, Freeze, Manipulator, Noise, Override
    from harness.part import Calls, Part, Port
    from harness.plan import Plan
    from harness.result import Result, select
    from harness.results import load_result, save_result, to_csv, to_mat, to_netcdf, to_parquet
    from harness.series import SeriesPart
    from harness.ssp import Parameter, ParameterSet, read_ssv, write_ssv
    from harness.sweeps import grid, latin_hypercube, read_samples, read_sweep, sobol, sweep
    from harness.system import System
    from harness.tap import Progress, Tap
    from harness.units import BaseUnit, parse_unit
    from harness.wire import Wire
else:
    __getattr__, __dir__ = lazy_names(
        __name__,
        {
            "harness.archive": ["open_archive"],
            "harness.callable_part": ["CallablePart"],
            "harness.drive": ["Drive"],
            "harness.experiment": ["Experiment"],
            "harness.fmu": ["FmuPart"],
            "harness.manipulator": ["Bias", "Delay", "DropOut", "Freeze", "Manipulator", "Noise", "Override"],
            "harness.part": ["Calls", "Part", "Port"],
            "harness.plan": ["Plan"],
            "harness.result": ["Result", "select"],
            "harness.results": ["load_result", "save_result", "to_csv", "to_mat", "to_netcdf", "to_parquet"],
            "harness.series": ["SeriesPart"],
            "harness.ssp": ["Parameter", "ParameterSet", "read_ssv", "write_ssv"],
            "harness.sweeps": ["grid", "latin_hypercube", "read_samples", "read_sweep", "sobol", "sweep"],
            "harness.system": ["System"],
            "harness.tap": ["Progress", "Tap"],
            "harness.units": ["BaseUnit", "parse_unit"],
            "harness.wire": ["Wire"],
        },
    )

__all__ = [
    "AlgebraicLoopError",
    "BaseUnit",
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
    "to_csv",
    "to_mat",
    "to_netcdf",
    "to_parquet",
    "write_ssv",
]
