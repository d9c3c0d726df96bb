"""The experiment: times, communication step, master algorithm and recorded variables."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final

from harness.errors import ExperimentError, nearest
from harness.system.wire import Manipulator
from harness.values import MOST_TICKS, is_count, is_number, make_plain, shown

LOOP_TOLERANCE: Final = 3e-8
"""Default of `Experiment.loop_tolerance`. It needs at most 9 % more evaluations than 1e-7; 1e-8 needs up to 12 %
more."""

COUPLING_TOLERANCE: Final = 1e-5  # default of `Experiment.coupling_tolerance`
STEP_TOLERANCE: Final = 0.01  # default of `Experiment.step_tolerance`
LIMITS: Final = {  # what it is, and the numbers as a message shows them
    "loop_tolerance": ("tolerance of loops", "1e-14", "0.01"),
    "coupling_tolerance": ("coupling tolerance", "1e-12", "0.01"),
    "step_tolerance": ("tolerance of steps", "1e-6", "0.5"),
}


@dataclass(frozen=True)
class Experiment:
    """Settings of a run.

    Parameters
    ----------
    stop, step : float
        End of the run and communication step [s]. The span must be an integer multiple of the step, as a shorter last
        step would change the sample time of the controllers.
    start : float
        Start of the run [s].
    master : str
        Name of the master algorithm.
    record : tuple of str
        Recorded variables: ``part.port``, in which ``*`` and ``?`` match outputs. Inputs, parameters and local
        variables need their full names.
    decimate : int
        Number of communication steps from one recorded row to the next.
    tolerance : float or None
        Relative tolerance passed to the parts.
    order : tuple of str
        Names of all parts in stepping order, instead of the order derived from their dependencies.
    extrapolation : int
        Order of the polynomials, 0 to 2, with which the master jacobi extrapolates inputs; 0 holds the values.
    loop_tolerance : float or None
        Residual relative to the magnitude of the values at which the masters newton and adaptive accept a loop as
        solved; None stands for 3e-8. A smaller value needs more evaluations, and reduces noise and creep at rest.
    coupling_tolerance : float or None
        Coupling error relative to the magnitude of the values from which the master adaptive chooses its inner steps;
        None stands for 1e-5.
    step_tolerance : float or None
        Difference between a step and its two halves, relative to the magnitude of the values, from which the masters
        newton and adaptive divide a step that they check; None stands for 0.01.
    manipulators : tuple of Manipulator
        Changes to the values of connections during the run.

    Raises
    ------
    ExperimentError
        If a setting is invalid.
    """

    stop: float
    step: float
    start: float = 0.0
    master: str = "gauss-seidel"
    record: tuple[str, ...] = ("*",)
    decimate: int = 1
    tolerance: float | None = None
    order: tuple[str, ...] = ()
    extrapolation: int = 0
    loop_tolerance: float | None = None
    coupling_tolerance: float | None = None
    step_tolerance: float | None = None
    manipulators: tuple[Manipulator, ...] = ()

    def __post_init__(self) -> None:
        make_plain(self)
        for name in ("start", "stop", "step"):
            object.__setattr__(self, name, _seconds(name, getattr(self, name)))  # an FMU accepts no other number type
        if self.step <= 0:
            raise ExperimentError(f"the step is {self.step} s: give a positive number of seconds")
        if self.stop < self.start:
            raise ExperimentError(
                f"the run stops at {self.stop} s before it starts at {self.start} s: give a stop after the start"
            )
        if not is_count(self.decimate):
            raise ExperimentError(
                f"decimate is {shown(self.decimate)}: give 1 to record every communication step, or more"
            )
        if self.tolerance is not None and not (is_number(self.tolerance) and 0.0 <= self.tolerance < math.inf):
            raise ExperimentError(f"the tolerance is {shown(self.tolerance)}: give a positive number, or leave it out")
        if self.extrapolation not in (0, 1, 2):
            raise ExperimentError(f"the extrapolation is of order {shown(self.extrapolation)}: give 0, 1 or 2")
        for name, (what, least, most) in LIMITS.items():
            value = getattr(self, name)
            if value is not None and not (is_number(value) and float(least) <= value <= float(most)):
                raise ExperimentError(f"the {what} is {shown(value)}: give a number from {least} to {most}")
        from harness.masters import best_first, find_master  # they import this module

        if self.extrapolation and not find_master(self.master).extrapolates:
            others = " or ".join(best_first(lambda master: master.extrapolates))
            raise ExperimentError(f"the master {self.master} does not extrapolate: use {others} or leave it out")
        ratio = (self.stop - self.start) / self.step
        if ratio > MOST_TICKS:
            raise ExperimentError(
                f"a step of {self.step:.12g} s from {self.start:.12g} to {self.stop:.12g} s makes more than 2^62 "
                "steps: use a longer step or stop earlier"
            )
        if abs(ratio - round(ratio)) > 1e-6:
            fitting = (self.stop - self.start) / max(1, round(ratio))
            stop = self.start + math.floor(ratio) * self.step
            raise ExperimentError(
                f"the step {self.step:.12g} s does not divide the span of {self.stop - self.start:.12g} s: "
                f"use a step of {fitting:.12g} s or stop at {stop:.12g} s"
            )

    @property
    def ticks(self) -> int:
        """Number of communication steps."""
        return round((self.stop - self.start) / self.step)


def as_experiment(given: Experiment | Mapping[str, Any] | None) -> Experiment | None:
    """Return an experiment, also of a mapping of its settings."""
    if not isinstance(given, Mapping):
        return given
    known = [each.name for each in fields(Experiment)]
    for name in given:
        if name not in known:
            raise ExperimentError(f"an experiment has no setting {shown(name)}: {nearest(str(name), known)}")
    if not {"stop", "step"} <= given.keys():
        raise ExperimentError(f"the experiment {shown(dict(given))} lacks stop or step: give both")
    settings: dict[str, Any] = {name: tuple(value) if name in LISTS else value for name, value in given.items()}
    return Experiment(**settings)


LISTS: Final = ("record", "order", "manipulators")
SCALARS: Final = tuple(each.name for each in fields(Experiment) if each.name not in LISTS)  # the other settings


def _seconds(name: str, value: object) -> float:
    try:
        seconds = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        seconds = math.nan
    if not math.isfinite(seconds):
        raise ExperimentError(f"{name} is {shown(value)}: give a finite number of seconds")
    return seconds
