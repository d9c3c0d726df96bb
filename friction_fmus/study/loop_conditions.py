"""Conditions from the literature for the loop of an axis, with the numbers of servo, axis and compensators."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from friction_fmus import conditions
from friction_fmus.axis.loop_assembly import with_friction
from friction_fmus.axis.servo import AxisPlant, Compensator, Servo, coefficients
from friction_fmus.blocks.axis_units import Words
from friction_fmus.blocks.block_declarations import Use
from friction_fmus.blocks.catalogue import find
from friction_fmus.blocks.contact import AxisFriction, Friction, Level
from friction_fmus.conditions import Condition
from friction_fmus.conditions.condition import above, first_largest, remainder, spectral_radius
from friction_fmus.errors import FrictionError
from friction_fmus.study.evaluation import AxisBench, Scheme
from friction_fmus.study.margins import driven, laws_of, named, path_of, sliding, viscous_beside, with_starts

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AddedLaw:
    """Compensator that is added to the servo."""

    model: str
    use: Use
    friction: Friction | None
    """Name of the block, and what its file says about it."""
    values: Mapping[str, float]  # parameters
    gain: float  # gain of the connection from its output to the force

    @property
    def share(self) -> float:
        """Fraction of the friction computed by the law that acts on the axis."""
        return self.gain * self.values.get("gain", 1.0)

    @property
    def at_rest(self) -> bool:
        """Whether it follows the measured motion and so also compensates friction at rest."""
        return self.friction is not None and self.friction.stiffness != "0"

    def value(self, name: str) -> float:
        """Return a parameter that the rule of the law needs."""
        if name not in self.values:
            raise FrictionError(
                f"{self.model} has the rule {self.use.rule!r}, but no parameter {name}: add it or remove the rule"
            )
        return self.values[name]

    def level(self, side: int) -> Level:
        """Return the friction that the law computes, forward or backward."""
        assert self.friction is not None
        return self.friction.levels(self.values)[side]


@dataclass(frozen=True)
class ExaminedLoop:
    """Loop of an axis with the laws that are added to its servo."""

    servo: Servo
    plant: AxisPlant
    added: tuple[AddedLaw, ...]
    estimator: tuple[Compensator, str, float] | None  # estimator that can be linearised, its kind and its gain
    words: Words  # nouns and units of the axis

    @cached_property
    def contact(self) -> AxisFriction | None:
        """Friction of the axis; None if its level changes with a load, or if the file of the block does not say it."""
        friction = find(self.plant.friction).about.friction
        if friction is None or self.plant.loaded:
            return None
        return friction.contact(with_starts(self.plant.friction, self.plant.values))

    @property
    def damping(self) -> float:
        """Coefficient of the viscous friction beside the friction block [N.s/m]."""
        return viscous_beside(self.plant)

    def left(self, side: int) -> Level:
        """Return the friction in one direction that is left by the laws which compensate it at rest."""
        assert self.contact is not None
        left = self.contact.levels[side]
        for law in self.added:
            if law.at_rest:
                known = law.level(side)
                left = replace(
                    left,
                    Fc=max(remainder(left.Fc, law.share * known.Fc), 0.0),
                    Fs=max(remainder(left.Fs, law.share * known.Fs), 0.0),
                    viscous=remainder(left.viscous, law.share * known.viscous),
                )
        return left

    def laws(self, Ts: float, estimating: bool) -> list[conditions.SampledLaw]:
        """Return the linear laws in the loop at a sample time, with or without the estimator."""
        servo = replace(self.servo, Ts=Ts)
        found = laws_of(servo, *self.estimator, 0.0) if estimating and self.estimator else laws_of(servo)
        assert found is not None
        return found


def loop_conditions(bench: AxisBench, scheme: Scheme) -> list[Condition]:
    """Return the conditions that apply to an axis with a scheme in its words, including those that hold."""
    one, other, gain = scheme.compensator, scheme.feedforward, scheme.gain
    if one is None:
        one, other, gain = other, None, 1.0
    one, other = with_friction(scheme.servo, one, other)
    added, estimator = [], None
    for law, own in ((one, gain), (other, 1.0)):
        if law is not None:
            found = find(law.model)
            assert found.about.use is not None
            added.append(
                AddedLaw(law.model, found.about.use, found.about.friction, with_starts(law.model, law.values), own)
            )
            if found.about.use.kind == "estimator" and (found.is_law or found.about.use.linear):
                estimator = law, "estimator", own
    loop = ExaminedLoop(scheme.servo, bench.plant, tuple(added), estimator, bench.trajectory.words)
    return [condition.in_words(loop.words) for condition in _applying(loop)]


def _applying(loop: ExaminedLoop) -> Iterator[Condition]:
    left = [loop.left(side) for side in (0, 1)] if loop.contact else []
    Kp, Kd, Ki = loop.servo.pid
    viscous = min((level.viscous for level in left), default=0.0)
    yield conditions.routh(loop.plant.mass, loop.damping + viscous, Kp, Kd, Ki)
    yield from _regimes(loop, viscous, False)
    if loop.estimator:
        yield from _regimes(loop, viscous, True)
    if loop.contact:
        yield from _stick_slip(loop, left)
        yield _hunting(loop, left, loop.contact)
        yield _break_away(loop, loop.contact)
        if loop.servo.quantum:
            yield _encoder(loop, loop.contact)
        yield from _compensated(loop, loop.contact)
    for law in loop.added:
        if law.at_rest and loop.contact and loop.contact.stiffness:  # a rigid contact is stiffer than any model of it
            assert law.friction is not None
            fed_back = law.share * law.friction.contact(law.values).stiffness
            yield conditions.fed_back_stiffness(fed_back, loop.contact.stiffness + Kp)
        if law.use.rule:
            yield from named(law.use.rule, RULES, "rule", law.model)(loop, law)


_BUZZ: Final = (
    "in presliding the contact acts as a spring, and the loop with this spring is unstable: the axis buzzes at rest"
)
_INVERSE: Final = (
    "the model in the estimator differs too much from the plant: |Q D| < 1 is violated and oscillations grow"
)


def _regimes(loop: ExaminedLoop, viscous: float, estimating: bool) -> Iterator[Condition]:
    """Yield the stability of the loop in sliding and, if that holds, in presliding."""
    found = _poles(loop, viscous, 0.0, "in sliding", estimating)
    yield found
    contact = loop.contact
    if found.ok and contact is not None and contact.stiffness:
        where = f"in presliding (stiffness {contact.stiffness:.4g} {loop.words.N_m})"
        yield _poles(loop, contact.damping + contact.viscous, contact.stiffness, where, estimating)


def _poles(loop: ExaminedLoop, damping: float, stiffness: float, where: str, estimating: bool) -> Condition:
    texts = {}
    if estimating:
        texts = {"name": "disturbance observer", "why": _INVERSE}
        texts["hint"] = f"lower the bandwidth of the estimator, correct its {loop.words.mass}"
    elif loop.plant.load is not None:
        p = loop.plant.load.parameters(loop.plant.mass)
        frequency = math.sqrt(p["k"] * (p["m1"] + p["m2"]) / (p["m1"] * p["m2"])) / (2.0 * math.pi)
        texts["why"] = (
            f"motor and load resonate at {frequency:.4g} Hz, and with its delays the loop excites this resonance: the "
            "oscillation grows"
        )
    elif stiffness:
        texts = {"name": "presliding loop", "why": _BUZZ}
    plant, servo = driven(loop.plant, loop.damping + damping, stiffness), loop.servo
    return conditions.loop_poles(
        plant, lambda Ts: loop.laws(Ts, estimating), servo.Ts, path_of(servo), where=where, **texts
    )


def _stick_slip(loop: ExaminedLoop, left: list[Level]) -> Iterator[Condition]:
    """Yield stick-slip from the damping of the position loop, or from the poles if the loop has more dynamics."""
    falling_curves = [at for at in left if at.vs and above(at.Fs, at.Fc)]
    if not falling_curves:
        return

    def fall(at: Level) -> float:
        return conditions.steepest_fall(at.Fc, at.Fs, at.vs or 0.0, at.delta)

    worst = max(falling_curves, key=fall)
    (Kp, Kd, Ki), path = loop.servo.pid, path_of(loop.servo)
    dynamic = (loop.plant.load, path.tau, path.delay, path.lowpass, path.notch, loop.estimator)
    if any(dynamic) and math.isfinite(fall(worst)):
        if _poles(loop, worst.viscous, 0.0, "", bool(loop.estimator)).ok:
            yield _falling(loop, worst)
        return
    taken = loop.plant.mass * Ki / Kp if Kp > 0.0 and Ki > 0.0 else 0.0
    falls = [
        conditions.stick_slip_free(Kd, loop.damping + at.viscous, at.Fc, at.Fs, at.vs or 0.0, at.delta, taken)
        for at in falling_curves
    ]
    yield max(falls, key=lambda found: found.bound - found.value)


def _falling(loop: ExaminedLoop, level: Level) -> Condition:
    """Return the stability of slow motion at the least stable speed."""
    assert loop.contact is not None
    assert level.vs is not None
    servo, path, u = loop.servo, path_of(loop.servo), loop.words
    speeds = level.vs * np.geomspace(0.05, 5.0, 31)
    slopes = np.gradient(level.at(speeds), speeds)
    laws = loop.laws(servo.Ts, True)
    found = []
    for v, slope in zip(speeds.tolist(), slopes.tolist(), strict=True):
        plant = sliding(loop.plant, loop.contact, level, loop.damping, v, slope)
        found.append((spectral_radius(conditions.chain(plant, laws, servo.Ts, path)), v, slope, plant))
    _, v, slope, plant = found[first_largest([radius for radius, *_ in found])]
    return conditions.loop_poles(
        *(plant, lambda Ts: loop.laws(Ts, True), servo.Ts, path),
        name="stick-slip",
        where=f"at {v:.4g} {u.m_s}, where friction falls by {-slope:.4g} {u.Ns_m},",
        why="friction falls with speed faster than the loop's damping can make up for: slow motion is unstable "
        "(stick-slip)",
        hint="raise the damping of the loop or the bandwidth of the estimator, or compensate the friction",
    )


def _hunting(loop: ExaminedLoop, left: list[Level], contact: AxisFriction) -> Condition:
    """Return whether the axis hunts, in its worse direction."""
    at, (Kp, Kd, Ki) = max(left, key=lambda level: level.Fs - level.Fc), loop.servo.pid
    integral = Ki > 0.0 and Kp > 0.0
    viscous = loop.damping + at.viscous
    slip = conditions.expected_slip(loop.plant.mass, viscous, Kp, Kd, at.Fc, at.Fs) if integral else math.inf
    return conditions.hunting(Ki, at.Fc, at.Fs, slip, at.Fs / contact.stiffness if contact.stiffness > 0.0 else 0.0)


def _break_away(loop: ExaminedLoop, contact: AxisFriction) -> Condition:
    side = max((0, 1), key=lambda side: contact.levels[side].Fs)
    return conditions.break_away(loop.servo.force_limit, contact.levels[side].Fs, ("forward", "backward")[side])


def _encoder(loop: ExaminedLoop, contact: AxisFriction) -> Condition:
    servo, lowpass = loop.servo, loop.servo.velocity_filter
    laws = loop.laws(servo.Ts, True)
    Kp, Kd = (float(sum(law.D[i] for law in laws)) for i in (0, 1))
    window = servo.window * servo.Ts
    if lowpass is not None:  # the largest velocity of one count is that of this longer window
        count = np.zeros(servo.window + math.ceil(1.0 / (lowpass.cutoff * servo.Ts)))
        count[: servo.window] = 1.0
        window /= float(np.max(lfilter(*coefficients(lowpass, servo.Ts), count)))
    return conditions.encoder_count(servo.quantum, Kp, Kd, min(at.Fs for at in contact.levels), window)


def _compensated(loop: ExaminedLoop, contact: AxisFriction) -> Iterator[Condition]:
    """Yield the ratio of all compensated friction to the friction of the axis, at the worst speed."""
    known = [law for law in loop.added if law.friction is not None]
    if not known:
        return
    worst = 0.0
    for side, level in enumerate(contact.levels):
        scales = [at.vs for at in (level, *(law.level(side) for law in known)) if at.vs]
        speeds = np.geomspace(1e-3 * min(scales, default=1.0), 1e3 * max(scales, default=1.0), 1000)
        there = level.at(speeds)
        total = sum(law.share * law.level(side).at(speeds) for law in known)
        if there.min() > 0.0:
            worst = max(worst, float(np.max(total / there)))
    yield conditions.overcompensation(worst, any(law.use.kind == "model feedback" for law in known))


def _dither(loop: ExaminedLoop, law: AddedLaw) -> Iterator[Condition]:
    """Yield the condition on the stroke of a dither."""
    contact, force = loop.contact, abs(law.share) * law.value("Ad")
    if contact is not None and contact.stiffness and force:
        F = max(max(at.Fc, at.Fs) for at in contact.levels)
        yield conditions.dither_stroke(force, law.value("frequency"), loop.plant.mass, F, contact.stiffness)


def windowed_sinc(frequency: Array, fq: float, Ts: float, M: int) -> Array:
    """Return Q of RepetitiveController: a low-pass filter over M samples to each side, with a squared-cosine window."""
    if not 0.0 < fq < 0.5 / Ts or M == 0:
        return np.ones_like(frequency)
    i = np.arange(-M, M + 1)
    q = np.sinc(2.0 * fq * Ts * i) * np.cos(np.pi * i / (2.0 * (M + 1))) ** 2
    return np.asarray(np.cos(2.0 * np.pi * np.outer(frequency * Ts, i)) @ (q / q.sum()))


def _contraction(loop: ExaminedLoop, law: AddedLaw) -> Iterator[Condition]:
    """Yield the convergence of repetitive control, from 1/(N Ts), the lowest frequency that can be learned."""
    Ts, (m, Kp, Kd, Ki) = loop.servo.Ts, (law.value(name) for name in ("m", "Kp", "Kd", "Ki"))
    frequency = np.linspace(1.0 / (law.value("N") * Ts), 0.5 / Ts, 4001)
    viscous = loop.damping + (loop.contact.levels[0].viscous if loop.contact else 0.0)
    sensitivity = conditions.sampled_sensitivity(frequency, loop.plant.mass, viscous, *loop.servo.pid, Ts)
    learning = conditions.learning_filter(frequency, m, Kp, Kd, Ki, Ts)
    lowpass = windowed_sinc(frequency, law.value("fq"), Ts, int(law.value("M")))
    yield conditions.contraction(frequency, law.share * sensitivity, learning, lowpass, law.value("rate"))


RULES: Final[Mapping[str, Callable[[ExaminedLoop, AddedLaw], Iterator[Condition]]]] = {
    "contraction": _contraction,
    "dither_stroke": _dither,
}
"""Further conditions that the file of a law can name, see `Use.rule`."""
