"""The servo of a study, in which the compensation of a target is simulated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from harness import Experiment, Part, SeriesPart, System, Wire
from harness.run import Session
from harness.system.wire import parse_wire, split_name

Array: TypeAlias = NDArray[np.float64]

COMPENSATING: Final = ("compensator", "feedforward", "load", "table", "force", "unexplained")
"""Parts of the archive of a study that are beside servo and machine."""

AT_REST: Final = ("axis.v0", "axis.v1_0", "axis.v2_0", "velocity.v0")
"""Start values of an axis that begins at rest on its reference."""


class ReferenceMotion(NamedTuple):
    """Reference and its derivatives at the samples of the servo, each of shape (n,) [m, m/s, m/s2]."""

    r: Array
    rd: Array
    rdd: Array


@dataclass(frozen=True)
class AxisLoop:
    """Servo, mass and friction of a study."""

    archive: str  # path of ``axis.ssp``, the axis with the recommended compensator
    gains: Mapping[str, float]  # gains of the servo without it
    law: str  # name of the recommended compensator; "none" without one
    as_measured: float | None
    fed: float | None
    recommended: float | None
    """Tracking errors, rms, that the study found [m]: servo as measured, servo as in `error` without friction
    compensation, and servo with the recommended compensator; None if the run failed."""

    @cached_property
    def whole(self) -> System:
        """The axis with the recommended compensator."""
        return System.from_ssp(self.archive)

    @property
    def _experiment(self) -> Experiment:
        assert self.whole.experiment is not None
        return self.whole.experiment

    @property
    def sample_time(self) -> float:
        """Sample time of the servo [s]."""
        return self._experiment.step * self._experiment.decimate

    @cached_property
    def motion(self) -> ReferenceMotion:
        """The reference of the study."""
        names = tuple(f"reference.{name}" for name in ReferenceMotion._fields)
        source = System([self.whole.parts["reference"]], experiment=replace(self._experiment, record=names))
        found = Session(source, replace(self._experiment, record=names)).run({})
        return ReferenceMotion(*(found.column(name)[:-1] for name in names))

    def error(self, force: Array, motion: ReferenceMotion | None = None) -> Array:
        """Return the tracking error over the samples, shape (n,) [m], with a force at the output of the servo.

        The servo has the gains of the record, and velocity and acceleration feedforward if the study has them. `force`,
        of shape (n,) [N], stands for all forces beside the servo, the constant one included. `motion` is another
        reference, which begins at rest.
        """
        from friction_fmus.axis.servo_loop import accurate

        whole, t = self.whole, self.sample_time * np.arange(float(len(force)))
        added = {"added": {"F": force}} | ({} if motion is None else {"reference": motion._asdict()})
        parts: list[Part] = [part for name, part in whole.parts.items() if name not in (*COMPENSATING, *added)]
        # all are read at samples; a held output would still have the value of the sample before
        parts += [SeriesPart(name, t, each, beyond="hold") for name, each in added.items()]
        known = {part.name for part in parts}
        wires = [wire for wire in map(parse_wire, whole.wires) if {end[0] for end in wire.ends} <= known]
        wires.append(Wire("added.F", "servo.f"))
        start = {name: value for name, value in whole.start.items() if split_name(name)[0] in known}
        start |= {f"servo.{name}": value for name, value in self.gains.items()}
        start |= {} if motion is None else {name: 0.0 for name in AT_REST if name in start}
        start.pop("servo.f", None)
        experiment = replace(self._experiment, stop=len(force) * self.sample_time)
        _, found = accurate(System(parts, wires, start, experiment, whole.name))
        error: Array = (motion or self.motion).r - found.column(experiment.record[1])[:-1]  # the second is the position
        return error
