"""Records as what a friction block is driven with, and its force as what was measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.errors import RecordError
from friction_fmus.identification.fit.idim import InverseModelSettings, decimate, filtered_motion
from friction_fmus.identification.fit.models import ContactModel, Traits
from harness import Drive
from harness.parts.part import StartValue

Between: TypeAlias = Literal["held", "linear", "halves"]


@dataclass(frozen=True, eq=False)
class Piece:
    """One record, ready for a fit.

    Attributes
    ----------
    record : Record
        Where it comes from.
    inputs : mapping of str to array, shape (n,)
        What drives the block: v, and Fn where the normal force was measured.
    between : {"held", "linear", "halves"}
        The inputs between two samples: the later value, on straight lines, or the nearer value.
    x : array, shape (n,)
        Position along which the block is driven, from 0.
    a : array, shape (n,) or None
        Acceleration, where the measured force is that of the drive.
    per : array, shape (n,) or None
        Normal force, where the signal is the friction coefficient [N].
    measured : array, shape (m,)
        The signal to reproduce, decimated as `rows` does.
    t : array, shape (m,)
        Its instants [s].
    filter : InverseModelSettings or None
        Filter that both sides of the equation see; None: none.
    stride : int
        Samples of the record from one to the next.
    """

    record: Record
    inputs: Mapping[str, Array]
    between: Between
    x: Array
    a: Array | None
    per: Array | None
    measured: Array
    t: Array
    filter: InverseModelSettings | None
    stride: int = 1

    @property
    def step(self) -> float:
        """Sampling interval [s]."""
        return self.stride * self.record.Ts

    def thinned(self, stride: int) -> Piece:
        """Every so many samples of a piece that is driven on straight lines and not filtered."""
        inputs = {name: values[::stride] for name, values in self.inputs.items()}
        per = None if self.per is None else self.per[::stride]
        some = replace(self, inputs=inputs, x=self.x[::stride], per=per, stride=stride)
        return replace(some, measured=self.measured[::stride], t=self.t[::stride])

    def run(
        self, drive: Drive, outputs: Sequence[str], start: Mapping[str, StartValue], tolerance: float | None = None
    ) -> Array:
        """Outputs of a block at the samples, shape (n, len(outputs))."""
        if self.between == "linear":
            return drive.run(self.inputs, outputs, self.step, between="linear", start=start, tolerance=tolerance)
        if self.between == "halves":
            nearer = {name: np.repeat(values, 2)[1:] for name, values in self.inputs.items()}
            return drive.run(nearer, outputs, 0.5 * self.step, start=start, tolerance=tolerance)[::2]
        # the step that ends at a sample takes its values, also at the first one
        inputs = {name: np.append(values, values[-1]) for name, values in self.inputs.items()}
        return drive.run(inputs, outputs, self.step, start=start, tolerance=tolerance)[1:]

    def rows(self, signal: Array) -> Array:
        """What is left of a signal of shape (n,) or (n, columns) behind the filter."""
        if self.filter is None:
            return signal
        return decimate(signal[self.filter.border :], self.filter.decimation)

    def predicted(self, F: Array, M: float, OF: float) -> Array:
        """The signal for this friction force, mass and offset."""
        if self.per is not None:
            return (F + OF) / self.per
        return self.rows(F + OF if self.a is None else F + M * self.a + OF)

    @property
    def reciprocating(self) -> bool:
        """Whether the contact slides to and fro, so that an offset of the force shows."""
        v = self.inputs["v"]
        fast = 0.1 * float(np.max(np.abs(v)))
        return min(float(np.mean(v > fast)), float(np.mean(v < -fast))) > 0.05


def signal_of(records: Sequence[Record]) -> tuple[str, str]:
    """Return name and unit of the signal that is fitted: mu, friction or force.

    Raises
    ------
    RecordError
        A record has neither, or not the same ones as the others.
    """
    if all(record.friction is not None for record in records):
        if all(record.normal is not None for record in records):
            return "mu", "1"
        return "friction", records[0].units.force
    for record in records:
        if record.force is None:
            raise RecordError(
                f"The record {record.name!r} has neither friction nor force; give the column that is to be explained."
            )
    return "force", records[0].units.force


def prepare(record: Record, model: ContactModel, signal: str, settings: InverseModelSettings | None = None) -> Piece:
    """Make a piece of a record.

    Parameters
    ----------
    record : Record
        Motion and forces.
    model : ContactModel
        Tells whether the path alone matters.
    signal : str
        As from `signal_of`.
    settings : InverseModelSettings, optional
        Filter of the motion and, for the force of a drive, of both sides of the equation.

    Returns
    -------
    Piece
        Driven by the measured velocity, on straight lines. Without one: a force that depends on the path only is
        driven along the measured path exactly, with the difference quotient held over each interval; any other one
        with the velocity of the filtered position.

    Raises
    ------
    RecordError
        The contact opens (normal force not positive), or the record is too short for the filter.
    """
    filter_ = settings if settings is not None else default_settings(record)
    inputs: dict[str, Array] = {}
    a: Array | None = None
    between: Between = "linear"
    used: InverseModelSettings | None = None
    if signal == "force":
        used = filter_
        if record.q is not None:
            motion = filtered_motion(record, filter_)
            v, a = motion.v, motion.a
        else:
            v = record.column("v")
            a = np.gradient(v, record.Ts)
        if not model.static:
            # way and force at each sample are of second order, as with straight lines, and a bristle model has exact
            # steps for it; the later value would make sigma1 smaller by about sigma0 Ts/2
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
    piece = Piece(record, inputs, between, x, a, per, np.zeros(0), record.t, used)
    column = record.column("force" if signal == "force" else "friction")
    measured = column / per if per is not None else piece.rows(column)
    t = record.t if used is None else _kept(record.t[used.border :], used.decimation)
    return replace(piece, measured=measured, t=t)


def default_settings(record: Record) -> InverseModelSettings:
    """The filter of the EMPS record, at other sampling rates in the same place below the Nyquist frequency, but not
    above its 100 Hz."""
    rate = 1.0 / record.Ts
    cutoff = min(100.0, 0.1 * rate)
    return InverseModelSettings(cutoff=cutoff, decimation=max(1, round(rate / cutoff)))


def traits(pieces: Sequence[Piece], scale: float = 1.0) -> Traits:
    """Look at the data: what a friction law's parameters are about.

    Parameters
    ----------
    pieces : sequence of Piece
        The records.
    scale : float
        Force that corresponds to 1 of the signal: the mean normal force where the signal is mu.

    Raises
    ------
    RecordError
        Nothing moves, or the signal is zero.
    """
    v, x, y = [], [], []
    for piece in pieces:
        columns = np.column_stack([piece.inputs["v"], piece.x])
        kept = piece.rows(columns)
        v.append(kept[:, 0])
        x.append(kept[:, 1])
        force = piece.measured * scale
        if piece.a is not None:
            force = _without_inertia(piece, kept[:, 0])
        y.append(force)
    speed = np.concatenate(v)
    force = np.concatenate(y)
    top = float(np.max(np.abs(speed)))
    if top == 0.0 or not np.any(force):
        raise RecordError(
            f"The record {pieces[0].record.name!r} has no motion or no force; give one in which the contact moves."
        )
    moving = np.abs(speed) > 0.3 * top
    level = float(np.median(np.abs(force[moving])))
    level = level if level > 0.0 else float(np.max(np.abs(force)))
    fast = np.abs(speed[moving])
    viscous = 0.0
    if np.ptp(fast) > 0.0:
        # reversals make force and speed grow together, too: at most half of the force is taken for viscous
        slope = float(np.polyfit(fast, np.abs(force[moving]), 1)[0])
        viscous = min(max(0.0, slope), 0.5 * level / top)
    stiffness, damping = _presliding(v, x, y, level)
    return Traits(
        level=level - viscous * float(np.median(fast)),
        peak=float(np.quantile(np.abs(force), 0.98)),
        viscous=viscous if viscous > 0.0 else 0.01 * level / top,
        stiffness=stiffness,
        damping=damping,
        speed=top,
    )


def _presliding(v: Sequence[Array], x: Sequence[Array], y: Sequence[Array], level: float) -> tuple[float, float]:
    """Stiffness and damping of the small-signal response: dF = sigma0 dx + sigma1 dv while the force is far from the
    level of sliding."""
    rows, forces = [], []
    for velocity, position, force in zip(v, x, y, strict=True):
        dx, dv, dF = np.diff(position), np.diff(velocity), np.diff(force)
        far = (np.abs(force[1:]) < 0.6 * level) & (dx != 0.0)
        rows.append(np.column_stack([dx[far], dv[far]]))
        forces.append(dF[far])
    A, b = np.concatenate(rows), np.concatenate(forces)
    reach = max(float(np.ptp(position)) for position in x)
    least = 2.0 * level / reach if reach > 0.0 else 1.0
    stiffness, damping = least, 0.0
    if len(b) >= 3:
        length = np.linalg.norm(A, axis=0)
        length[length == 0.0] = 1.0
        solution = np.linalg.lstsq(A / length, b, rcond=None)[0] / length
        # differences of noise say nothing: the ratio of the sums is what remains of many small steps
        stiffness = max(float(solution[0]), least)
        damping = max(float(solution[1]), 0.0)
    top = max(float(np.max(np.abs(velocity))) for velocity in v)
    return stiffness, damping if damping > 0.0 else 0.01 * level / top


def _without_inertia(piece: Piece, v: Array) -> Array:
    """The drive force less mass times acceleration and offset, by least squares with Coulomb and viscous friction."""
    assert piece.a is not None
    a = piece.rows(piece.a)
    sign = piece.rows(np.sign(piece.inputs["v"]))
    A = np.column_stack([a, np.ones_like(a), v, sign])
    length = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    solution = np.linalg.lstsq(A / length, piece.measured, rcond=None)[0] / length
    rest: Array = piece.measured - A[:, :2] @ solution[:2]
    return rest


def inertia_guess(pieces: Sequence[Piece]) -> tuple[float, float]:
    """Start values of mass and offset: least squares with Coulomb and viscous friction."""
    rows, forces = [], []
    for piece in pieces:
        assert piece.a is not None
        v = piece.inputs["v"]
        rows.append(piece.rows(np.column_stack([piece.a, np.ones_like(v), v, np.sign(v)])))
        forces.append(piece.measured)
    A = np.concatenate(rows)
    length = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    solution = np.linalg.lstsq(A / length, np.concatenate(forces), rcond=None)[0] / length
    return float(solution[0]), float(solution[1])


def _normal(record: Record) -> Array:
    normal = record.column("normal")
    if np.min(normal) <= 0.01 * float(np.mean(np.abs(normal))):
        raise RecordError(
            f"The normal force of the record {record.name!r} is {np.min(normal):g} N at "
            f"{record.t[int(np.argmin(normal))]:g} s; cut a window in which the contact is loaded."
        )
    return normal


def _kept(t: Array, factor: int) -> Array:
    return t[(len(t) - 1) % factor :: factor]
