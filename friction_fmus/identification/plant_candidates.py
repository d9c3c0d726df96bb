"""What a record shows of an axis beyond a rigid mass with friction that is the same in both directions and always.

The drive force is fitted by F = M a + h(|v|) sgn(v) + F0 with a free friction curve h, elements of presliding friction
and a delay (the derivative of the acceleration). Each candidate adds columns. Those that explain most are taken first;
they are found if they are significant, in a Wald test with the covariance of coloured residuals, and explain enough of
the force. A second mass adds the force f of its spring over its mass, simulated along the measured motion x of the
first one:

    f = w^2 s + 2 D w (x' - y'),  y'' = f - g sgn(y') - b y',  s = x - y less the backlash.

A force from outside comes first, as it looks like any of the others: a line in the spectrum of what the base leaves,
with one amplitude and phase from begin to end, at a frequency that the motion lacks.

Sizes and standard errors are those of all findings together, for the second mass with the derivatives of f with respect
to its parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, product
from math import pi, sqrt
from typing import Final, NamedTuple, TypeAlias

import numpy as np
import scipy.stats
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from friction_fmus.axis.servo import FlexibleLoad
from friction_fmus.blocks.axis_units import Words
from friction_fmus.errors import RecordError
from friction_fmus.identification.data.record import Array, Record, RecordFinding
from friction_fmus.identification.fit.estimate import coloured_covariance, correlation_length
from friction_fmus.identification.fit.idim import InverseModelSettings, default_settings, derivative, filtered_motion
from friction_fmus.identification.fit.scores import rms

LEVEL: Final = 0.01  # significance level
NOTABLE: Final = 0.015  # part of the rms force that a drift, for example of 5 % of the force, must explain
MATTERS: Final = 0.03  # part of the rms force that another candidate must explain
BIASED: Final = 0.005  # part of the rms force that a rigid mass leaves, above which a second one is searched
LOOSE: Final = 0.02  # the same for a backlash
UNEQUAL: Final = 0.1  # constant force over Coulomb friction above which the directions differ
SPEEDS: Final = (0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0)  # nodes of the friction curve, over the largest speed
SLOW: Final = SPEEDS[1]  # speed over the largest one below which the axis may stick
PRESLIDING: Final = (1e-4, 2.5e-4, 6e-4, 1.5e-3, 4e-3, 1e-2, 2.5e-2)  # break-away distances of elements, over stroke
PROMISING, EXPLAINED = 0.85, 0.6  # parts of the residual that a second mass may leave after the first and last search
LIGHTEST: Final = 0.1  # part of the moved mass below which a second mass is not one
AWAY: Final = 0.02  # relative step to the minimum of a fitted frequency, above which the frequency is uncertain
DAMPED: Final = 0.25  # damping ratio above which a second mass does not resonate
ALIKE: Final = 1.05  # what friction that differs between parts leaves, without and with a drift, if there is none
PARTS: Final = 16  # parts of the record between which the friction may differ
RIPPLES: Final = 300  # most pitches that are tried, the longest with 1.5 periods in the stroke
ALIASED: Final = 0.35  # frequency of a ripple over the rate of the rows above which a row does not show it
FREE: Final = 0.02  # friction of a second mass, relative to that of the first one, that is tried as none
ROUNDS, DRAWS = 5, 50  # rounds of the search of a second mass by the cross-entropy method, and trials in each
LONG: Final = 30_000  # steps of the simulation of a second mass above which only a part of the record is searched
TOGETHER: Final = 2_000_000  # samples times trials that are computed together
STEPS: Final = 3  # steps by the method of Gauss and Newton after it
START: Final = np.array([0.3, 1.0, 1.0, 1.0, 0.3])  # standard deviations of the logarithms in the first round
TINY: Final = 1e-300  # logarithm of zero
CYCLES: Final = 6  # fewest periods of a periodic force, and parts of a record in which it must have the same phase
ALONE, STEADY = 0.5, 0.98  # least part of what the base leaves that it explains, and of what it explains by parts
REPEATED: Final = 0.9  # the latter for a function of the motion, above which the motion has this frequency
FORBIDS: Final = 0.1  # part of the rms force that a periodic force explains, above which no result can be used
SATURATED: Final = 0.98  # part of the force limit above which a sample is saturated
RARE, OFTEN = 0.01, 0.1  # part of saturated samples up to which it does not matter, and above which no interval holds

Signals: TypeAlias = Mapping[str, Array]
"""t, q, v, a, jerk and sign of one record, shape (n,)."""


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
        """Return rows of mass, viscous and Coulomb friction, constant force, and delay."""
        return self.rows(lambda s: [s["a"], s["v"], s["sign"], np.ones_like(s["v"]), s["jerk"]])

    def left(self) -> float:
        """Return the rms force that the base leaves."""
        Q = _orthogonal(self.base)
        return rms(self.force - Q @ (Q.T @ self.force))

    def fitted(self, A: Array) -> tuple[Array, Array, Array]:
        """Return the coefficients of columns, their covariance, and the force that they leave."""
        norm = np.linalg.norm(A, axis=0)
        length = np.where(norm > 0.0, norm, 1.0)
        U, singular, right = np.linalg.svd(A / length, full_matrices=False)
        back = right.T / np.maximum(singular, 1e-9 * singular[0]) / length[:, None]
        theta: Array = back @ (U.T @ self.force)
        rest = self.force - A @ theta
        return theta, coloured_covariance(back, U, rest, self.lengths, correlation_length(rest)), rest

    def coefficients(self, A: Array) -> Array:
        """Return the coefficients of columns without their covariance, which takes longer."""
        norm = np.linalg.norm(A, axis=0)
        length = np.where(norm > 0.0, norm, 1.0)
        return np.asarray(np.linalg.lstsq(A / length, self.force, rcond=1e-9)[0] / length)

    def matters(self, columns: Array, least: float, trials: int = 1) -> bool:
        """Return whether columns, which were chosen from some trials, are significant beside the base, and explain."""
        theta, C, rest = self.fitted(np.hstack([self.base, columns]))
        if sqrt(max(self.left() ** 2 - rms(rest) ** 2, 0.0)) < least * rms(self.force):
            return False
        count = columns.shape[1]
        statistic = float(theta[-count:] @ np.linalg.pinv(C[-count:, -count:], hermitian=True) @ theta[-count:])
        return bool(trials * scipy.stats.chi2.sf(statistic, count) < LEVEL)

    def beside(self, columns: Iterable[Array]) -> ForceBalance:
        """Return the balance with more columns in its base."""
        return replace(self, base=np.hstack([self.base, *columns]))


def force_balance(records: Sequence[Record]) -> ForceBalance | None:
    """Return the rows of some records; None without position and drive force, or if they are too short."""
    if any(record.q is None or record.force is None or record.friction is not None for record in records):
        return None
    settings = default_settings(max(records, key=len))
    signals: list[dict[str, Array]] = []
    moves, forces, end = [], [], -np.inf
    try:
        for record in records:
            settings.require(record, 2 * len(SPEEDS))
            m = filtered_motion(record, settings)
            # records may all begin at 0: they follow one another
            t = record.t if record.t[0] > end else record.t - record.t[0] + (end + record.Ts if signals else 0.0)
            end = float(t[-1])
            jerk = derivative(m.a, record.Ts)
            signals.append({"t": t, "q": m.q, "v": m.v, "a": m.a, "jerk": jerk, "sign": np.sign(m.v)})
            if record.normal is not None:
                signals[-1] |= {"normal": record.normal}
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
) -> tuple[tuple[RecordFinding, ...], FlexibleLoad | None]:
    """Return what records show of an axis beyond a rigid mass, and the part of the mass behind a spring."""
    found: list[RecordFinding] = list(_saturation(records, limit))
    load: FlexibleLoad | None = None
    records = [record.without_load() for record in records]
    if (balance := force_balance(records)) is not None:
        longest, most = max(records, key=len), LONG * _stride(balance)
        frequency = _frequency_from_outside(balance)
        outside = {} if frequency is None else {"outside": _waves(balance, frequency)}
        balance = balance.beside(outside.values())
        part: ForceBalance | None = balance
        if sum(map(len, records)) > most:  # a search of a second mass in all of it would take too long
            part = force_balance([longest.window(longest.t[0], longest.t[min(most, len(longest)) - 1])])
            part = part.beside([_waves(part, frequency)]) if part and frequency else part
        effects, second = ({}, None) if part is None else _beside_each_other(part)
        if part is not balance:
            second = None if second is None else SecondMass(second.trial, _slopes(balance, second.trial))
            effects = _effects(balance if second is None else balance.beside([second.columns[:, :2]]))
        own = effects if second is None else effects | {"second": second.columns[:, :2]}
        sizes = _sizes(balance, outside | own)
        found += [] if frequency is None else [_from_outside(balance, frequency, sizes)]
        found += _named(balance.beside(own.values()), effects, sizes)
        for finding, behind in () if second is None else _of_second_mass(balance.beside(effects.values()), second):
            found, load = [*found, finding], behind
    return tuple(found), load


def _beside_each_other(balance: ForceBalance) -> tuple[dict[str, Array], SecondMass | None]:
    """Return effects and a second mass, each found beside the other if it explains less."""
    effects, second = _effects(balance), _second_mass(balance)
    beside = balance.beside(effects.values())
    if effects and (second is None or beside.left() < balance.beside([second.columns]).left()):
        second = _second_mass(beside)
    elif second:
        effects = _effects(balance.beside([second.columns[:, :2]]))
    return effects, second


def _waves(balance: ForceBalance, frequency: float) -> Array:
    """Return sine and cosine of the time for each record, whose clocks may differ, the longest one first."""
    owns = sorted(balance.signals, key=lambda s: -len(s["t"]))
    columns = balance.rows(lambda s: [wave * (s is own) for own in owns for wave in _wave(s["t"], frequency).T])
    return columns[:, np.any(columns != 0.0, axis=0)]


def _explained(Q: Array, y: Array, columns: Array) -> float:
    """Return the part of y beside Q that columns explain."""
    E = _orthogonal(columns - Q @ (Q.T @ columns))
    return float(np.sum(np.square(E.T @ y))) / max(float(y @ y - np.sum(np.square(Q.T @ y))), 1e-9 * float(y @ y), TINY)


def _line(Q: Array, y: Array, t: Array, frequency: float) -> tuple[float, float]:
    """Return the part of y beside Q that a sine over time explains, and its ratio to that of one sine for each part."""
    wave, at = _wave(t, frequency), np.digitize(t, np.linspace(t[0], t[-1], CYCLES + 1)[1:-1])
    whole = _explained(Q, y, wave)
    return whole, whole / max(_explained(Q, y, np.hstack([wave * (at == i)[:, None] for i in range(CYCLES)])), TINY)


def _wave(t: Array, frequency: float) -> Array:
    return np.column_stack([np.sin(2.0 * pi * frequency * t), np.cos(2.0 * pi * frequency * t)])


def _frequency_from_outside(balance: ForceBalance) -> float | None:
    """Return the frequency of a force that is periodic in time, in the longest record; None if there is none."""
    longest = int(np.argmax(balance.lengths))
    own, record = slice(*np.cumsum([0, *balance.lengths])[longest : longest + 2]), balance.records[longest]
    t, one = balance.rows(lambda s: [s["t"], np.ones_like(s["t"])])[own].T
    t, base, force, interval = t / one, balance.base[own], balance.force[own], balance.settings.decimation * record.Ts
    n = round((t[-1] - t[0]) / interval) + 1
    bins, near = np.fft.rfftfreq(4 * n, interval), np.linspace(-0.5, 0.5, 21) / (n * interval)
    inside = (bins > CYCLES / (n * interval)) & (bins < ALIASED / interval)
    Q, found = _orthogonal(base), []
    # a force that moves a slow axis looks like its inertia, so that the line may only show without it
    for part in (Q, _orthogonal(np.delete(base, (0, 2), axis=1))):
        spread = np.zeros(n)
        spread[np.round((t - t[0]) / interval).astype(int)] = force - part @ (part.T @ force)
        peak = bins[np.argmax(np.abs(np.fft.rfft(spread, 4 * n)) * inside)]
        found.extend((peak + near).tolist())
    frequency = max(found, key=lambda f: _explained(Q, force, _wave(t, f)))
    share, steady = _line(Q, force, t, frequency)
    left = rms(force - Q @ (Q.T @ force))
    if len(t) < 100 or share < ALONE or steady < STEADY or sqrt(share) * left < MATTERS * rms(force):
        return None
    path = record.column("q") if record.reference is None else record.reference
    x, at = (each[:: balance.settings.decimation] for each in (path - np.mean(path), record.t))
    v, mean = np.gradient(x), np.full((len(x), 1), len(x) ** -0.5)
    for each in (v, np.gradient(v), np.sign(v), np.abs(v), x * x, x * v):
        if max(_line(mean, each, at, f)[1] for f in frequency + near) > REPEATED:
            return None
    # at one speed, a force over position is periodic, too
    pitch = _pitch(balance, max(float(np.ptp(s["q"])) for s in balance.signals))
    ways = _waves(balance, frequency), _ripple(balance, 2.0 * pi / pitch)
    less = [balance.left() ** 2 - balance.beside([columns]).left() ** 2 for columns in ways]
    return None if less[1] > REPEATED * less[0] else frequency


def _from_outside(balance: ForceBalance, frequency: float, sizes: Sizes) -> RecordFinding:
    """Return the finding about a force that is periodic in time."""
    u, power = sizes.u, sum(sizes({f"outside {i}": 1.0})[0] ** 2 for i in range(2)) / 2.0
    name = "missing-force" if sqrt(power) > FORBIDS * rms(balance.force) else "disturbed-force"
    what = (
        f"A {u.force} of {frequency:.3f} Hz acts from outside, or disturbs the recorded one; its amplitude is "
        f"{sizes.ripple('outside')}. The motion lacks this frequency. {u.mass.capitalize()}, friction and the other "
        "findings may be wrong because of it."
    )
    change = f"Find its source and record without it, or record this {u.force} and declare its column as injected."
    return RecordFinding(name, what, change)


def _saturation(records: Sequence[Record], limit: float | None) -> Iterator[RecordFinding]:
    forces = [record.force for record in records if record.force is not None]
    if not forces:
        return
    force = np.concatenate(forces)
    at = np.abs(force) >= SATURATED * limit if limit else (force == np.max(force)) | (force == np.min(force))
    at &= force != 0.0  # the least value of a current without sign
    share = float(np.mean(at))
    if share < RARE or not np.ptp(force) or (not limit and np.sum(at[1:] & at[:-1]) < 0.5 * np.sum(at[:-1])):
        return
    u = records[0].units.words
    level = limit or float(np.median(np.abs(force[at])))
    what = f"The drive {u.force} is at its limit of {level:.4g} {u.N} in {100 * share:.3g} % of the samples."
    trust = f"Do not trust the intervals of {u.mass} and friction. " if share > OFTEN else ""
    change = f"{trust}Record slower motion or raise the limit: no compensation acts while the drive saturates."
    yield RecordFinding("saturated", what, change)


def _effects(balance: ForceBalance) -> dict[str, Array]:
    """Return the columns of the effects that are found, in the order of what they explain."""
    found: dict[str, Array] = {}
    while True:
        now = balance.beside(found.values())
        tries = [each for each in _candidates(now) if each[0] not in found]
        tries.sort(key=lambda each: now.beside([each[1]]).left())
        best = next((each for each in tries if now.matters(*each[1:])), None)
        if best is None:
            parts = _parts(balance)
            if "normal" in found or not now.matters(parts, MATTERS):
                return found
            steady = {name: columns for name, columns in found.items() if name != "drift"} | {"parts": parts}
            both = found | {"parts": parts}  # steps between parts look like a drift
            drifts = balance.beside(steady.values()).left() > ALIKE * balance.beside(both.values()).left()
            return both if drifts else steady
        found[best[0]] = best[1]


def _candidates(balance: ForceBalance) -> Iterator[tuple[str, Array, float, int]]:
    """Yield names and columns of effects, the part of the force that they must explain, and the number of trials."""
    whole = {key: np.concatenate([each[key] for each in balance.signals]) for key in "tq"}

    def over(key: str, s: Signals) -> Array:
        return _powers(np.interp(s[key], (np.min(whole[key]), np.max(whole[key])), (-1.0, 1.0))).T

    def friction(s: Signals) -> list[Array]:
        return [each * s[name] for name in ("sign", "v") for each in over("t", s)]

    yield "direction", balance.rows(lambda s: [np.abs(s["v"])]), MATTERS, 1
    yield "drift", balance.rows(friction), NOTABLE, 1
    yield "offset drift", balance.rows(lambda s: over("t", s)), NOTABLE, 1
    yield "position", balance.rows(lambda s: over("q", s)), MATTERS, 1
    if all("normal" in each for each in balance.signals):
        yield "normal", balance.rows(lambda s: [s["sign"] * s["normal"]]), NOTABLE, 1
    if balance.records[0].units.position == "rad":
        yield "gravity", _ripple(balance, 1.0), MATTERS, 1
    pitch = _pitch(balance, float(np.ptp(whole["q"])))
    yield f"cogging {pitch}", _ripple(balance, 2.0 * pi / pitch), MATTERS, RIPPLES


def _powers(x: Array) -> Array:
    """Return x, x^2 and x^3 without their means over -1 to 1, shape (n, 3)."""
    return np.column_stack([x, x**2 - 1.0 / 3.0, x**3])


def _ripple(balance: ForceBalance, wave: float) -> Array:
    return balance.rows(lambda s: [np.sin(wave * s["q"]), np.cos(wave * s["q"])])


def _pitch(balance: ForceBalance, stroke: float) -> float:
    """Return the pitch of the ripple that explains most of what is left."""
    q, v, one = balance.rows(lambda s: [s["q"], s["v"], np.ones_like(s["q"])]).T
    q = q / one  # the filter of the rows has a gain
    Q = _orthogonal(balance.base)
    rest, rate = balance.force - Q @ (Q.T @ balance.force), 1.0 / balance.settings.decimation / balance.records[0].Ts

    def left(pitch: float) -> float:
        shows = np.abs(v) < ALIASED * rate * pitch
        columns = np.column_stack([np.sin(2.0 * pi * q / pitch), np.cos(2.0 * pi * q / pitch)]) * shows[:, None]
        columns = _orthogonal(columns - Q @ (Q.T @ columns))
        return rms(rest - columns @ (columns.T @ rest))

    best = min(stroke / np.arange(1.5, 1.5 + 0.5 * RIPPLES, 0.5), key=left)
    return float(min(1.0 / (1.0 / best + np.linspace(-0.5, 0.5, 21) / stroke), key=left))


def _parts(balance: ForceBalance) -> Array:
    """Return columns of a Coulomb friction that differs between parts of the record, without that of the first one."""
    starts = [signals["t"][0] for signals in balance.signals]
    ends = np.union1d(np.linspace(starts[0], balance.signals[-1]["t"][-1], PARTS + 1)[1:-1], starts[1:])
    columns = balance.rows(lambda s: [s["sign"] * (np.digitize(s["t"], ends) == i) for i in range(len(ends) + 1)])
    norm = np.linalg.norm(columns, axis=0)
    return columns[:, norm > 0.1 * np.max(norm)][:, 1:]  # a part at rest shows no friction


@dataclass(frozen=True, eq=False)
class Sizes:
    """Coefficients of a rigid mass and of all that is found beside it."""

    names: Sequence[str]
    theta: Array
    covariance: Array
    u: Words

    def __call__(self, parts: Mapping[str, float]) -> tuple[float, float]:
        """Return a sum of coefficients with these factors, and its standard error."""
        weights = np.array([parts.get(name, 0.0) for name in self.names])
        return float(weights @ self.theta), sqrt(max(float(weights @ self.covariance @ weights), 0.0))

    def shown(self, parts: Mapping[str, float], unit: str) -> str:
        """Return value, standard error and unit."""
        value, error = self(parts)
        return f"{value:.3g} ± {error:.1g} {unit}"

    def ripple(self, name: str) -> str:
        """Return the amplitude of a sine and a cosine."""
        sine, cosine = (self({f"{name} {i}": 1.0})[0] for i in range(2))
        size = float(np.hypot(sine, cosine))
        return self.shown({f"{name} 0": sine / size, f"{name} 1": cosine / size}, self.u.N)


def _sizes(balance: ForceBalance, effects: Mapping[str, Array]) -> Sizes:
    names = ["M", "Fv", "Fc", "OF", "delay"]
    names += [f"{name} {i}" for name, columns in effects.items() for i in range(columns.shape[1])]
    theta, C, _ = balance.fitted(np.hstack([balance.rigid(), *effects.values()]))
    return Sizes(names, theta, C, balance.records[0].units.words)


def _named(balance: ForceBalance, effects: Iterable[str], sizes: Sizes) -> Iterator[RecordFinding]:
    """Yield the findings about effects, which are in the base."""
    u, N, shown = sizes.u, sizes.u.N, sizes.shown
    (Fc, _), (offset, _) = sizes({"Fc": 1.0}), sizes({"OF": 1.0})
    without = replace(balance, base=np.delete(balance.base, 1, axis=1))
    constant = abs(offset) > UNEQUAL * max(Fc, 0.0) and without.matters(balance.base[:, 1:2], MATTERS)
    of_constant = shown({"OF": 1.0}, N)
    if "direction" in effects or (constant and abs(offset) <= Fc):
        name = "direction-dependent-friction"
        forward, backward = (shown({"Fc": 1.0, "OF": sign}, N) for sign in (1.0, -1.0))
        what = f"Coulomb friction is {forward} forward and {backward} backward, "
        if "direction" in effects:
            forward, backward = (shown({"Fv": 1.0, "direction 0": sign}, u.Ns_m) for sign in (1.0, -1.0))
            what += f"viscous friction {forward} and {backward}, "
            name = "direction-dependent-viscous-friction"
        what += f"or a constant {u.force} of {of_constant} acts; motion does not separate the two."
        change = f"Add this constant {u.force} to the drive; it compensates both while the axis moves."
        yield RecordFinding(name, what, change)
    elif constant:
        what = f"A constant {u.force} of {of_constant} acts, more than Coulomb friction ({Fc:.3g} {N})."
        yield RecordFinding("constant-force", what, f"Add this {u.force}, of gravity or a preload, to the drive.")
    yield from _over_time(effects, sizes)
    yield from _over_position(effects, sizes)


def _over(level: str, name: str, x: float, first: int = 0) -> dict[str, float]:
    """Return the factors of a level that follows time or position, x from -1 to 1."""
    return {level: 1.0, **{f"{name} {first + i}": float(each) for i, each in enumerate(_powers(np.array([x]))[0])}}


def _over_time(effects: Iterable[str], sizes: Sizes) -> Iterator[RecordFinding]:
    u = sizes.u
    warm = "Record the axis warmed up, or compensate with an estimator, which follows a drift."

    def change(level: str, name: str, unit: str, first: int = 0) -> str:
        begin, end = (sizes.shown(_over(level, name, x, first), unit) for x in (-1.0, 1.0))
        return f"from {begin} to {end}"

    if "drift" in effects:
        what = f"Coulomb friction changes {change('Fc', 'drift', u.N)} during the record, "
        what += f"viscous friction {change('Fv', 'drift', u.Ns_m, 3)}."
        yield RecordFinding("friction-drifts", what, warm)
    if "offset drift" in effects:
        what = f"A constant {u.force} changes {change('OF', 'offset drift', u.N)} during the record."
        yield RecordFinding("offset-drifts", what, warm)
    if "normal" in effects:
        what = f"Coulomb friction depends on the load: {sizes.shown({'normal 0': 1.0}, u.N)} per N of normal force."
        model = "Use a friction model with the normal force as input, or an estimator, which follows the load."
        yield RecordFinding("load-dependent-friction", what, model)
    if "parts" in effects:
        others = [name for name in sizes.names if name.startswith("parts ")]
        levels = [{"Fc": 1.0}, *({"Fc": 1.0, name: 1.0} for name in others)]
        low, *_, high = sorted(levels, key=lambda each: sizes(each)[0])
        between = f"{sizes.shown(low, u.N)} and {sizes.shown(high, u.N)}"
        what = f"Coulomb friction varies between {between} in the course of the record, as if it depends on the load."
        log = "Log the load and declare it as column normal, or record under constant conditions."
        yield RecordFinding("friction-varies", what, log)


def _over_position(effects: Iterable[str], sizes: Sizes) -> Iterator[RecordFinding]:
    u, table = sizes.u, "Identify and compensate it with a position map."
    if "position" in effects:
        ways = [_over("OF", "position", x) for x in np.linspace(-1.0, 1.0, 101)]
        low, *_, high = sorted(ways, key=lambda each: sizes(each)[0])
        change = sizes.shown({name: high[name] - low[name] for name in high}, u.N)
        what = f"The {u.force} over position, as of gravity or a spring, changes by {change} along the stroke."
        yield RecordFinding("force-over-position", what, table)
    if "gravity" in effects:
        what = f"A {u.force} of {sizes.ripple('gravity')} times the sine of the angle acts, as gravity on an eccentric"
        change = f"Add this {u.force} to the drive as a feedforward of the angle."
        yield RecordFinding("gravity", f"{what} load.", change)
    for name in effects:
        if name.startswith("cogging"):
            pitch = float(name.partition(" ")[2])
            what = f"A {u.force} of cogging has the amplitude {sizes.ripple(name)} and the pitch {pitch:.4g} {u.m}."
            yield RecordFinding("cogging", what, table)


class SecondMass(NamedTuple):
    """A second mass that is found."""

    trial: Array  # w, D, g, b and backlash
    columns: Array  # f, its derivative, and the changes of the force with the logarithms of the parameters


def _second_mass(balance: ForceBalance) -> SecondMass | None:
    """Search a second mass behind a spring or a backlash."""
    base, Ts = balance.left(), balance.records[0].Ts
    M, Fv, Fc, *_ = balance.coefficients(balance.rigid())
    if base < BIASED * rms(balance.force) or M <= 0.0:
        return None
    cutoff, limit = 2.0 * pi * balance.settings.cutoff, 1.0 / (_stride(balance) * Ts)  # the latter of the integration
    stroke = max(float(np.ptp(s["q"])) for s in balance.signals)
    shares = [(share * max(Fc / M, 0.0), share * max(Fv / M, 0.0)) for share in (FREE, 0.4, 0.7, 1.0, 1.3)]
    springs, gaps = np.geomspace(0.01, 0.3, 14) * cutoff, stroke * np.geomspace(1e-4, 3e-2, 18)
    tried = [(w, D, g, FREE * max(Fv / M, 0.0), 0.0) for w, D, (g, _) in product(springs, (0.05, 0.2), shares)]
    if base > LOOSE * rms(balance.force):
        tried += [(0.4 * cutoff, 0.2, *share, gap) for share, gap in product(shares, gaps)]
    trials = np.array(tried)
    left = _left(balance, trials)
    if np.min(left) > PROMISING * base:
        return None
    rubs = trials[:, 2] > shares[0][0]  # without friction there is another local minimum
    starts = [trials[own][np.argmin(left[own])] for own in (rubs, ~rubs) if np.any(own)]
    ends = np.array([_searched(balance, start, limit) for start in starts])
    best = ends[np.argmin(_left(balance, ends))]
    for _ in range(STEPS):
        theta = balance.coefficients(np.hstack([balance.base, _slopes(balance, best)]))
        parts = np.clip(np.outer((0.0, 1.0, 0.5, 0.2, 0.05), theta[-5:]), -1.0, 1.0)
        near = _stable(best * np.exp(parts), limit)
        left = _left(balance, near)
        best = near[np.argmin(left)]
    columns = _slopes(balance, best)
    theta = balance.coefficients(np.hstack([balance.base, columns[:, :2]]))
    light = theta[0] <= 0.0 or theta[-2] < LIGHTEST * (theta[0] + theta[-2])
    if np.min(left) > EXPLAINED * base or light or (best[1] > DAMPED and not best[4]):
        return None
    return SecondMass(best, columns) if balance.matters(columns[:, :2], BIASED, trials=1000) else None


def _searched(balance: ForceBalance, start: Array, limit: float) -> Array:
    """Return the best trial of a search from a start by the cross-entropy method, see R. Rubinstein, 1999."""
    random, spread, mean = np.random.default_rng(1), START, np.log(np.maximum(start, TINY))
    for _ in range(ROUNDS):
        draws = np.exp(mean + spread * random.standard_normal((DRAWS, 5))) * (start > 0.0)
        near = _stable(np.vstack([start, draws]), limit)
        near = near[np.argsort(_left(balance, near), stable=True)]
        few = np.log(np.maximum(near[: DRAWS // 6], TINY))
        start, mean, spread = near[0], np.mean(few, axis=0), np.maximum(np.std(few, axis=0), 0.02)
    return start


def _stable(trials: Array, limit: float) -> Array:
    """Return trials with frequencies and damping that the simulation can follow."""
    w = np.minimum(trials[:, 0], limit)
    return np.column_stack([w, np.minimum(trials[:, 1], 0.5 * limit / w), trials[:, 2:]])


def _slopes(balance: ForceBalance, trial: Array) -> Array:
    """Return f, its derivative, and the changes of the force with the logarithms of the parameters, shape (rows, 7)."""
    own, *others = _coupling(balance, trial * np.exp(1e-3 * np.vstack([np.zeros(5), np.eye(5), -np.eye(5)])))
    theta = balance.coefficients(np.hstack([balance.base, own]))[-2:]
    slopes = [(more - less) @ theta / 2e-3 for more, less in zip(others[:5], others[5:], strict=True)]
    return np.column_stack([own, *slopes])


def _of_second_mass(balance: ForceBalance, second: SecondMass) -> Iterator[tuple[RecordFinding, FlexibleLoad | None]]:
    """Yield the finding about a second mass, and the load behind a spring; None for a backlash."""
    w, D, g, _, gap = second.trial.tolist()
    whole = np.hstack([balance.base, second.columns])
    own = balance.base.shape[1]
    theta, C, _ = balance.fitted(whole)
    # the search has ended far from where its slopes point: noise of the position counts for more than they
    away = abs(theta[own + 2]) > max(AWAY, 3.0 * sqrt(C[own + 2, own + 2]))
    # without slopes that hardly have an effect, as of a load without friction, along which a step would be too far
    while np.max(np.diag(C)[own + 3 :], initial=0.0) > 1.0:
        whole = np.delete(whole, own + 3 + np.argmax(np.diag(C)[own + 3 :]), axis=1)
        theta, C, _ = balance.fitted(whole)
    motor, load, errors = float(theta[0]), float(theta[own]), np.sqrt(np.diag(C)).tolist()
    if min(motor, load) <= 0.0:
        return
    u = balance.records[0].units.words

    def shown(value: float, error: float) -> str:
        return f"about {value:.2g}" if away else f"{value:.3g} ± {error:.1g}"

    what = (
        f"The {u.mass} is in two parts, {shown(motor, errors[0])} {u.kg} at the motor and {shown(load, errors[own])} "
        f"{u.kg} behind "
    )
    if gap:
        what += f"a backlash of about {gap:.2g} {u.m}."
        change = "Reduce it, or preload the coupling. Bounces on impact can make it look twice as wide."
        yield RecordFinding("backlash", what, change), None
        return
    friction = g * load
    Fc = friction + max(balance.coefficients(np.hstack([balance.rigid(), second.columns]))[2], 0.0)
    behind = friction / Fc if Fc else 0.0
    flexible = FlexibleLoad(load / (motor + load), w, D, behind, motor + load)
    low, high = w / (2.0 * pi), flexible.resonance
    resonance = f"about {high:.2g}" if away else f"{high:.3g}"
    rubs = f", and friction of {friction:.3g} {u.N} behind it" if behind > 0.05 else ""
    what += (
        f"a spring{rubs}: resonance at {resonance} Hz, antiresonance at {shown(low, low * errors[own + 2])} Hz with "
        f"a damping ratio of {D:.2g}."
    )
    known = "Measure the resonance, and set it as resonance" if away else f"Set resonance = [{high:.3g}]"
    change = f"{known} in [axis]; results for a rigid {u.mass} hold only well below {low:.3g} Hz."
    yield RecordFinding("two-masses", what, change), flexible


def _orthogonal(A: Array) -> Array:
    """Return an orthonormal basis of the columns."""
    U, singular, _ = np.linalg.svd(A / np.maximum(np.linalg.norm(A, axis=0), 1e-300), full_matrices=False)
    return np.asarray(U[:, singular > 1e-9 * singular[0]])


def _left(balance: ForceBalance, trials: Array) -> Array:
    """Return the rms forces that trials leave; infinity with a negative mass."""
    Q, found = _orthogonal(balance.base), []
    rest = balance.force - Q @ (Q.T @ balance.force)
    few = max(8, TOGETHER // sum(balance.lengths) // balance.settings.decimation)
    parts = (_coupling(balance, trials[i : i + few]) for i in range(0, len(trials), few))
    for columns in chain.from_iterable(parts):
        E = columns - Q @ (Q.T @ columns)
        E = E / np.maximum(np.linalg.norm(E, axis=0), 1e-300)
        theta = np.linalg.lstsq(E, rest, rcond=1e-9)[0]
        found.append(rms(rest - E @ theta) if theta[0] > 0.0 else np.inf)
    return np.array(found)


def _stride(balance: ForceBalance) -> int:
    """Return the step of the simulation of a second mass in samples."""
    return max(1, round(0.2 / balance.settings.cutoff / balance.records[0].Ts))


def _coupling(balance: ForceBalance, trials: Array) -> Array:
    """Return f and its derivative, which stands for the delay, shape (trials, rows, 2)."""
    Ts, stride = balance.records[0].Ts, _stride(balance)

    def columns(s: Signals) -> list[Array]:
        at = np.arange(0, len(s["t"]), stride)
        spline = make_interp_spline(at, _simulated(s["q"][at], s["v"][at], stride * Ts, trials), k=1)
        f = spline(np.minimum(np.arange(len(s["t"])), at[-1]))
        return [*f.T, *np.gradient(f, Ts, axis=0).T]

    return np.stack(np.split(balance.rows(columns), 2, axis=1), axis=2).transpose(1, 0, 2)


def _simulated(x: Array, v: Array, h: float, trials: Array) -> Array:
    """Return f for all trials, shape (n, trials): semi-implicit Euler method, implicit in the friction."""
    w, D, g, b, gap = trials.T
    k, c, stops, kept, half = w * w, 2.0 * D * w, h * g, 1.0 / (1.0 + h * b), 0.5 * gap
    y, speed, force = np.full(len(w), x[0]), np.full(len(w), v[0]), np.empty((len(x), len(w)))
    rigid, loose = gap == 0.0, bool(np.any(gap))
    for i in range(len(x)):
        s, slip = x[i] - y, v[i] - speed
        if loose:
            s = s - np.minimum(np.maximum(s, -half), half)
            slip = slip * (rigid | (s != 0.0))
        force[i] = now = k * s + c * slip
        speed = speed + h * now
        speed = (speed - np.minimum(np.maximum(speed, -stops), stops)) * kept
        y = y + h * speed
    return force


def _elements(x: Array, breaks: Array) -> Array:
    """Return the forces of elements of presliding friction over their break-away forces, shape (n, elements)."""
    force, z = np.empty((len(x), len(breaks))), np.zeros(len(breaks))
    for i, step in enumerate(np.diff(x, prepend=x[0])):
        force[i] = z = np.minimum(np.maximum(z + step / breaks, -1.0), 1.0)
    return force
