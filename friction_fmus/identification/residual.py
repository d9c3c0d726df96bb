"""Residual of an identified friction model over velocity, position and direction, learned by least squares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from friction_fmus.fmi.package import build
from friction_fmus.identification.data.record import Array, AxisUnits, Finding, Record
from friction_fmus.identification.errors import FitError, RecordError
from friction_fmus.identification.fit.models import contact_model
from friction_fmus.identification.fit.prediction import known_force, simulated
from friction_fmus.identification.fit.scores import independent_samples
from friction_fmus.identification.fit.simulation_data import prepare
from friction_fmus.identification.result import Identification
from friction_fmus.lawkit.residual_grid import POSITIONS, SPEEDS

MASSES: Final[Mapping[str, tuple[float, float]]] = {"m": (1e-6, 1e7), "rad": (1e-10, 1e7)}
"""Smallest and largest mass [kg] or moment of inertia [kg.m2] of a machine, by unit of the position."""

FORBIDDING: Final = ("wrong-sign", "negative-mass", "driving-friction", "implausible-mass", "missing-force")
"""Findings after which identified parameters cannot be used."""

OUTSIDE: Final = 8.0
"""Residual over its robust standard deviation above which another force acts."""

MISSING: Final = 0.15
"""Residual over the rms force above which another force acts."""

BESIDE: Final = 5
"""Number of decimated samples on either side of a reversal that are left out, and half of those at an end."""

ITERATIONS: Final = 15
"""Iterations of the robust fit."""

SIGNIFICANT: Final = 3.0
"""Number of standard errors by which a negative mass must differ from zero."""

DRIVING: Final = 0.02
"""Power of friction that drives the axis, over the mean power of the force, above which the sign is wrong."""


@dataclass(frozen=True)
class DriveBalance:
    """Least squares of the drive force."""

    mass: float
    error: float
    """Mass and its standard error [kg or kg.m2]."""
    dissipated: float
    """Mean power of viscous and Coulomb friction over the mean magnitude of the power of the force without offset;
    negative if friction drives the axis."""


def drive_balance(records: Sequence[Record]) -> DriveBalance | None:
    """Fit mass and friction to the drive force of some records."""
    equations = _equations(records)
    if equations is None:
        return None
    A, F, *_ = equations
    length = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    theta = np.linalg.lstsq(A / length, F, rcond=None)[0] / length
    rest = F - A @ theta
    inverse = np.linalg.pinv((A / length).T @ (A / length)) / np.outer(length, length)
    samples = max(independent_samples([rest]) - 4.0, 1.0)
    v = A[:, 1]
    power = float(np.mean(np.abs((F - theta[3]) * v)))
    friction = float(np.mean((theta[1] * v + theta[2] * A[:, 2]) * v))
    error = float(np.sqrt(max(inverse[0, 0], 0.0) * float(rest @ rest) / samples))
    return DriveBalance(float(theta[0]), error, friction / power if power else 0.0)


def _equations(records: Sequence[Record]) -> tuple[Array, Array, Array, NDArray[np.bool_]] | None:
    """Return regressors a, v, sgn(v), 1, shape (n, 4), force, time, and whether a row is at an end of its record.

    None as for `drive_balance`.
    """
    rows, forces, times, ends = [], [], [], []
    for record in records:
        if record.force is None or record.friction is not None:
            return None
        try:
            segment = prepare(record, contact_model("Viscous", record.units), "force")
        except RecordError:
            return None
        assert segment.a is not None
        v = segment.inputs["v"]
        rows.append(segment.rows(np.column_stack([segment.a, v, np.sign(v), np.ones_like(v)])))
        forces.append(segment.measured)
        times.append(segment.t)
        ends.append(np.minimum(np.arange(len(segment.t)), np.arange(len(segment.t))[::-1]) < 2 * BESIDE)
    return np.concatenate(rows), np.concatenate(forces), np.concatenate(times), np.concatenate(ends)


def missing_force(records: Sequence[Record]) -> Finding | None:
    """Return a finding if, in some intervals, the motion needs another force than the recorded one.

    Mass and friction are fitted robustly (Tukey's bisquare), so that these intervals do not count. Samples near a
    reversal are left out, where a force that follows the sign of the velocity is smoothed by the filter.
    """
    equations = _equations(records)
    if equations is None:
        return None
    A, F, t, ends = equations
    if len(F) <= 2 * BESIDE + 1:  # too short to tell a disturbance from a reversal
        return None
    scaled = A / np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    weight = np.ones_like(F)
    for _ in range(ITERATIONS):
        root = np.sqrt(weight)
        rest = F - scaled @ np.linalg.lstsq(scaled * root[:, None], F * root, rcond=None)[0]
        core = max(float(np.median(np.abs(rest))) / 0.6745, 1e-12 * float(np.max(np.abs(F), initial=1e-300)))
        weight = np.square(np.maximum(1.0 - np.square(rest / (4.685 * core)), 0.0))
    v = A[:, 1]
    turns = np.append(v[1:] * v[:-1] <= 0.0, False) | (np.abs(v) < 0.02 * float(np.max(np.abs(v))))
    near = (np.convolve(turns, np.ones(2 * BESIDE + 1), "same") > 0.5) | ends
    level = float(np.sqrt(np.mean(np.square(F))))
    outside = (np.abs(rest) > max(OUTSIDE * core, MISSING * level)) & ~near
    starts = np.flatnonzero(np.diff(np.concatenate([[0], outside.astype(np.int8)])) == 1)
    if np.count_nonzero(outside) < 3 * len(starts) or not len(starts) or np.mean(outside) > 0.4:
        return None
    size = float(np.median(np.abs(rest[outside])))
    unit = records[0].units.force
    what = (
        f"In {len(starts)} intervals, the first one at {t[starts[0]]:.4g} s, the motion needs about {size:.3g} {unit} "
        "more or less than the recorded drive force."
    )
    change = "Record the force that acts there and declare its column as injected, or choose windows without it."
    share = float(np.sqrt(np.mean(np.square(np.where(outside, rest, 0.0))))) / level
    return Finding("missing-force" if share > 0.1 else "disturbed-force", what, change)


def contradictions(records: Sequence[Record]) -> tuple[Finding, ...]:
    """Return findings about a drive force that no mass with friction can need for the measured motion."""
    balance = drive_balance(records)
    if balance is None:
        return ()
    missing = missing_force(records)
    return (*_about_mass(balance, records[0].units), *(() if missing is None else (missing,)))


def _about_mass(balance: DriveBalance, units: AxisUnits) -> tuple[Finding, ...]:
    """Return the finding about sign and size of mass and friction."""
    low, high = MASSES[units.position]
    shown = f"{balance.mass:.3g} ± {balance.error:.2g} {units.inertia}"
    negative = balance.mass < -SIGNIFICANT * balance.error
    driving = balance.dissipated < -DRIVING
    if negative and driving:
        what = f"The drive force has the wrong sign: it fits a mass of {shown}, and friction that drives the axis."
        return (Finding("wrong-sign", what, "Set sign = -1 for the force in [columns]."),)
    if negative:
        what = f"The drive force fits a mass of {shown}, which is negative."
        change = (
            "Check units and times of force and position; a spring or a load that depends on position does the same."
        )
        return (Finding("negative-mass", what, change),)
    if driving:
        what = (
            f"Friction would drive the axis: its power is {100.0 * balance.dissipated:.3g} % of the power of the drive."
        )
        change = "Check the sign of the force, and that force and position are logged in the same sample."
        return (Finding("driving-friction", what, change),)
    if balance.mass < balance.error:
        what = f"The record does not determine the mass ({shown})."
        return (Finding("mass-not-identified", what, "Record faster motion, or give the mass."),)
    if not low <= balance.mass <= high:
        what = f"The drive force fits a mass of {shown}; machines have {low:g} to {high:g} {units.inertia}."
        return (Finding("implausible-mass", what, "Correct the unit of the force or of the position."),)
    return ()


BLOCK = "FrictionResidual"
"""Law that adds the residual to the force of a model."""

BLOCKS = 6
"""Number of blocks of the cross-validation."""

RIDGES = tuple(float(ridge) for ridge in np.geomspace(1e-4, 1e2, 7))
"""Ridge parameters to try, over the mean square of the columns."""

HELPS = 0.98
"""Largest cross-validation error, relative to that without a residual, at which a residual is used."""


@dataclass(frozen=True)
class ResidualTable:
    """Residual of a friction model: parameters of the law `FrictionResidual`.

    Attributes
    ----------
    v_max : float
        Largest speed; the others are `SPEEDS` times it [m/s].
    x_begin, spacing : float
        First position, and distance of the positions [m].
    forward, backward : tuple of float
        Friction to add at each speed and position, position by position for each speed [N].
    R_max : float
        Largest residual [N].
    only_adds : bool
        Whether the residual never assists the motion.
    """

    v_max: float
    x_begin: float
    spacing: float
    forward: tuple[float, ...]
    backward: tuple[float, ...]
    R_max: float
    only_adds: bool = False

    def start_values(self) -> dict[str, float | bool]:
        """Return the start values of `FrictionResidual`.

        Returns
        -------
        dict of str to float or bool
            Values by variable.
        """
        vectors = {"forward": self.forward, "backward": self.backward}
        elements = {f"{name}[{i}]": each for name, values in vectors.items() for i, each in enumerate(values, 1)}
        rest = {name: vars(self)[name] for name in ("v_max", "x_begin", "spacing", "R_max", "only_adds")}
        return {**elements, **rest}

    def total(self, F_model: Array, x: Array, v: Array) -> Array:
        """Return the force of a model with the residual, as `FrictionResidual` does.

        Parameters
        ----------
        F_model, x, v : array, shape (n,)
            Force of the model [N], position [m] and velocity [m/s].

        Returns
        -------
        array, shape (n,)
            Force [N].
        """
        weights = np.array([*self.forward, *self.backward])
        along = np.clip(np.sign(v) * (columns(self.v_max, self.x_begin, self.spacing, x, v) @ weights), *self._limits)
        way = np.sign(v)
        total: Array = F_model + way * np.maximum(along, -np.maximum(way * F_model, 0.0))
        return total

    def to_fmu(self, folder: Path, name: str = BLOCK, rotary: bool = False) -> Path:
        """Build the FMU with this table in a folder.

        Parameters
        ----------
        folder : Path
            Folder of the FMU.
        name : str
            Model identifier.
        rotary : bool
            Whether the axis has angles and torques.

        Returns
        -------
        Path
            The FMU.

        Raises
        ------
        BuildError
            If the FMU cannot be built.
        """
        return build(BLOCK, folder, self.start_values(), name, domain="rotational" if rotary else "translational")

    @property
    def _limits(self) -> tuple[float, float]:
        return (0.0 if self.only_adds else -self.R_max), self.R_max


@dataclass(frozen=True)
class LearnedResidual:
    """Residual learned from the training data of an identification.

    Attributes
    ----------
    table : ResidualTable
        The residual.
    crossed, crossed_without : float
        Rms error of the cross-validation over blocks of the training data, with and without the residual, in the unit
        of the signal.
    train, train_without, validation, validation_without : float
        Rms errors with the residual, limits included, and without; NaN without validation data.
    ridge : float
        Ridge parameter over the mean square of the columns.
    over_position : bool
        Whether the residual depends on position.
    """

    table: ResidualTable
    crossed: float
    crossed_without: float
    train: float
    train_without: float
    validation: float
    validation_without: float
    ridge: float
    over_position: bool


def columns(v_max: float, x_begin: float, spacing: float, x: Array, v: Array) -> Array:
    """Return the force for a unit of each value of the table, shape (n, values), forward before backward."""
    nodes = np.array([0.0, *SPEEDS])
    along_speed = np.interp(np.abs(v) / v_max, nodes, np.arange(nodes.size))
    along_x = np.clip((x - x_begin) / spacing, 0.0, POSITIONS - 1.0)
    of_speed = np.maximum(1.0 - np.abs(along_speed[:, None] - np.arange(1, nodes.size)), 0.0)
    of_x = np.maximum(1.0 - np.abs(along_x[:, None] - np.arange(POSITIONS)), 0.0)
    table = (of_speed[:, :, None] * of_x[:, None, :]).reshape(len(x), -1)
    return np.hstack([np.where(v[:, None] > 0.0, table, 0.0), np.where(v[:, None] < 0.0, -table, 0.0)])


def learn_residual(
    result: Identification,
    validation: Record | Sequence[Record] | None = None,
    *,
    only_adds: bool = False,
) -> LearnedResidual | None:
    """Learn the residual of an identified model from its training data.

    Parameters
    ----------
    result : Identification
        Friction model identified from friction or drive force along a measured motion.
    validation : Record or sequence of Record, optional
        Data on which the errors with and without the residual are reported; they have no influence on it.
    only_adds : bool
        Whether the residual may never assist the motion, so that the sum is passive with every passive model.

    Returns
    -------
    LearnedResidual or None
        None if no table reduces the cross-validation error by 2 % or more.

    Raises
    ------
    FitError
        If the model was fitted to positions.

    Notes
    -----
    The values follow from least squares with a ridge, over blocks of the training data in cross-validation: the ridge
    (`RIDGES`), and whether the table depends on position, are those with the smallest error on blocks that are left
    out. `FrictionResidual` limits the residual; the reported errors contain these limits.
    """
    if result.signal == "q":
        raise FitError(
            f"learn_residual: {result.model} was fitted to positions, not to a force; identify it by another method."
        )
    parts = [_Part(result, record) for record in result.records]
    v, x = (np.concatenate(values) for values in zip(*((part.v, part.x) for part in parts), strict=True))
    v_max = float(np.max(np.abs(v)))
    x_begin = float(x.min())
    spacing = float(np.ptp(x)) / (POSITIONS - 1) or 1.0
    A = np.vstack([part.rows(columns(v_max, x_begin, spacing, part.x, part.v)) for part in parts])
    target = np.concatenate([part.measured - part.predicted(part.F) for part in parts])
    same = np.kron(np.eye(2 * len(SPEEDS)), np.ones((POSITIONS, 1)))  # one value for all positions
    without = _rms(target)
    tried = [
        (_crossed(A @ shape, target, ridge), ridge, shape) for shape in (same, np.eye(A.shape[1])) for ridge in RIDGES
    ]
    crossed, ridge, shape = min(tried, key=lambda each: each[0])
    if crossed > HELPS * without:
        return None
    weights = shape @ _ridge(A @ shape, target, ridge)
    forward, backward = np.split(weights, 2)
    table = ResidualTable(
        v_max,
        x_begin,
        spacing,
        tuple(forward.tolist()),
        tuple(backward.tolist()),
        float(np.abs(weights).max()),
        only_adds,
    )
    records = (validation,) if isinstance(validation, Record) else tuple(validation or ())
    checked = [_Part(result, record) for record in records]
    return LearnedResidual(
        table=table,
        crossed=crossed,
        crossed_without=without,
        train=_error(parts, table),
        train_without=_error(parts, None),
        validation=_error(checked, table),
        validation_without=_error(checked, None),
        ridge=ridge,
        over_position=shape is not same,
    )


class _Part:
    """A record with the force of the identified model along its motion."""

    def __init__(self, result: Identification, record: Record) -> None:
        self.segment, self.F = simulated(result, record, fit=True)
        self.v = self.segment.inputs["v"]
        self.x = self.segment.x if record.q is None else record.column("q")
        self.measured = self.segment.measured
        self._values = result.values()
        self._known = self.segment.rows(known_force(result, self.segment))

    def predicted(self, F: Array) -> Array:
        """Return the signal for a friction force."""
        values = self._values
        return self.segment.predicted(F, values.get("M", 0.0), values.get("OF", 0.0)) - self._known

    def rows(self, forces: Array) -> Array:
        """Return the signals of friction forces, shape (n, columns)."""
        return forces / self.segment.per[:, None] if self.segment.per is not None else self.segment.rows(forces)


def _error(parts: Sequence[_Part], table: ResidualTable | None) -> float:
    """Return the rms error with or without a residual; NaN without data."""
    if not parts:
        return float("nan")
    forces = [part.F if table is None else table.total(part.F, part.x, part.v) for part in parts]
    return _rms(np.concatenate([part.measured - part.predicted(F) for part, F in zip(parts, forces, strict=True)]))


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(np.square(error))))


def _ridge(A: Array, target: Array, ridge: float) -> Array:
    normal = A.T @ A
    weight = max(ridge * float(np.mean(np.diag(normal))), np.finfo(float).tiny)
    return np.asarray(np.linalg.solve(normal + weight * np.eye(len(normal)), A.T @ target))


def _crossed(A: Array, target: Array, ridge: float) -> float:
    """Return the rms error on blocks that are left out of the regression."""
    block = np.arange(len(A)) * BLOCKS // len(A)
    errors = [
        target[block == b] - A[block == b] @ _ridge(A[block != b], target[block != b], ridge) for b in range(BLOCKS)
    ]
    return _rms(np.concatenate(errors))
