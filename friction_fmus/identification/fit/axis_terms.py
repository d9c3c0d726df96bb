"""What acts on an axis beside a friction model: gravity of an arm, and what changes the level of the friction.

The drive force of the axis is

    gain F_drive = M a + OF + G_sin sin q + G_cos cos q - load + F(v, Fn),
    Fn / Fn0     = (1 + |a_external F_external - a_drive F_drive| / Fc) (1 + direction sgn v) (1 + drift (t - t0))
                   (1 + warming (T - T0)),

where F_external acts on the axis from outside, t0 is the middle of the records, and T0 the mean of their temperatures:
a contact under load as in `TransmissionLoad` (M. Duclusaud, G. Passault, V. Padois, O. Ly, ICRA 2025), Fc at no load.
"""

from collections.abc import Mapping, Sequence
from math import inf
from typing import Final

import numpy as np

from friction_fmus.blocks.axis_units import AxisUnits
from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.fit.simulation_data import PreparedSegment

TERMS: Final[Mapping[str, tuple[str, ...]]] = {
    "gravity": ("G_sin", "G_cos"),
    "load": ("a",),
    "sides": ("a_drive", "a_external"),
    "direction": ("direction",),
    "drift": ("drift",),
    "temperature": ("warming",),
    "gain": ("gain",),
}
"""Values of each term; a stands for both coefficients of the load."""

CANDIDATES: Final = ("gravity", "load", "direction", "temperature", "drift")  # terms that are tried

OF_FRICTION: Final = ("load", "sides", "direction", "drift", "temperature")  # terms that need a model with normal force

VALUES: Final = frozenset(name for names in TERMS.values() for name in names)

#: Ranges of values. With a = 1, the drive force would be its own friction, which fits every record.
LIMITS: Final[Mapping[str, tuple[float, float]]] = {
    **dict.fromkeys(("a", "a_drive", "a_external"), (0.0, 0.5)),
    "direction": (-0.8, 0.8),
    "gain": (0.0, inf),
}

LEAST: Final = 1e-3  # normal force over Fn0 that is left by direction and drift


def term_units(units: AxisUnits) -> dict[str, str]:
    """Return the units of the values."""
    return {**dict.fromkeys(VALUES, "1"), "G_sin": units.force, "G_cos": units.force, "drift": "1/s", "warming": "1/K"}


def force_beside(values: Mapping[str, float], segment: PreparedSegment) -> Array:
    """Return the force that the drive needs beside inertia, offset and friction, shape (n,)."""
    record = segment.record
    found = np.zeros(len(record)) if record.load is None else -record.load
    if values.get("G_sin") or values.get("G_cos"):
        q = record.column("q")
        found = found + values.get("G_sin", 0.0) * np.sin(q) + values.get("G_cos", 0.0) * np.cos(q)
    return found


def relative_load(values: Mapping[str, float], segment: PreparedSegment, level: float) -> Array | None:
    """Return Fn over Fn0 along a segment for the friction `level` without load; None if nothing changes it."""
    if values.keys().isdisjoint({name for term in OF_FRICTION for name in TERMS[term]}):
        return None
    both = values.get("a", 0.0)
    external = -force_beside(values, segment) - values.get("OF", 0.0)
    drive = values.get("gain", 1.0) * segment.drive
    loaded = np.abs(values.get("a_external", both) * external - values.get("a_drive", both) * drive)
    found = 1.0 + loaded / level
    found *= 1.0 + values.get("direction", 0.0) * np.sign(segment.inputs["v"])
    found *= 1.0 + values.get("drift", 0.0) * (segment.record.t - segment.middle)
    if values.get("warming"):
        found *= 1.0 + values["warming"] * (segment.record.column("temperature") - segment.warm)
    return np.maximum(found, LEAST)


def middle_of(records: Sequence[Record]) -> float:
    """Return the time in the middle of records [s], from which drift counts."""
    return float(0.5 * (min(record.t[0] for record in records) + max(record.t[-1] for record in records)))


def mean_temperature(records: Sequence[Record]) -> float:
    """Return the mean temperature of records [K], from which warming counts; 0 if it is not known."""
    known = [record.temperature for record in records if record.temperature is not None]
    return float(np.mean(np.concatenate(known))) if known else 0.0


def sizes_of(segments: Sequence[PreparedSegment], level: float) -> dict[str, float]:
    """Return typical sizes of the values."""
    span = max(segment.record.t[-1] - segment.middle for segment in segments)
    rates = {"drift": 0.1 / max(span, 1e-9), "warming": 0.01}
    return {**dict.fromkeys(VALUES, 0.1), "G_sin": level, "G_cos": level, **rates, "gain": 1.0}
