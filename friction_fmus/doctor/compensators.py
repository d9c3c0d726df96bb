"""Rules of single laws: which of their conditions apply to an axis, and with which numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from friction_fmus import conditions
from friction_fmus.blocks.arithmetic import evaluate
from friction_fmus.blocks.contact import Level
from friction_fmus.conditions import Condition
from friction_fmus.conditions.condition import below, remainder
from friction_fmus.doctor.axis import ActiveLaw, Axis, Values

Array: TypeAlias = NDArray[np.float64]
Lowpass: TypeAlias = Callable[[Array, Values], Array]


def butterworth_there_and_back(frequency: Array, p: Values) -> Array:
    """Return Q of IterativeLearning: a second-order Butterworth filter, forward and backward; 1 for fq = 0."""
    fq, Ts = p["fq"], p["Ts"]
    if not 0.0 < fq < 0.5 / Ts:
        return np.ones_like(frequency)
    return np.asarray(1.0 / (1.0 + (np.tan(np.pi * frequency * Ts) / np.tan(np.pi * fq * Ts)) ** 4))


def windowed_sinc(frequency: Array, p: Values) -> Array:
    """Return Q of RepetitiveController: a low-pass filter over M samples to each side, with a squared-cosine window."""
    fq, Ts, M = p["fq"], p["Ts"], int(p["M"])
    if not 0.0 < fq < 0.5 / Ts or M == 0:
        return np.ones_like(frequency)
    i = np.arange(-M, M + 1)
    q = np.sinc(2.0 * fq * Ts * i) * np.cos(np.pi * i / (2.0 * (M + 1))) ** 2
    return np.asarray(np.cos(2.0 * np.pi * np.outer(frequency * Ts, i)) @ (q / q.sum()))


def trials_contract(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the convergence condition of iterative learning with a position loop."""
    yield from _contract(axis, used, butterworth_there_and_back)


def periods_contract(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the convergence condition of repetitive control with a position loop."""
    yield from _contract(axis, used, windowed_sinc)


def _contract(axis: Axis, used: ActiveLaw, lowpass: Lowpass) -> Iterator[Condition]:
    """Evaluate the condition on the sampled loop, from 1/(N Ts), the lowest frequency that can be learned."""
    gains, p = axis.servo.gains if axis.servo else None, used.values
    if gains is None:
        return
    Ts = p["Ts"]
    frequency = np.linspace(1.0 / (p["N"] * Ts), 0.5 / Ts, 4001)
    viscous = axis.damping + (axis.contact.levels[0].viscous if axis.contact else 0.0)
    loop = (axis.m, viscous, gains.Kp, gains.Kd, gains.Ki, Ts, axis.stiffness)
    sensitivity = used.to_force * p["gain"] * conditions.sampled_sensitivity(frequency, *loop)
    learning = conditions.learning_filter(frequency, p["m"], p["Kp"], p["Kd"], p["Ki"], Ts)
    yield conditions.contraction(frequency, sensitivity, learning, lowpass(frequency, p), p["rate"])


def share_of(used: ActiveLaw) -> float:
    """Return the fraction of the friction computed by a law that acts on the plant."""
    return used.to_force * used.values.get("gain", 1.0)


def left_of(axis: Axis, side: int, feedforward: bool = False) -> Level:
    """Return the friction in one direction that remains after compensation.

    Only observers that also act at rest count; with `feedforward`, all compensators count.
    """
    assert axis.contact is not None
    left = axis.contact.levels[side]
    for used in axis.laws:
        if used.law.levels is not None and (used.law.at_rest or feedforward):
            share, known = share_of(used), used.law.levels(used.values)[side]
            left = replace(
                left,
                Fc=max(remainder(left.Fc, share * known.Fc), 0.0),
                Fs=max(remainder(left.Fs, share * known.Fs), 0.0),
                viscous=remainder(left.viscous, share * known.viscous),
            )
    return left


def injection_of_error(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the condition on a LuGre observer that is corrected by the position error, k > 0."""
    gains = axis.servo.gains if axis.servo else None
    p = used.values
    if gains is not None and p["k"] > 0.0:
        yield conditions.injection(axis.m, gains.Kp, gains.Kd, gains.Ki, p["sigma0"], p["sigma1"], axis.words)


def feeds_stiffness_back(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the condition on a law whose contact model, of bristles or elements, follows the measured motion."""
    gains = axis.servo.gains if axis.servo else None
    if gains is not None and axis.contact is not None:
        stiffness = axis.contact.stiffness + axis.stiffness + gains.Kp
        if axis.contact.stiffness:  # a rigid contact is stiffer than any model of it
            fed_back = float(evaluate("either(sigma0, sum(k))", used.values))
            yield conditions.fed_back_stiffness(share_of(used) * fed_back, stiffness, axis.words)


def covers_friction(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the condition that a set-valued sliding mode covers the friction not compensated by other laws."""
    if axis.contact is not None:
        left = [left_of(axis, side, feedforward=True) for side in (0, 1)]
        yield conditions.sliding_gain(
            share_of(used) * used.values["K"], max(max(at.Fc, at.Fs) for at in left), axis.words
        )


def follows_friction(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the condition on the gains of a super-twisting law."""
    yield conditions.super_twisting(used.values["c1"], used.values["c2"])


def adapts(texts: tuple[str, ...], axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the stability condition of an adaptation, from the expressions of its rate and its damping."""
    rate, damping = (float(evaluate(text, used.values)) for text in texts)
    yield conditions.adaptation(rate, damping, axis.m, used.values["Ts"], axis.words)


def looks_ahead(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the condition on the preview of a non-causal inverse; zero-phase tracking (ZPETC) needs none."""
    p = used.values
    if not p["zero_phase"]:
        yield conditions.preview(p["zero"], p["preview"])


def dithers(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the conditions on the frequency and the stroke of a dither."""
    p = used.values
    force = abs(share_of(used)) * p["Ad"]
    if force == 0.0:
        return
    yield conditions.dither_frequency(p["frequency"], p["Ts"])
    if axis.contact is not None and axis.contact.stiffness:
        F = max(max(at.Fc, at.Fs) for at in axis.contact.levels)
        yield conditions.dither_stroke(force, p["frequency"], axis.m, F, axis.contact.stiffness, axis.words)


def pushes(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the condition on force pulses, for errors from the tolerance to a thousand times the tolerance."""
    p = used.values
    if axis.contact is None or p["tol"] <= 0.0:
        return
    worst = max(axis.contact.levels, key=lambda at: at.Fs - at.Fc)
    if worst.Fc <= 0.0:
        return
    tp = p["n_pulse"] * p["Ts"]
    errors = p["tol"] * np.geomspace(1.0, 1e3, 301)
    if p["sized"]:
        forces = (p["Fc"] + np.sqrt(p["Fc"] ** 2 + 8.0 * p["m"] * p["Fc"] * p["gain"] * errors / tp**2)) / 2.0
        forces = np.maximum(forces, p["Fs"])
    else:
        errors, forces = errors[:1], np.array([p["F_pulse"]])
    most = min(used.path.high, -used.path.low)
    sent = np.minimum(abs(used.to_force) * forces, most)
    short = np.array([below(float(F), most) for F in sent])
    kept = short | (np.arange(len(sent)) == 0)  # a pulse at the force limit is repeated: one is enough
    gains = axis.servo.gains if axis.servo else None
    loop = (gains.Kp, gains.Kd) if gains else (0.0, 0.0)
    yield conditions.pulses(errors[kept], sent[kept], worst.Fc, worst.Fs, tp, axis.m, *loop, axis.words)
