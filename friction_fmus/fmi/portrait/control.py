"""Experiments with laws and controllers: their response to a motion, an error or a command."""

from __future__ import annotations

import math

import numpy as np

from friction_fmus.fmi.portrait.course import Bench, Curve, Panel, Vector
from friction_fmus.fmi.portrait.friction import speed_scale

POINTS = 400
"""Number of samples in a period of the motion."""

TIME = ("time", "s")


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
