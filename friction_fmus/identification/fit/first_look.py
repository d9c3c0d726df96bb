"""Coulomb and viscous friction within a second, by least squares over sliding, before any model is simulated."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from friction_fmus.identification.data.motion_tests import smoothed
from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.fit.estimate import Estimate
from friction_fmus.identification.fit.scores import independent_samples

WIDTHS: Final = (0.8, 1.2, 2.0, 3.0, 5.0, 8.0, 12.0, 18.0, 25.0)  # widths of the smoothing [samples]
KEPT: Final = 0.5  # share of the samples in motion that the widest smoothing leaves
SLIDING: Final = 0.02  # fraction of the top speed above which the axis slides
LIGHT: Final = 3.0  # width of the smoothing of the speed that shows where the axis may stick [samples]
FEWEST: Final = 50  # fewest samples in sliding
APART: Final = 1e-3  # share of the derivative of the force that is no acceleration, speed or direction if it counts
LATE: Final = 0.5  # a delay is the cause if the residual with it is less than this part of the one without


def first_look(records: Sequence[Record]) -> dict[str, Estimate]:
    """Return M, Fc, Fv and OF of F = M a + Fc sgn(v) + Fv v + OF; empty without a drive force or enough sliding."""
    # A motion that never reverses shows only the sum Fc + OF, or the difference.
    #
    # Motion, direction and force pass the same Gaussian filter, the widest one that leaves most of the samples: noise
    # and rounding of the acceleration would make M too small and Fc too large. Samples whose filter reaches across a
    # reversal are left out, as the axis may stick there.
    if records[0].friction is not None and records[0].normal is None:
        return _of_friction(records)
    found: list[Array] = []
    for width in WIDTHS:
        parts = [part for record in records if (part := _rows(record.without_load(), width)) is not None]
        if not parts or (found and sum(map(len, parts)) < KEPT * len(found[0])):
            break
        found = [np.concatenate(parts), *parts] if not found else [found[0], *parts]
    if not found or sum(map(len, found[1:])) < FEWEST:
        return {}
    rows = np.concatenate(found[1:])
    units = records[0].units
    own = {"M": units.inertia, "Fc": units.force, "Fv": units.viscous, "OF": units.force}
    if not np.ptp(rows[:, 1]):
        own = {"M": units.inertia, f"Fc {'+' if rows[0, 1] > 0.0 else '-'} OF": units.force, "Fv": units.viscous}
    return _without_delay(rows[:, : len(own)], rows[:, 4], rows[:, 5], own, records[0].Ts)


def _without_delay(A: Array, F: Array, rate: Array, own: Mapping[str, str], Ts: float) -> dict[str, Estimate]:
    """Return the solution with the delay between force and motion as a further unknown, if it explains the rest."""
    # A command that is held or filtered, or a force that is logged late, is F - T dF/dt, which makes M and Fv wrong.
    # T dF/dt is the first term of what filters do; half of what it changes allows for the others. If the rest has other
    # causes, or in a sine of one frequency, half a sample, by which a command is held, is the allowance.
    found = plain = solved(A, F, own)
    if not plain:
        return {}
    change = np.linalg.lstsq(A, rate, rcond=None)[0] * Ts
    timed = np.column_stack([A, rate])
    rest = [np.linalg.norm(F - each @ np.linalg.lstsq(each, F, rcond=None)[0]) for each in (A, timed)]
    apart = np.linalg.norm(rate - A @ change / Ts) > APART * np.linalg.norm(rate)
    if apart and rest[1] < LATE * rest[0]:
        found = solved(timed, F, {**own, "delay": "s"})
        change = np.array([found[name].value - each.value for name, each in plain.items()])
    return {
        name: replace(found[name], standard_error=math.hypot(found[name].standard_error, 0.5 * each))
        for name, each in zip(own, change, strict=True)
    }


def _of_friction(records: Sequence[Record]) -> dict[str, Estimate]:
    """Return Fc and Fv of a measured friction force."""
    moving = [record for record in records if record.v is not None and record.friction is not None]
    if len(moving) < len(records):
        return {}
    v, F = (np.concatenate([record.column(name) for record in moving]) for name in ("v", "friction"))
    sliding = np.abs(v) > SLIDING * float(np.max(np.abs(v)))
    units = records[0].units
    rows = np.column_stack([np.sign(v), v])[sliding]
    return solved(rows, F[sliding], {"Fc": units.force, "Fv": units.viscous})


def solved(A: Array, F: Array, own: Mapping[str, str]) -> dict[str, Estimate]:
    """Return the least squares solution with standard errors by name, for units by name; empty if a column is zero."""
    length = np.linalg.norm(A, axis=0)
    if not np.all(length > 0.0):
        return {}
    theta = np.linalg.lstsq(A / length, F, rcond=None)[0] / length
    rest = F - A @ theta
    inverse = np.linalg.pinv((A / length).T @ (A / length)) / np.outer(length, length)
    samples = max(independent_samples([rest]) - A.shape[1], 1.0)
    errors = np.sqrt(np.maximum(np.diag(inverse), 0.0) * float(rest @ rest) / samples)
    return {
        name: Estimate(name, float(value), float(error), unit)
        for (name, unit), value, error in zip(own.items(), theta, errors, strict=True)
    }


def _rows(record: Record, width: float) -> Array | None:
    """Return filtered a, sgn(v), v, 1, force and its derivative in sliding, shape (n, 6); None if it is too short."""
    edge = round(4.0 * width)
    if len(record) < 2 * edge + FEWEST or record.force is None or record.friction is not None:
        return None

    def smooth(values: Array, order: int = 0) -> Array:
        return smoothed(values, width, order) / record.Ts**order

    signal, order = (record.q, 1) if record.q is not None else (record.column("v"), 0)
    v, a = smooth(signal, order), smooth(signal, order + 1)
    light = smoothed(signal, min(width, LIGHT), order)
    slow = np.abs(light) <= SLIDING * float(np.quantile(np.abs(light), 0.99))
    sliding = (np.abs(smooth(np.sign(light))) > 0.999) & (smooth(slow.astype(np.float64)) < 0.001)
    force = record.force_at_samples()
    rows = np.column_stack([a, np.sign(v), v, np.ones_like(v), smooth(force), smooth(force, 1)])
    inside = np.arange(len(v))
    return rows[sliding & (inside >= edge) & (inside < len(v) - edge)]
