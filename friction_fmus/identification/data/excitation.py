"""Whether a record contains the motion that friction parameters need, and what to measure if it does not."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from friction_fmus.identification.data.findings import Finding
from friction_fmus.identification.data.motion import Course, course
from friction_fmus.identification.data.record import Array, Record

#: How far a contact moves before it slides: an upper value for machines [m], [rad at a radius of 0.1 m].
PRESLIDING = {"m": 1e-4, "rad": 1e-3}

#: Movements between two turns up to this many times `PRESLIDING` are taken for ones with presliding in them.
REACH = 20.0

#: Turns that let hysteresis be told from an offset and a drift.
TURNS = 4

#: Share of the moving samples within 10 % of one speed from which there is only that speed.
ONE_SPEED = 0.7

#: Low speeds are those below this share of the highest one.
LOW_SPEED = 0.1

#: Share of the force below which inertia is not seen.
INERTIA_SHARE = 0.02

#: Samples of the first `PRESLIDING` behind a turn that show its course.
SAMPLES = 5

#: Share of samples at exactly the largest or smallest force from which it is limited.
LIMITED = 0.002


@dataclass(frozen=True, eq=False)
class _Seen:
    """A record, its motion, its top speed and a short way to write lengths."""

    record: Record
    course: Course
    top: float

    def length(self, value: float) -> str:
        unit = self.record.units.position
        for factor, name in ((1.0, "m"), (1e3, "mm"), (1e6, "µm")) if unit == "m" else ():
            if value * factor >= 0.9995:
                return f"{value * factor:.3g} {name}"
        return f"{value * 1e9:.3g} nm" if unit == "m" else f"{value:.3g} {unit}"

    def speed(self, value: float) -> str:
        return f"{self.length(value)}/s" if self.record.units.position == "m" else f"{value:.3g} rad/s"

    @property
    def presliding(self) -> float:
        return PRESLIDING[self.record.units.position]


def examine(record: Record) -> tuple[Finding, ...]:
    """Look for what a record lacks.

    Parameters
    ----------
    record : Record
        One measurement, or one piece of it.

    Returns
    -------
    tuple of Finding
        Of these, the ones that apply: ``constant-column``, ``no-motion``, ``no-reversal``, ``few-reversals``,
        ``one-speed``, ``no-low-speed``, ``no-presliding``, ``coarse-position``, ``slow-sampling``,
        ``no-acceleration``, ``force-saturated``.

    Notes
    -----
    How far a contact moves before it slides is not known beforehand. 0.1 mm, or 1 mrad, is taken as an upper value:
    presliding distances reported for machines are some micrometres to some ten (Al-Bender, Lampaert, Swevers, IEEE
    Transactions on Automatic Control 50(11), 2005; Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30(7),
    1994).
    """
    constant = list(_constant(record))
    if any(finding.what.startswith(("The position", "The velocity")) for finding in constant):
        return tuple(constant)
    motion = course(record)
    seen = _Seen(record, motion, float(np.quantile(np.abs(motion.v), 0.99)))
    if np.ptp(motion.q) <= 10.0 * max(motion.noise, record.quantum):
        what = f"The axis moves by {seen.length(float(np.ptp(motion.q)))}, no more than the position is uncertain."
        return (*constant, Finding("no-motion", what, "Move the axis to and fro at several speeds and amplitudes."))
    looks: tuple[Callable[[_Seen], Iterator[Finding]], ...] = (
        _reversals,
        _one_speed,
        _low_speed,
        _presliding,
        _resolution,
        _sampling,
        _inertia,
        _saturation,
    )
    return (*constant, *(finding for look in looks for finding in look(seen)))


def examine_pieces(records: Sequence[Record]) -> tuple[Finding, ...]:
    """What all pieces of a measurement lack, as the longest one of them tells it."""
    found = [(len(record), examine(record)) for record in records]
    common = set.intersection(*({finding.name for finding in findings} for _, findings in found))
    _, longest = max(found, key=lambda pair: pair[0])
    return tuple(finding for finding in longest if finding.name in common)


def _constant(record: Record) -> Iterator[Finding]:
    names = {"q": "position", "v": "velocity", "force": "force", "friction": "friction"}
    for column, name in names.items():
        values: Array | None = getattr(record, column)
        if values is not None and np.ptp(values) == 0.0:
            what = f"The {name} is {values[0]:.4g} in all {len(values)} samples."
            yield Finding("constant-column", what, "Check its column, its sensor and whether the axis was on.")


def _reversals(seen: _Seen) -> Iterator[Finding]:
    turns = len(seen.course.turns)
    length = f"{seen.record.t[-1] - seen.record.t[0]:.3g} s"
    if turns == 0:
        what = f"The motion never turns round in {length}, so Coulomb friction and an offset cannot be told apart."
        yield Finding("no-reversal", what, f"Move to and fro, with {TURNS} reversals or more.")
    elif turns < TURNS:
        what = f"The motion turns round {turns} time{'s' * (turns > 1)} in {length}."
        yield Finding("few-reversals", what, f"Move to and fro, with {TURNS} reversals or more in each window.")


def _one_speed(seen: _Seen) -> Iterator[Finding]:
    speed = np.abs(seen.course.v)
    moving = speed[speed > 0.05 * seen.top]
    usual = float(np.median(moving))
    share = float(np.mean(np.abs(moving / usual - 1.0) < 0.1))
    if share > ONE_SPEED:
        what = f"{100 * share:.0f} % of the motion is at one speed, {seen.speed(usual)} within 10 %."
        yield Finding(
            "one-speed", what, f"Move at 5 speeds or more, from {seen.speed(0.01 * usual)} to {seen.speed(usual)}."
        )


def _low_speed(seen: _Seen) -> Iterator[Finding]:
    """Look for slow sliding: a way of 1 % of the longest one, all below a tenth of the top speed."""
    v, Ts = seen.course.v, seen.record.Ts
    slow = np.abs(v) < LOW_SPEED * seen.top
    changes = np.flatnonzero((np.diff(slow.astype(int)) != 0) | (np.diff(np.sign(v)) != 0)) + 1
    edges = np.concatenate([[0], changes, [len(v)]])
    ways = np.abs(np.add.reduceat(v, edges[:-1])) * Ts
    longest = max(float(seen.course.strokes.max(initial=0.0)), 0.0) or float(np.ptp(seen.course.q))
    if float(ways[slow[edges[:-1]]].max(initial=0.0)) < 0.01 * longest:
        what = (
            f"Below {seen.speed(LOW_SPEED * seen.top)}, a tenth of the top speed, there is no sliding away from the "
            "reversals, so Stribeck parameters (Fs, vs) are hardly determined."
        )
        slowest = seen.speed(0.01 * seen.top)
        yield Finding("no-low-speed", what, f"Add slow strokes at constant speeds from {slowest} upwards.")


def _presliding(seen: _Seen) -> Iterator[Finding]:
    strokes = seen.course.strokes[seen.course.strokes > 10.0 * seen.record.quantum]
    if not strokes.size:
        return  # said by no-reversal or coarse-position
    shortest = float(np.quantile(strokes, 0.05))
    if shortest <= REACH * seen.presliding:
        return
    what = (
        f"The shortest movements between reversals are {seen.length(shortest)}; a contact slides after "
        f"{seen.length(seen.presliding)} at most, so its stiffness (sigma0) shows in little of the record."
    )
    small, large = seen.length(0.02 * seen.presliding), seen.length(seen.presliding)
    yield Finding("no-presliding", what, f"Add slow sines with amplitudes from {small} to {large}.")


def _resolution(seen: _Seen) -> Iterator[Finding]:
    quantum, motion = seen.record.quantum, float(np.ptp(seen.course.q))
    if quantum <= 0.1 * seen.presliding and quantum <= 0.02 * motion:
        return
    what = (
        f"The position comes in steps of {seen.length(quantum)}; the axis moves by {seen.length(motion)}, and a "
        f"contact slides after {seen.length(seen.presliding)} at most."
    )
    finer = seen.length(min(0.02 * seen.presliding, 0.01 * motion))
    yield Finding("coarse-position", what, f"Measure the position in steps of {finer} or finer.")


def _sampling(seen: _Seen) -> Iterator[Finding]:
    """Count the samples on the first bit of way behind a turn."""
    q, turns = seen.course.q, seen.course.turns
    counts = []
    for turn, end in pairwise([*turns, len(q)]):
        away = np.abs(q[turn:end] - q[turn]) >= seen.presliding
        if away.any():  # the others stay in presliding
            at_rest = np.abs(q[turn:end] - q[turn]) < 0.01 * seen.presliding
            counts.append(int(np.argmax(away)) - int(np.argmin(at_rest)) + 1)
    if not counts or np.median(counts) >= SAMPLES:
        return
    count = float(np.median(counts))
    what = (
        f"Behind a reversal the first {seen.length(seen.presliding)} have {count:.3g} samples, at one every "
        f"{1e3 * seen.record.Ts:.3g} ms, so the damping of the bristles (sigma1) and their course do not show."
    )
    rate = SAMPLES / max(count, 1.0) * 2.0 / seen.record.Ts
    yield Finding("slow-sampling", what, f"Sample at {rate:.2g} Hz or more, or reverse more gently.")


def _inertia(seen: _Seen) -> Iterator[Finding]:
    """Regress the force on acceleration, velocity and its sign, and compare the parts."""
    record, v = seen.record, seen.course.v
    if record.force is None or not np.ptp(record.force):
        return
    a = np.gradient(v, record.Ts)
    moving = np.abs(v) > 0.05 * seen.top
    regressors = np.column_stack([a, v, np.sign(v), np.ones_like(v)])[moving]
    if np.count_nonzero(moving) < 20:
        return
    scale = np.sqrt(np.mean(regressors**2, axis=0)) + np.finfo(float).tiny
    found = np.linalg.lstsq(regressors / scale, record.force[moving], rcond=None)[0]
    share = float(abs(found[0]) / (np.std(record.force[moving]) + np.finfo(float).tiny))
    if share < INERTIA_SHARE:
        what = (
            f"The acceleration, {seen.speed(float(scale[0]))}² rms, explains {100 * share:.2g} % of the force, so the "
            "moved mass is not determined."
        )
        yield Finding("no-acceleration", what, "Add fast strokes, such as sines of several Hz, or give M as fixed.")


def _saturation(seen: _Seen) -> Iterator[Finding]:
    force = seen.record.force
    if force is None or not np.ptp(force):
        return
    still = np.diff(force) == 0.0
    for limit, word in ((force.max(), "largest"), (force.min(), "smallest")):
        at_limit = (force[1:] == limit) & still
        share = float(np.mean(at_limit))
        elsewhere = float(np.mean(still[~at_limit])) if (~at_limit).any() else 1.0
        # a force without noise, or of a coarse converter, stands still elsewhere, too
        if share > LIMITED and elsewhere < 0.2:
            what = (
                f"{100 * share:.2g} % of the samples are exactly the {word} force, {limit:.4g} "
                f"{seen.record.units.force}, as behind a limit."
            )
            yield Finding("force-saturated", what, "Move more gently, or log the force behind the limit.")
            return
