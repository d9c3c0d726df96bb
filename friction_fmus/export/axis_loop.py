"""The servo of a study, in which the compensation of a target is simulated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from harness import SeriesPart, System, Wire
from harness.run import Session
from harness.system.wire import parse_wire, split_name

Array: TypeAlias = NDArray[np.float64]

COMPENSATING = ("compensator", "feedforward", "table", "force", "unexplained")
"""Parts of the archive of a study that are beside servo and machine."""


class Motion(NamedTuple):
    """Reference and its derivatives at the samples of the servo, each of shape (n,) [m, m/s, m/s2]."""

    r: Array
    rd: Array
    rdd: Array


@dataclass(frozen=True)
class AxisLoop:
    """Servo, mass and friction of a study.

    Attributes
    ----------
    archive : str
        Path of ``axis.ssp``, the axis with the recommended compensator.
    gains : mapping of str to float
        Gains of the servo without it.
    law : str
        Name of the recommended compensator; "none" without one.
    as_measured, fed, recommended : float or None
        Tracking errors, rms, that the study found [m]: servo as measured, servo as here without friction compensation,
        and servo with the recommended compensator; None if the run failed.
    """

    archive: str
    gains: Mapping[str, float]
    law: str
    as_measured: float | None
    fed: float | None
    recommended: float | None

    @cached_property
    def whole(self) -> System:
        """The axis with the recommended compensator."""
        return System.from_ssp(self.archive)

    @property
    def sample_time(self) -> float:
        """Sample time of the servo [s]."""
        experiment = self.whole.experiment
        assert experiment is not None
        return experiment.step * experiment.decimate

    @cached_property
    def motion(self) -> Motion:
        """The reference of the study."""
        experiment = self.whole.experiment
        assert experiment is not None
        names = ("reference.r", "reference.rd", "reference.rdd")
        source = System([self.whole.parts["reference"]], experiment=replace(experiment, record=names))
        found = Session(source, source.experiment or experiment).run({})
        return Motion(*(found.column(name)[:-1] for name in names))

    def error(self, force: Array) -> Array:
        """Return the tracking error over the samples, shape (n,) [m], with a force at the output of the servo.

        The servo has the gains of the record, and velocity and acceleration feedforward. `force`, of shape (n,) [N],
        stands for all forces of the drive beside the servo, the constant one included; it is held within a sample.
        """
        from friction_fmus.axis.servo_loop import accurate

        whole, t = self.whole, self.sample_time * np.arange(float(len(force)))
        added = SeriesPart("added", t, {"F": force}, interpolation="previous", beyond="hold")
        left = [part for name, part in whole.parts.items() if name not in COMPENSATING]
        known = {part.name for part in left}
        wires = [wire for wire in map(parse_wire, whole.wires) if {end[0] for end in wire.ends} <= known]
        wires.append(Wire("added.F", "servo.f"))
        start = {name: value for name, value in whole.start.items() if split_name(name)[0] in known}
        start |= {f"servo.{name}": value for name, value in self.gains.items()}
        start.pop("servo.f", None)
        _, found = accurate(System([*left, added], wires, start, whole.experiment, whole.name))
        error: Array = found.column("tracking_error.y")[:-1]
        return error
