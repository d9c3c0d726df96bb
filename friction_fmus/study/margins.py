"""Margins of the servo with a compensator, from the laws and the axis linearised in sliding and at rest."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Final, TypeVar

import numpy as np
from casadi import Function

from friction_fmus.axis.loop_assembly import block
from friction_fmus.axis.servo import GAINS, AxisPlant, Compensator, Servo, coefficients
from friction_fmus.blocks.catalogue import find, listing
from friction_fmus.blocks.contact import AxisFriction, Level
from friction_fmus.conditions import DrivenPlant, PathDynamics, SampledLaw, chain, on_bristles, one_mass, two_masses
from friction_fmus.conditions.chain import Margins, loop_margins
from friction_fmus.conditions.condition import spectral_radius
from friction_fmus.errors import FrictionError, did_you_mean
from friction_fmus.lawkit.law import Kind, Law, discover_laws
from friction_fmus.study.study_result import LoopMargins
from harness import FmuPart

NUDGE = 1e-15
"""Position error about which a law is linearised [m]; not 0, where the root in super-twisting has no derivative."""

SETTLED = 500  # samples after which the gains of a filter, or a law in steady motion, count as settled


@cache
def _with_jacobian(path: Path, name: str) -> tuple[Law, Function]:
    """Return the law of a file and its Jacobian."""
    law = next(law for law in discover_laws(path) if law.name == name)
    return law, law.function.jacobian()


def linearised(name: str, values: Mapping[str, float], Ts: float, output: str = "u", speed: float = 0.0) -> SampledLaw:
    """Return a law on its target as a linear sampled system from (x, v, u_prev) to a force."""
    law, jacobian = _with_jacobian(listing()[name].path, name)
    given = [scalar for variable in law.given for scalar in variable.scalars]
    results = [scalar for variable in law.results for scalar in variable.scalars]
    states = [s for variable in law.select(Kind.STATE, Kind.STATES) for s in variable.scalars]
    start = {
        scalar: float(value)
        for variable in law.given
        for scalar, value in zip(variable.scalars, variable.starts, strict=True)
    }
    parameters = {s for v in law.given if v.kind not in (Kind.INPUT, Kind.STATE, Kind.STATES) for s in v.scalars}
    now = start | {key: value for key, value in values.items() if key in parameters} | {"Ts": Ts, "enable": 1.0}
    now |= {key: speed for key in ("v", "rd") if key in now}
    for k in range(SETTLED):
        now |= {key: speed * k * Ts for key in ("x", "r") if key in now}
        found = dict(zip(results, map(float, law.function.call([now[key] for key in given])), strict=True))
        before = np.array([now[key] for key in states])
        now |= {key: found[key] for key in states}
        after = np.array([now[key] for key in states])
        if speed == 0.0 and (np.abs(after - before) <= 1e-12 * np.abs(after)).all():
            break
    if speed == 0.0:
        now["x"] = -NUDGE
    blocks = jacobian.call([*(now[key] for key in given), *([0.0] * len(results))])
    table = np.array([float(block) for block in blocks]).reshape(len(results), len(given))
    row, column = {key: i for i, key in enumerate(results)}, {key: i for i, key in enumerate(given)}

    def part(rows: list[str], columns: list[str]) -> np.ndarray:
        return np.array([[table[row[r], column[c]] if c in column else 0.0 for c in columns] for r in rows]).reshape(
            len(rows), len(columns)
        )

    signals = ["x", "v", "u_prev"]
    kept = _moved_and_read(part(states, states), part(states, signals), part([output], states)[0])
    names = [key for key, keep in zip(states, kept, strict=True) if keep]
    return SampledLaw(part(names, names), part(names, signals), part([output], names)[0], part([output], signals)[0])


def _moved_and_read(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Return which states depend on the signals and affect the force."""
    n = len(C)
    moved, read = np.abs(B).sum(axis=1) > 0.0, C != 0.0
    for _ in range(n):
        moved = moved | ((np.abs(A) > 0.0) @ moved)
        read = read | ((np.abs(A) > 0.0).T @ read)
    return np.asarray(moved & read)


