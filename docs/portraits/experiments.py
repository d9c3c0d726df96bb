"""Experiments for the pages of blocks whose ports do not tell what to show, and the values they begin with.

Each slider of a page must change a figure, so some pages have a further experiment or begin with other values than the
start values, such as a second sine that is not zero.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from friction_fmus.blocks.catalogue import Block
from portraits.by_ports import (
    POINTS,
    TIME,
    Bench,
    Experiment,
    experiment,
    largest_force,
    path_unit,
    presliding_loop,
    sample_times,
    sine,
    speed_scale,
)
from portraits.chart import Curve, Panel, Vector

Values = Mapping[str, float]


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


def towed(bench: Bench, speed: float, length: float) -> tuple[Panel, ...]:
    """Return the friction of a model that is pulled steadily over a distance."""
    path = np.linspace(0.0, length, 601)
    (force,) = bench.run(path / speed, {"v": np.full(path.size, speed)}, ["F"])
    caption = (
        f"Friction while the driver moves at a constant velocity of {speed:g} {bench.variables['v'].unit}".rstrip()
    )
    return (Panel((Curve(path, force),), ("displacement", path_unit(bench)), bench.axis("F"), f"{caption}."),)


def towed_to_and_fro(bench: Bench) -> tuple[Panel, ...]:
    """Return the loop of a chain whose slider moves by some periods of the substrate."""
    return (presliding_loop(bench, 0.05, 2.0),)


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


def alternating_error(bench: Bench) -> tuple[Panel, ...]:
    """Return the force over time for a sinusoidal position error."""
    times = sample_times(bench, 2 * POINTS)
    w = 2.0 * math.pi / times[POINTS]
    inputs = {"r": 1e-3 * np.sin(w * times), "rd": 1e-3 * w * np.cos(w * times)}
    (force,) = bench.run(times, inputs, ["u"])
    return (Panel((Curve(times, force),), TIME, bench.axis("u"), "Force for a sinusoidal position error."),)


def own_course(bench: Bench) -> tuple[Panel, ...]:
    """Return the force over time with all inputs at zero."""
    times = sample_times(bench, 120)
    (force,) = bench.run(times, {}, ["u"])
    return (Panel((Curve(times, force),), TIME, bench.axis("u"), "Force with all inputs at zero."),)


def learning(bench: Bench) -> tuple[Panel, ...]:
    """Return the force over some periods of a repeating error."""
    period = int(bench.start("N", 400.0))
    times = sample_times(bench, 4 * period)
    phase = np.arange(times.size) / period
    error = 1e-4 * np.sin(2.0 * math.pi * phase)
    (force,) = bench.run(times, {"r": error, "trial_end": np.arange(times.size) % period == 0}, ["u"])
    caption = "Force over four periods of the same sinusoidal error."
    return (Panel((Curve(times, force),), TIME, bench.axis("u"), caption),)


def move(bench: Bench, samples: int) -> tuple[Vector, dict[str, Vector]]:
    """Return a move by 1 mm with continuous snap, with rest before and after."""
    times = sample_times(bench, 2 * samples)
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


def held(bench: Bench) -> tuple[Panel, ...]:
    """Return friction over the other forces on a mass that does not move, or moves within the velocity band of rest."""
    push = 2.5 * largest_force(bench) * np.concatenate([np.linspace(-1.0, 1.0, 201), np.linspace(1.0, -1.0, 201)])
    speed = 0.5 * max(0.0, bench.variables["DV"].start) if "DV" in bench.variables else 0.0
    times = 1e-3 * np.arange(push.size)
    (force,) = bench.run(times, {"v": np.full(push.size, speed), "F_ext": push}, ["F"])
    at = f"at a velocity of {speed:g} m/s" if speed else "at rest"
    # the output after a step belongs to the force before it
    return (Panel((Curve(push[:-1], force[1:]),), bench.axis("F_ext"), bench.axis("F"), f"Friction {at}."),)


def lag(bench: Bench) -> tuple[Panel, ...]:
    """Return the loop of friction over a velocity that varies without reversal."""
    w = 2.0 * math.pi * 10.0
    times = 4.0 * math.pi / w * np.linspace(0.0, 1.0, 801)
    velocity = speed_scale(bench) * (1.1 - np.cos(w * times))
    (force,) = bench.run(times, {"v": velocity}, ["F"])
    caption = "Frictional lag: friction while the velocity varies without reversal."
    return (Panel((Curve(velocity[400:], force[400:]),), bench.axis("v"), bench.axis("F"), caption),)


def followed(bench: Bench) -> tuple[Panel, ...]:
    """Return the force while the axis lags a sinusoidal reference, and rests after each reversal."""
    times, motion = sine(bench, 2)
    r = motion["r"]
    lost = 0.1 * r.max()
    x = np.zeros(r.size)
    for k in range(1, r.size):
        x[k] = min(max(x[k - 1], r[k] - lost), r[k] + lost)
    measured = {"x": x, "v": np.gradient(x, times)}
    (force,) = bench.run(times, {**motion, **measured}, ["u"])
    caption = "Force while the axis lags a sinusoidal reference and rests after each reversal."
    return (Panel((Curve(times, force),), TIME, bench.axis("u"), caption),)


def position(bench: Bench) -> tuple[Panel, ...]:
    """Return the position of a mass that is pushed forward and back."""
    times = np.linspace(0.0, 3.0, 601)
    force = 2.5 * largest_force(bench) * np.sin(2.0 * math.pi * times)
    (x,) = bench.run(times, {"F_drive": force, "F_ext": force}, ["x"])
    return (Panel((Curve(times, x),), TIME, bench.axis("x"), "Position for a sinusoidal force."),)


def sampled(bench: Bench) -> tuple[Panel, ...]:
    """Return the measured velocity of a steady motion."""
    Ts = bench.start("Ts", 1e-3)
    times = Ts * np.arange(61)
    speed = 10.0 * bench.start("q", 1e-6) / Ts
    (found,) = bench.run(times, {"x": speed * times, "v": np.full(times.size, speed)}, ["v_measured"])
    caption = "Measured velocity of a steady motion by ten counts per sample."
    return (Panel((Curve(times, found),), TIME, bench.axis("v_measured"), caption),)


def in_turn(bench: Bench) -> tuple[Panel, ...]:
    """Return the output while one input after another steps to 1."""
    times = bench.start("Ts", 5e-3) * np.arange(101)
    steps = {name: np.where(np.arange(101) >= 20 * (k + 1), 1.0, 0.0) for k, name in enumerate(bench.inputs)}
    (found,) = bench.run(times, steps, bench.outputs[:1])
    caption = "Output while one input after another steps to 1."
    return (Panel((Curve(times, found),), TIME, bench.axis(bench.outputs[0]), caption),)


def both_ways(bench: Bench, x: Vector, speeds: tuple[float, ...], output: str) -> tuple[Panel, ...]:
    """Return the output over the position, forward and back, at each speed."""
    curves = []
    for speed in speeds:
        for direction, label in ((1.0, "forward"), (-1.0, "back")):
            way = x[:: int(direction)]
            v = np.full(x.size, direction * speed)
            (force,) = bench.run(1e-3 * np.arange(x.size), {"x": way, "v": v, "f": np.sign(v)}, [output])
            # the output after a step belongs to the position before it
            curves.append(Curve(way[:-1], force[1:], label, aside=direction < 0.0))
    caption = "Force over the position, forward and back" + (", at each speed of the table." if speeds[1:] else ".")
    return (Panel(tuple(curves), bench.axis("x"), bench.axis(output), caption),)


def over_pitch(bench: Bench) -> tuple[Panel, ...]:
    """Return the force of tables over one period of the position."""
    return both_ways(bench, np.linspace(0.0, bench.start("pitch", 1.0), 161), (4.0 * speed_scale(bench),), "u")


def over_input(bench: Bench, name: str, reach: float, cases: Mapping[str, Values], caption: str) -> Panel:
    """Return the first output over an input from -reach to reach, a curve for each case of the other inputs."""
    x, output = reach * np.linspace(-1.0, 1.0, 201), bench.outputs[0]
    curves = []
    for label, held in cases.items():
        given = {other: np.full(x.size, value) for other, value in held.items()}
        (found,) = bench.run(bench.start("Ts", 1e-3) * np.arange(x.size), {name: x, **given}, [output])
        # the output after a step belongs to the input before it
        curves.append(Curve(x[:-1], found[1:], label))
    return Panel(tuple(curves), bench.axis(name), bench.axis(output), caption)


def motor(bench: Bench) -> tuple[Panel, ...]:
    """Return the force over the velocity, up to 1.2 times that without load."""
    cases = {f"duty {duty:g}": {"duty": duty} for duty in (1.0, 0.5, -1.0)}
    reach = 1.2 * bench.variables["U"].start / bench.start("K", 1.0)
    return (over_input(bench, "v", reach, cases, "Force over velocity at three duty cycles."),)


def lifting(bench: Bench) -> tuple[Panel, ...]:
    """Return the load of a contact over the force that it holds, in both directions of motion."""
    cases = {"forward": {"v": 1.0}, "back": {"v": -1.0}}
    caption = "Load of the contact over the force of the load, in motion forward and back."
    return (over_input(bench, "F_load", 2.0, cases, caption),)


def transmitting(bench: Bench) -> tuple[Panel, ...]:
    """Return the load of a contact over the force of the drive, and over the velocity."""
    speed, against = speed_scale(bench), {"F_external": -1.0}
    cases = {"at rest": {"v": 0.0, **against}, "in motion": {"v": 4.0 * speed, **against}}
    drive = "Load of the contact over the force of the drive, against a force of 1."
    velocity = "Load of the contact over velocity, with a drive of 2 against a force of 1."
    return (
        over_input(bench, "F_drive", 3.0, cases, drive),
        over_input(bench, "v", 4.0 * speed, {"": {"F_drive": 2.0, **against}}, velocity),
    )


def arm_ahead(bench: Bench) -> tuple[Panel, ...]:
    """Return the force and the load over the position of an arm that swings over a turn."""
    phase, size = np.linspace(0.0, 2.0 * math.pi, 401), 0.5 * bench.start("pitch", 1.0)
    motion = {"r": size * np.sin(phase), "rd": np.cos(phase), "rdd": -np.sin(phase) / size}
    u, Fn = bench.run(sample_times(bench, 400), motion, ["u", "Fn"])
    # the outputs after a step belong to the position before it
    return tuple(
        Panel((Curve(motion["r"][:-1], found[1:]),), bench.axis("r"), bench.axis(name), f"{text} over the position.")
        for name, found, text in (("u", u, "Force"), ("Fn", Fn, "Load of the contact"))
    )


def through_rest(bench: Bench) -> tuple[Panel, ...]:
    """Return the force over the velocity at a position."""
    velocity = 5.0 * bench.start("v_sign", 1e-3) * np.linspace(-1.0, 1.0, 201)
    times = 1e-3 * np.arange(velocity.size)
    (begin,) = bench.run(times[:2], {}, ["x_begin"])
    (force,) = bench.run(times, {"x": np.full(times.size, begin[0]), "v": velocity}, ["F_position"])
    caption = "Force at the begin of the table over the velocity."
    return (Panel((Curve(velocity[:-1], force[1:]),), bench.axis("v"), bench.axis("F_position"), caption),)


def pulses(bench: Bench) -> tuple[Panel, ...]:
    """Return the force after a step of the position error while a controller pushes."""
    times = bench.start("Ts", 1e-3) * np.arange(61)
    error = np.where(times > 0.1 * times[-1], 1e-3, 0.0)
    given = {"r": error, "f": 0.3 * bench.start("Fs", 1.0) * np.sign(error)}
    curves = []
    for sized, label in ((1.0, "pulse sized by the error"), (0.0, "F_pulse")):
        with bench.changed({"sized": sized}):
            (force,) = bench.run(times, given, ["u"])
        curves.append(Curve(times, force, label, aside=not sized))
    caption = "Force after a step of the position error, while a controller pushes, too."
    return (Panel(tuple(curves), TIME, bench.axis("u"), caption),)


def quick_move(bench: Bench) -> tuple[Panel, ...]:
    """Return the force over time for a move in few samples."""
    times, motion = move(bench, 8)
    (force,) = bench.run(times, motion, ["u"])
    return (Panel((Curve(times, force),), TIME, bench.axis("u"), "Force for a move in eight samples."),)


SHOWN: Final[Mapping[str, Experiment]] = {
    "Actuator": saturation,
    "Belt": ride,
    "BurridgeKnopoff": avalanches,
    "Circle": circle,
    "Cogging": ripple,
    "DCMotor": motor,
    "Differentiator": differentiation,
    "Dither": own_course,
    "EfficiencyLoad": lifting,
    "FrenkelKontorova": depinning,
    "FrenkelKontorovaTomlinson": towed_to_and_fro,
    "KarnoppMass": pushed_mass,
    "LoadFeedforward": arm_ahead,
    "Mass": push,
    "PositionMap": over_position,
    "PrandtlTomlinson": tomlinson,
    "ResetPID": alternating_error,
    "SwitchMass": stick_slip,
    "TransmissionLoad": transmitting,
    "TwoMass": resonance,
    **dict.fromkeys(("DiscreteInverse", "InverseDynamics"), inversion),
    **dict.fromkeys(("Encoder", "Quantiser"), staircase),
    **dict.fromkeys(("IterativeLearning", "RepetitiveController"), learning),
    **dict.fromkeys(("Prefilter", "PreviewPrefilter"), shaping),
}
"""The experiment of a block in place of the one that its ports select."""

FURTHER: Final[Mapping[str, Experiment]] = {
    **dict.fromkeys(("DeadZoneTorque", "Stiction"), held),
    **dict.fromkeys(("Mass", "KarnoppMass"), position),
    **dict.fromkeys(("Sum", "SampledSum"), in_turn),
    **dict.fromkeys(("PID", "CascadePPI", "ResetPID", "MultiLoopKarnopp", "AdaptiveSlidingMode"), followed),
    **dict.fromkeys(("LuGreObserver", "GMSObserver", "AdaptiveLuGre"), followed),
    "DiscreteInverse": quick_move,
    "Encoder": sampled,
    "GMS": lag,
    "ImpulsiveControl": pulses,
    "PositionMap": through_rest,
    "TustinFeedback": over_pitch,
}
"""A further experiment, by block."""


def _wave(name: str, size: float, count: int) -> dict[str, float]:
    """Return a table of a sine that decays from one period to the next."""
    values = (size * 0.8 ** (k // 8) * math.sin(2.0 * math.pi * k / 8.0) for k in range(count))
    return {f"{name}[{k}]": round(value, 3) for k, value in enumerate(values, start=1)}


BEGIN: Final[Mapping[str, Values]] = {
    "AdaptiveLuGre": {"theta_max": 1.2},
    "AdaptiveSlidingMode": {"Fc_max": 1.2},
    "Cogging": {f"amplitude[{k}]": 0.5 / k for k in range(2, 7)},
    "Encoder": {"jitter": 1e-4},
    "FrenkelKontorova": {"amplitude": 0.3},
    "FrenkelKontorovaTomlinson": {"amplitude": 0.3},
    "ImpulsiveControl": {"alone": 0.0},
    "InverseDynamics": {"m_load": 1.0, "compliance": 1e-5},
    "KalmanFriction": {"use_v": 1.0},
    "LoadFeedforward": {"G_cos": 0.3, "Fv": 0.2},
    "Mass": {"k": 10.0},
    "MultiLoopKarnopp": {"CV_num[2]": 2000.0, "CV_num[3]": 20000.0},
    "PID": {"db": 1e-5, "reversal": 0.0, "v_zc": 1e-3},
    "PrandtlTomlinson": {"kT": 0.01},
    "Profile": {"cyclic": 1.0},
    "TransmissionLoad": {"at_rest": 0.3, "b_drive": 0.1, "b_external": 0.3, "c_drive": 0.2, "c_external": 0.1},
    "Sine": {"amplitude[2]": 0.005, "amplitude[3]": 0.003, "amplitude[4]": 0.002},
    "TustinFeedback": _wave("cogging", 0.3, 16),
}
"""Values with which a page begins in place of start values with which another parameter has no effect."""

_IDLE: Final[Mapping[str, tuple[str, ...]]] = {
    "AdaptiveSlidingMode": ("Fv_max",),
    "Bristle": ("detour",),
    "EfficiencyLoad": ("v_rest",),
    "GenericAsperity": ("detour",),
    "SevenParameter": ("detour", "speed"),
}


def shown(bench: Bench) -> Experiment | None:
    """Return the experiment of a block, or None if there is nothing to show."""
    return SHOWN.get(bench.block.name) or experiment(bench)


def idle(block: Block) -> tuple[str, ...]:
    """Return the parameters and properties of the motion that no figure of a block shows, and that get no slider."""
    rate_independent = block.kind == "friction" and "rate dependent" not in block.features
    return (*_IDLE.get(block.name, ()), *(["speed"] if rate_independent else []))
