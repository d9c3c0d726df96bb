"""The error of a number that summarises a run, such as an rms value, from the same number of runs with other steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from harness.accuracy.convergence import IRREGULAR, converge
from harness.accuracy.repeat import others
from harness.accuracy.rungs import of_equal_end, ratios
from harness.accuracy.tolerances import floor_of, order_of
from harness.engine.tap import Recorder
from harness.system.assembly import Assembly
from harness.system.experiment import Experiment

BOUND: Final = ".bound"
"""Suffix of the error bound of a number or a variable."""


def measure_bounds(
    system: Assembly,
    experiment: Experiment,
    measure: Callable[[Recorder], Mapping[str, float]],
    found: Mapping[str, float],
    *,
    dense: bool = False,
) -> dict[str, float]:
    """Return the error bounds of numbers that were found in a run."""
    # numbers of runs that end at different times differ by what happens in between
    runs = others(system, experiment, of_equal_end(experiment, ratios(system, experiment)), dense=dense)
    finer = bool(runs) and runs[0].ratio < 1
    numbers = [found, *(measure(run.recorder) for run in runs)]
    most, noise = order_of(experiment), floor_of(system, experiment).error
    return {
        name + BOUND: number_bound([each[name] for each in numbers], most=most, noise=noise, finer=finer)
        for name in found
    }


def number_bound(values: Sequence[float], *, most: float, noise: float, finer: bool) -> float:
    """Return the error bound of the first number."""
    if len(values) < 2 or not all(map(math.isfinite, values)):
        return math.inf
    size = abs(values[0])
    near, *further = (abs(a - b) for a, b in pairwise(values))
    # numbers that agree by chance prove nothing: the difference that the order predicts counts as well
    near = max([near, *(each / 2.0**most for each in further)])
    far = np.array(further[:1]) if further else None
    how = converge(np.array([near]), far, most, size, noise * size, finer=finer)
    bound = how.factor * near if how.resolved else IRREGULAR * max([near, *further])
    return float(bound + noise * size)
