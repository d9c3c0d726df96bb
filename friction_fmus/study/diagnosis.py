"""Reasons why a servo does not reproduce the recorded drive force, and what to change.

Each explanation is a small model of the recorded force. The simplest one that leaves at most `EXPLAINED` of the
residual, and not much more than the best one, is reported. A residual that none of them explains and that lies in
pulses or at a few frequencies is a force that was added from outside.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi
from typing import Final, TypeAlias

import numpy as np

from friction_fmus.axis.servo import GAINS, Servo
from friction_fmus.identification import Array
from friction_fmus.study.injection import frequencies, pulses
from friction_fmus.study.records import IdentifiedParameter
from friction_fmus.study.regression import (
    Comparison,
    LinearFit,
    fitted,
    gains_of,
    references,
    regressors,
    rms,
    shifted,
    velocity,
)

EXPLAINED: Final = 0.2
"""Largest part of the residual that an explanation leaves."""

LATEST: Final = 8
"""Largest delay between command and recorded force that is tried, in samples; half of it for a force that leads."""

WIDEST: Final = 16
"""Largest window of the velocity that is tried, in samples."""

CONFIRMED: Final = 0.05
"""Relative difference up to which a configured gain agrees with the one that the record shows."""

FACTORS: Final[Mapping[str, float]] = {
    "the ratio of N and lbf": 4.4482216,
    "the ratio of kgf and N": 9.80665,
    "the ratio of in and mm": 25.4,
    "2 pi, the ratio of turns and rad": 2.0 * pi,
    "the ratio of rad and degrees": 180.0 / pi,
    "the ratio of minutes and seconds": 60.0,
}
"""Factors between units that are often confused, besides powers of ten."""


@dataclass(frozen=True)
class Explanation:
    """Explanation of a residual: name, sentence and change, as in `StudyFinding`."""

    name: str
    what: str
    change: str


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Explanations of a residual."""

    explanations: tuple[Explanation, ...]
    """Explanations that hold together."""
    gains: tuple[IdentifiedParameter, ...] = ()
    """Gains that the record shows; empty if they are not estimated."""
    injected: Array | None = None
    """Force added from outside."""
    confirmed: bool = False
    """Whether the record shows the configured gains, although it contains another force."""


def explain(compared: Comparison, allowed: float) -> Diagnosis:
    """Return why the servo does not reproduce the recorded force."""
    enough = max(allowed, EXPLAINED * compared.residual)
    attempts = [
        attempt(compared, allowed)
        for attempt in (_factor, _delay, _feedforward, _window, _gains, _gains_and_feedforward)
    ]
    least = max(allowed, 2.0 * min(left for _, left in attempts))
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
        "Check the law, window and Ts of the servo; log the force that its law commands, before filters and limits, "
        "and add a column injected if another force is added to it."
    )
    gains = _gains(compared, allowed)[0].gains
    configured = compared.servo.gains
    confirmed = all(abs(gain.value / configured[gain.name] - 1.0) < CONFIRMED for gain in gains if gain.name[1:] != "i")
    if confirmed:
        what = "the gains agree with the record, but the force contains noise or another force."
    return Diagnosis((Explanation("servo-unexplained", what, change),), gains, confirmed=confirmed)


Attempt: TypeAlias = tuple[Diagnosis, float]


def _factor(compared: Comparison, allowed: float) -> Attempt:
    """Explain the difference by a constant factor: a sign, a unit, or the outer gain of the law."""
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
        what = "the force is the command with the opposite sign."
        change = "Set sign = -1 for the force in [columns], or for position and reference, whichever is inverted."
        return Diagnosis((Explanation("wrong-sign", what, change),)), left
    unit = _unit(abs(factor))
    what = f"the force is {factor:.4g} times the command" + (f", which is {unit}." if unit else ".")
    change = f"Set {values} in [servo], or correct the unit of force, position and reference."
    if factor < 0.0:
        return Diagnosis((Explanation("wrong-sign-and-unit", what, "Correct sign and unit of the force."),)), left
    name = "wrong-unit-or-gain" if unit else "wrong-gain"
    return Diagnosis((Explanation(name, what, change),), _gains(compared, allowed)[0].gains), left


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