def local_function(p: Mapping[str, float], Ts: float) -> SampledLaw:
    """Return LocalFunctionEstimator as a linear sampled system: a weighted sum of means over past intervals (FIR)."""
    n = int(p["window"])
    degree = min(int(p["degree"]), n - 1)
    t = (n - 1) / 2.0 - np.arange(n)
    # value at t = n/2 of the polynomial with the best least-squares fit of the means over unit intervals about t
    means = np.array([((t + 0.5) ** (i + 1) - (t - 0.5) ** (i + 1)) / (i + 1) for i in range(degree + 1)]).T
    w = (n / 2.0) ** np.arange(degree + 1) @ np.linalg.pinv(means)
    A, B = np.zeros((n, n)), np.zeros((n, 3))  # states: the last velocity, then the forces F_m[1] ... F_m[n-1]
    B[0, 1] = 1.0
    force_state, force_input = np.zeros(n), np.array([0.0, -p["m"] / Ts, 1.0])
    force_state[0] = p["m"] / Ts
    if n > 1:
        A[1], B[1] = force_state, force_input
        A[2:, 1:-1] = np.eye(n - 2)
    C = w[0] * force_state
    C[1:] += w[1:]
    return SampledLaw(A, B, p["gain"] * C, p["gain"] * w[0] * force_input)


FILTERS: Final[Mapping[str, Callable[[Mapping[str, float], float], SampledLaw]]] = {"local_function": local_function}
"""Linear parts that the file of a controller in C can name, see `Use.linear`."""

Named = TypeVar("Named")


def named(name: str, known: Mapping[str, Named], row: str, block: str) -> Named:
    """Return what a row in the file of a block names."""
    if name not in known:
        raise FrictionError(f"{row} of {block} names the unknown {name!r}{did_you_mean(name, known)}")
    return known[name]


OPEN_LOOP: Final = ("feedforward", "dither")
"""Kinds of compensators that do not use measured signals and leave the margins unchanged."""


LEAK: Final = 1e-6
"""Share of the deflection of modelled bristles that is lost in a sample at rest.

At rest it only changes with the position, which is an eigenvalue of exactly 1; any motion makes it decay.
"""


def margins_of(
    servo: Servo,
    plant: AxisPlant,
    speed: float,
    compensator: Compensator | None = None,
    kind: str = "",
    gain: float = 1.0,
) -> LoopMargins | None:
    """Return the margins of the servo with a compensator; None if the compensator cannot be linearised."""
    found, resonance = [], 0.0
    for at, driven in operating_points(plant, speed):
        if not at and not _rests(servo, driven):
            continue
        laws = laws_of(servo, compensator if kind not in OPEN_LOOP else None, kind, gain, at)
        if laws is None:
            return None
        found.append(loop_margins(driven, laws, servo.Ts, path_of(servo)))
        resonance = max(resonance, tolerated_resonance(servo, plant, laws))
    return replace(_worst(found), resonance=resonance)


def path_of(servo: Servo) -> PathDynamics:
    """Return delay, velocity estimate and filters of a servo."""
    filters = (servo.velocity_filter, servo.notch)
    lowpass, notch = (None if own is None else coefficients(own, servo.Ts) for own in filters)
    return PathDynamics(servo.lag, servo.delay * servo.Ts, servo.window, lowpass=lowpass, notch=notch)


def _rests(servo: Servo, driven: DrivenPlant) -> bool:
    """Return whether the servo without integral action is stable on a contact at rest.

    The measured axis was at rest with it: otherwise the record does not determine stiffness and damping of the contact,
    and margins at rest say nothing about the axis.
    """
    laws = laws_of(replace(servo, gains={**servo.gains, GAINS[servo.law][-1]: 0.0}))
    return laws is not None and spectral_radius(chain(driven, laws, servo.Ts, path_of(servo))) < 1.0


FREQUENCIES: Final = 32  # number of resonances that are tried
LOWEST: Final = 0.25  # lowest of them divided by the natural frequency of the position loop
HIGHEST: Final = 0.4  # highest of them divided by the sample rate
DAMPING: Final = 0.02  # damping ratio of the resonance
LOAD: Final = 0.5  # mass of the load divided by the mass of the motor


def tolerated_resonance(servo: Servo, plant: AxisPlant, laws: Sequence[SampledLaw]) -> float:
    """Return the frequency above which a loop is stable with any lightly damped resonance [Hz].

    Motor and load have the mass of the plant together; the encoder is at the motor, as is the viscous friction.
    """
    motor = plant.mass / (1.0 + LOAD)
    load = plant.mass - motor
    reduced = motor * load / plant.mass
    viscous = max(plant.values.get("Fv", plant.values.get("sigma2", 0.0)), 0.0)
    path = path_of(servo)
    natural = float(np.sqrt(servo.pid[0] / plant.mass)) / (2.0 * np.pi)
    tolerated = 0.5 / servo.Ts
    for frequency in np.geomspace(HIGHEST / servo.Ts, min(LOWEST * natural, 0.1 / servo.Ts), FREQUENCIES):
        w = 2.0 * np.pi * float(frequency)
        flexible = two_masses(motor, load, reduced * w**2, 2.0 * DAMPING * reduced * w, (viscous, 0.0))
        if spectral_radius(chain(flexible, laws, servo.Ts, path)) > 1.0 + 1e-9:
            return tolerated
        tolerated = float(frequency)
    return 0.0


