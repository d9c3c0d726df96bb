"""Preparation of records for simulation: inputs of a friction block, and the measured signal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.fit.contact_model import ContactModel, DataTraits
from friction_fmus.identification.fit.idim import (
    InverseModelSettings,
    default_settings,
    derivative,
    filtered_motion,
    smoothed,
)
from friction_fmus.identification.fit.rests import standstill, unresolved_rest
from harness import Drive
from harness.parts.part import StartValue

Between: TypeAlias = Literal["held", "linear", "halves"]


@dataclass(frozen=True, eq=False)
class PreparedSegment:
    """Record prepared for a fit."""

    record: Record  # original record
    inputs: Mapping[str, Array]  # inputs of the block: v, and Fn if the normal force was measured
    between: Between  # interpolation of the inputs between samples: the later value, linear, or the nearer value
    x: Array  # position of the motion, from 0
    a: Array | None  # acceleration, if the signal is a drive force
    per: Array | None  # normal force, if the signal is the friction coefficient [N]
    measured: Array  # signal to reproduce, decimated by `rows`
    t: Array  # time of the signal [s]
    filter: InverseModelSettings | None  # filter of both sides of the equation; None for none
    stride: int = 1  # distance between the samples used, in samples of the record
    kept: NDArray[np.bool_] | None = None  # filtered rows outside rests; None for all
    drive: Array = field(default_factory=lambda: np.zeros(0))  # drive force, filtered as the position
    middle: float = 0.0  # time in the middle of all records [s]
    warm: float = 0.0  # mean temperature of all records [K]

    @property
    def step(self) -> float:
        """Sample time [s]."""
        return self.stride * self.record.Ts

    def thinned(self, stride: int) -> PreparedSegment:
        """Return the segment with every `stride`-th sample; it must have linear inputs and no filter."""
        inputs = {name: values[::stride] for name, values in self.inputs.items()}
        per = None if self.per is None else self.per[::stride]
        some = replace(self, inputs=inputs, x=self.x[::stride], per=per, stride=stride)
        return replace(some, measured=self.measured[::stride], t=self.t[::stride])

    def run(
        self, drive: Drive, outputs: Sequence[str], start: Mapping[str, StartValue], tolerance: float | None = None
    ) -> Array:
        """Simulate the block and return its outputs at the samples, shape (n, len(outputs))."""
        if self.between == "linear":
            return drive.run(self.inputs, outputs, self.step, between="linear", start=start, tolerance=tolerance)
        if self.between == "halves":
            nearer = {name: np.repeat(values, 2)[1:] for name, values in self.inputs.items()}
            return drive.run(nearer, outputs, 0.5 * self.step, start=start, tolerance=tolerance)[::2]
        # the step that ends at a sample uses the values of that sample, including the first one
        inputs = {name: np.append(values, values[-1]) for name, values in self.inputs.items()}
        return drive.run(inputs, outputs, self.step, start=start, tolerance=tolerance)[1:]

    def rows(self, signal: Array) -> Array:
        """Return a signal of shape (n,) or (n, columns), filtered and decimated like the measured one."""
        if self.filter is None:
            return signal
        found = self.filter.rows(signal, self.record.Ts)
        return found if self.kept is None else found[self.kept]

    def predicted(self, F: Array, M: float, OF: float) -> Array:
        """Return the predicted signal for a friction force, mass and offset."""
        if self.per is not None:
            return (F + OF) / self.per
        return self.rows(F + OF if self.a is None else F + M * self.a + OF)

    @property
    def reciprocating(self) -> bool:
        """Whether the contact slides in both directions, so that a force offset is identifiable."""
        v = self.inputs["v"]
        fast = 0.1 * float(np.max(np.abs(v)))
        return min(float(np.mean(v > fast)), float(np.mean(v < -fast))) > 0.05


def signal_of(records: Sequence[Record]) -> tuple[str, str]:
    """Return name and unit of the signal to fit: mu, friction or force."""
    if all(record.friction is not None for record in records):
        if all(record.normal is not None for record in records):
            return "mu", "1"
        return "friction", records[0].units.force
    for record in records:
        if record.force is None:
            raise RecordError(
                f"The record {record.name!r} has neither friction nor force; add a column with one of them."
            )
    return "force", records[0].units.force


def prepare(
    record: Record, model: ContactModel, signal: str, settings: InverseModelSettings | None = None
) -> PreparedSegment:
    """Prepare a record for the simulation of a friction block."""
    filter_ = settings if settings is not None else default_settings(record)
    inputs: dict[str, Array] = {}
    a: Array | None = None
    between: Between = "linear"
    used: InverseModelSettings | None = None
    if signal == "force":
        used = filter_
        used.require(record)
        if record.q is not None:
            motion = filtered_motion(record, filter_)
            v, a = motion.v, motion.a
        else:
            v = record.column("v")
            a = derivative(v, record.Ts)
        if not model.static:
            # the nearer value gives second-order accuracy of path and force, as linear interpolation does, and bristle
            # models step it exactly; the later value would reduce sigma1 by about sigma0 Ts/2
            between = "halves"
    elif record.v is not None:
        v = record.v
    elif model.rate_dependent:
        v = filtered_motion(record, filter_).v
    else:
        q, between = record.column("q"), "held"
        v = np.append(0.0, np.diff(q) / record.Ts)
    inputs["v"] = np.asarray(v, dtype=np.float64)
    per = _normal(record) if signal == "mu" else None
    if per is not None and model.loaded:
        inputs["Fn"] = per
    if between == "held":
        x = record.column("q") - record.column("q")[0]
    else:
        x = np.append(0.0, np.cumsum(0.5 * (v[1:] + v[:-1]) * record.Ts))
    rows = None
    if used is not None:  # the model cannot explain rests
        rest = unresolved_rest(record)
        rows = used.rows_outside(rest | standstill(record) if model.static else rest, record.Ts)
    segment = PreparedSegment(record, inputs, between, x, a, per, np.zeros(0), record.t, used, kept=rows)
    if signal == "force":
        drive = smoothed(record.force_at_samples(), record, filter_)
        segment = replace(segment, drive=drive, inputs=inputs | ({"F_t": drive} if model.transmits else {}))
    column = record.force_at_samples() if signal == "force" else record.column("friction")
    measured = column / per if per is not None else segment.rows(column)
    t = record.t if used is None else used.times(record.t, record.Ts)
    return replace(segment, measured=measured, t=t if rows is None else t[rows])


def traits(segments: Sequence[PreparedSegment], scale: float = 1.0) -> DataTraits:
    """Return rough properties of the friction, for start values of parameters."""
    v, x, y = [], [], []
    for segment in segments:
        columns = np.column_stack([segment.inputs["v"], segment.x])
        kept = segment.rows(columns)
        v.append(kept[:, 0])
        x.append(kept[:, 1])
        force = segment.measured * scale
        if segment.a is not None:
            mass, offset = inertia_guess([segment])
            force = segment.measured - segment.rows(mass * segment.a + offset)
        y.append(force)
    speed = np.concatenate(v)
    force = np.concatenate(y)
    top = float(np.max(np.abs(speed)))
    if top == 0.0 or not np.any(force):
        raise RecordError(
            f"The record {segments[0].record.name!r} has no motion or no "
            f"{segments[0].record.units.words.force}; use a record with sliding."
        )
    moving = np.abs(speed) > 0.3 * top
    level = float(np.median(np.abs(force[moving])))
    level = level if level > 0.0 else float(np.max(np.abs(force)))
    fast = np.abs(speed[moving])
    viscous = 0.0
    if np.ptp(fast) > 0.0:
        # force and speed also increase together after reversals: at most half of the force counts as viscous
        slope = float(np.polyfit(fast, np.abs(force[moving]), 1)[0])
        viscous = min(max(0.0, slope), 0.5 * level / top)
    unresolved = any(segment.kept is not None for segment in segments)
    stiffness, damping = _presliding(v, x, y, level, STIFF if unresolved else SOFT)
    return DataTraits(
        level=level - viscous * float(np.median(fast)),
        peak=float(np.quantile(np.abs(force), 0.98)),
        viscous=viscous if viscous > 0.0 else 0.01 * level / top,
        stiffness=stiffness,
        damping=damping,
        speed=top,
    )


SOFT, STIFF = 2.0, 100.0  # smallest stiffness times the reach over the level, without and with unresolved rests


def _presliding(
    v: Sequence[Array], x: Sequence[Array], y: Sequence[Array], level: float, least: float
) -> tuple[float, float]:
    """Return stiffness and damping from dF = sigma0 dx + sigma1 dv while the force is well below the sliding level."""
    rows, forces = [], []
    for velocity, position, force in zip(v, x, y, strict=True):
        dx, dv, dF = np.diff(position), np.diff(velocity), np.diff(force)
        far = (np.abs(force[1:]) < 0.6 * level) & (dx != 0.0)
        rows.append(np.column_stack([dx[far], dv[far]]))
        forces.append(dF[far])
    A, b = np.concatenate(rows), np.concatenate(forces)
    reach = max(float(np.ptp(position)) for position in x)
    least = least * level / reach if reach > 0.0 else 1.0
    stiffness, damping = least, 0.0
    if len(b) >= 3:
        length = np.linalg.norm(A, axis=0)
        length[length == 0.0] = 1.0
        solution = np.linalg.lstsq(A / length, b, rcond=None)[0] / length
        # with noisy differences the estimate may be too small
        stiffness = max(float(solution[0]), least)
        damping = max(float(solution[1]), 0.0)
    top = max(float(np.max(np.abs(velocity))) for velocity in v)
    return stiffness, damping if damping > 0.0 else 0.01 * level / top


def inertia_guess(segments: Sequence[PreparedSegment]) -> tuple[float, float]:
    """Return start values of mass and offset, fitted together with Coulomb and viscous friction."""
    rows, forces = [], []
    for segment in segments:
        assert segment.a is not None
        v = segment.inputs["v"]
        rows.append(segment.rows(np.column_stack([segment.a, np.ones_like(v), v, np.sign(v)])))
        forces.append(segment.measured)
    A = np.concatenate(rows)
    length = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    solution = np.linalg.lstsq(A / length, np.concatenate(forces), rcond=None)[0] / length
    return float(solution[0]), float(solution[1])


def _normal(record: Record) -> Array:
    normal = record.column("normal")
    if np.min(normal) <= 0.01 * float(np.mean(np.abs(normal))):
        raise RecordError(
            f"The normal force of the record {record.name!r} is {np.min(normal):g} N at "
            f"{record.t[int(np.argmin(normal))]:g} s; select a window in which the contact is loaded."
        )
    return normal
