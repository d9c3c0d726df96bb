"""Experiments that show what a block does, chosen from its ports, and the bench that runs its binary for them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import pairwise

import numpy as np

from friction_fmus.blocks.catalogue import Block
from friction_fmus.blocks.probe import INPUT, OUTPUT, REAL, STATE_OUTPUT, BlockVariable, BlockVariables
from harness.errors import HarnessError
from harness.parts.fmu import FmuPart
from portraits.chart import Curve, Panel, Vector


class Bench:
    """Test bench that runs a compiled block with its start values.

    Attributes
    ----------
    values : mapping of str to float
        Parameters that differ from the start values.
    """

    def __init__(self, block: Block, description: BlockVariables, part: FmuPart) -> None:
        self.block = block
        self._part = part
        self.kind: Callable[..., BenchRun] = BenchRun
        self.values: Mapping[str, float] = {}
        self.variables: dict[str, BlockVariable] = {v.name: v for v in description.variables}
        inputs = sorted((v for v in description.variables if v.role == INPUT), key=lambda v: v.type)
        self._starts = {v.name: v.start for v in inputs}
        self.inputs = tuple(v.name for v in description.variables if v.role == INPUT and v.type == REAL)
        self.outputs = tuple(
            v.name for v in description.variables if v.role in (OUTPUT, STATE_OUTPUT) and v.type == REAL
        )

    def has(self, *names: str) -> bool:
        """Return whether these are all inputs or outputs."""
        return set(names) <= {*self.inputs, *self.outputs}

    def start(self, name: str, otherwise: float) -> float:
        """Return the value of a parameter at the start, if it exists and is positive."""
        value = self.values.get(name, self.variables[name].start) if name in self.variables else otherwise
        return value if value > 0.0 else otherwise

    def axis(self, name: str) -> tuple[str, str]:
        """Return name and unit of a variable for the axis of a panel."""
        return name, self.variables[name].unit

    @contextmanager
    def session(self, outputs: Sequence[str], start: float = 0.0) -> Iterator[BenchRun]:
        """Open a run of a new instance, step by step."""
        self._part.enter_initialisation(start, math.inf, None, self.values)
        try:
            yield self.kind(self._part, self._starts, outputs)
        finally:
            self._part.terminate()

    def run(self, times: Vector, inputs: Mapping[str, Vector], outputs: Sequence[str]) -> tuple[Vector, ...]:
        """Step from each time to the next."""
        rows = [dict(zip(inputs, row, strict=True)) for row in zip(*inputs.values(), strict=True)] or [{}] * times.size
        with self.session(outputs, float(times[0])) as session:
            session.begin(rows[0])
            values = [session.values()]
            for row, (begin, end) in zip(rows, pairwise(times), strict=False):
                session.put(row)
                values.append(session.step(float(begin), float(end - begin)))
        return tuple(np.array(values).T)


class BenchRun:
    """A run of one instance. Inputs that the block does not have are ignored."""

    def __init__(self, part: FmuPart, starts: Mapping[str, float], outputs: Sequence[str]) -> None:
        self._part = part
        self._places = {name: place for place, name in enumerate(starts)}
        self._inputs, self._outputs = np.array([*starts.values()], dtype=float), np.zeros(len(outputs))
        self._calls = part.bind([*starts], outputs, self._inputs, self._outputs)

    def begin(self, inputs: Mapping[str, float]) -> None:
        """Set the inputs and leave initialization mode."""
        self.put(inputs)
        self._part.exit_initialisation()

    def put(self, inputs: Mapping[str, float]) -> None:
        """Set the inputs; a Boolean is true if its value is not zero."""
        for name, value in inputs.items():
            if name in self._places:
                self._inputs[self._places[name]] = value
        self._calls.set()

    def step(self, time: float, length: float) -> list[float]:
        """Perform one communication step and return the outputs after it."""
        self._calls.step(time, length)
        return self.values()

    def values(self) -> list[float]:
        """Return the current outputs."""
        self._calls.get()
        return list(map(float, self._outputs))


TIME = ("time", "s")


def course(bench: Bench) -> tuple[Panel, ...]:
    """Return the first output over one second."""
    times = np.linspace(0.0, 1.0, 501)
    (values,) = bench.run(times, {}, bench.outputs[:1])
    return (
        Panel((Curve(times, values),), TIME, bench.axis(bench.outputs[0]), "Output over time with the start values."),
    )


def step_response(bench: Bench) -> tuple[Panel, ...]:
    """Return the first output after a unit step of the first input."""
    given, answer = bench.inputs[0], bench.outputs[0]
    times = np.linspace(0.0, 200.0 * bench.start("Ts", 5e-3), 201)
    step = np.where(times > 0.1 * times[-1], 1.0, 0.0)
    (values,) = bench.run(times, {given: step}, [answer])
    caption = f"Response of {answer} to a step of {given} by 1 {bench.variables[given].unit}".rstrip() + "."
    return (Panel((Curve(times, values),), TIME, bench.axis(answer), caption),)


SPEEDS = ("vs", "DV", "vt")  # parameters with a velocity scale of friction

SHARE = 0.9  # share of the largest friction at which a contact is considered to be at the onset of sliding


def friction_panels(bench: Bench) -> tuple[Panel, ...]:
    """Return friction over steady velocities and, for an elastic contact, over displacement in presliding."""
    peak = 4.0 * speed_scale(bench)
    reach = elastic_reach(bench, peak / 100.0)
    panels = [_sliding(bench, peak, reach or 0.0)]
    if reach is not None:
        panels.append(presliding_loop(bench, peak / 100.0, 2.2 * reach))
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
    longest = np.array([0.0, 10.0 * reach / speeds[0] + 1e-3])
    bench.run(longest, _moving(bench, np.full(2, speeds[0])), ["F"])  # fails at once where the last hold would fail
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


def presliding_loop(bench: Bench, speed: float, amplitude: float) -> Panel:
    """Return a slow oscillating motion, then one with an inner loop, without the first approach."""
    turns = amplitude * np.array([0.0, 1.0, -1.0, 1.0, 0.5, 0.9, -1.0])
    path = np.concatenate([np.linspace(a, b, 60, endpoint=False) for a, b in pairwise(turns)])
    path = np.append(path, turns[-1])
    steps = np.diff(path)
    times = np.concatenate([[0.0], np.cumsum(np.abs(steps) / speed)])
    velocity = np.append(np.sign(steps) * speed, 0.0)
    (force,) = bench.run(times, _moving(bench, velocity), ["F"])
    return Panel(
        (Curve(path[60:181], force[60:181]), Curve(path[180:], force[180:])),
        ("displacement", path_unit(bench)),
        bench.axis("F"),
        "Friction in presliding: a slow oscillating motion with an inner hysteresis loop.",
    )


def path_unit(bench: Bench) -> str:
    """Return the unit of a displacement."""
    return {"m/s": "m", "rad/s": "rad"}.get(bench.variables["v"].unit, "")


POINTS = 400  # number of samples in a period of the motion


def sample_times(bench: Bench, samples: int) -> Vector:
    """Return the times of samples."""
    return np.asarray(bench.start("Ts", 1e-3) * np.arange(samples + 1))


def sine(bench: Bench, periods: int) -> tuple[Vector, dict[str, Vector]]:
    """Return a sinusoidal reference with speeds in the range where friction varies."""
    times = sample_times(bench, periods * POINTS)
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
    """Return the friction estimate of a law that moves a mass with Coulomb friction along a sinusoidal reference."""
    # The velocity of the mass is stepped so that the mass sticks exactly.
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
    times = sample_times(bench, 60)
    error = np.where(times > 0.1 * times[-1], 1e-3, 0.0)
    (force,) = bench.run(times, {"r": error}, ["u"])
    caption = f"Force after a reference step of 0.001 {bench.variables['r'].unit} with the axis at rest."
    return (Panel((Curve(times, force),), TIME, bench.axis("u"), caption),)


Experiment = Callable[[Bench], tuple[Panel, ...]]


def finite_panels(bench: Bench, chosen: Experiment | None) -> tuple[Panel, ...]:
    """Return the panels of the experiment; none if the block rejects its start values or returns no finite numbers."""
    try:
        panels = chosen(bench) if chosen else ()
    except HarnessError:
        return ()
    finite = all(np.isfinite([curve.x, curve.y]).all() for panel in panels for curve in panel.curves)
    return panels if finite else ()


def experiment(bench: Bench) -> Experiment | None:
    """Return the experiment for a block, or None if there is nothing to show."""
    by_ports: tuple[tuple[bool, Experiment], ...] = (
        (bench.block.kind == "friction" and "v" in bench.inputs and "F" in bench.outputs, friction_panels),
        (bench.has("r", "rd", "x", "u", "F_hat"), tracking),
        (bench.has("F_hat") and (bench.has("v") or bench.has("rd")), estimate),
        (bench.has("r", "x", "u"), held_error),
        (bool(bench.outputs and bench.inputs), step_response),
        (bool(bench.outputs) and not any(v.role == INPUT for v in bench.variables.values()), course),
    )
    return next((made for fits, made in by_ports if fits), None)
