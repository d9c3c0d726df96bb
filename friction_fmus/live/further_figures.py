"""Further figures for the pages of blocks: experiments in which each parameter matters, and the values they start with.

The figures in the documentation of an FMU show what a block does with its start values. On a page, each slider must
change a figure, so some pages have a further experiment or begin with other values, such as a second sine that is not
zero.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from friction_fmus.blocks.catalogue import Block
from friction_fmus.fmi.portrait.bench import Bench, Curve, Panel, Vector
from friction_fmus.fmi.portrait.experiments import TIME, Experiment, largest_force, move, sine, speed_scale

Values = Mapping[str, float]


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


def over_table(bench: Bench) -> tuple[Panel, ...]:
    """Return the force of tables over the position at each speed of the table."""
    x = 7.0 * bench.start("spacing", 1e-3) * np.linspace(-0.1, 1.1, 121)
    speeds = tuple(share * bench.start("v_max", 1.0) for share in (0.03, 0.1, 0.3, 0.6, 1.0))
    return both_ways(bench, x, speeds, "residual")


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


FURTHER: Final[Mapping[str, Experiment]] = {
    **dict.fromkeys(("DeadZoneTorque", "Stiction"), held),
    **dict.fromkeys(("Mass", "KarnoppMass"), position),
    **dict.fromkeys(("Sum", "SampledSum"), in_turn),
    **dict.fromkeys(("PID", "CascadePPI", "ResetPID", "MultiLoopKarnopp", "AdaptiveSlidingMode"), followed),
    **dict.fromkeys(("LuGreObserver", "GMSObserver", "AdaptiveLuGre"), followed),
    "DiscreteInverse": quick_move,
    "Encoder": sampled,
    "FrictionResidual": over_table,
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
    "FrictionResidual": {"R_max": 0.5, **_wave("forward", 0.4, 40), **_wave("backward", 0.3, 40)},
    "ImpulsiveControl": {"alone": 0.0},
    "InverseDynamics": {"m_load": 1.0, "compliance": 1e-5},
    "KalmanFriction": {"use_v": 1.0},
    "Mass": {"k": 10.0},
    "MultiLoopKarnopp": {"CV_num[2]": 2000.0, "CV_num[3]": 20000.0},
    "PID": {"db": 1e-5, "reversal": 0.0, "v_zc": 1e-3},
    "PrandtlTomlinson": {"kT": 0.01},
    "Profile": {"cyclic": 1.0},
    "Sine": {"amplitude[2]": 0.005, "amplitude[3]": 0.003, "amplitude[4]": 0.002},
    "TustinFeedback": _wave("cogging", 0.3, 16),
}
"""Values with which a page begins in place of start values with which another parameter has no effect."""

_IDLE: Final[Mapping[str, tuple[str, ...]]] = {
    "AdaptiveSlidingMode": ("Fv_max",),
    "Bristle": ("detour",),
    "SevenParameter": ("detour", "speed"),
}


def idle(block: Block) -> tuple[str, ...]:
    """Return the parameters and properties of the motion that no figure of a block shows, and that get no slider."""
    rate_independent = block.kind == "friction" and "rate dependent" not in block.features
    return (*_IDLE.get(block.name, ()), *(["speed"] if rate_independent else []))
