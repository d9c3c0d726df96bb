"""Record of an axis or a contact, the input of every identification: quantities, findings and the record itself."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from friction_fmus.blocks.axis_units import LINEAR, ROTARY, AxisUnits
from friction_fmus.errors import RecordError
from harness.units import LONGEST_UNIT, BaseUnit, parse_unit


class RecordWarning(UserWarning):
    """Warning about a problem in a record; the text starts with the name of the finding."""


@dataclass(frozen=True)
class RecordFinding:
    """Finding about a record.

    Attributes
    ----------
    name : str
        Stable name, such as ``no-reversal``.
    what : str
        Description with numbers, in one sentence.
    measure : str
        Advice on what to measure or change, in one sentence.
    """

    name: str
    what: str
    measure: str

    def __str__(self) -> str:
        return f"{self.name}: {self.what} {self.measure}"


Array: TypeAlias = NDArray[np.float64]

JITTER = 0.01  # largest relative deviation of a sampling interval from the mean


#: Columns of a record; all except the time are optional.
COLUMNS = ("t", "q", "v", "reference", "force", "friction", "normal", "injected", "load", "temperature")


@dataclass(frozen=True, eq=False)
class Record:
    """Motion and forces of an axis or a contact, sampled at equal intervals.

    Parameters
    ----------
    name : str
        Name in reports and error messages.
    t : array, shape (n,)
        Time [s], increasing, equally spaced within 1 %.
    q : array, shape (n,), optional
        Measured position, in `units.position`.
    reference : array, shape (n,), optional
        Reference position, in `units.position`.
    force : array, shape (n,), optional
        Drive force or torque, in `units.force`.
    v : array, shape (n,), optional
        Measured velocity, in `units.velocity`.
    friction : array, shape (n,), optional
        Measured friction force, in `units.force`; positive for a positive velocity.
    normal : array, shape (n,), optional
        Measured normal force [N].
    units : AxisUnits
        Units of the axis.
    citation : str
        Citation of the data.
    quantum : float
        Resolution of the position measurement, in `units.position`; 0 if unknown.
    injected : array, shape (n,), optional
        Force added to that of the servo from outside, in `units.force`; `force` does not contain it, see
        `with_total_force`.
    load : array, shape (n,), optional
        Known force on the axis from outside, positive forward, such as the gravity of a rigid-body model, in
        `units.force`.
    temperature : array, shape (n,), optional
        Temperature of the machine [K], of which only differences matter, so that degrees Celsius are as good.
    held : bool
        Whether the forces are commands that the drive holds from one sample to the next, instead of values at the
        samples.
    steady : bool
        Whether each sample is a steady speed of its own; the time counts them.

    Raises
    ------
    RecordError
        If position and velocity are missing, lengths differ, there are fewer than 3 samples, NaN or infinite samples,
        or the time is not increasing and equally spaced.
    """

    name: str
    t: Array
    q: Array | None = None
    reference: Array | None = None
    force: Array | None = None
    v: Array | None = None
    friction: Array | None = None
    normal: Array | None = None
    units: AxisUnits = LINEAR
    citation: str = ""
    quantum: float = 0.0
    injected: Array | None = None
    load: Array | None = None
    temperature: Array | None = None
    held: bool = False
    steady: bool = False

    def __post_init__(self) -> None:
        columns = {}
        for column in COLUMNS:
            if (given := getattr(self, column)) is None:
                continue
            try:
                values = np.array(given, dtype=np.float64).ravel()
            except (TypeError, ValueError) as error:
                raise RecordError(
                    f"Column {column!r} of the record {self.name!r} is not numeric; give an array of numbers."
                ) from error
            values.flags.writeable = False
            columns[column] = values
            object.__setattr__(self, column, values)

        if self.q is None and self.v is None:
            raise RecordError(f"The record {self.name!r} has neither position nor velocity; give one of them.")
        lengths = {column: len(values) for column, values in columns.items()}
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"{column} {length}" for column, length in lengths.items())
            raise RecordError(
                f"The columns of the record {self.name!r} have different lengths ({listed}); make them equal."
            )
        if lengths["t"] < 3:
            raise RecordError(f"The record {self.name!r} has {lengths['t']} samples; use at least 3.")
        for column, values in columns.items():
            bad = np.flatnonzero(~np.isfinite(values))
            if bad.size:
                raise RecordError(
                    f"Column {column!r} of the record {self.name!r} has {bad.size} NaN or infinite "
                    f"samples, the first at index {bad[0]}; remove or interpolate them."
                )
        steps = np.diff(columns["t"])
        if np.any(steps <= 0):
            raise RecordError(
                f"The time of the record {self.name!r} does not increase at index "
                f"{int(np.argmax(steps <= 0)) + 1}; sort the samples and remove duplicates."
            )
        off = np.abs(steps / self.Ts - 1.0)
        if np.any(off > JITTER):
            raise RecordError(
                f"The record {self.name!r} is not equally spaced (interval "
                f"{steps[int(np.argmax(off))]:.6g} s after index {int(np.argmax(off))}, mean {self.Ts:.6g} "
                "s); resample it."
            )

    @property
    def clock(self) -> str:
        """Label of the time in a figure."""
        return "steady speeds, in order" if self.steady else "time [s]"

    @property
    def Ts(self) -> float:  # noqa: N802 (the symbol of the sample time)
        """Mean sample time [s]."""
        return float((self.t[-1] - self.t[0]) / (len(self.t) - 1))

    def __len__(self) -> int:
        return len(self.t)

    def column(self, name: str) -> Array:
        """Return a required column.

        Parameters
        ----------
        name : str
            One of `COLUMNS`.

        Returns
        -------
        array, shape (n,)
            Values of the column.

        Raises
        ------
        RecordError
            If the record does not have the column.
        """
        values: Array | None = getattr(self, name)
        if values is None:
            raise RecordError(f"The record {self.name!r} has no column {name!r}, which is required; add it.")
        return values

    def with_total_force(self) -> Record:
        """Return the record with the injected force added to the drive force, and without the column for it.

        Returns
        -------
        Record
            This record if it has no drive force or no injected force.
        """
        if self.force is None or self.injected is None:
            return self
        return replace(self, force=self.force + self.injected, injected=None)

    def without_load(self) -> Record:
        """Return the record with the known force from outside added to the drive force, and without its column.

        Returns
        -------
        Record
            This record if it has no drive force or no load.
        """
        if self.force is None or self.load is None:
            return self
        return replace(self, force=self.force + self.load, load=None)

    def force_at_samples(self) -> Array:
        """Return the total drive force to which the acceleration at each sample belongs.

        Returns
        -------
        array, shape (n,)
            For a held force, the mean of its values before and after the sample.
        """
        force = self.with_total_force().column("force")
        return 0.5 * (force + np.append(force[0], force[:-1])) if self.held else force

    def window(self, begin: float, end: float) -> Record:
        """Return the samples with begin <= t <= end.

        Parameters
        ----------
        begin, end : float
            Start and end of the window [s].

        Returns
        -------
        Record
            Record with the samples in the window.

        Raises
        ------
        RecordError
            If fewer than 3 samples are in the window.
        """
        inside = (self.t >= begin) & (self.t <= end)
        if np.count_nonzero(inside) < 3:
            raise RecordError(
                f"The window {begin:g} .. {end:g} s has fewer than 3 samples of the record {self.name!r}, which "
                f"extends from {self.t[0]:g} to {self.t[-1]:g} s; choose another one."
            )
        columns = {name: getattr(self, name) for name in COLUMNS}
        return replace(self, **{name: values[inside] for name, values in columns.items() if values is not None})


class Role(NamedTuple):
    """What a column of a data file can be: physical quantity, column of a record, example of a unit."""

    quantity: str
    field: str
    example: str


ROLES: Final[Mapping[str, Role]] = {
    "time": Role("time", "t", "s"),
    "position": Role("position", "q", "mm"),
    "velocity": Role("velocity", "v", "mm/s"),
    "reference": Role("position", "reference", "mm"),
    "force": Role("force", "force", "N"),
    "friction": Role("force", "friction", "N"),
    "normal": Role("normal", "normal", "N"),
    "injected": Role("force", "injected", "N"),
    "load": Role("force", "load", "N"),
    "temperature": Role("temperature", "temperature", "degC"),
}

_LONGEST = 2 * LONGEST_UNIT  # largest number of characters of a number with a unit

DRIVE_UNITS = {
    **dict.fromkeys(("1/min", "min-1", "min^-1"), "rpm"),
    **dict.fromkeys(("Sek", "sek", "Sekunden", "Sekunde"), "s"),
    **{"Grad": "deg", "grad": "deg", "Grad/s": "deg/s", "U": "rev", "Umdr": "rev", "°/s": "deg/s"},
    **{"Arms": "A", "A_rms": "A", "A rms": "A", "Aeff": "A", "rps": "rev/s"},
    **dict.fromkeys(("qc", "inc", "incr", "increments", "Ink", "Inkremente", "count", "counts", "cnt", "cts"), "1"),
    **dict.fromkeys(("pulse", "pulses", "pls", "puls", "ticks", "steps", "LSB", "digit", "digits"), "1"),
}
"""Units as drives write them, which mean something else or nothing in a model."""

PER_MILLE = ("‰", "permille", "per mille", "0.1%", "0.1 %")

_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)")


def unit_of(text: str) -> BaseUnit | None:
    """Return the base unit of a unit such as ``mm``, ``N.m``, ``rpm``; None if the unit is unknown."""
    symbol = DRIVE_UNITS.get(text.strip(), text)
    if symbol in PER_MILLE:
        return BaseUnit(factor=1e-3)
    return parse_unit(symbol)


def wanted_unit(role: str, units: AxisUnits) -> str:
    """Return the unit of a role, such as ``position``, in a record."""
    return {
        "time": "s",
        "position": units.position,
        "velocity": units.velocity,
        "force": units.force,
        "normal": LINEAR.force,
        "temperature": "K",
    }[ROLES[role].quantity]


def fits(role: str, unit: BaseUnit) -> bool:
    """Return whether a unit is valid for a role, on a linear or a rotary axis."""
    return any(unit.exponents == _exponents(wanted_unit(role, units)) for units in (LINEAR, ROTARY))


def axis_units(role: str, unit: BaseUnit) -> AxisUnits | None:
    """Return the axis units implied by the unit of a position, velocity or reference; None for other roles."""
    if ROLES[role].quantity not in ("position", "velocity"):
        return None
    return LINEAR if unit.exponents == _exponents(wanted_unit(role, LINEAR)) else ROTARY


def factor(role: str, unit: BaseUnit, units: AxisUnits) -> float | None:
    """Return the conversion factor from a unit to the unit of the record; None if the quantities differ."""
    return unit.factor if unit.exponents == _exponents(wanted_unit(role, units)) else None


def parse_quantity(text: str | float, where: str, form: str = "35.15 N/V") -> tuple[float, BaseUnit]:
    """Return number and unit of a text of this form; a number alone has the unit 1."""
    given = str(text)
    match = _NUMBER.fullmatch(given) if len(given) <= _LONGEST and not isinstance(text, bool) else None
    unit = unit_of(match[2] or "1") if match else None
    if match is None or unit is None or not 0.0 < abs(float(match[1])) < math.inf:
        raise RecordError(
            f"{where} is {given[:_LONGEST]!r}, which is not a number with a known unit; use the form {form!r}."
        )
    return float(match[1]), unit


def times(a: BaseUnit, b: BaseUnit) -> BaseUnit:
    """Return the product of two units."""
    return BaseUnit(tuple(i + j for i, j in zip(a.exponents, b.exponents, strict=True)), a.factor * b.factor)


def _exponents(unit: str) -> tuple[int, ...]:
    known = parse_unit(unit)
    assert known is not None
    return known.exponents
