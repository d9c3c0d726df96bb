"""Sweeps: many runs of one system, with parameter sets, measures, workers, and a folder of results."""

from typing import TYPE_CHECKING

from harness.extras import lazy_names
from harness.sweeps.driver import sweep
from harness.sweeps.measures import Measure
from harness.sweeps.samples import Given, Sample, WithUnits, grid, latin_hypercube, read_samples, sobol

if TYPE_CHECKING:
    from harness.sweeps.folder import read_sweep
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "Given",
    "Measure",
    "Sample",
    "WithUnits",
    "grid",
    "latin_hypercube",
    "read_samples",
    "read_sweep",
    "sobol",
    "sweep",
]
