"""The experiment: from when to when, in which steps, by which master, and what is recorded."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from harness.errors import ExperimentError
from harness.system.manipulator import Manipulator
from harness.values import MOST_TICKS, is_count, is_number, shown

LOOP_TOLERANCE: Final = 3e-8
"""Default of `Experiment.loop_tolerance`: against 1e-7 it costs at most 9 % more evaluations, 1e-8 up to 12 %."""


@dataclass(frozen=True)
class Experiment:
    """How a system is run.

    Parameters
    ----------
    stop, step : float
        End of the run and length of a communication step (tick) [s]. The span must be a whole number of
        steps: a shorter last step would change the sampling of every controller in it.
    start : float
        Begin of the run [s].
    master : str
        Name of the master algorithm.
    record : tuple of str
        What is recorded: ``part.port``, with ``*`` and ``?`` standing for any outputs. Inputs, parameters and
        local variables are recorded when they are named in full.
    decimate : int
        Every so many ticks a row is recorded.
    tolerance : float or None
        Relative tolerance handed to the parts.
    loop_tolerance : float or None
        Residual of a solved loop over the size of its values, at which the masters newton and adaptive take the loop
        as solved; None: 3e-8. A smaller one costs evaluations and reduces noise and creep at rest.
    extrapolation : int
        Order of the polynomials, 0 to 2, through earlier values on which the master jacobi steps all parts; 0 holds
        the values.
    manipulators : tuple of Manipulator
        What is done to the values of wires.
    order : tuple of str
        Names of all parts in the order in which they are stepped, instead of the order found from their
        dependencies.

    Raises
    ------
    ExperimentError
        If the numbers make no sense.
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
    manipulators: tuple[Manipulator, ...] = ()

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("start", "stop", "step"):
            object.__setattr__(self, name, _seconds(name, getattr(self, name)))  # an FMU takes no other kind of number
        if self.step <= 0:
            raise ExperimentError(f"the step is {self.step} s: give a positive number of seconds")
        if self.stop < self.start:
            raise ExperimentError(f"the run stops at {self.stop} s before it starts at {self.start} s: exchange them")
        if not is_count(self.decimate):
            raise ExperimentError(f"decimate is {shown(self.decimate)}: give 1 to record every tick, or more")
        if self.tolerance is not None and not (is_number(self.tolerance) and 0.0 <= self.tolerance < math.inf):
            raise ExperimentError(f"the tolerance is {shown(self.tolerance)}: give a positive number, or leave it out")
        if self.extrapolation not in (0, 1, 2):
            raise ExperimentError(f"the extrapolation is of order {shown(self.extrapolation)}: give 0, 1 or 2")
        if self.loop_tolerance is not None and not (
            is_number(self.loop_tolerance) and 1e-14 <= self.loop_tolerance <= 1e-2
        ):
            raise ExperimentError(
                f"the tolerance of loops is {shown(self.loop_tolerance)}: give a number from 1e-14 to 0.01"
            )
        if self.extrapolation and self.master != "jacobi":
            raise ExperimentError(f"the master {self.master} does not extrapolate: use jacobi or leave it out")
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
        """Number of steps."""
        return round((self.stop - self.start) / self.step)


def _seconds(name: str, value: object) -> float:
    try:
        seconds = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        seconds = math.nan
    if not math.isfinite(seconds):
        raise ExperimentError(f"{name} is {shown(value)}: give a finite number of seconds")
    return seconds
