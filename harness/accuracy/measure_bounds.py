"""The error of a number that summarises a run, such as an rms value, from the same number of runs with other steps."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from harness.accuracy.error_estimate import IRREGULAR, OTHER, converge
from harness.accuracy.rungs import by_newton, of_equal_end, others, ratios
from harness.engine.algorithm import Recorder
from harness.masters import find_master
from harness.system.assembly import Assembly
from harness.system.experiment import LOOP_TOLERANCE, Experiment

ROUNDING: Final = 1e-9  # relative error that rounding leaves in a long run
OF_LOOPS: Final = 10.0  # relative error of a variable over the tolerance of the loops


@dataclass(frozen=True)
class Floor:
    """The relative error that no shorter step reduces."""

    error: float  # its size, relative to the range of a variable
    source: str  # the setting or the part that leaves it: ``rounding``, ``loop_tolerance`` or ``tolerance of NAME``


def order_of(experiment: Experiment) -> float:
    """Return the order with which the master converges at best."""
    return 2.0 if experiment.extrapolation else find_master(experiment.master).order


def has_lines(experiment: Experiment) -> bool:
    """Return whether the master passes values as lines instead of held values."""
    return find_master(experiment.master).implicit or experiment.extrapolation > 0


def floor_of(system: Assembly, experiment: Experiment) -> Floor:
    """Return the error that loops, rounding and solvers inside the parts leave, whichever is largest."""
    found = [Floor(ROUNDING, "rounding")]
    if find_master(experiment.master).implicit:
        found.append(Floor(OF_LOOPS * (experiment.loop_tolerance or LOOP_TOLERANCE), "loop_tolerance"))
    for name, part in system.parts.items():
        found.append(Floor(part.inner_tolerance(experiment.tolerance), f"tolerance of {name}"))
    return max(found, key=lambda floor: floor.error)


BOUND: Final = ".bound"  # suffix of the error bound of a number or a variable


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
    newton = by_newton(system, experiment, runs, dense=dense)
    other = measure(newton.recorder) if newton else found
    return {
        name + BOUND: max(
            number_bound([each[name] for each in numbers], most=most, noise=noise, finer=finer),
            OTHER * abs(found[name] - other[name]),  # last, as a NaN says nothing
        )
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
