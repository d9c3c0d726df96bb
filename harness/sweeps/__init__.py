"""Sweeps: many runs of one system, with parameter sets, measures, workers, and a folder of results."""

from harness.sweeps.driver import sweep
from harness.sweeps.folder import read_sweep
from harness.sweeps.measures import Measure
from harness.sweeps.samples import Given, Sample, WithUnits, grid, latin_hypercube, read_samples, sobol

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
