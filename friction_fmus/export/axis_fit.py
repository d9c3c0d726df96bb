"""Parameters of a simple compensation that follow the identified axis best along its motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final, TypeAlias

import numpy as np
from scipy.optimize import lsq_linear

from friction_fmus.blocks.axis_units import domain_of
from friction_fmus.errors import BuildError
from friction_fmus.export.axis_loop import Array, Motion
from friction_fmus.export.block_fmu import fmu
from friction_fmus.export.identified_axis import IdentifiedAxis
from harness import Experiment, FmuPart, SeriesPart, System
from harness.run import Session

STANDS: Final = 1e-6  # part of the largest reference speed below which the reference stands
PROBE: Final = 0.05  # relative change of a parameter from which its effect on the tracking error is computed
ROUNDS: Final = 3  # largest number of steps towards the least tracking error
GAINS_MORE: Final = 0.99  # ratio of the tracking errors after and before a step above which the next one is left out

SAMPLES: Final = 4000
RAMP: Final = 1.0
"""Number of samples and duration of a ramp of the motion that stands for a record without servo [s]."""

Bounds: TypeAlias = tuple[Array | float, Array | float]
FREE: Final[Bounds] = (-np.inf, np.inf)
AGAINST: Final[Bounds] = (0.0, np.inf)  # for forces that oppose the motion


@dataclass(frozen=True, eq=False)
class AxisFit:
    """An axis along its motion, for fits of the force that a drive adds to its servo."""

    axis: IdentifiedAxis

    @cached_property
    def motion(self) -> Motion:
        """The reference of the study; without one, ramps of the velocity up to the largest speed of the record."""
        if self.axis.loop is not None:
            return self.axis.loop.motion
        if self.axis.speed <= 0.0:
            raise BuildError(
                f"The record {self.axis.name} has no position, so that the speeds of the axis are unknown."
            )
        t = self.sample_time * np.arange(float(SAMPLES))
        rd = self.axis.speed * (1.0 - np.abs((t / RAMP + 1.0) % 4.0 - 2.0))
        return Motion(np.cumsum(rd) * self.sample_time, rd, np.gradient(rd, self.sample_time))

    @property
    def sample_time(self) -> float:
        """Sample time [s]."""
        return 4.0 * RAMP / SAMPLES if self.axis.loop is None else self.axis.loop.sample_time

    @cached_property
    def held(self) -> Array:
        """Direction of the command, shape (n,): 1 or -1, held while the reference stands; 0 before it first moves."""
        moving = signs(self.motion)
        last = np.maximum.accumulate(np.where(moving != 0.0, np.arange(len(moving)), 0))
        found: Array = moving[last]
        return found

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

    def least_squares(self, columns: Array, known: Array | float, bounds: Bounds = FREE) -> Array:
        """Return the factors of the columns, shape (n, p), with which they and a known force follow the needed one."""
        moving = signs(self.motion) != 0.0
        return _bounded(columns[moving], (self.needed - known)[moving], *bounds)

    def tracking(self, force: Array) -> float:
        """Return the tracking error, rms, with a force beside that of the servo [m]."""
        return rms(self._error(force))

    def _error(self, force: Array) -> Array:
        assert self.axis.loop is not None
        return self.axis.loop.error(force)

    def fit(self, columns: Array, known: Array | float, bounds: Bounds = FREE) -> Array:
        """Return the factors of the columns, shape (p,), with the least tracking error.

        Without a servo, they are those of `least_squares`. The tracking error of a linear loop is affine in the
        factors, so that a run for each gives the least square (Gauss-Newton).
        """
        p = self.least_squares(columns, known, bounds)
        if self.axis.loop is None:
            return p
        error = self._error(columns @ p + known)
        size = np.max(np.abs(columns @ p)) / np.maximum(np.max(np.abs(columns), axis=0), 1e-300)
        for _ in range(ROUNDS):
            step = PROBE * np.maximum(np.abs(p), 0.1 * size)
            probes = [self._error(columns @ (p + step * unit) + known) for unit in np.eye(len(p))]
            slopes = np.column_stack([(probe - error) / d for probe, d in zip(probes, step, strict=True)])
            change = _bounded(slopes, -error, bounds[0] - p, bounds[1] - p)
            tried = [(self._error(columns @ each + known), each) for each in (p + change, p + 0.5 * change)]
            best, chosen = min(tried, key=lambda each: rms(each[0]))
            before = rms(error)
            if rms(best) < before:
                error, p = best, chosen
            if rms(best) > GAINS_MORE * before:
                break
        return p


def signs(motion: Motion) -> Array:
    """Return the direction of a reference at each sample, shape (n,): 1, -1, or 0 while it stands."""
    found: Array = np.sign(motion.rd) * (np.abs(motion.rd) > STANDS * np.max(np.abs(motion.rd), initial=0.0))
    return found


def _bounded(columns: Array, target: Array, least: Array | float, most: Array | float) -> Array:
    """Return the least-squares factors of the columns within bounds, for columns of any size."""
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    found: Array = lsq_linear(columns / size, target, (least * size, most * size)).x / size
    return found


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
