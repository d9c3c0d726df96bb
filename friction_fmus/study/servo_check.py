"""The servo of a record: compared with the recorded drive force before anything is simulated, or estimated from it.

The law of the servo is a function of reference and position, both of which are in the record. Its force for them is
computed with the FMUs of the servo, in open loop, and compared with the recorded force. No property of the axis enters,
so that a difference is an error of the configuration, of the columns, or a force from outside the servo.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from math import pi, sqrt
from operator import itemgetter
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion
from scipy.optimize import minimize, minimize_scalar
from threadpoolctl import threadpool_limits

from friction_fmus.axis.loop_assembly import block
from friction_fmus.axis.servo import BUTTERWORTH, GAIN_UNITS, GAINS, LowPass, Notch, Servo, filtered
from friction_fmus.blocks.axis_units import Words
from friction_fmus.identification import Array, Record
from friction_fmus.identification.fit.scores import independent_samples, rms
from friction_fmus.study.study_result import Fit, IdentifiedParameter, ServoCheck, StudyFinding, thinned
from harness import Experiment, FmuPart, SeriesPart, System


@dataclass(frozen=True, eq=False)
class ComparedForce:
    """Recorded force and the force that the servo commands."""

    force: Array
    command: Array
    unlimited: Array
    """Recorded force, command within the force limit, and command without this limit."""
    used: NDArray[np.bool_]  # samples that are compared
    servo: Servo  # servo as configured
    record: Record  # record with reference and position
    included: bool = False  # whether a declared injected force was subtracted from the recorded force
    late: int = 0  # samples by which the column of the force has the command later
    loop: LowPass | None = None  # current loop between them

    @property
    def level(self) -> float:
        """Rms value of the recorded force."""
        return rms(self.force[self.used])

    @property
    def residual(self) -> float:
        """Rms difference of force and command; without its mean if the servo has an integral of unknown start value."""
        return self.left(self.force - self.command)

    def left(self, difference: Array) -> float:
        """Return the rms value of a difference of shape (n,) over the compared samples."""
        values = difference[self.used]
        return rms(values - np.mean(values)) if self.servo.pid[2] else rms(values)

    def thinned(self, most: int) -> ComparedForce:
        """Return the same with at most about this many compared samples."""
        places = np.flatnonzero(self.used)
        return replace(self, used=np.isin(np.arange(len(self.used)), places[:: len(places) // most + 1]))

    def left_by(self, servo: Servo) -> float:
        """Return the residual of another servo; both are within the limit at the compared samples."""
        change = linear_command(servo, self.record) - linear_command(self.servo, self.record)
        return self.left(self.force - self.command - self.logged(change))

    def logged(self, command: Array) -> Array:
        """Return a command of shape (n,) as the column of the force has it."""
        return shifted(filtered(self.loop, command, self.servo.Ts), self.late)


@dataclass(frozen=True, eq=False)
class LinearFit:
    """Linear least squares: coefficients by column, their covariance, and the rms residual."""

    values: Mapping[str, float]
    covariance: Array
    left: float


def fitted(compared: ComparedForce, columns: Mapping[str, Array], target: Array) -> LinearFit:
    """Fit a target of shape (n,) by columns; the covariance counts the independent samples of the residual."""
    y = target[compared.used]
    if not columns:
        return LinearFit({}, np.zeros((0, 0)), compared.left(target))
    X = np.column_stack([column[compared.used] for column in columns.values()])
    lengths = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    Q, R = np.linalg.qr(X / lengths)  # ten times as fast as the least squares of all rows
    solution = np.linalg.lstsq(R, Q.T @ y, rcond=None)[0] / lengths
    rest = y - X @ solution
    samples = max(independent_samples([rest]) - len(lengths), 1.0)
    inverse = np.linalg.pinv(R.T @ R) / np.outer(lengths, lengths)
    covariance = inverse * float(rest @ rest) / samples
    return LinearFit(dict(zip(columns, solution.tolist(), strict=True)), covariance, rms(rest))


def regressors(compared: ComparedForce, integral: bool) -> dict[str, Array]:
    """Return the signals that the gains of the law multiply: errors of position and velocity, and their integrals."""
    servo, record = compared.servo, compared.record
    e, d = errors(servo, record)
    columns = {"e": e, "d": d}
    if integral:
        columns["integral of e"] = servo.Ts * (np.cumsum(e) - e)
        if servo.law == "CascadePPI" and not servo.velocity_feedforward:  # with it, the integral of d is e
            columns["integral of d"] = servo.Ts * (np.cumsum(d) - d)
        columns["1"] = np.ones_like(e)
    return behind_notch(servo, columns)


def behind_notch(servo: Servo, columns: Mapping[str, Array]) -> dict[str, Array]:
    """Return signals behind the notch filter of a servo."""
    return {name: filtered(servo.notch, column, servo.Ts) for name, column in columns.items()}


def errors(servo: Servo, record: Record) -> tuple[Array, Array]:
    """Return the errors of position and velocity that a servo computes."""
    r = record.column("reference")
    v = velocity(record, servo)
    return r - record.column("q"), np.gradient(r, servo.Ts) - v if servo.velocity_feedforward else -v


def linear_command(servo: Servo, record: Record) -> Array:
    """Return the force of a servo without limits."""
    first, second, third = (servo.gains[name] for name in GAINS[servo.law])
    e, d = errors(servo, record)
    w = e if servo.law == "PID" else first * e + d
    u = first * e + second * d if servo.law == "PID" else second * w
    known = references(record, servo.Ts)
    u = u + third * servo.Ts * (np.cumsum(w) - w) + servo.viscous_feedforward * known["rd"]
    u += servo.inertia_feedforward * known["rdd"] + servo.coulomb_feedforward * known["sign"]
    return behind_notch(servo, {"u": u})["u"]


def references(record: Record, Ts: float) -> dict[str, Array]:
    """Return the signals of a feedforward of the reference."""
    rd = np.gradient(record.column("reference"), Ts)
    return {"rd": rd, "rdd": np.gradient(rd, Ts), "sign": np.sign(rd), "constant": np.ones_like(rd)}


def gains_of(compared: ComparedForce, fit: LinearFit) -> tuple[IdentifiedParameter, ...]:
    """Return the gains of the law, with standard errors, from the coefficients of `regressors`."""
    servo, names = compared.servo, list(fit.values)

    def gain(name: str, value: float, slopes: Mapping[str, float]) -> IdentifiedParameter:
        slope = np.array([slopes.get(column, 0.0) for column in names])
        error = float(np.sqrt(max(slope @ fit.covariance @ slope, 0.0)))
        unit = compared.record.units.words.fill(GAIN_UNITS[name])
        return IdentifiedParameter(name, value, error, unit, "gain of the servo")

    a, b = fit.values["e"], fit.values["d"]
    slow = fit.values.get("integral of e", 0.0)
    if servo.law == "PID":
        gains = [gain("Kp", a, {"e": 1.0}), gain("Kd", b, {"d": 1.0})]
        return (*gains, gain("Ki", slow, {"integral of e": 1.0})) if "integral of e" in names else tuple(gains)
    if "integral of d" in names:
        ki, of_ki = fit.values["integral of d"], {"integral of d": 1.0}
        kp, of_kp = a / b, {"e": 1.0 / b, "d": -a / b**2}
    elif "integral of e" in names:  # a = kv kp + ki and slow = ki kp, of which the smaller ki is the one of a servo
        root = sqrt(max(a**2 - 4.0 * b * slow, 0.0))
        ki, kp = 0.5 * (a - root), 0.5 * (a + root) / b
        of_ki, of_kp = {"integral of e": 1.0 / kp}, {"e": 1.0 / b, "d": -a / b**2}
    else:
        return gain("kp", a / b, {"e": 1.0 / b, "d": -a / b**2}), gain("kv", b, {"d": 1.0})
    return gain("kp", kp, of_kp), gain("kv", b, {"d": 1.0}), gain("ki", ki, of_ki)


def velocity(record: Record, servo: Servo) -> Array:
    """Return the velocity that a servo computes; before the first sample the axis moves as in the first interval."""
    q, window = record.column("q"), servo.window
    before = q[0] - (q[1] - q[0]) * np.arange(float(window), 0.0, -1.0)
    raw = (q - np.concatenate([before, q])[: len(q)]) / (window * servo.Ts)
    return filtered(servo.velocity_filter, raw, servo.Ts)


def shifted(values: Array, samples: int) -> Array:
    """Return values that appear some samples later; the ends hold."""
    places = np.clip(np.arange(len(values)) - samples, 0, len(values) - 1)
    return values[places]


BETWEEN: Final = 0.5  # fraction of the samples that the servo must reproduce if the rest is a force in pulses
LINES: Final = 0.6  # fraction of the power of a periodic force in its strongest frequencies


def pulses(compared: ComparedForce, difference: Array) -> str:
    """Return the description of pulses between which the servo reproduces the force; empty if there are none."""
    size = np.where(compared.used, np.abs(difference), 0.0)
    peak = float(np.max(size))
    outside = size > 0.2 * peak
    between = compared.used & (size <= 0.05 * peak)
    if np.count_nonzero(between) < BETWEEN * np.count_nonzero(compared.used):
        return ""
    starts = np.flatnonzero(np.diff(np.concatenate([[0], outside.astype(np.int8)])) == 1)
    peaks = [size[begin:end].max() for begin, end in zip(starts, [*starts[1:], len(size)], strict=True)]
    force, t = compared.record.units.force, compared.record.t[starts[0]]
    one = len(peaks) == 1
    return (
        f"in {'one pulse' if one else f'{len(peaks)} pulses'} of {float(np.median(peaks)):.3g} {force}, "
        f"{'at' if one else 'the first one at'} {t:.4g} s"
    )


def frequencies(compared: ComparedForce, difference: Array) -> str:
    """Return the description of a periodic force; empty if its frequency is one of the reference, or it is not one."""
    power, reference = (
        np.abs(np.fft.rfft((values - np.mean(values)) * np.hanning(len(values)))) ** 2
        for values in (np.where(compared.used, difference, 0.0), references(compared.record, compared.servo.Ts)["rd"])
    )
    left, places = power.copy(), np.zeros(len(power), dtype=bool)
    for _ in range(3):
        place = int(np.argmax(left))
        if np.sum(left[max(0, place - 3) : place + 4]) < 0.05 * np.sum(power):
            break
        places[max(0, place - 3) : place + 4] = True
        left[places] = 0.0
    if np.sum(power[places]) < LINES * np.sum(power) or np.sum(reference[places]) > 0.05 * np.sum(reference):
        return ""
    frequency = float(np.argmax(power)) / (len(difference) * compared.servo.Ts)
    amplitude = sqrt(2.0) * rms(difference[compared.used])
    return f"periodic, mainly at {frequency:.4g} Hz, with an amplitude of {amplitude:.3g} {compared.record.units.force}"


# Reasons why a servo does not reproduce the recorded drive force, and what to change.
#
# Each explanation is a small model of the recorded force. The simplest one that leaves at most `EXPLAINED` of the
# residual, and not much more than the best one, is reported. A residual that none of them explains and that lies in
# pulses or at a few frequencies is a force that was added from outside.

EXPLAINED: Final = 0.2  # largest part of the residual that an explanation leaves

LATEST: Final = 8
"""Largest delay between command and recorded force that is tried, in samples; half of it for a force that leads."""

WIDEST: Final = 16  # largest window of the velocity that is tried, in samples
LOWEST: Final = 1e-3
HIGHEST: Final = 0.4
"""Frequencies of filters among which the first one is sought, over the sample rate."""

FASTEST: Final = 2.0  # highest bandwidth of a current loop of order 1 that is sought, over the sample rate

ENOUGH: Final = 5000  # samples above which only some are used in searches with other unknowns
SIMPLER: Final = 1.05  # residual over the smallest one up to which a simpler explanation is taken
NARROW: Final = 0.75  # damping of a notch filter above which it could as well be a lag of the recorded force
WHITE: Final = 0.2  # largest part of the power of noise in the lowest tenth of the frequencies
CONFIRMED: Final = 0.05  # relative difference up to which a configured gain agrees with the one that the record shows

FACTORS: Final[Mapping[str, float]] = {
    "the ratio of N and lbf": 4.4482216,
    "the ratio of kgf and N": 9.80665,
    "the ratio of in and mm": 25.4,
    "2 pi, the ratio of turns and rad": 2.0 * pi,
    "the ratio of rad and degrees": 180.0 / pi,
    "the ratio of minutes and seconds": 60.0,
}
"""Factors between units that are often confused, besides powers of ten."""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Explanations of a residual."""

    explanations: tuple[StudyFinding, ...]  # explanations that hold together
    gains: tuple[IdentifiedParameter, ...] = ()  # gains that the record shows; empty if they are not estimated
    injected: Array | None = None  # force added from outside
    confirmed: bool = False  # whether the record shows the configured gains, although it contains another force
    servo: Servo | None = None  # servo with the filter that explains the residual


