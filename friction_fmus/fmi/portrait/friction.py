"""Experiments with friction models: steady sliding, presliding hysteresis, and the motion of chains and masses."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from friction_fmus.fmi.portrait.course import Bench, Curve, Panel, Vector

SPEEDS = ("vs", "DV", "vt")
"""Parameters with a velocity scale of friction."""

SHARE = 0.9
"""Share of the largest friction at which a contact is considered to be at the onset of sliding."""


def friction_panels(bench: Bench) -> tuple[Panel, ...]:
    """Return friction over steady velocities and, for an elastic contact, over displacement in presliding."""
    peak = 4.0 * speed_scale(bench)
    reach = elastic_reach(bench, peak / 100.0)
    panels = [_sliding(bench, peak, reach or 0.0)]
    if reach is not None:
        panels.append(_loop(bench, peak / 100.0, 2.2 * reach))
    return tuple(panels)


def speed_scale(bench: Bench) -> float:
    """Return the velocity scale of friction from the start values."""
    return max((bench.start(name, 1e-3) for name in SPEEDS if name in bench.variables), default=1e-3)


def elastic_reach(bench: Bench, speed: float) -> float | None:
    """Return the displacement from rest to `SHARE` of the largest friction, or None if the contact is rigid."""
    times = np.concatenate([[0.0], np.geomspace(1e-4, 1e3, 141)])
    (force,) = bench.run(times, _moving(bench, np.full(times.size, speed)), ["F"])
    level = SHARE * np.abs(force).max()
    first = int(np.argmax(np.abs(force) >= level))
    return float(speed * times[first]) if first > 2 else None


def largest_force(bench: Bench) -> float:
    """Return the largest force among the start values, 1 if there is none."""
    unit = next(bench.variables[name].unit for name in ("F", "F_drive") if name in bench.variables)
    forces = (abs(v.start) for v in bench.variables.values() if v.unit == unit and math.isfinite(v.start))
    return max(forces, default=0.0) or 1.0


def _moving(bench: Bench, velocity: Vector) -> dict[str, Vector]:
    """Return the inputs for a motion; other forces are large enough to break away."""
    return {"v": velocity, "F_ext": 10.0 * largest_force(bench) * np.sign(velocity)}


def _sliding(bench: Bench, peak: float, reach: float) -> Panel:
    """Hold each velocity until the contact has slid many times its elastic displacement, then average some samples."""
    samples, speeds = 6, peak * np.linspace(0.0, 1.0, 49)[1:] ** 2
    halves = []
    for sign in (-1.0, 1.0):
        held = np.repeat(speeds[::-1], samples)
        durations = 10.0 * reach / held + 1e-3
        times = np.concatenate([[0.0], np.cumsum(durations)])
        velocity = sign * np.append(held, held[-1])
        (force,) = bench.run(times, _moving(bench, velocity), ["F"])
        halves.append(force[1:].reshape(-1, samples)[:, 2:].mean(axis=1))
    speed = np.concatenate([-speeds[::-1], speeds])
    return Panel(
        (Curve(speed, np.concatenate([halves[0], halves[1][::-1]])),),
        bench.axis("v"),
        bench.axis("F"),
        "Friction in steady sliding: each velocity is held until the force has settled.",
    )


def _loop(bench: Bench, speed: float, amplitude: float) -> Panel:
    """Return a slow oscillating motion, then one with an inner loop, without the first approach."""
    turns = amplitude * np.array([0.0, 1.0, -1.0, 1.0, 0.5, 0.9, -1.0])
    path = np.concatenate([np.linspace(a, b, 60, endpoint=False) for a, b in pairwise(turns)])
    path = np.append(path, turns[-1])
    steps = np.diff(path)
    times = np.concatenate([[0.0], np.cumsum(np.abs(steps) / speed)])
    velocity = np.append(np.sign(steps) * speed, 0.0)
    (force,) = bench.run(times, _moving(bench, velocity), ["F"])
    return Panel(
        (Curve(path[60:181], force[60:181]), Curve(path[180:], force[180:], detail=True)),
        ("displacement", _path_unit(bench)),
        bench.axis("F"),
        "Friction in presliding: a slow oscillating motion with an inner hysteresis loop.",
    )


def _path_unit(bench: Bench) -> str:
    return {"m/s": "m", "rad/s": "rad"}.get(bench.variables["v"].unit, "")


def towed(bench: Bench, speed: float, length: float) -> tuple[Panel, ...]:
    """Return the friction of a model that is pulled steadily over a distance."""
    path = np.linspace(0.0, length, 601)
    (force,) = bench.run(path / speed, {"v": np.full(path.size, speed)}, ["F"])
    caption = (
        f"Friction while the driver moves at a constant velocity of {speed:g} {bench.variables['v'].unit}".rstrip()
    )
    return (Panel((Curve(path, force),), ("displacement", _path_unit(bench)), bench.axis("F"), f"{caption}."),)


def towed_to_and_fro(bench: Bench) -> tuple[Panel, ...]:
    """Return the loop of a chain whose slider moves by some periods of the substrate."""
    return (_loop(bench, 0.05, 2.0),)


def tomlinson(bench: Bench) -> tuple[Panel, ...]:
    """Return the saw-tooth of a tip that jumps from one potential well to the next."""
    period = bench.start("a", 1.0)
    return towed(bench, 0.02 * period * math.sqrt(bench.start("k", 1.0) / bench.start("m", 1.0)), 4.0 * period)


def avalanches(bench: Bench) -> tuple[Panel, ...]:
    """Return loading by the driver and slip avalanches over time."""
    times = np.linspace(0.0, 4.0 / bench.start("nu", 0.01), 601)
    (force,) = bench.run(times, {}, ["F"])
    caption = "Friction while the driver loads the chain and avalanches unload it."
    return (Panel((Curve(times, force),), ("time", ""), bench.axis("F"), caption),)


def depinning(bench: Bench) -> tuple[Panel, ...]:
    """Return the velocity of a chain for a force that increases and decreases slowly."""
    peak = bench.start("K", 1.0) / (2.0 * math.pi)
    force = peak * (1.0 - np.abs(np.linspace(-1.0, 1.0, 161)))
    times = np.linspace(0.0, 800.0, force.size)
    (velocity,) = bench.run(times, {"F_drive": force}, ["v"])
    caption = (
        "Velocity while the driving force increases and decreases slowly; the chain rests below the static friction."
    )
    return (Panel((Curve(force, velocity),), bench.axis("F_drive"), bench.axis("v"), caption),)


def pushed_mass(bench: Bench) -> tuple[Panel, ...]:
    """Return friction over velocity for a mass with a slow sinusoidal force."""
    peak, mass = 2.5 * max(bench.start("Fc", 1.0), bench.start("Fs", 1.0)), bench.start("m", 1.0)
    period = math.sqrt(mass * 10.0 * bench.start("DV", 1e-3) / peak) * 10.0
    times = np.linspace(0.0, 2.0 * period, 1201)
    push = peak * np.sin(2.0 * math.pi * times / period)
    velocity, force = bench.run(times, {"F_ext": push}, ["v", "F"])
    caption = "Friction of the mass under a sinusoidal force."
    return (Panel((Curve(velocity[600:], force[600:]),), bench.axis("v"), bench.axis("F"), caption),)


def stick_slip(bench: Bench) -> tuple[Panel, ...]:
    """Return the limit cycle of a mass on a belt: the mass sticks, slips back and sticks again."""
    period = 2.0 * math.pi * math.sqrt(bench.start("m", 1.0) / bench.start("k", 1.0))
    times = np.linspace(0.0, 6.0 * period, 1801)
    position, velocity = bench.run(times, {"v_belt": np.full(times.size, 0.2)}, ["x", "v"])
    caption = "Stick-slip of the mass on the belt: the mass sticks to the belt, slips back and sticks again."
    return (Panel((Curve(position[900:], velocity[900:]),), bench.axis("x"), bench.axis("v"), caption),)
