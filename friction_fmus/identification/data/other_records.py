"""Records without a drive force over time: steady speeds, coasting, and a free pendulum."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from friction_fmus.blocks.axis_units import LINEAR, ROTARY, units_of_channels
from friction_fmus.errors import AmbiguousColumnsError, RecordError
from friction_fmus.identification.data.column_choice import NO_DRIVE
from friction_fmus.identification.data.column_guess import Guesser
from friction_fmus.identification.data.mapping import Column, DataMapping, combined_unit, with_gain
from friction_fmus.identification.data.motion_tests import smoothed, without_jumps
from friction_fmus.identification.data.record import Array, Record, axis_units, factor, fits, unit_of
from friction_fmus.identification.data.tables import DataTable

FEWEST: Final = 6  # fewest steady speeds
MOST: Final = 5000  # most rows of a table of steady speeds
FIT: Final = 0.8  # least share of the variance that friction explains
WIDTH: Final = 4.0  # width of the filter before the derivative [samples]
LEAST: Final = 60  # fewest samples of a free motion


@dataclass(frozen=True)
class OtherRecord:
    """Friction over velocity from a record without a drive force over time."""

    record: Record
    columns: Mapping[str, Column]
    lines: tuple[tuple[str, str], ...]  # what was understood, as subject and text


def other_record(table: DataTable, known: DataMapping, refusal: AmbiguousColumnsError) -> OtherRecord:
    """Return what a file shows that has no drive force over time; raise the refusal if it shows nothing."""
    guesser = Guesser(table)
    kinds = guesser.about
    named = {
        kind: [name for name, each in kinds.items() if each.kind == kind and each.qualifier in ("", "actual")]
        for kind in ("time", "position", "velocity", "force")
    }
    forces = [name for name, each in kinds.items() if each.kind == "force"]
    one = {kind: found[0] for kind, found in named.items() if len(found) == 1}
    found = None
    if not named["time"] and not table.clocks and {"velocity", "force"} <= one.keys() and not table.period:
        found = _steady(table, known, *(Column(one[kind], kinds[one[kind]].unit) for kind in ("velocity", "force")))
    elif "time" in one and not forces and kinds[one["time"]].unit:
        scale = unit_of(kinds[one["time"]].unit)
        t = table.columns[one["time"]] * (scale.factor if scale is not None else 1.0)
        if "velocity" in one and not named["position"]:
            found = _coasting(table, known, t, one["time"], Column(one["velocity"], kinds[one["velocity"]].unit))
        elif "position" in one:
            found = _pendulum(table, known, t, one["time"], Column(one["position"], kinds[one["position"]].unit))
    if found is None:
        raise refusal
    if known.gain and "friction" not in found.columns:
        raise RecordError(NO_DRIVE.format(table.file, known.gain))
    return found


def _steady(table: DataTable, known: DataMapping, speed: Column, force: Column) -> OtherRecord | None:
    """Return friction at steady speeds, without the offset of the drive if both directions were measured."""
    v, F = table.columns[speed.column], table.columns[force.column]
    good = np.isfinite(v) & np.isfinite(F) & (v != 0.0)
    order = np.argsort(v[good], kind="stable")
    v, F = v[good][order], F[good][order]
    unit, own = unit_of(speed.unit), unit_of(force.unit) if force.unit else None
    if not FEWEST <= len(v) <= MOST or unit is None or not fits("velocity", unit):
        return None
    si = axis_units("velocity", unit) or LINEAR
    if known.gain:
        force = with_gain(force, known.gain, si)
        gain, own = combined_unit("force", force, "--gain")
        F = gain * F
    scaled = own is not None and factor("force", own, si) is not None
    units = si if scaled else units_of_channels(si.position, force.unit or "1")
    v, F = unit.factor * v, (own.factor if own is not None and scaled else 1.0) * F
    both = bool(np.any(v > 0.0) and np.any(v < 0.0))
    A = np.column_stack([np.sign(v), v, *([np.ones_like(v)] if both else [])])
    theta = np.linalg.lstsq(A, F, rcond=None)[0]
    if np.sum((F - A @ theta) ** 2) > (1.0 - FIT) * np.sum((F - np.mean(F)) ** 2):
        return None
    offset = float(theta[2]) if both else 0.0
    at = np.arange(float(len(v)))
    record = Record(known.name, at, v=v, friction=F - offset, units=units, citation=known.citation, steady=True)
    what = f"{len(v)} steady speeds from {v.min():.3g} to {v.max():.3g} {units.velocity}, no time: static models only"
    named = (("velocity", speed), (units.words.force, force))
    lines = [*((subject, f"{each.column!r} [{each.unit}]") for subject, each in named), ("record", what)]
    lines += [("offset", f"{offset:.4g} {units.force}, subtracted")] if both else []
    columns = {"time": Column("", period="1 s"), "velocity": speed, "friction": force}
    return OtherRecord(record, columns, tuple(lines))


def _used(clock: str, subject: str, column: Column) -> tuple[tuple[str, str], ...]:
    """Return the lines about the columns of a free motion."""
    return ("time", repr(clock)), (subject, f"{column.column!r} [{column.unit}]")


def _even(t: Array, values: Array) -> tuple[Array, Array] | None:
    """Return times at equal steps and values; None if they are too few or too irregular."""
    good = np.isfinite(t) & np.isfinite(values)
    t, values = t[good], without_jumps(values[good])
    if len(t) < LEAST or np.any(np.diff(t) <= 0.0):
        return None
    even = np.linspace(t[0], t[-1], len(t))
    return even, np.interp(even, t, values)


def _coasting(table: DataTable, known: DataMapping, t: Array, clock: str, speed: Column) -> OtherRecord | None:
    """Return friction over inertia of a coasting axis: its deceleration."""
    unit, even = unit_of(speed.unit), _even(t, table.columns[speed.column])
    if unit is None or not fits("velocity", unit) or even is None:
        return None
    t, v = even[0], unit.factor * even[1]
    v = v * np.sign(v[0])
    smooth = smoothed(v, WIDTH)
    moving = smooth > 0.03 * smooth.max()
    end = int(np.argmin(moving)) if not moving.all() else len(v)
    edge = round(3.0 * WIDTH)
    if end < LEAST or np.mean(np.diff(smooth[:end]) < 0.0) < 0.95 or smooth[end - 1] > 0.5 * smooth[0]:
        return None
    friction = -smoothed(v, WIDTH, order=1) * (len(t) - 1) / (t[-1] - t[0])
    kept = slice(edge, end - edge)
    position = (axis_units("velocity", unit) or LINEAR).position
    units = units_of_channels(position, f"{position}/s2")
    record = Record(known.name, t[kept], v=smooth[kept], friction=friction[kept], units=units, citation=known.citation)
    lines = (
        *_used(clock, "velocity", speed),
        ("record", "the axis coasts without a drive: friction and offset over inertia, static models only"),
        ("result", f"in {units.force}: multiply by the inertia for {'N.m' if position == 'rad' else 'N'}"),
    )
    return OtherRecord(record, {"time": Column(clock, "s"), "velocity": speed}, lines)


def _pendulum(table: DataTable, known: DataMapping, t: Array, clock: str, angle: Column) -> OtherRecord | None:
    """Return friction over m g l of a free pendulum."""
    unit, even = unit_of(angle.unit), _even(t, table.columns[angle.column])
    if unit is None or not fits("position", unit) or axis_units("position", unit) != ROTARY or even is None:
        return None
    t, q = even[0], unit.factor * even[1]
    rate = (len(t) - 1) / (t[-1] - t[0])
    v, a = smoothed(q, WIDTH, order=1) * rate, smoothed(q, WIDTH, order=2) * rate**2
    q = smoothed(q, WIDTH)
    moving = np.abs(v) > 0.02 * np.abs(v).max()
    A = np.column_stack([np.sin(q), np.cos(q), np.sign(v), v])
    theta = np.linalg.lstsq(A[moving], -a[moving], rcond=None)[0]
    left = np.sum((a + A @ theta)[moving] ** 2) / np.sum((a[moving] - np.mean(a[moving])) ** 2)
    turns = np.count_nonzero(np.diff(np.sign(v[moving])) != 0)
    stiffness = float(np.hypot(theta[0], theta[1]))
    half = len(q) // 2
    if left > 1.0 - FIT or turns < 4 or not np.std(q[half:]) < 0.98 * np.std(q[:half]):
        return None
    friction = -(a + A[:, :2] @ theta[:2]) / stiffness
    edge = round(3.0 * WIDTH)
    kept = np.flatnonzero(moving)
    last = int(kept[kept < len(q) - edge][-1])
    inside = slice(edge, last)
    units = units_of_channels("rad", "1")
    record = Record(known.name, t[inside], v=v[inside], friction=friction[inside], units=units, citation=known.citation)
    lines = (
        *_used(clock, "position", angle),
        ("record", f"a free pendulum, {stiffness**0.5 / (2.0 * np.pi):.4g} Hz in small motions: static models only"),
        ("result", "friction over m g l, without unit: multiply by m g l for N.m"),
    )
    return OtherRecord(record, {"time": Column(clock, "s"), "position": angle}, lines)
