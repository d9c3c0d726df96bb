"""Checks for implausible units and signs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.integrate import cumulative_trapezoid

from friction_fmus.identification.data.findings import Finding
from friction_fmus.identification.data.mapping import Column
from friction_fmus.identification.data.record import Array, Record

#: Largest plausible travel and speed of a machine, by unit of the position.
LARGEST = {"m": (100.0, 100.0), "rad": (1e6, 1e5)}

#: Ratio of two columns above which one of their units counts as wrong.
FACTOR = 3.0


def plausible(records: Sequence[Record], columns: Mapping[str, Column]) -> Iterator[Finding]:
    """Yield findings about units and signs of a measurement."""
    longest = max(records, key=len).with_total_force()
    yield from _velocity(longest)
    yield from _reference(longest)
    yield from _size(longest)
    yield from _turns(longest)
    yield from _sign(longest, columns)


def _velocity(record: Record) -> Iterator[Finding]:
    if record.q is None or record.v is None:
        return
    travelled = cumulative_trapezoid(record.v, record.t, initial=0)
    a, b = _without_line(record.q, record.t), _without_line(travelled, record.t)
    if not (np.any(a) and np.any(b)):
        return
    ratio = float(a @ b) / float(b @ b)
    if 1.0 / FACTOR < ratio < FACTOR:
        return
    units = record.units
    what = (
        f"The position [{units.position}] changes by {ratio:.3g} times the integral of the velocity [{units.velocity}]."
    )
    yield Finding("position-and-velocity-disagree", what, "Correct the unit or the sign of one of the two columns.")


def _reference(record: Record) -> Iterator[Finding]:
    if record.q is None or record.reference is None or not np.ptp(record.reference):
        return
    ratio = float(np.ptp(record.q) / np.ptp(record.reference))
    if 0.1 < ratio < 10.0:
        return
    what = f"The range of the position is {ratio:.3g} times the range of its reference."
    yield Finding("position-and-reference-disagree", what, "Correct the unit of one of the two columns.")


def _size(record: Record) -> Iterator[Finding]:
    distance, speed = LARGEST[record.units.position]
    found = float(np.ptp(record.q)) if record.q is not None else 0.0
    v = record.v if record.v is not None else np.gradient(record.column("q"), record.Ts)
    fast = float(np.quantile(np.abs(v), 0.99))
    if found <= distance and fast <= speed:
        return
    what = (
        f"The axis moves by {found:.3g} {record.units.position} at up to {fast:.3g} {record.units.velocity}, which is "
        "implausible."
    )
    yield Finding("implausible-motion", what, "Correct the unit of the position, of the velocity or of the time.")


def _turns(record: Record) -> Iterator[Finding]:
    """Yield a finding about an angle that wraps around after each turn, as from absolute encoders and resolvers."""
    if record.q is None or record.units.position != "rad":
        return
    jumps = np.abs(np.diff(record.q))
    jumps = jumps[jumps > np.pi]
    if jumps.size:
        what = f"The position jumps by {jumps.max():.4g} rad from one sample to the next, {_times(jumps.size)}."
        yield Finding("position-jumps", what, "Log a multi-turn position, or unwrap the angle.")


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _sign(record: Record, columns: Mapping[str, Column]) -> Iterator[Finding]:
    """Yield findings about signs: over whole cycles, the mean of drive or friction force times velocity is positive."""
    v = record.v if record.v is not None else np.gradient(record.column("q"), record.Ts)
    for role, force in (("force", record.force), ("friction", record.friction)):
        if force is None:
            continue
        power = (force - np.mean(force)) * v
        lost = float(np.mean(power))
        if lost < -0.2 * float(np.mean(np.abs(power))) < 0.0:
            heading = columns[role].column if role in columns else role
            what = (
                f"The sign of the {role} in column {heading!r} seems to be inverted: the contact would deliver power "
                f"({lost:.3g} W on average)."
            )
            other = -columns[role].sign if role in columns else -1
            yield Finding(f"{role}-of-other-sign", what, f"Set sign = {other} for this column.")


def _without_line(values: Array, t: Array) -> Array:
    """Return values minus their linear trend, which a velocity offset causes."""
    return np.asarray(values - np.polynomial.Polynomial.fit(t, values, 1)(t), dtype=np.float64)
