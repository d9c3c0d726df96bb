"""Experiments with plants, signals and all other blocks: time series, characteristics and step responses."""

from __future__ import annotations

import math

import numpy as np

from friction_fmus.fmi.portrait.course import Bench, Curve, Panel

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