def _delay(compared: Comparison, allowed: float) -> Attempt:
    """Explain the difference by a command that is recorded some samples later or earlier."""
    trials = {n: compared.left(compared.force - shifted(compared.command, n)) for n in range(-LATEST // 2, LATEST + 1)}
    n = min(trials, key=lambda n: trials[n])
    late = "later" if n > 0 else "earlier"
    samples = "1 sample" if abs(n) == 1 else f"{abs(n)} samples"
    what = f"the force is the command of the law {samples} {late}."
    change = f"Log force, position and reference of the same sample, or move the column of the force by {samples}."
    return Diagnosis((Explanation("delay", what, change),)), trials[n]


def _feedforward(compared: Comparison, allowed: float) -> Attempt:
    """Explain the difference by a feedforward of the reference that the configuration does not contain."""
    difference = compared.force - compared.command
    columns = references(compared.record, compared.servo.Ts)
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


def _window(compared: Comparison, allowed: float) -> Attempt:
    """Explain the difference by another number of samples over which the servo computes the velocity."""
    servo = compared.servo
    Kd = servo.pid[1]
    v = velocity(compared.record, servo.Ts, servo.window)
    trials = {}
    for window in range(1, WIDEST + 1):
        command = compared.command + Kd * (v - velocity(compared.record, servo.Ts, window))
        trials[window] = compared.left(compared.force - command)
    window = min(trials, key=lambda n: trials[n])
    what = f"the force fits a velocity computed over {window} samples instead of {servo.window}."
    return Diagnosis((Explanation("wrong-window", what, f"Set window = {window} in [servo]."),)), trials[window]


def _gains(compared: Comparison, allowed: float) -> Attempt:
    """Explain the difference by other gains of the law: without an integral, and with one if that explains more."""
    servo = compared.servo
    timing: dict[str, Array] = {}
    if servo.velocity_feedforward:  # the drive may use the reference velocity of half a sample earlier or later
        timing["rdd"] = references(compared.record, servo.Ts)["rdd"]
    fit = fitted(compared, {**regressors(compared, integral=False), **timing}, compared.force)
    if fit.left > allowed:
        with_integral = fitted(compared, {**regressors(compared, integral=True), **timing}, compared.force)
        fit = with_integral if with_integral.left < 0.5 * fit.left else fit
    gains = gains_of(compared, fit)
    return Diagnosis((_of_gains(servo, gains),), gains), fit.left


def _gains_and_feedforward(compared: Comparison, allowed: float) -> Attempt:
    """Explain the difference by other gains and a feedforward together."""
    servo = compared.servo
    columns = {**regressors(compared, integral=bool(servo.pid[2])), **references(compared.record, servo.Ts)}
    fit = fitted(compared, columns, compared.force)
    gains = gains_of(compared, fit)
    sizes = {name: abs(fit.values[name]) * rms(column[compared.used]) for name, column in columns.items()}
    shown = {name for name, size in sizes.items() if size > allowed}
    return Diagnosis((_of_gains(servo, gains), *_added(compared, fit, shown)), gains), fit.left


def _of_gains(servo: Servo, gains: Sequence[IdentifiedParameter]) -> Explanation:
    shown = [f"{gain.name} = {gain.value:.5g} ± {gain.standard_error:.2g}" for gain in gains]
    given = [f"{gain.name} = {servo.gains[gain.name]:.5g}" for gain in gains]
    lines = [f"{gain.name} = {gain.value:.6g}" for gain in gains]
    integral = GAINS[servo.law][-1]
    if servo.gains[integral] and len(gains) < len(GAINS[servo.law]):  # the record fits a law without integral
        shown.append(f"{integral} = 0")
        given.append(f"{integral} = {servo.gains[integral]:.5g}")
        lines.append(f"{integral} = 0")
    what = f"the force fits {', '.join(shown)} instead of {', '.join(given)}."
    return Explanation("wrong-gains", what, f"Set {', '.join(lines)} in [servo].")


def _added(compared: Comparison, fit: LinearFit, shown: set[str] | None = None) -> tuple[Explanation, ...]:
    """Return a sentence for each signal of `references` that the recorded force contains."""
    units, servo = compared.record.units, compared.servo
    Kd = servo.pid[1]
    declare = "Log this force and declare its column as injected."
    found = []
    for name in ("rd", "rdd", "sign", "constant"):
        if name not in fit.values or (shown is not None and name not in shown):
            continue
        value = fit.values[name]
        if name == "rd" and abs(abs(value) / Kd - 1.0) < 0.05 and (value < 0.0) == servo.velocity_feedforward:
            wanted = str(not servo.velocity_feedforward).lower()
            has = "has no velocity feedforward" if servo.velocity_feedforward else "has a velocity feedforward"
            change = f"Set velocity_feedforward = {wanted} in [servo]."
            what = f"the measured servo {has} ({value:.5g} {units.viscous} times the reference velocity)."
            found.append(Explanation("velocity-feedforward", what, change))
        elif name == "rd":
            what = f"the force contains the reference velocity times {value:.5g} {units.viscous}."
            found.append(Explanation("viscous-feedforward", what, declare))
        elif name == "rdd" and servo.velocity_feedforward and abs(value) < LATEST * Kd * servo.Ts / 2.0:
            samples = -value / (Kd * servo.Ts)
            late = "later" if samples > 0.0 else "earlier"
            what = (
                f"the reference velocity of its feedforward is {abs(samples):.2g} samples {late} than that of the log."
            )
            change = "Log the reference that the servo uses, in the same sample as position and force."
            found.append(Explanation("reference-timing", what, change))
        elif name == "rdd":
            what = f"the force contains the reference acceleration times {value:.5g} {units.inertia}."
            total = value + servo.inertia_feedforward
            change = (
                f"Set inertia_feedforward = {total:.5g} in [servo]."
                if total > 0.0
                else "Log force, position and reference of the same sample."
            )
            found.append(Explanation("inertia-feedforward", what, change))
        elif name == "sign":
            what = f"the force contains {value:.5g} {units.force} in the direction of the reference velocity."
            found.append(Explanation("friction-feedforward", what, declare))
        else:
            what = f"a constant force of {value:.5g} {units.force} is added to the command."
            found.append(Explanation("constant-force", what, declare))
    return tuple(found)


def _injected(compared: Comparison) -> Diagnosis | None:
    """Return the diagnosis of a force that was added from outside, in pulses or periodic; None if there is none."""
    difference = compared.force - compared.command
    if compared.servo.pid[2]:
        difference = difference - np.median(difference[compared.used])
    said = pulses(compared, difference) or frequencies(compared, difference)
    if not said:
        return None
    change = (
        "Add a column injected with this force to [columns]; until then the study uses the difference between recorded "
        "force and command as injected force."
    )
    outside = np.where(compared.used, difference, 0.0)
    return Diagnosis((Explanation("injected-force", f"a force is added from outside, {said}.", change),), (), outside)
