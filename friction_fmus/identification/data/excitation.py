"""Checks of a record: the motion needed to identify friction, and positions and forces that are not the axis's own."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.signal import butter, find_peaks, sosfiltfilt

from friction_fmus.identification.data.record import Array, Record, RecordFinding

#: Ratio of the bandwidth of the smoothed position to the frequency below which half of the power of its velocity is.
BANDWIDTH = 30.0


@dataclass(frozen=True, eq=False)
class MotionFeatures:
    """Features of the motion in a record."""

    q: Array
    v: Array
    """Smoothed position and velocity."""
    noise: float  # standard deviation of the noise of the position, or of the integral of the velocity
    reversals: Array  # indices of the reversal points
    strokes: Array  # distances between consecutive reversal points


def motion_features(record: Record) -> MotionFeatures:
    """Return the features of the motion in a record."""
    # A reversal point is a peak with a prominence of at least 10 standard deviations of the noise (from fourth
    # differences), 3 encoder counts and a millionth of the travel. A velocity that was not measured is the central
    # difference of the position behind a second-order zero-phase low-pass filter.
    measured = record.q if record.q is not None else cumulative_trapezoid(record.column("v"), record.t, initial=0)
    noise = float(np.median(np.abs(np.diff(measured, 4)))) / (0.6745 * np.sqrt(70.0))
    q = _smoothed(measured, record.Ts)
    v = record.v if record.v is not None else np.gradient(q, record.Ts)
    span = float(np.ptp(measured))
    height = max(10.0 * noise, 3.0 * record.quantum, 1e-6 * span)
    reversals = np.sort(np.concatenate([find_peaks(side * measured, prominence=height)[0] for side in (1.0, -1.0)]))
    return MotionFeatures(q, v, noise, reversals, np.abs(np.diff(q[reversals])) if reversals.size else np.zeros(0))


def _smoothed(q: Array, Ts: float) -> Array:
    """Return the position behind a zero-phase low-pass filter at `BANDWIDTH` times the median frequency."""
    power = np.abs(np.fft.rfft(np.gradient(q))) ** 2
    frequencies = np.fft.rfftfreq(len(q), Ts)
    total = np.cumsum(power)
    typical = float(frequencies[int(np.searchsorted(total, 0.5 * total[-1]))]) if total[-1] > 0 else 0.0
    cutoff = BANDWIDTH * max(typical, 1.0 / (len(q) * Ts))
    if cutoff >= 0.4 / Ts:
        return q
    filtered = sosfiltfilt(butter(2, cutoff, fs=1.0 / Ts, output="sos"), q, padlen=min(len(q) - 1, 200))
    return np.asarray(filtered, dtype=np.float64)


#: Upper limit of the presliding displacement of machines [m], [rad at a radius of about 0.1 m].
PRESLIDING = {"m": 1e-4, "rad": 1e-3}

REACH = 20.0  # strokes up to this multiple of `PRESLIDING` count as containing presliding
FEW_REVERSALS = 4  # number of reversals below which hysteresis cannot be separated from offset and drift

#: Fraction of moving samples within 10 % of one speed above which the record counts as having a single speed.
ONE_SPEED = 0.7

LOW_SPEED = 0.1  # upper limit of low speeds, as a fraction of the top speed
INERTIA_SHARE = 0.02  # fraction of the force below which inertia is negligible
SAMPLES = 5  # number of samples within `PRESLIDING` after a reversal that resolve the transition

#: Fraction of samples at exactly the largest or smallest force above which the force counts as saturated.
LIMITED = 0.002


@dataclass(frozen=True, eq=False)
class _ExaminedRecord:
    """Record with its motion and top speed, and formatting of lengths and speeds."""

    record: Record
    motion: MotionFeatures
    top: float

    def length(self, value: float) -> str:
        unit = self.record.units.position
        for factor, name in ((1.0, "m"), (1e3, "mm"), (1e6, "µm")) if unit == "m" else ():
            if value * factor >= 0.9995:
                return f"{value * factor:.3g} {name}"
        return f"{value * 1e9:.3g} nm" if unit == "m" else f"{value:.3g} {unit}"

    def speed(self, value: float) -> str:
        units = self.record.units
        return f"{self.length(value)}/s" if units.position == "m" else f"{value:.3g} {units.velocity}"

    @property
    def presliding(self) -> float:
        return PRESLIDING[self.record.units.position]


def examine(record: Record) -> tuple[RecordFinding, ...]:
    """Check whether a record contains the motion needed to identify friction.

    Parameters
    ----------
    record : Record
        Measurement, or a segment of it.

    Returns
    -------
    tuple of RecordFinding
        Findings that apply: ``constant-column``, ``no-motion``, ``no-reversal``, ``few-reversals``, ``one-speed``,
        ``no-low-speed``, ``no-presliding``, ``coarse-position``, ``slow-sampling``, ``no-acceleration``,
        ``force-saturated``.

    Notes
    -----
    The presliding displacement is not known in advance. The checks assume at most 0.1 mm or 1 mrad: reported presliding
    displacements of machines range from a few to some tens of micrometres (Al-Bender, Lampaert, Swevers, IEEE
    Transactions on Automatic Control 50(11), 2005; Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994).
    """
    constant = list(_constant(record))
    if any(finding.what.startswith(("The position", "The velocity")) for finding in constant):
        return tuple(constant)
    motion = motion_features(record)
    data = _ExaminedRecord(record, motion, float(np.quantile(np.abs(motion.v), 0.99)))
    if np.ptp(motion.q) <= 10.0 * max(motion.noise, record.quantum):
        what = f"The axis moves by {data.length(float(np.ptp(motion.q)))}, which is within the measurement noise."
        return (
            *constant,
            RecordFinding("no-motion", what, "Move the axis back and forth at several speeds and amplitudes."),
        )
    small = (_presliding, _resolution, _sampling) if record.units.position in PRESLIDING else ()
    checks: tuple[Callable[[_ExaminedRecord], Iterator[RecordFinding]], ...] = (
        *(_reversals, _one_speed, _low_speed, *small, _inertia, _saturation),
    )
    return (*constant, *(finding for check in checks for finding in check(data)))


def examine_segments(records: Sequence[Record]) -> tuple[RecordFinding, ...]:
    """Check whether any segment of a measurement contains the motion needed to identify friction."""
    found = [(len(record), examine(record)) for record in records]
    common = set.intersection(*({finding.name for finding in findings} for _, findings in found))
    _, longest = max(found, key=lambda pair: pair[0])
    return tuple(finding for finding in longest if finding.name in common)


def _constant(record: Record) -> Iterator[RecordFinding]:
    names = {"q": "position", "v": "velocity", "force": record.units.words.force, "friction": "friction"}
    for column, name in names.items():
        values: Array | None = getattr(record, column)
        if values is not None and np.ptp(values) == 0.0:
            what = f"The {name} is {values[0]:.4g} in all {len(values)} samples."
            yield RecordFinding(
                "constant-column", what, "Check its column, its sensor, and whether the axis was enabled."
            )


def _reversals(data: _ExaminedRecord) -> Iterator[RecordFinding]:
    reversals = len(data.motion.reversals)
    length = f"{data.record.t[-1] - data.record.t[0]:.3g} s"
    if reversals == 0:
        force = data.record.units.words.force
        what = f"The motion never reverses in {length}, so Coulomb friction cannot be separated from a {force} offset."
        yield RecordFinding("no-reversal", what, f"Move back and forth, with {FEW_REVERSALS} reversals or more.")
    elif reversals < FEW_REVERSALS:
        what = f"The motion reverses only {reversals} time{'s' * (reversals > 1)} in {length}."
        yield RecordFinding(
            "few-reversals", what, f"Move back and forth, with {FEW_REVERSALS} reversals or more in each window."
        )


def _one_speed(data: _ExaminedRecord) -> Iterator[RecordFinding]:
    speed = np.abs(data.motion.v)
    moving = speed[speed > 0.05 * data.top]
    usual = float(np.median(moving))
    share = float(np.mean(np.abs(moving / usual - 1.0) < 0.1))
    if share > ONE_SPEED:
        what = f"{100 * share:.0f} % of the motion is within 10 % of one speed, {data.speed(usual)}."
        yield RecordFinding(
            "one-speed", what, f"Move at 5 speeds or more, from {data.speed(0.01 * usual)} to {data.speed(usual)}."
        )


def _low_speed(data: _ExaminedRecord) -> Iterator[RecordFinding]:
    """Check for slow sliding: a distance of 1 % of the longest stroke, entirely below a tenth of the top speed."""
    v, Ts = data.motion.v, data.record.Ts
    slow = np.abs(v) < LOW_SPEED * data.top
    changes = np.flatnonzero((np.diff(slow.astype(int)) != 0) | (np.diff(np.sign(v)) != 0)) + 1
    edges = np.concatenate([[0], changes, [len(v)]])
    ways = np.abs(np.add.reduceat(v, edges[:-1])) * Ts
    longest = max(float(data.motion.strokes.max(initial=0.0)), 0.0) or float(np.ptp(data.motion.q))
    if float(ways[slow[edges[:-1]]].max(initial=0.0)) < 0.01 * longest:
        what = (
            f"Apart from reversals, there is no sliding below {data.speed(LOW_SPEED * data.top)}, a tenth of the top "
            "speed, so Stribeck parameters (Fs, vs) are poorly identifiable."
        )
        slowest = data.speed(0.01 * data.top)
        yield RecordFinding("no-low-speed", what, f"Add slow strokes at constant speeds from {slowest} upwards.")


def _presliding(data: _ExaminedRecord) -> Iterator[RecordFinding]:
    strokes = data.motion.strokes[data.motion.strokes > 10.0 * data.record.quantum]
    if not strokes.size:
        return  # covered by no-reversal or coarse-position
    shortest = float(np.quantile(strokes, 0.05))
    if shortest <= REACH * data.presliding:
        return
    what = (
        f"The shortest strokes are {data.length(shortest)}; a contact slides after at most "
        f"{data.length(data.presliding)}, so only a small part of the record depends on its stiffness (sigma0)."
    )
    small, large = data.length(0.02 * data.presliding), data.length(data.presliding)
    yield RecordFinding("no-presliding", what, f"Add slow sines with amplitudes from {small} to {large}.")


def _resolution(data: _ExaminedRecord) -> Iterator[RecordFinding]:
    quantum, motion = data.record.quantum, float(np.ptp(data.motion.q))
    if quantum <= 0.1 * data.presliding and quantum <= 0.02 * motion:
        return
    what = (
        f"The resolution of the position is {data.length(quantum)}; the axis moves by {data.length(motion)}, and a "
        f"contact slides after at most {data.length(data.presliding)}."
    )
    finer = data.length(min(0.02 * data.presliding, 0.01 * motion))
    yield RecordFinding("coarse-position", what, f"Measure the position with a resolution of {finer} or better.")


def _sampling(data: _ExaminedRecord) -> Iterator[RecordFinding]:
    """Count the samples within the presliding displacement after each reversal."""
    q, reversals = data.motion.q, data.motion.reversals
    counts = []
    for turn, end in pairwise([*reversals, len(q)]):
        away = np.abs(q[turn:end] - q[turn]) >= data.presliding
        if away.any():  # shorter strokes stay in presliding
            at_rest = np.abs(q[turn:end] - q[turn]) < 0.01 * data.presliding
            counts.append(int(np.argmax(away)) - int(np.argmin(at_rest)) + 1)
    if not counts or np.median(counts) >= SAMPLES:
        return
    count = float(np.median(counts))
    what = (
        f"After a reversal, the first {data.length(data.presliding)} have only {count:.3g} sample"
        f"{'' if count == 1.0 else 's'}, one every {1e3 * data.record.Ts:.3g} ms, so the transition and the bristle "
        "damping (sigma1) are not resolved."
    )
    rate = SAMPLES / max(count, 1.0) * 2.0 / data.record.Ts
    yield RecordFinding("slow-sampling", what, f"Sample at {rate:.2g} Hz or more, or reverse more slowly.")


def _inertia(data: _ExaminedRecord) -> Iterator[RecordFinding]:
    """Check the contribution of inertia by a regression of the force on acceleration, velocity and its sign."""
    record, v = data.record, data.motion.v
    if record.force is None or not np.ptp(record.force):
        return
    a = np.gradient(v, record.Ts)
    moving = np.abs(v) > 0.05 * data.top
    regressors = np.column_stack([a, v, np.sign(v), np.ones_like(v)])[moving]
    if np.count_nonzero(moving) < 20:
        return
    scale = np.sqrt(np.mean(regressors**2, axis=0)) + np.finfo(float).tiny
    found = np.linalg.lstsq(regressors / scale, record.force[moving], rcond=None)[0]
    share = float(abs(found[0]) / (np.std(record.force[moving]) + np.finfo(float).tiny))
    if share < INERTIA_SHARE:
        what = (
            f"The acceleration, {data.speed(float(scale[0]))}² rms, explains {100 * share:.2g} % of the "
            f"{record.units.words.force}, so the {record.units.words.moved_mass} is not determined."
        )
        yield RecordFinding(
            "no-acceleration", what, "Add fast strokes, such as sines of several Hz, or give M as fixed."
        )


def _saturation(data: _ExaminedRecord) -> Iterator[RecordFinding]:
    force = data.record.force
    if force is None or not np.ptp(force):
        return
    still = np.diff(force) == 0.0
    for limit, word in ((force.max(), "largest"), (force.min(), "smallest")):
        at_limit = (force[1:] == limit) & still
        share = float(np.mean(at_limit))
        elsewhere = float(np.mean(still[~at_limit])) if (~at_limit).any() else 1.0
        # a force without noise, or with coarse quantisation, is also constant elsewhere
        if share > LIMITED and elsewhere < 0.2:
            u = data.record.units.words
            what = (
                f"{100 * share:.2g} % of the samples are exactly the {word} {u.force}, {limit:.4g} {u.N}, "
                f"which indicates saturation."
            )
            yield RecordFinding(
                "force-saturated", what, f"Reduce the acceleration, or log the {u.force} after saturation."
            )
            return


JUMP: Final = 10.0  # ratio of a step of the position to the usual largest step that is a jump
AXES: Final = 33  # number of axes below which rows of one after the other are searched
ALTERNATING: Final = 0.02  # least usual step over the range of the position at which they are
OTHERS: Final = 0.99  # fraction of the steps that are no jumps
LONG: Final = 5  # smallest number of samples at the largest or smallest value that may be clipped
FAST: Final = 0.5  # fraction of the usual speed just before a stop above which the position is clipped
HELD: Final = 0.1  # fraction of the steps between moving samples that are zero above which the position is held


def position_findings(records: Sequence[Record]) -> Iterator[RecordFinding]:
    """Yield findings after which no parameter can be identified from these records."""
    for record in records:
        if record.q is None or np.ptp(record.q) == 0.0:
            continue
        jumps = position_jumps(record.column("q"), record.t, record.quantum, record.units.words.m)
        found = [*jumps, *_clipped(record), *_held(record)]
        if found:
            yield from found
            return


def position_jumps(q: Array, t: Array, quantum: float, unit: str) -> Iterator[RecordFinding]:
    """Yield a finding about a position that jumps, such as an angle that wraps or a counter that was reset."""
    size, intervals = np.abs(np.diff(q)), np.diff(t)
    steps = size * np.minimum(1.0, np.median(intervals) / intervals)
    for n in range(2, min(AXES, len(q) // 4)):
        if np.median(size) > max(4.0 * np.median(np.abs(q[n:] - q[:-n])), ALTERNATING * np.ptp(q)):
            what = f"Each position continues the one {n} samples before it: the rows are of {n} axes in turn."
            yield RecordFinding("position-jumps", what, "Keep the rows of one axis in the file.")
            return
    usual = float(np.quantile(steps, OTHERS))
    beside = np.maximum(np.append(steps[1:], 0.0), np.append(0.0, steps[:-1]))
    largest = np.maximum(usual, np.minimum(beside, 0.5 * steps))
    at = np.flatnonzero(steps > JUMP * np.maximum(largest, 3.0 * quantum))
    if unit == "rad":
        at = np.union1d(at, np.flatnonzero(size > np.pi))
    if at.size and usual > 0.0:
        times = "once" if at.size == 1 else f"{at.size} times"
        what = (
            f"The position jumps by {size[at].max():.4g} {unit} from one sample to the next, {times}, first at "
            f"t = {t[at[0]]:.6g} s."
        )
        yield RecordFinding("position-jumps", what, "Log a continuous position, or choose windows without jumps.")


def _clipped(record: Record) -> Iterator[RecordFinding]:
    """Yield a finding about a position that stops at its largest or smallest value without slowing down before."""
    q = record.column("q")
    steps = np.abs(np.diff(q))
    usual = float(np.median(steps[steps > 0.0])) if steps.any() else 0.0
    for word, side in (("largest", 1.0), ("smallest", -1.0)):
        limit = float(np.max(side * q))
        begins, ends = _runs(side * q >= limit)
        long = ends - begins >= LONG
        entered = [steps[b - 2] for b in begins[long] if b >= 2]
        left = [steps[e] for e in ends[long] if e < len(steps)]
        speeds = [*entered, *left]
        if len(speeds) >= 2 and float(np.median(speeds)) > FAST * max(usual, 3.0 * record.quantum):
            share = float(np.sum((ends - begins)[long])) / len(q)
            what = (
                f"The position stops at its {word} value, {side * limit:.4g} {record.units.position}, without slowing "
                f"down before, for {100 * share:.2g} % of the time; it is clipped."
            )
            yield RecordFinding("position-clipped", what, "Log the whole motion, or choose windows within it.")
            return


def _held(record: Record) -> Iterator[RecordFinding]:
    """Yield a finding about a position that is updated less often than it is logged, at varying intervals."""
    steps = np.abs(np.diff(record.column("q")))
    moved = steps > max(5.0 * record.quantum, 0.2 * float(np.quantile(steps, 0.9)))
    between = (steps[1:-1] == 0.0) & (moved[:-2] | moved[2:])
    share = float(np.count_nonzero(between)) / max(float(np.count_nonzero(moved)), 1.0)
    if np.count_nonzero(moved) >= 20 and share > HELD:
        what = f"The position does not change in {100 * share:.2g} % of the samples beside one at which it moves fast."
        yield RecordFinding("position-held", what, "Log the position as often as the other signals.")


def _runs(mask: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first index of each run of true values, and the one behind its last."""
    edges = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