def explain(compared: ComparedForce, allowed: float) -> Diagnosis:
    """Return why the servo does not reproduce the recorded force."""
    u = compared.record.units.words
    enough = max(allowed, EXPLAINED * compared.residual)
    tries = (_factor, _delay, _feedforward, _filter, _gains, _gains_and_feedforward)
    attempts = [attempt(compared, allowed) for attempt in tries]
    if min(left for _, left in attempts) > allowed:
        attempts += [_with_filter(name, compared, allowed) for name in FILTERS]
    least = max(_resolution(compared.record, compared.servo), 1.5 * min(left for _, left in attempts))
    for found, left in attempts:
        if left <= min(enough, least):
            return found
    outside = _injected(compared)
    if outside is not None:
        return outside
    what = (
        "neither other gains, a delay, a feedforward nor a factor explains the difference, and it is neither periodic "
        "nor in pulses."
    )
    change = (
        f"Check the law, window and Ts of the servo; log the {u.force} that its law commands, before filters and "
        f"limits, and add a column injected if another {u.force} is added to it."
    )
    gains = _gains(compared, allowed)[0].gains
    confirmed = _agree(compared.servo, gains) and is_noise(compared)
    if confirmed:
        what = f"the gains agree with the record, but the {u.force} contains noise or another {u.force}."
    return Diagnosis((StudyFinding("servo-unexplained", what, change),), gains, confirmed=confirmed)


