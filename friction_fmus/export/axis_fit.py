"""Parameters of a simple compensation that follow the identified axis best along its motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final, TypeAlias

import numpy as np
from scipy.optimize import lsq_linear

from friction_fmus.blocks.axis_units import domain_of
from friction_fmus.errors import BuildError
from friction_fmus.export.block_fmu import fmu
from friction_fmus.export.identified_axis import Array, IdentifiedAxis, ReferenceMotion
from harness import Experiment, FmuPart, SeriesPart, System
from harness.run import Session

STANDS: Final = 1e-6  # part of the largest reference speed below which the reference stands
PROBE: Final = 0.05  # relative change of a factor from which its effect on the tracking error is computed
RAMP: Final = 1.0  # duration of a ramp of the motion that stands for a record without servo [s]
SAMPLES: Final = 4000  # number of samples of the four ramps

Bounds: TypeAlias = tuple[Array | float, Array | float]
FREE: Final[Bounds] = (-np.inf, np.inf)
AGAINST: Final[Bounds] = (0.0, np.inf)  # for forces that oppose the motion


@dataclass(frozen=True, eq=False)
class AxisFit:
    """An axis along its motion, for fits of the force that a drive adds to its servo."""

    axis: IdentifiedAxis

    @cached_property
    def motion(self) -> ReferenceMotion:
        """The reference of the study; without one, ramps of the velocity up to the largest speed of the record."""
        loop, speed = self.axis.loop, self.axis.speed
        if loop is not None and np.any(loop.motion.rd):
            return loop.motion
        if loop is not None or speed <= 0.0:
            raise BuildError(f"{self.axis.name} does not move, or has no position: export an axis in motion.")
        t = self.sample_time * np.arange(float(SAMPLES))
        rd = speed * (1.0 - np.abs((t / RAMP + 1.0) % 4.0 - 2.0))
        return ReferenceMotion(np.cumsum(rd) * self.sample_time, rd, np.gradient(rd, self.sample_time))

    @property
    def sample_time(self) -> float:
        """Sample time [s]."""
        return 4.0 * RAMP / SAMPLES if self.axis.loop is None else self.axis.loop.sample_time

    @cached_property
    def held(self) -> Array:
        """Direction of the command, shape (n,): 1 or -1, held while the reference stands; 0 before it first moves."""
        moving = signs(self.motion)
        last = np.maximum.accumulate(np.where(moving != 0.0, np.arange(len(moving)), 0))
        return moving[last]

    @property
    def coulomb(self) -> Array:
        """Unit forces in the direction of the command, forward and backward, shape (n, 2)."""
        return np.column_stack([self.held > 0.0, -1.0 * (self.held < 0.0)])

    @cached_property
    def friction(self) -> Array:
        """Friction of the model along the reference, with the viscous part beside it, shape (n,) [N]."""
        from friction_fmus.axis.loop_assembly import typed

        axis, rd = self.axis, self.motion.rd
        t = self.sample_time * np.arange(float(len(rd)))
        velocity = SeriesPart("motion", t, {"v": rd}, beyond="hold")
        experiment = Experiment(float(t[-1]), self.sample_time, record=("friction.F",))
        block = FmuPart("friction", fmu(axis.model, domain_of(axis.rotary)))
        if axis.loop is None and any(port.name == "F_t" for port in block.inputs):
            raise BuildError(
                f"The friction of {axis.label} follows the {axis.words.force} of the drive, which only a study with a "
                "servo knows; export the result of `friction-fmus study`, or another model with --model."
            )
        given = {"F_ext": 0.0} | ({"Fn": axis.parameters["Fn0"]} if "Fn0" in axis.parameters else {})
        known = {port.name: given[port.name] for port in block.inputs if port.name in given}
        start = {f"friction.{name}": value for name, value in {**typed(block, axis.parameters), **known}.items()}
        with System([velocity, block], ["motion.v -> friction.v"], start, experiment) as system:
            found: Array = Session(system, experiment).run(start).column("friction.F")
        return found + axis.viscous * rd

    @cached_property
    def needed(self) -> Array:
        """Force that the axis needs beside that of its mass, along the reference, shape (n,) [N]."""
        return self.friction + self.axis.offset - self.along

    @cached_property
    def along(self) -> Array:
        """Force over position on the axis along the reference, shape (n,) [N]."""
        table = self.axis.position
        return np.zeros(len(self.motion.r)) if table is None else table.force(self.motion.r, self.motion.rd)

    def tracking(self, force: Array) -> float:
        """Return the tracking error, rms, with a force beside that of the servo [m]."""
        assert self.axis.loop is not None
        return rms(self.axis.loop.error(force))

    def least_squares(self, columns: Array, known: Array | float, bounds: Bounds = FREE) -> Array:
        """Return the factors of the columns, shape (n, p), with which they and a known force follow the needed one."""
        moving = signs(self.motion) != 0.0
        return _bounded(columns[moving], (self.needed - known)[moving], *bounds)

    def fit(self, columns: Array, known: Array | float, bounds: Bounds = FREE) -> Array:
        """Return the factors of the columns, shape (p,), with the least tracking error.

        Without a servo, they are those of `least_squares`. The tracking error of a linear loop is affine in the
        factors, so that a run for each gives the least square.
        """
        p, loop = self.least_squares(columns, known, bounds), self.axis.loop
        if loop is None:
            return p
        error = loop.error(columns @ p + known)
        size = np.max(np.abs(columns @ p)) / np.maximum(np.max(np.abs(columns), axis=0), 1e-300)
        steps = np.diag(PROBE * np.maximum(np.abs(p), 0.1 * size))
        slopes = [(loop.error(columns @ (p + step) + known) - error) / np.max(step) for step in steps]
        better = p + _bounded(np.column_stack(slopes), -error, bounds[0] - p, bounds[1] - p)
        return better if self.tracking(columns @ better + known) < rms(error) else p


def signs(motion: ReferenceMotion) -> Array:
    """Return the direction of a reference at each sample, shape (n,): 1, -1, or 0 while it stands."""
    found: Array = np.sign(motion.rd) * (np.abs(motion.rd) > STANDS * np.max(np.abs(motion.rd), initial=0.0))
    return found


def _bounded(columns: Array, target: Array, least: Array | float, most: Array | float) -> Array:
    """Return the least-squares factors of the columns within bounds, for columns of any size."""
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    found: Array = lsq_linear(columns / size, target, (least * size, most * size)).x / size
    return found


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
