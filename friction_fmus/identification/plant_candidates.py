"""What a record shows of an axis beyond a rigid mass with the same friction in both directions.

The drive force is fitted by F = M a + h(|v|) sgn(v) + F0 with a free friction curve h, elements of presliding friction
and a delay (the derivative of the acceleration). Each candidate adds columns. It is found if these are significant, in
a Wald test with the covariance of coloured residuals, and explain enough of the force. A second mass adds the force f
of its spring over its mass, simulated along the measured motion x of the first one:

    f = w^2 s + 2 D w (x' - y'),  y'' = f - g sgn(y'),  s = x - y less the backlash.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import pi, sqrt
from typing import Final, TypeAlias

import numpy as np
import scipy.stats
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.record import Array, Record, RecordFinding
from friction_fmus.identification.fit.estimate import coloured_covariance, correlation_length
from friction_fmus.identification.fit.idim import InverseModelSettings, default_settings, derivative, filtered_motion
from friction_fmus.identification.fit.scores import rms

LEVEL: Final = 0.01  # significance level
DRIFTS: Final = 0.015  # part of the rms force that a drift must explain: 5 % of the force from begin to end
MATTERS: Final = 0.03  # part of the rms force that another candidate must explain
BIASED: Final = 0.04  # part of the rms force that a rigid mass leaves, above which a second one is searched
UNEQUAL: Final = 0.1  # constant force over Coulomb friction above which the directions differ
SPEEDS: Final = (0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0)  # nodes of the friction curve, over the largest speed
SLOW: Final = SPEEDS[1]  # speed over the largest one below which the axis may stick
PRESLIDING: Final = (1e-4, 2.5e-4, 6e-4, 1.5e-3, 4e-3, 1e-2, 2.5e-2)  # break-away distances of elements, over stroke
PROMISING, EXPLAINED = 0.85, 0.6  # parts of the residual that a second mass may leave after the first and last search
LIGHTEST: Final = 0.1  # part of the moved mass below which a second mass is not one
DAMPED: Final = 0.25  # damping ratio above which a second mass does not resonate
SATURATED: Final = 0.98  # part of the force limit above which a sample is saturated
RARE, OFTEN = 0.01, 0.1  # part of saturated samples up to which it does not matter, and above which no interval holds

Signals: TypeAlias = Mapping[str, Array]
"""t, q, v, a, jerk and sign of one record, shape (n,)."""

Trial: TypeAlias = tuple[float, float, float, float]
"""Parameters w, D, g of a second mass, and its backlash."""


@dataclass(frozen=True, eq=False)
class ForceBalance:
    """Filtered rows of the drive force, in which the axis moves, and the columns that explain it."""

    records: Sequence[Record]
    signals: Sequence[Signals]
    settings: InverseModelSettings
    moves: NDArray[np.bool_]
    force: Array
    lengths: Sequence[int]
    base: Array

    def rows(self, columns: Callable[[Signals], Iterable[Array]]) -> Array:
        """Return rows of columns that are computed from the signals of each record."""
        parts = [
            self.settings.rows(np.column_stack(list(columns(signals))), record.Ts)
            for record, signals in zip(self.records, self.signals, strict=True)
        ]
        return np.asarray(np.concatenate(parts)[self.moves])

    def rigid(self) -> Array:
        """Return mass, viscous and Coulomb friction, and constant force."""
        A = self.rows(lambda s: [s["a"], s["v"], s["sign"], np.ones_like(s["v"]), s["jerk"]])
        return np.asarray(np.linalg.lstsq(A, self.force, rcond=None)[0][:4])

    def left(self) -> float:
        """Return the rms force that the base leaves."""
        Q = _orthogonal(self.base)
        return rms(self.force - Q @ (Q.T @ self.force))

    def matters(self, columns: Array, least: float, trials: int = 1) -> Array | None:
        """Return the coefficients of base and columns, which were chosen from some trials; None if not found."""
        A = np.hstack([self.base, columns])
        length = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
        U, singular, right = np.linalg.svd(A / length, full_matrices=False)
        back = right.T / np.maximum(singular, 1e-9 * singular[0]) / length[:, None]
        theta: Array = back @ (U.T @ self.force)
        rest = self.force - A @ theta
        if sqrt(max(self.left() ** 2 - rms(rest) ** 2, 0.0)) < least * rms(self.force):
            return None
        count = columns.shape[1]
        C = coloured_covariance(back, U, rest, self.lengths, correlation_length(rest))[-count:, -count:]
        statistic = float(theta[-count:] @ np.linalg.pinv(C, hermitian=True) @ theta[-count:])
        return theta if trials * scipy.stats.chi2.sf(statistic, count) < LEVEL else None


def force_balance(records: Sequence[Record]) -> ForceBalance | None:
    """Return the rows of some records; None without position and drive force, or if they are too short."""
    if any(record.q is None or record.force is None or record.friction is not None for record in records):
        return None
    settings = default_settings(max(records, key=len))
    signals, moves, forces = [], [], []
    try:
        for record in records:
            settings.require(record, 2 * len(SPEEDS))
            m = filtered_motion(record, settings)
            jerk = derivative(m.a, record.Ts)
            signals.append({"t": record.t, "q": m.q, "v": m.v, "a": m.a, "jerk": jerk, "sign": np.sign(m.v)})
            slides = np.abs(m.v) > SLOW * float(np.max(np.abs(m.v)))
            moves.append(settings.rows(slides.astype(float), record.Ts) > 0.5)
            forces.append(settings.rows(record.force_at_samples(), record.Ts)[moves[-1]])
    except RecordError:
        return None
    lengths, top = [len(each) for each in forces], max(float(np.max(np.abs(each["v"]))) for each in signals)
    breaks = max(float(np.ptp(each["q"])) for each in signals) * np.array(PRESLIDING)
    force = np.concatenate(forces)
    if len(force) < 100 or not rms(force) or not top:
        return None

    def columns(s: Signals) -> list[Array]:
        over_speed = [s["sign"] * np.interp(np.abs(s["v"]) / top, SPEEDS, node) for node in np.eye(len(SPEEDS))]
        return [s["a"], np.ones_like(s["v"]), s["jerk"], *over_speed, *_elements(s["q"], breaks).T]

    found = ForceBalance(records, signals, settings, np.concatenate(moves), force, lengths, np.zeros((len(force), 0)))
    return replace(found, base=found.rows(columns))


def plant_findings(
    records: Sequence[Record], limit: float | None = None
) -> tuple[tuple[RecordFinding, ...], tuple[float, ...]]:
    """Return what records show of an axis beyond a rigid mass."""
    found, resonances = list(_saturation(records, limit)), []
    if (balance := force_balance(records)) is not None:
        gravity, balance = _gravity(balance)
        found += [*gravity, *_constant(balance), *_drift(balance)]
        for finding, resonance in _second_mass(balance):
            found.append(finding)
            resonances += [resonance] if resonance else []
    return tuple(found), tuple(resonances)


def _saturation(records: Sequence[Record], limit: float | None) -> Iterator[RecordFinding]:
    forces = [record.force for record in records if record.force is not None]
    if not forces:
        return
    force = np.concatenate(forces)
    at = np.abs(force) >= SATURATED * limit if limit else (force == np.max(force)) | (force == np.min(force))
    share = float(np.mean(at))
    if share < RARE or not np.ptp(force) or (not limit and np.mean(at[1:][at[:-1]]) < 0.5):
        return
    u = records[0].units.words
    level = limit or float(np.max(np.abs(force)))
    what = f"The drive {u.force} is at its limit of {level:.4g} {u.N} in {100 * share:.3g} % of the samples."
    trust = f"Do not trust the intervals of {u.mass} and friction. " if share > OFTEN else ""
    change = f"{trust}Record slower motion or raise the limit: no compensation acts while the drive saturates."
    yield RecordFinding("saturated", what, change)


def _constant(balance: ForceBalance) -> Iterator[RecordFinding]:
    """Yield a finding about a constant force, which acts in motion as Coulomb friction that differs by direction."""
    *_, Fc, offset = balance.rigid()
    u = balance.records[0].units.words
    without = replace(balance, base=np.delete(balance.base, 1, axis=1))
    if abs(offset) <= UNEQUAL * max(Fc, 0.0) or without.matters(balance.base[:, 1:2], MATTERS) is None:
        return
    if abs(offset) > Fc:
        what = f"A constant {u.force} of {offset:.3g} {u.N} acts, more than Coulomb friction ({Fc:.3g} {u.N})."
        yield RecordFinding("constant-force", what, f"Add this {u.force}, of gravity or a preload, to the drive.")
        return
    what = (
        f"Coulomb friction is {Fc + offset:.3g} {u.N} forward and {Fc - offset:.3g} {u.N} backward, or a constant "
        f"{u.force} of {offset:.3g} {u.N} acts; motion does not separate the two."
    )
    change = f"Add this constant {u.force} to the drive; it compensates both while the axis moves."
    yield RecordFinding("direction-dependent-friction", what, change)


def _drift(balance: ForceBalance) -> Iterator[RecordFinding]:
    """Yield findings about Coulomb friction and constant force that change linearly with time."""
    begin, end = balance.records[0].t[0], balance.records[-1].t[-1]
    u, (_, _, Fc, offset) = balance.records[0].units.words, balance.rigid()
    time = balance.rows(lambda s: [s["sign"] * (s["t"] - begin), s["t"] - begin]) / (end - begin)
    change = "Record the axis warmed up, or compensate with an estimator, which follows a drift."
    kinds = (("friction-drifts", "Coulomb friction", Fc), ("offset-drifts", f"A constant {u.force}", offset))
    for (name, what, mean), column in zip(kinds, time.T[:, :, None], strict=True):
        if (theta := balance.matters(column - (name == "offset-drifts") * 0.5, DRIFTS)) is not None:
            low, high = mean - 0.5 * theta[-1], mean + 0.5 * theta[-1]
            text = f"{what} changes from {low:.3g} to {high:.3g} {u.N} during the record."
            yield RecordFinding(name, text, change)


def _gravity(balance: ForceBalance) -> tuple[list[RecordFinding], ForceBalance]:
    """Return the finding about gravity on a rotary axis, and the balance without its force."""
    if balance.records[0].units.position != "rad":
        return [], balance
    columns = balance.rows(lambda s: [np.sin(s["q"]), np.cos(s["q"])])
    theta = balance.matters(columns, MATTERS)
    if theta is None:
        return [], balance
    size, u = float(np.hypot(*theta[-2:])), balance.records[0].units.words
    what = f"A {u.force} of {size:.3g} {u.N} times the sine of the angle acts, as gravity on an eccentric load."
    finding = RecordFinding("gravity", what, f"Add this {u.force} to the drive as a feedforward of the angle.")
    return [finding], replace(balance, force=balance.force - columns @ theta[-2:])


def _second_mass(balance: ForceBalance) -> Iterator[tuple[RecordFinding, float]]:
    """Yield the finding about a second mass behind a spring or a backlash, and its resonance; 0 for a backlash."""
    base, (M, _, Fc, _) = balance.left(), balance.rigid()
    if base < BIASED * rms(balance.force) or M <= 0.0:
        return
    slowing, cutoff = max(float(Fc / M), 0.0), 2.0 * pi * balance.settings.cutoff
    stroke = max(float(np.ptp(s["q"])) for s in balance.signals)
    some = slowing * np.array([0.0, 0.35, 0.7, 1.4])
    spring = _best(balance, product(np.geomspace(0.01, 0.3, 14) * cutoff, (0.03, 0.1), some, (0.0,)))
    loose = _best(balance, product((0.5 * cutoff,), (0.1,), some, stroke * np.geomspace(1e-4, 3e-2, 14)))
    left, chosen = min(spring, loose)
    if left > PROMISING * base:
        return
    for k in (0.12, 0.06, 0.02):
        w, D, g, gap = chosen
        frequencies = w * (np.array([0.7, 1.0, 1.4]) if gap else np.linspace(1 - k, 1 + k, 7))
        near = sorted({0.0, *(max(g + each * k * max(g, slowing), 0.0) for each in (-4.0, -1.5, 0.0, 1.5, 4.0))})
        gaps = gap * np.linspace(1 - 3 * k, 1 + 3 * k, 7) if gap else (0.0,)
        left, chosen = _best(balance, product(frequencies, (D,) if gap else (0.5 * D, D, 2.0 * D), near, gaps))
    theta = balance.matters(_coupling(balance, np.array([chosen]))[0], MATTERS, trials=1000)
    w, D, g, gap = map(float, chosen)
    if left > EXPLAINED * base or theta is None or D > DAMPED:
        return
    motor, load = float(theta[0]), float(theta[-2])
    if motor <= 0.0 or load < LIGHTEST * (motor + load):
        return
    u = balance.records[0].units.words
    what = f"The {u.mass} is in two parts, {motor:.3g} {u.kg} at the motor and {load:.3g} {u.kg} behind "
    if gap:
        what += f"a backlash of about {gap:.2g} {u.m}."
        yield RecordFinding("backlash", what, "Reduce the backlash, or preload the coupling."), 0.0
        return
    low, high = w / (2.0 * pi), w / (2.0 * pi) * sqrt(1.0 + load / motor)
    rubs = f", and friction of {g * load:.3g} {u.N} behind it" if g * load > 0.05 * Fc else ""
    what += (
        f"a spring{rubs}: resonance at {high:.3g} Hz, antiresonance at {low:.3g} Hz with a damping ratio of {D:.2g}."
    )
    change = f"Set resonance = [{high:.3g}] in [axis]; results for a rigid {u.mass} hold only well below {low:.3g} Hz."
    yield RecordFinding("two-masses", what, change), high


def _orthogonal(A: Array) -> Array:
    """Return an orthonormal basis of the columns."""
    U, singular, _ = np.linalg.svd(A / np.maximum(np.linalg.norm(A, axis=0), 1e-300), full_matrices=False)
    return np.asarray(U[:, singular > 1e-9 * singular[0]])


def _best(balance: ForceBalance, trials: Iterable[Trial]) -> tuple[float, Trial]:
    """Return the rms force that the best trial leaves, and the trial."""
    tried, Q, found = list(trials), _orthogonal(balance.base), []
    rest = balance.force - Q @ (Q.T @ balance.force)
    for columns, trial in zip(_coupling(balance, np.array(tried)), tried, strict=True):
        E = columns - Q @ (Q.T @ columns)
        E = E / np.maximum(np.linalg.norm(E, axis=0), 1e-300)
        theta = np.linalg.lstsq(E, rest, rcond=1e-9)[0]
        found.append((rms(rest - E @ theta) if theta[0] > 0.0 else np.inf, trial))
    return min(found)


def _coupling(balance: ForceBalance, trials: Array) -> Array:
    """Return f and its derivative, which stands for the delay, shape (trials, rows, 2)."""
    Ts = balance.records[0].Ts
    stride = max(1, round(0.2 / balance.settings.cutoff / Ts))

    def columns(s: Signals) -> list[Array]:
        at = np.arange(0, len(s["t"]), stride)
        spline = make_interp_spline(at, _simulated(s["q"][at], s["v"][at], stride * Ts, trials), k=1)
        f = spline(np.minimum(np.arange(len(s["t"])), at[-1]))
        return [*f.T, *np.gradient(f, Ts, axis=0).T]

    return np.stack(np.split(balance.rows(columns), 2, axis=1), axis=2).transpose(1, 0, 2)


def _simulated(x: Array, v: Array, h: float, trials: Array) -> Array:
    """Return f for all trials, shape (n, trials): semi-implicit Euler method, implicit in the friction."""
    w, D, g, gap = trials.T
    y, speed, force = np.full(len(w), x[0]), np.full(len(w), v[0]), np.empty((len(x), len(w)))
    for i in range(len(x)):
        twist = x[i] - y
        s = twist - np.clip(twist, -0.5 * gap, 0.5 * gap)
        force[i] = w * w * s + 2.0 * D * w * (v[i] - speed) * ((gap == 0.0) | (s != 0.0))
        speed = speed + h * force[i]
        speed = speed - np.clip(speed, -h * g, h * g)
        y = y + h * speed
    return force


def _elements(x: Array, breaks: Array) -> Array:
    """Return the forces of elements of presliding friction over their break-away forces, shape (n, elements)."""
    force, z = np.empty((len(x), len(breaks))), np.zeros(len(breaks))
    for i, step in enumerate(np.diff(x, prepend=x[0])):
        force[i] = z = np.clip(z + step / breaks, -1.0, 1.0)
    return force