def is_noise(compared: ComparedForce) -> bool:
    """Return whether the residual has no more power at low frequencies than white noise has."""
    difference = np.where(compared.used, compared.force - compared.command, 0.0)
    power = np.abs(np.fft.rfft(difference)[1:]) ** 2
    return float(np.sum(power[: len(power) // 10])) <= WHITE * float(np.sum(power))


def _agree(servo: Servo, gains: Sequence[IdentifiedParameter]) -> bool:
    """Return whether the gains that the record shows are the configured ones, apart from an integral gain."""
    return all(abs(each.value / servo.gains[each.name] - 1.0) < CONFIRMED for each in gains if each.name[1:] != "i")


Attempt: TypeAlias = tuple[Diagnosis, float]

FILTERS: Final[Mapping[str, Callable[[Servo, Array], Servo]]] = {
    "velocity-filter": lambda servo, p: replace(servo, velocity_filter=LowPass(1, float(p[0]))),
    "velocity-filter-2": lambda servo, p: replace(servo, velocity_filter=LowPass(2, float(p[0]))),
    "notch": lambda servo, p: replace(servo, notch=Notch(*map(float, p))),
}
"""Servos with a filter of these parameters, by explanation."""


def best_filter(name: str, servo: Servo, cost: Callable[[Servo], float], rounds: int = 60) -> tuple[Servo, float]:
    """Return the servo with the filter for which a cost is smallest, and this cost."""
    make = FILTERS[name]

    def of(logarithms: Array) -> float:
        p = np.exp(logarithms)
        inside = 0.1 * LOWEST < p[0] * servo.Ts < 0.45 and np.all((p[1:] > 1e-3) & (p[1:] < 3.0))
        return cost(make(servo, p)) if inside else np.inf

    frequencies = np.geomspace(LOWEST / servo.Ts, HIGHEST / servo.Ts, 20)
    begins = product(frequencies, (0.1, 0.5), (0.1,)) if name == "notch" else product(frequencies)
    begin = min((np.log(p) for p in begins), key=of)
    simplex = np.vstack([begin, begin + 0.2 * np.eye(len(begin))])
    found = minimize(
        of,
        begin,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": rounds * len(begin), "xatol": 1e-4, "fatol": 0.0},
    )
    return make(servo, np.exp(found.x)), float(found.fun)


def _filter(compared: ComparedForce, allowed: float) -> Attempt:
    """Explain the difference by another velocity, the current loop or a notch filter, the first that is near best."""
    filters = []
    for name in FILTERS:
        servo, left = best_filter(name, compared.servo, compared.left_by)
        if servo.notch == compared.servo.notch or (servo.notch is not None and servo.notch.damping < NARROW):
            filters.append((Diagnosis((_of_filter(compared, servo, left),), servo=servo), left))
    loop = _current_loop(compared)
    loops = [loop] if loop[1] <= min(left for _, left in filters) else []
    attempts = [_window(compared), *_without_filter(compared), *loops, *filters]
    return next(each for each in attempts if each[1] <= SIMPLER * min(left for _, left in attempts))


def _without_filter(compared: ComparedForce) -> Iterator[Attempt]:
    """Explain the difference by a configured filter that the drive does not have."""
    given = compared.servo
    without = {"velocity_filter": replace(given, velocity_filter=None), "notch": replace(given, notch=None)}
    for key, servo in without.items():
        if servo != given:
            left = compared.left_by(servo)
            change = f"Remove {key} from [servo]{_better(compared, left)}"
            finding = StudyFinding(f"no-{key.replace('_', '-')}", f"the drive has no {key.replace('_', ' ')}.", change)
            yield Diagnosis((finding,), servo=servo), left


def _of_filter(compared: ComparedForce, servo: Servo, left: float) -> StudyFinding:
    key = "velocity_filter" if servo.notch == compared.servo.notch else "notch"
    what = f"the drive has a {'low-pass filter of the velocity' if key != 'notch' else 'notch filter of the command'}."
    change = f"Set {key} = {servo.features[key]} in [servo]{_better(compared, left)}"
    return StudyFinding(key.replace("_", "-"), what, change)


def _better(compared: ComparedForce, left: float) -> str:
    before, after = (_percent(size, compared.level) for size in (compared.residual, left))
    return f": residual {before:.3g} % → {after:.2g} %."


def _with_filter(name: str, compared: ComparedForce, allowed: float) -> Attempt:
    """Explain the difference by a filter together with other gains and a feedforward."""
    few = compared.thinned(ENOUGH)
    servo, _ = best_filter(name, compared.servo, lambda servo: _all_fitted(replace(few, servo=servo)).left, 30)
    found, left = _gains_and_feedforward(replace(compared, servo=servo), allowed)
    return replace(found, explanations=(_of_filter(compared, servo, left), *found.explanations)), left


def _factor(compared: ComparedForce, allowed: float) -> Attempt:
    """Explain the difference by a constant factor: a sign, a unit, or the outer gain of the law."""
    u = compared.record.units.words
    force, command = (values[compared.used] for values in (compared.force, compared.unlimited))
    if compared.servo.pid[2]:
        force, command = force - np.mean(force), command - np.mean(command)
    power = float(command @ command)
    factor = float(command @ force) / power if power else 0.0
    left = rms(force - factor * command)
    law, gains = compared.servo.law, compared.servo.gains
    scaled = ("kv", "ki") if law == "CascadePPI" else GAINS[law]
    values = " and ".join(f"{name} = {factor * gains[name]:.5g}" for name in scaled if gains[name])
    if factor < 0.0 and abs(factor + 1.0) < 0.05:
        what = f"the {u.force} is the command with the opposite sign."
        change = f"Set sign = -1 for the {u.force} in [columns], or for position and reference, whichever is inverted."
        return Diagnosis((StudyFinding("wrong-sign", what, change),)), left
    unit = _unit(abs(factor))
    what = f"the {u.force} is {factor:.4g} times the command" + (f", which is {unit}." if unit else ".")
    change = f"Set {values} in [servo], or correct the unit of {u.force}, position and reference."
    if factor < 0.0:
        return Diagnosis((StudyFinding("wrong-sign-and-unit", what, f"Correct sign and unit of the {u.force}."),)), left
    name = "wrong-unit-or-gain" if unit else "wrong-gain"
    return Diagnosis((StudyFinding(name, what, change),), _gains(compared, allowed)[0].gains), left


def _unit(factor: float) -> str:
    """Return the ratio of units that is equal to a factor within 0.5 %; empty if there is none."""
    if factor <= 0.0:
        return ""
    exponent = round(np.log10(factor))
    if exponent and abs(factor / 10.0**exponent - 1.0) < 0.005:
        return "a power of ten"
    for name, value in FACTORS.items():
        for ratio in (value, 1.0 / value):
            for scale in (1e-3, 1.0, 1e3):
                if abs(factor / (ratio * scale) - 1.0) < 0.005:
                    return name if scale == 1.0 else f"{name} times a power of ten"
    return ""


def _delay(compared: ComparedForce, allowed: float) -> Attempt:
    """Explain the difference by a command that is recorded some samples later or earlier."""
    u = compared.record.units.words
    trials = {n: compared.left(compared.force - shifted(compared.command, n)) for n in range(-LATEST // 2, LATEST + 1)}
    n = min(trials, key=lambda n: trials[n])
    late = "later" if n > 0 else "earlier"
    samples = "1 sample" if abs(n) == 1 else f"{abs(n)} samples"
    what = f"the {u.force} is the command of the law {samples} {late}."
    change = (
        f"Log {u.force}, position and reference of the same sample, or move the column of the {u.force} by {samples}"
        + (f'; if the drive acts so late, set delay = {n}, logged_force = "actual" in [servo].' if n > 0 else ".")
    )
    return Diagnosis((StudyFinding("delay", what, change),)), trials[n]


def _current_loop(compared: ComparedForce) -> Attempt:
    """Explain the difference by a force that is recorded behind the current loop, a low-pass filter of the command."""
    u, servo = compared.record.units.words, compared.servo
    sent = commanded(servo, compared.record)

    def left(order: int, late: int, logarithm: float) -> float:
        behind = filtered(LowPass(order, float(np.exp(logarithm))), sent, servo.Ts)
        return compared.left(compared.force - shifted(behind, late))

    tried = []
    for order, highest in ((1, FASTEST), (2, HIGHEST)):
        ends = np.log([LOWEST / servo.Ts, highest / servo.Ts]).tolist()
        for late in range(LATEST // 2 + 1):
            found = minimize_scalar(partial(left, order, late), bounds=ends, method="bounded")
            tried.append((found, order, late))
    enough = SIMPLER * min(found.fun for found, _, _ in tried)
    found, order, late = min(tried, key=lambda each: (each[0].fun > enough, each[1], each[0].fun))
    cutoff = float(np.exp(found.x))
    lag = (1.0 if order == 1 else 2.0 * BUTTERWORTH) / (2.0 * pi * cutoff)
    # the force at a sample is that before the command of this sample
    given = replace(servo, delay=max(late - 1, 0), logged_force="actual")
    one = order == 1
    given = replace(given, current_loop=cutoff * one, delay=given.delay + (0 if one else round(lag / servo.Ts)))
    what = (
        f"the {u.force} is that behind the current loop, a low-pass filter of the command of order {order} with a "
        f"bandwidth of {cutoff:.3g} Hz, a lag of {1e3 * lag:.3g} ms."
    )
    entries = {name: text for name, text in given.features.items() if servo.features.get(name) != text}
    if not given.delay and servo.delay:
        entries["delay"] = "0"
    change = f"Set {', '.join(map(' = '.join, entries.items()))} in [servo]{_better(compared, float(found.fun))}"
    finding = StudyFinding("current-loop", what, change)
    return Diagnosis((finding,), servo=given), float(found.fun)


def _feedforward(compared: ComparedForce, allowed: float) -> Attempt:
    """Explain the difference by a feedforward of the reference that the configuration does not contain."""
    difference = compared.force - compared.command
    fed = behind_notch(compared.servo, references(compared.record, compared.servo.Ts))
    columns = {name: compared.logged(column) for name, column in fed.items()}
    kept: dict[str, Array] = {}
    fit = fitted(compared, kept, difference)
    while len(kept) < len(columns) and fit.left > allowed:
        trials = {
            name: fitted(compared, {**kept, name: column}, difference)
            for name, column in columns.items()
            if name not in kept
        }
        name = min(trials, key=lambda name: trials[name].left)
        if trials[name].left > 0.8 * fit.left:
            break
        kept[name], fit = columns[name], trials[name]
    return Diagnosis(_added(compared, fit)), fit.left


def _window(compared: ComparedForce) -> Attempt:
    """Explain the difference by another number of samples over which the servo computes the velocity."""
    u = compared.record.units.words
    servo = compared.servo
    trials = {window: compared.left_by(replace(servo, window=window)) for window in range(1, WIDEST + 1)}
    window = min(trials, key=lambda n: trials[n])
    what = f"the {u.force} fits a velocity computed over {window} samples instead of {servo.window}."
    return Diagnosis((StudyFinding("wrong-window", what, f"Set window = {window} in [servo]."),)), trials[window]


def _gains(compared: ComparedForce, allowed: float) -> Attempt:
    """Explain the difference by other gains of the law: without an integral, and with one if that explains more."""
    servo = compared.servo
    timing: dict[str, Array] = {}
    if servo.velocity_feedforward:  # the drive may use the reference velocity of half a sample earlier or later
        timing["rdd"] = references(compared.record, servo.Ts)["rdd"]

    def of(integral: bool) -> LinearFit:
        columns = {**regressors(compared, integral=integral), **timing}
        return fitted(compared, {name: compared.logged(each) for name, each in columns.items()}, compared.force)

    fit = of(False)
    if fit.left > allowed:
        with_integral = of(True)
        fit = with_integral if with_integral.left < 0.5 * fit.left else fit
    gains = gains_of(compared, fit)
    return Diagnosis((_of_gains(compared.record.units.words, servo, gains),), gains), _possible(gains, fit.left)


def _gains_and_feedforward(compared: ComparedForce, allowed: float) -> Attempt:
    """Explain the difference by other gains and a feedforward together."""
    fit = _all_fitted(compared)
    gains = gains_of(compared, fit)
    columns = references(compared.record, compared.servo.Ts)
    shown = {name for name, values in columns.items() if abs(fit.values[name]) * rms(values[compared.used]) > allowed}
    found = () if _agree(compared.servo, gains) else (_of_gains(compared.record.units.words, compared.servo, gains),)
    return Diagnosis((*found, *_added(compared, fit, shown)), gains), _possible(gains, fit.left)


def _possible(gains: Sequence[IdentifiedParameter], left: float) -> float:
    """Return the residual that gains leave; infinity if one is negative, as no servo has it."""
    return left if all(gain.value > 0.0 for gain in gains) else np.inf


def _all_fitted(compared: ComparedForce) -> LinearFit:
    """Fit the recorded force by the signals of the law and of all feedforwards."""
    servo = compared.servo
    fed = behind_notch(servo, references(compared.record, servo.Ts))
    columns = {**regressors(compared, integral=bool(servo.pid[2])), **fed}
    late = {name: compared.logged(column) for name, column in columns.items()}
    return fitted(compared, late, compared.force)


def _of_gains(u: Words, servo: Servo, gains: Sequence[IdentifiedParameter]) -> StudyFinding:
    shown = [f"{gain.name} = {gain.value:.5g} ± {gain.standard_error:.2g}" for gain in gains]
    given = [f"{gain.name} = {servo.gains[gain.name]:.5g}" for gain in gains]
    lines = [f"{gain.name} = {gain.value:.6g}" for gain in gains]
    integral = GAINS[servo.law][-1]
    if servo.gains[integral] and len(gains) < len(GAINS[servo.law]):  # the record fits a law without integral
        shown.append(f"{integral} = 0")
        given.append(f"{integral} = {servo.gains[integral]:.5g}")
        lines.append(f"{integral} = 0")
    what = f"the {u.force} fits {', '.join(shown)} instead of {', '.join(given)}."
    return StudyFinding("wrong-gains", what, f"Set {', '.join(lines)} in [servo].")


def _added(compared: ComparedForce, fit: LinearFit, shown: set[str] | None = None) -> tuple[StudyFinding, ...]:
    """Return a sentence for each signal of `references` that the recorded force contains."""
    u, servo = compared.record.units.words, compared.servo
    Kd = fit.values.get("d", servo.pid[1])  # the estimated gain, as the configured one may be wrong
    declare = f"Log this {u.force} and declare its column as injected."
    better, found = _better(compared, fit.left), []
    for name in ("rd", "rdd", "sign", "constant"):
        if name not in fit.values or (shown is not None and name not in shown):
            continue
        value = fit.values[name]
        if name == "rd" and abs(abs(value) / Kd - 1.0) < 0.05 and (value < 0.0) == servo.velocity_feedforward:
            wanted = str(not servo.velocity_feedforward).lower()
            has = "has no velocity feedforward" if servo.velocity_feedforward else "has a velocity feedforward"
            change = f"Set velocity_feedforward = {wanted} in [servo]."
            what = f"the measured servo {has} ({value:.5g} {u.Ns_m} times the reference velocity)."
            found.append(StudyFinding("velocity-feedforward", what, change))
        elif name == "rdd" and servo.velocity_feedforward and abs(value) < LATEST * Kd * servo.Ts / 2.0:
            samples = -value / (Kd * servo.Ts)
            late = "later" if samples > 0.0 else "earlier"
            what = (
                f"the reference velocity of its feedforward is {abs(samples):.2g} samples {late} than that of the log."
            )
            change = f"Log the reference that the servo uses, in the same sample as position and {u.force}."
            found.append(StudyFinding("reference-timing", what, change))
        elif name == "rdd":
            what = f"the {u.force} contains the reference acceleration times {value:.5g} {u.kg}."
            total = value + servo.inertia_feedforward
            change = (
                f"Set inertia_feedforward = {total:.5g} in [servo]."
                if total > 0.0
                else f"Log {u.force}, position and reference of the same sample."
            )
            found.append(StudyFinding("inertia-feedforward", what, change))
        elif name in ("rd", "sign"):
            key, kind = ("viscous_feedforward", "viscous") if name == "rd" else ("coulomb_feedforward", "friction")
            size = f"the reference velocity times {value:.5g} {u.Ns_m}"
            size = size if name == "rd" else f"{value:.5g} {u.N} in the direction of the reference velocity"
            total = value + getattr(servo, key)
            change = f"Set {key} = {total:.5g} in [servo]{better}" if total >= 0.0 else declare
            found.append(StudyFinding(f"{kind}-feedforward", f"the {u.force} contains {size}.", change))
        else:
            what = f"a constant {u.force} of {value:.5g} {u.N} is added to the command."
            found.append(StudyFinding("constant-force", what, declare))
    return tuple(found)


def _injected(compared: ComparedForce) -> Diagnosis | None:
    """Return the diagnosis of a force that was added from outside, in pulses or periodic; None if there is none."""
    u = compared.record.units.words
    difference = compared.force - compared.command
    if compared.servo.pid[2]:
        difference = difference - np.median(difference[compared.used])
    said = pulses(compared, difference) or frequencies(compared, difference)
    if not said:
        return None
    change = (
        f"Add a column injected with this {u.force} to [columns]; until then the study uses the difference between "
        f"recorded {u.force} and command as injected {u.force}."
    )
    outside = np.where(compared.used, difference, 0.0)
    return Diagnosis(
        (StudyFinding("injected-force", f"a {u.force} is added from outside, {said}.", change),), (), outside
    )


NOTABLE: Final = 0.005  # residual over the rms force above which a filter of the drive is mentioned
MATCH: Final = 0.02  # residual over the rms force up to which the servo reproduces the record
TRUSTED: Final = 0.1  # residual over the rms force up to which the servo is simulated and its compensators are ranked

SETTLING: Final = 10
"""Number of samples, beyond the window of the velocity, that are not compared: the motion before them is unknown."""

SATURATED: Final = 0.98  # fraction of the force limit above which a sample is not compared


def commanded(servo: Servo, record: Record) -> Array:
    """Return the force that the servo commands for a recorded reference and position."""
    known, t = references(record, servo.Ts), servo.Ts * np.arange(float(len(record)))
    fed = servo.coulomb_feedforward * known["sign"] + servo.viscous_feedforward * known["rd"]
    columns = {"r": record.column("reference"), "rd": known["rd"] * servo.velocity_feedforward, "rdd": known["rdd"]}
    columns |= {"x": record.column("q"), "v": velocity(record, servo), "f": fed}
    series = SeriesPart("record", t, columns, interpolation="previous", beyond="hold")
    values = {**servo.gains, "u_min": -servo.force_limit, "u_max": servo.force_limit, "Ts": servo.Ts}
    start = {f"servo.{name}": value for name, value in {**values, "m": servo.inertia_feedforward}.items()}
    wires = [f"record.{name} -> servo.{name}" for name in columns]
    parts = [series, FmuPart("servo", block(servo.law, record.units.rotary))]
    experiment = Experiment(stop=len(t) * servo.Ts, step=servo.Ts, record=("servo.u",))
    with System(parts, wires, start, experiment, "servo_check") as system:
        result = system.run()
    # a row of the result has the force of the sampling period that ends there
    limited = np.asarray(result["servo.u"].to_numpy(), dtype=np.float64)[1:]
    return behind_notch(servo, {"u": limited})["u"]


@dataclass(frozen=True, eq=False)
class CheckedServo:
    """Result of the comparison, and the force that was added to that of the servo."""

    result: ServoCheck  # residual and findings
    included: bool = False  # whether the recorded force contains the injected force
    injected: Array | None = None
    """Force added to that of the servo from outside, as declared or as found; None without one."""
    servo: Servo | None = None  # servo with a filter that the record shows, with which the study goes on


def check_servo(record: Record, servo: Servo | None) -> CheckedServo:
    """Compare the servo with the recorded drive force."""
    missing = [name for name, values in (("reference", record.reference), ("position", record.q)) if values is None]
    u = record.units.words
    missing += [f"drive {u.force}"] if record.force is None else []
    if servo is None or missing:
        lacks = "the configuration has no servo" if servo is None else f"the record has no {' and no '.join(missing)}"
        if not missing and record.units.known:  # it was tried by `estimate_servo`
            lacks += f", and no known controller gives this {u.force}, which may be logged late or at a lower rate"
        reason = f"The servo was not compared with the record, because {lacks}."
        return CheckedServo(ServoCheck(reason=reason), injected=record.injected)
    compared = _compared(record, servo)
    level, residual = compared.level, compared.residual
    allowed = max(MATCH * level, _resolution(record, servo))
    t = record.t - record.t[0]
    result = ServoCheck(
        Fit(residual, _percent(residual, level), "force", record.units.force),
        _percent(allowed, level),
        recorded=thinned(t, compared.force),
        commanded=thinned(t, compared.command),
    )
    if residual > allowed:
        with threadpool_limits(1):  # a thread would take longer to start than one of these small fits
            found = explain(compared, allowed)
    elif residual > max(NOTABLE * level, 1.5 * _resolution(record, servo)) and not is_noise(compared):
        found, left = _filter(compared, allowed)
        found = found if left < residual / 3.0 else Diagnosis(())
    else:
        found = Diagnosis(())
    stops = residual > max(TRUSTED * level, allowed) and found.injected is None and not found.confirmed
    exactly = " exactly" if residual <= allowed else ""
    begin = (
        f"The servo as configured does not{exactly} reproduce the recorded drive {u.force} (residual "
        f"{_percent(residual, level):.3g} % of its rms value): "
    )
    findings = tuple(replace(each, what=begin + each.what, stops=stops) for each in found.explanations)
    if found.servo is not None and not stops:
        findings = tuple(replace(each, what=f"{each.what} The study goes on with it.") for each in findings)
    result = replace(result, findings=findings, gains=found.gains)
    if found.injected is None:
        return CheckedServo(result, compared.included, record.injected, None if stops else found.servo)
    return CheckedServo(result, True, found.injected)


def _compared(record: Record, servo: Servo) -> ComparedForce:
    """Return force and command; a declared injected force is taken out of the force if the force contains it."""
    assert record.force is not None
    command = commanded(servo, record)
    free = commanded(replace(servo, force_limit=1e6 * servo.force_limit), record)
    used = np.maximum(np.abs(record.force), np.abs(command)) < SATURATED * servo.force_limit
    used[: servo.window + SETTLING] = False
    if np.count_nonzero(used) < 50:  # a unit is so wrong that all samples exceed the limit
        used[servo.window + SETTLING :] = True
    whole = ComparedForce(record.force, command, free, used, servo, record)
    ways = [replace(whole, late=late, loop=loop) for late, loop in _ways(servo)]
    if len(ways) > 1:
        with threadpool_limits(1):  # a servo that lacks a feature must not decide it: with all of them fitted
            ways.sort(key=lambda each: _all_fitted(each).left)
    whole = replace(ways[0], command=ways[0].logged(command), unlimited=ways[0].logged(free))
    if record.injected is None:
        return whole
    without = replace(whole, force=record.force - record.injected, included=True)
    return without if without.residual < whole.residual else whole


def _ways(servo: Servo) -> list[tuple[int, LowPass | None]]:
    """Return how a column of the force may lag the command: delay in samples, and current loop."""
    command: list[tuple[int, LowPass | None]] = [(0, None)]
    actual: list[tuple[int, LowPass | None]] = [(servo.delay, None)]
    if servo.lag:  # the force at a sample is that before its command, unless it is read later
        actual = [(servo.delay + late, LowPass(1, servo.current_loop)) for late in (1, 0)]
    ways = {"command": command, "actual": actual}.get(servo.logged_force, [*command, *actual])
    return list(dict.fromkeys(ways))


def _resolution(record: Record, servo: Servo) -> float:
    """Return two standard deviations of the force that rounding of the recorded position causes."""
    rounding = max(record.quantum, servo.quantum) / np.sqrt(12.0)
    Kp, Kd, _ = servo.pid
    return float(2.0 * rounding * np.hypot(Kp, np.sqrt(2.0) * Kd / (servo.window * servo.Ts)))


def _percent(value: float, level: float) -> float:
    return 100.0 * value / level if level else 0.0


WINDOWS: Final = (1, 2, 3, 4, 6, 8)  # numbers of samples over which the velocity may be computed
FILTERED: Final = (1, 2)  # the same, if a low-pass filter follows
FEW: Final = 1500  # samples that are used in the search for a filter
DELAYS: Final = (0, 1, 2, 3)  # samples by which the recorded force may lag the command
EXACT: Final = 1e-3  # residual over the rms force up to which fits are equally good
PILED: Final = 0.01  # fraction of samples at the largest force above which it is the limit of the drive
NEAR_LIMIT: Final = 0.95  # share of the largest force above which a measured force may be that at the limit
BEYOND: Final = 1.5  # assumed limit over the largest recorded force, if the record does not show the limit


@dataclass(frozen=True, eq=False)
class EstimatedServo:
    """Servo, and how well it reproduces the record."""

    servo: Servo
    residual: float  # rms residual over the rms force
    finding: StudyFinding  # what was estimated, and what to check


@dataclass(frozen=True, eq=False)
class _Attempt:
    compared: ComparedForce  # its servo has no gains yet
    fit: LinearFit
    extras: int  # number of features beyond two gains

    def servo(self) -> Servo | None:
        """Return the servo with gains and feedforwards; None if one of them is negative."""
        servo, fed = self.compared.servo, [self.fit.values.get(name, 0.0) for name in ("rdd", "sign")]
        gains = {**servo.gains} | {gain.name: gain.value for gain in gains_of(self.compared, self.fit)}
        *needed, integral = (gains[name] for name in GAINS[servo.law])
        if min(needed) <= 0.0 or min(integral, *fed) < 0.0:
            return None
        return replace(servo, gains=gains, inertia_feedforward=fed[0], coulomb_feedforward=fed[1])


def estimate_servo(record: Record) -> EstimatedServo | None:
    """Return the servo that reproduces the recorded drive force, or None if none of the known laws does."""
    # The force is fitted by linear least squares for each velocity window, delay, and with or without feedforward of
    # the velocity, of the acceleration, of Coulomb friction, and integral action, and for a low-pass filter of the
    # velocity beside the best of them. Of those that fit nearly as well as the best, the one with the fewest features
    # is taken.
    if record.reference is None or record.q is None or record.force is None or len(record) < 20 * SETTLING:
        return None
    highest = float(np.max(np.abs(record.force)))
    if highest == 0.0:
        return None
    size, level = np.abs(record.force), rms(record.force)
    # A measured force is not exactly the limit: if no law reproduces the record, those near the largest one may be.
    near = float(np.median(size[size >= NEAR_LIMIT * highest]))
    piled = float(np.mean(size >= (1.0 - 1e-6) * highest)) > PILED
    for limit in (highest,) if piled else (BEYOND * highest, near):
        with threadpool_limits(1):  # a thread would take longer to start than one of these small fits
            attempts = list(_attempts(record, limit))
        least = min((attempt.fit.left for attempt in attempts), default=0.0)
        good = [each for each in attempts if each.fit.left <= max(SIMPLER * least, EXACT * level)]
        for attempt in sorted(good, key=lambda each: (each.extras, each.fit.left)):
            servo, residual = attempt.servo(), attempt.fit.left / level
            if servo is not None and residual <= TRUSTED:
                return EstimatedServo(servo, residual, _finding(record, servo, residual, limit <= highest))
    return None


def _attempts(record: Record, limit: float) -> Iterator[_Attempt]:
    """Yield the fits of all combinations, and of filters beside the best of them."""
    assert record.force is not None
    inside = np.abs(record.force) < SATURATED * limit
    inside &= binary_erosion(inside, iterations=max(DELAYS))
    inside[: max(WINDOWS) + SETTLING + max(DELAYS)] = False
    if np.count_nonzero(inside) < 10 * SETTLING:
        return
    none = Servo("PID", dict.fromkeys(GAINS["PID"], 0.0), record.Ts, limit, quantum=record.quantum)
    compared = ComparedForce(record.force, record.force, record.force, inside, none, record).thinned(ENOUGH)
    attempts = []
    for window, delay, fed, coulomb, inertia, integral in product(WINDOWS, DELAYS, *((False, True),) * 4):
        servo = replace(none, window=window, velocity_feedforward=fed, delay=delay)
        attempts.append(_fitted(replace(compared, servo=servo), coulomb, inertia, integral))
        yield attempts[-1]
    best = min(attempts, key=lambda each: each.fit.left)
    has = [name in best.fit.values for name in ("sign", "rdd", "integral of e")]
    few = compared.thinned(FEW)

    def left(servo: Servo) -> float:
        return _fitted(replace(few, servo=servo), *has).fit.left

    for name in ("velocity-filter", "velocity-filter-2"):
        start = best.compared.servo
        begins = [replace(start, window=window, delay=delay) for window, delay in product(FILTERED, DELAYS)]
        servo, _ = min((best_filter(name, each, left, 20) for each in begins), key=itemgetter(1))
        for fed, *flags in product(*((False, True),) * 4):
            yield _fitted(replace(compared, servo=replace(servo, velocity_feedforward=fed)), *flags)


def _fitted(compared: ComparedForce, coulomb: bool, inertia: bool, integral: bool) -> _Attempt:
    """Fit the gains of a servo, with these feedforwards and an integral or without."""
    law = "PID" if integral else "CascadePPI"
    servo = replace(compared.servo, law=law, gains=dict.fromkeys(GAINS[law], 0.0))
    compared = replace(compared, servo=servo)
    known = references(compared.record, servo.Ts)
    columns = regressors(compared, integral=integral)
    columns |= {name: known[name] for name, has in (("sign", coulomb), ("rdd", inertia)) if has}
    late = {name: shifted(column, servo.delay) for name, column in columns.items()}
    extras = servo.velocity_feedforward + coulomb + inertia + 2 * integral + (servo.delay > 0)
    extras += servo.velocity_filter is not None
    return _Attempt(compared, fitted(compared, late, compared.force), extras)


def _finding(record: Record, servo: Servo, residual: float, piled: bool) -> StudyFinding:
    u = record.units.words
    gains = ", ".join(f"{name} = {value:.4g}" for name, value in servo.gains.items() if value)
    parts = [f"{servo.law} with {gains}, velocity over {servo.window} samples"]
    parts += [f"{name} = {value}" for name, value in servo.features.items()]
    what = (
        f"The controller was estimated from the record: {', '.join(parts)}. It reproduces the {u.force} within "
        f"{100.0 * residual:.2g} % of its rms value. The {u.force} limit, {servo.force_limit:.4g} {u.N}, is "
        + (
            "the largest one of the record."
            if piled
            else f"assumed: the record reaches {servo.force_limit / BEYOND:.4g} {u.N}."
        )
    )
    return StudyFinding("servo-estimated", what, "Compare it with the settings of the drive, and correct [servo].")
