"""Experiments that show what a block does: named in the block's file, or chosen from its ports."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Final

import numpy as np

from friction_fmus.blocks.probe import INPUT
from friction_fmus.errors import FrictionError, did_you_mean
from friction_fmus.fmi.portrait.bench import Bench, Curve, Panel, Vector

TIME = ("time", "s")


def course(bench: Bench) -> tuple[Panel, ...]:
    """Return the first output over one second."""
    times = np.linspace(0.0, 1.0, 501)
    (values,) = bench.run(times, {}, bench.outputs[:1])
    return (
        Panel((Curve(times, values),), TIME, bench.axis(bench.outputs[0]), "Output over time with the start values."),
    )


def circle(bench: Bench) -> tuple[Panel, ...]:
    """Return the path of two axes."""
    turn = 2.0 * math.pi * bench.start("radius", 0.01) / bench.start("feed", 0.01)
    times = np.linspace(0.0, 1.2 * turn, 401)
    x, y = bench.run(times, {}, ["x", "y"])
    return (Panel((Curve(x, y),), bench.axis("x"), bench.axis("y"), "Path of the two axes.", equal=True),)


def staircase(bench: Bench) -> tuple[Panel, ...]:
    """Return the measured over the true value for a slow ramp across some quantisation steps."""
    answer, step = bench.outputs[0], bench.start("q", 1e-6)
    x = step * np.linspace(-2.5, 2.5, 501)
    Ts = bench.start("Ts", 1e-3)
    (measured,) = bench.run(Ts * np.arange(x.size), {"x": x}, [answer])
    # the output after a step belongs to the value before it
    curves = (Curve(x, x, "true", aside=True), Curve(x[:-1], measured[1:], answer))
    return (Panel(curves, bench.axis("x"), bench.axis(answer), "Measured over true value for a slow ramp."),)


def differentiation(bench: Bench) -> tuple[Panel, ...]:
    """Return the estimated and the true velocity of a triangular motion."""
    Ts = bench.start("Ts", 1e-3)
    times = Ts * np.arange(61)
    speed = np.where(np.arange(61) // 20 % 2 == 0, 1.0, -1.0)
    x = np.concatenate([[0.0], np.cumsum(speed[:-1] * Ts)])
    (found,) = bench.run(times, {"x": x}, ["v"])
    curves = (Curve(times, speed, "true", aside=True), Curve(times, found, "v"))
    return (Panel(curves, TIME, bench.axis("v"), "Velocity of a motion forward and back at constant speed."),)


def saturation(bench: Bench) -> tuple[Panel, ...]:
    """Return the output of an actuator for a triangular command that exceeds its limits."""
    scale = max(bench.start("tau", 1e-3), bench.start("delay", 1e-3))
    limits = [abs(bench.variables[name].start) for name in ("F_min", "F_max")]
    peak = 1.5 * max([limit for limit in limits if math.isfinite(limit)], default=1.0)
    times = 20.0 * scale * np.linspace(0.0, 1.0, 401)
    command = peak * 2.0 / math.pi * np.arcsin(np.sin(4.0 * math.pi * times / times[-1]))
    (force,) = bench.run(times, {"u": command}, ["F"])
    curves = (Curve(times, command, "u", aside=True), Curve(times, force, "F"))
    return (Panel(curves, TIME, bench.axis("F"), "Force for a triangular command that exceeds the limits."),)


def ripple(bench: Bench) -> tuple[Panel, ...]:
    """Return the force over two periods of the position."""
    x = bench.start("pitch", 0.024) * np.linspace(-1.0, 1.0, 201)
    (force,) = bench.run(np.arange(x.size) * 1e-3, {"x": x}, ["F"])
    # the output after a step belongs to the position before it
    return (Panel((Curve(x[:-1], force[1:]),), bench.axis("x"), bench.axis("F"), "Force over position."),)


def over_position(bench: Bench) -> tuple[Panel, ...]:
    """Return the force over the whole table of positions, forward and back."""
    times = 1e-3 * np.arange(501)
    begin, end = (float(bench.run(times[:2], {}, [name])[0][0]) for name in ("x_begin", "x_end"))
    x = np.linspace(begin, end, times.size)
    curves = []
    for direction, label in ((1.0, "forward"), (-1.0, "back")):
        speed = np.full(x.size, direction * 1e3 * bench.start("v_sign", 1e-3))
        (force,) = bench.run(times, {"x": x, "v": speed}, ["F_position"])
        # the output after a step belongs to the position before it
        curves.append(Curve(x[:-1], force[1:], label))
    return (
        Panel(tuple(curves), bench.axis("x"), bench.axis("F_position"), "Force over position, in both directions."),
    )


def push(bench: Bench) -> tuple[Panel, ...]:
    """Return the velocity of a mass that is pushed forward and back."""
    times = np.linspace(0.0, 1.0, 401)
    force = np.select([times < 0.1, times < 0.4, times < 0.5], [0.0, 1.0, 0.0], -1.0) * (times < 0.8)
    (velocity,) = bench.run(times, {"F_drive": force}, ["v"])
    caption = "Velocity for a driving force of 1 for 0.3 s and, after a pause of 0.1 s, of -1 for 0.3 s."
    return (Panel((Curve(times, velocity),), TIME, bench.axis("v"), caption),)


def resonance(bench: Bench) -> tuple[Panel, ...]:
    """Return the velocities of motor and load after a step of the driving force."""
    m1, m2 = bench.start("m1", 1.0), bench.start("m2", 1.0)
    period = 2.0 * math.pi * math.sqrt(m1 * m2 / (m1 + m2) / bench.start("k", 1.0))
    times = np.linspace(0.0, 6.0 * period, 401)
    motor, load = bench.run(times, {"F_drive": np.ones(times.size)}, ["v1", "v2"])
    curves = (Curve(times, load, "v2", aside=True), Curve(times, motor, "v1"))
    return (Panel(curves, TIME, bench.axis("v1"), "Velocities of motor and load from rest with a driving force of 1."),)


def ride(bench: Bench) -> tuple[Panel, ...]:
    """Return the position of a mass on a belt that drags it with constant friction."""
    times = 6.0 * math.pi * math.sqrt(bench.start("m", 1.0) / bench.start("k", 1.0)) * np.linspace(0.0, 1.0, 401)
    (position,) = bench.run(times, {"F_friction": -np.ones(times.size)}, ["x"])
    caption = "Position of the mass from rest while the belt drags it with a constant friction of 1."
    return (Panel((Curve(times, position),), TIME, bench.axis("x"), caption),)


def step_response(bench: Bench) -> tuple[Panel, ...]:
    """Return the first output after a unit step of the first input."""
    given, answer = bench.inputs[0], bench.outputs[0]
    times = np.linspace(0.0, 200.0 * bench.start("Ts", 5e-3), 201)
    step = np.where(times > 0.1 * times[-1], 1.0, 0.0)
    (values,) = bench.run(times, {given: step}, [answer])
    caption = f"Response of {answer} to a step of {given} by 1 {bench.variables[given].unit}".rstrip() + "."
    return (Panel((Curve(times, values),), TIME, bench.axis(answer), caption),)


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


POINTS = 400
"""Number of samples in a period of the motion."""


def _times(bench: Bench, samples: int) -> Vector:
    return np.asarray(bench.start("Ts", 1e-3) * np.arange(samples + 1))


def sine(bench: Bench, periods: int) -> tuple[Vector, dict[str, Vector]]:
    """Return a sinusoidal reference with speeds in the range where friction varies."""
    times = _times(bench, periods * POINTS)
    w = 2.0 * math.pi / (POINTS * bench.start("Ts", 1e-3))
    peak = 4.0 * speed_scale(bench)
    s, c = np.sin(w * times), np.cos(w * times)
    rd, rdd = peak * c, -peak * w * s
    return times, {"r": peak / w * s, "rd": rd, "rdd": rdd, "jerk": -w * w * rd, "snap": -w * w * rdd}


def estimate(bench: Bench) -> tuple[Panel, ...]:
    """Return the friction estimate over velocity in the third period of a sinusoidal motion with Coulomb friction."""
    times, motion = sine(bench, 3)
    coulomb, mass = bench.start("Fc", 1.0), bench.start("m", 1.0)
    applied = mass * motion["rdd"] + coulomb * np.sign(motion["rd"])
    measured = {"x": motion["r"], "v": motion["rd"], "u_prev": applied, "f_prev": 0.0 * applied}
    (estimated,) = bench.run(times, {**motion, **measured}, ["F_hat"])
    return (_over_velocity(bench, motion["rd"], estimated, "Friction estimate during a sinusoidal motion."),)


def _over_velocity(bench: Bench, velocity: Vector, estimated: Vector, caption: str) -> Panel:
    shown = slice(-POINTS - 1, None)
    axis = bench.axis(next(name for name in ("v", "v_est", "rd") if bench.has(name)))
    return Panel((Curve(velocity[shown], estimated[shown]),), axis, bench.axis("F_hat"), caption)


def tracking(bench: Bench) -> tuple[Panel, ...]:
    """Return the friction estimate of a law that moves a mass with Coulomb friction along a sinusoidal reference.

    The velocity of the mass is stepped so that the mass sticks exactly.
    """
    times, motion = sine(bench, 6)
    Ts, mass, coulomb = times[1], bench.start("m", 1.0), bench.start("Fc", 1.0)
    x, v, velocity, estimated = 0.0, float(motion["rd"][0]), [], []
    with bench.session(["u", "F_hat"]) as session:
        for k, time in enumerate(times):
            inputs = {name: float(column[k]) for name, column in motion.items()} | {"x": x, "v": v}
            if k == 0:
                session.begin(inputs)
                u, F_hat = session.values()
            session.put(inputs | {"u_prev": u})
            u, F_hat = session.step(float(time), float(Ts))
            velocity.append(v)
            estimated.append(F_hat)
            free = v + Ts / mass * u
            v = math.copysign(max(abs(free) - Ts / mass * coulomb, 0.0), free)
            x += Ts * v
    caption = "Friction estimate while the law moves a mass with Coulomb friction along a sinusoidal reference."
    return (_over_velocity(bench, np.array(velocity), np.array(estimated), caption),)


def held_error(bench: Bench) -> tuple[Panel, ...]:
    """Return the force over time after a step of the position error."""
    times = _times(bench, 60)
    error = np.where(times > 0.1 * times[-1], 1e-3, 0.0)
    (force,) = bench.run(times, {"r": error}, ["u"])
    caption = f"Force after a reference step of 0.001 {bench.variables['r'].unit} with the axis at rest."
    return (Panel((Curve(times, force),), TIME, bench.axis("u"), caption),)


def alternating_error(bench: Bench) -> tuple[Panel, ...]:
    """Return the force over time for a sinusoidal position error."""
    times = _times(bench, 2 * POINTS)
    w = 2.0 * math.pi / times[POINTS]
    inputs = {"r": 1e-3 * np.sin(w * times), "rd": 1e-3 * w * np.cos(w * times)}
    (force,) = bench.run(times, inputs, ["u"])
    return (Panel((Curve(times, force),), TIME, bench.axis("u"), "Force for a sinusoidal position error."),)


def own_course(bench: Bench) -> tuple[Panel, ...]:
    """Return the force over time with all inputs at zero."""
    times = _times(bench, 120)
    (force,) = bench.run(times, {}, ["u"])
    return (Panel((Curve(times, force),), TIME, bench.axis("u"), "Force with all inputs at zero."),)


def learning(bench: Bench) -> tuple[Panel, ...]:
    """Return the force over some periods of a repeating error."""
    period = int(bench.start("N", 400.0))
    times = _times(bench, 4 * period)
    phase = np.arange(times.size) / period
    error = 1e-4 * np.sin(2.0 * math.pi * phase)
    (force,) = bench.run(times, {"r": error, "trial_end": np.arange(times.size) % period == 0}, ["u"])
    caption = "Force over four periods of the same sinusoidal error."
    return (Panel((Curve(times, force),), TIME, bench.axis("u"), caption),)


def move(bench: Bench, samples: int) -> tuple[Vector, dict[str, Vector]]:
    """Return a move by 1 mm with continuous snap, with rest before and after."""
    times = _times(bench, 2 * samples)
    duration = times[samples]
    s = np.clip((times - times[samples // 2]) / duration, 0.0, 1.0)
    polynomial = 1e-3 * np.polynomial.Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])
    names = ("r", "rd", "rdd", "jerk", "snap")
    return times, {name: polynomial.deriv(n)(s) / duration**n for n, name in enumerate(names)}


def inversion(bench: Bench) -> tuple[Panel, ...]:
    """Return the force over time for a smooth move."""
    times, motion = move(bench, 100)
    (force,) = bench.run(times, motion, ["u"])
    caption = f"Force for a smooth move of 0.001 {bench.variables['r'].unit}."
    return (Panel((Curve(times, force),), TIME, bench.axis("u"), caption),)


def shaping(bench: Bench) -> tuple[Panel, ...]:
    """Return the reference before and after shaping, for a smooth move."""
    times, motion = move(bench, 20)
    (shaped,) = bench.run(times, motion, ["r_out"])
    curves = (Curve(times, motion["r"], "r", aside=True), Curve(times, shaped, "r_out"))
    return (Panel(curves, TIME, bench.axis("r_out"), "Reference for a smooth move, before and after the filter."),)


Experiment = Callable[[Bench], tuple[Panel, ...]]

EXPERIMENTS: Final[Mapping[str, Experiment]] = {
    made.__name__: made
    for made in (
        tomlinson,
        depinning,
        towed_to_and_fro,
        avalanches,
        pushed_mass,
        stick_slip,
        saturation,
        ride,
        ripple,
        over_position,
        push,
        resonance,
        alternating_error,
        own_course,
        inversion,
        shaping,
        learning,
        circle,
        staircase,
        differentiation,
    )
}
"""Experiments that a block's file can select by ``PORTRAIT``, or a law by ``portrait``."""


def experiment(bench: Bench) -> Experiment | None:
    """Return the experiment for a block, or None if there is nothing to show."""
    named = bench.portrait
    if named:
        if named not in EXPERIMENTS:
            raise FrictionError(f"There is no portrait {named!r}{did_you_mean(named, EXPERIMENTS)}")
        return EXPERIMENTS[named]
    by_ports: tuple[tuple[bool, Experiment], ...] = (
        ("v" in bench.inputs and "F" in bench.outputs, friction_panels),
        (bench.has("r", "rd", "x", "u", "F_hat"), tracking),
        (bench.has("F_hat") and (bench.has("v") or bench.has("rd")), estimate),
        (bench.has("r", "x", "u"), held_error),
        (bool(bench.outputs and bench.inputs), step_response),
        (bool(bench.outputs) and not any(v.role == INPUT for v in bench.variables.values()), course),
    )
    return next((made for fits, made in by_ports if fits), None)