def viscous_beside(plant: AxisPlant) -> float:
    """Return the coefficient of the viscous friction beside the friction block [N.s/m]."""
    friction = find(plant.friction).about.friction
    return plant.values.get("Fv", 0.0) if friction is None or friction.viscous == "0" else 0.0


def driven(plant: AxisPlant, damping: float, stiffness: float = 0.0) -> DrivenPlant:
    """Return the mass of an axis, or its motor and load, with damping and stiffness to ground."""
    if plant.load is None:
        return one_mass(plant.mass, damping, stiffness)
    p, at_load = plant.load.parameters(plant.mass), plant.load.friction
    damped, held = (((1.0 - at_load) * each, at_load * each) for each in (damping, stiffness))
    return two_masses(p["m1"], p["m2"], p["k"], p["d"], damped, held)


def sliding(
    plant: AxisPlant, contact: AxisFriction, level: Level, beside: float, speed: float, slope: float
) -> DrivenPlant:
    """Return an axis linearised about steady sliding, where its friction has this slope over the speed."""
    size = float(level.at(np.array([speed]))[0])
    if not contact.stiffness or size <= 0.0:
        return driven(plant, level.viscous + beside + slope)
    found = driven(plant, level.viscous + beside)
    p, at_load = (
        ({"m1": plant.mass}, 0.0) if plant.load is None else (plant.load.parameters(plant.mass), plant.load.friction)
    )
    for at, mass, share in ((1, "m1", 1.0 - at_load), (3, "m2", at_load)):
        if share:
            bristles = share * contact.stiffness, share * contact.damping, share * size, share * slope
            found = on_bristles(found, at, p[mass], *bristles, speed)
    return found


def operating_points(plant: AxisPlant, speed: float) -> list[tuple[float, DrivenPlant]]:
    """Return the plant linearised in sliding at a speed and, if its contact is elastic, at rest, with the speeds."""
    friction = find(plant.friction).about.friction
    if friction is None or speed <= 0.0:
        return [(speed, driven(plant, 0.0))]
    contact, beside = friction.contact(with_starts(plant.friction, plant.values)), viscous_beside(plant)
    level, near = contact.levels[0], speed * np.array([0.99, 1.01])
    low, high = level.at(near)
    found = [(speed, sliding(plant, contact, level, beside, speed, float((high - low) / (near[1] - near[0]))))]
    if contact.stiffness:
        found.append((0.0, driven(plant, contact.damping + contact.viscous + beside, contact.stiffness)))
    return found


def laws_of(
    servo: Servo, compensator: Compensator | None = None, kind: str = "", gain: float = 1.0, speed: float = 0.0
) -> list[SampledLaw] | None:
    """Return the linear laws in the loop; None if one of them cannot be linearised."""
    laws = [linearised(servo.law, servo.gains, servo.Ts)]
    if compensator is None:
        return laws
    limits = {"u_min": -servo.force_limit, "u_max": servo.force_limit}
    values, found = {**limits, **compensator.values}, find(compensator.model)
    if found.is_law:
        at = speed if kind == "model feedback" else 0.0  # the other laws are linear
        law = linearised(compensator.model, values, servo.Ts, compensator.output, at)
        if kind == "model feedback" and speed == 0.0:
            law = replace(law, A=(1.0 - LEAK) * law.A)
    else:
        use = found.about.use
        if use is None or not use.linear:
            return None
        starts = with_starts(compensator.model, compensator.values)
        law = named(use.linear, FILTERS, "LINEAR", found.name)(starts, servo.Ts)
    return [*laws, replace(law, C=gain * law.C, D=gain * law.D)]


def with_starts(name: str, values: Mapping[str, float]) -> dict[str, float]:
    """Return values of parameters of a block with the start values of its others."""
    ports = FmuPart("block", block(name)).parameters
    return {port.name: float(port.start) for port in ports if isinstance(port.start, (int, float))} | dict(values)


def _worst(found: Sequence[Margins]) -> LoopMargins:
    stable = all(each.stable for each in found)
    phase, delay = min(each.phase for each in found), min(each.delay for each in found)
    return LoopMargins(
        max(each.sensitivity for each in found) if stable else None,
        float(np.degrees(phase)) if np.isfinite(phase) else None,
        delay if np.isfinite(delay) else None,
    )
