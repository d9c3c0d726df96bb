"""The servo axis as a system of FMUs: reference, compensator, feedback, sensors, mass and friction.

This module connects FMUs. Control laws, plants and friction forces are computed inside them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from friction_fmus.axis.servo import Servo
from friction_fmus.fmi.package import fmu
from harness import Experiment, FmuPart, Part, System, Wire

RECORDED = ("axis.x", "servo.u")
"""Variables recorded at every sample of the servo."""

FINEST = 0.25e-3
"""Longest communication step between mass and friction [s]."""

SOFT = 0.1
"""Largest step times angular frequency of the mass on its bristles for which an explicit coupling is accurate."""


@dataclass(frozen=True)
class Plant:
    """Identified mass and friction of an axis.

    Attributes
    ----------
    friction : str
        Friction block.
    values : mapping of str to float
        Parameters of the friction block.
    mass : float
        Moved mass [kg].
    offset : float
        Constant force that the drive needs in addition to friction [N].
    """

    friction: str
    values: Mapping[str, float]
    mass: float
    offset: float = 0.0

    @property
    def stiffness(self) -> float:
        """Contact stiffness at rest [N/m]; 0 if rigid."""
        elements = sum(value for name, value in self.values.items() if name.startswith("k["))
        return max(self.values.get("sigma0", 0.0), self.values.get("sigma", 0.0), self.values.get("kt", 0.0), elements)


@dataclass(frozen=True)
class Compensator:
    """Compensator in the servo: block, name of its force output, and parameters of the block."""

    model: str
    output: str = "u"
    values: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Trajectory:
    """Reference that the axis follows, and its initial state.

    Attributes
    ----------
    reference : Path
        FMU that outputs the reference.
    samples : int
        Length in samples of the servo.
    x0, v0 : float
        Initial position and velocity of the axis [m, m/s].
    motion : bool
        Whether the servo receives the reference velocity and acceleration.
    offset : float
        Constant force added to the output of the servo [N].
    rotary : bool
        Whether the axis is rotary.
    """

    reference: Path
    samples: int
    x0: float
    v0: float
    motion: bool = False
    offset: float = 0.0
    rotary: bool = False


@dataclass(frozen=True, eq=False)
class Trace:
    """Position q [m] and drive force [N] of a run, shape (samples,); the force is commanded at the time of q."""

    q: NDArray[np.float64]
    force: NDArray[np.float64]


def block(name: str, rotary: bool = False) -> Path:
    """Return the FMU of a block with its default start values."""
    return fmu(name, "rotational" if rotary else "translational")


def typed(part: Part, values: Mapping[str, float]) -> dict[str, float | int | bool]:
    """Return the values that are parameters of a part, converted to the parameter's type."""
    kinds: dict[str, type[float | int | bool]] = {"Real": float, "Integer": int, "Boolean": bool}
    types = {port.name: kinds[port.type] for port in part.parameters if port.type in kinds}
    return {name: types[name](value) for name, value in values.items() if name in types}


def _master(plant: Plant, step: float) -> str:
    """Return the master: gauss-seidel for soft bristles, otherwise newton, which solves mass and friction jointly."""
    soft = 0.0 < step * (plant.stiffness / plant.mass) ** 0.5 <= SOFT
    return "gauss-seidel" if soft else "newton"


def closed_loop(
    servo: Servo,
    plant: Plant,
    trajectory: Trajectory,
    compensator: Compensator | None = None,
    fmus: Mapping[str, Path] | None = None,
    longest: float = FINEST,
) -> System:
    """Return the closed loop of an axis as a system.

    Parameters
    ----------
    servo : Servo
        Feedback and sensors.
    plant : Plant
        Mass and friction.
    trajectory : Trajectory
        Reference and initial state.
    compensator : Compensator, optional
        Compensator, whose force is added to the output of the servo; see `with_gain`.
    fmus : mapping of str to Path, optional
        FMUs to use instead of those of the library, by name of the part.
    longest : float
        Longest communication step between mass and friction [s].

    Returns
    -------
    System
        System with its experiment; the caller closes it.
    """
    every = max(1, int(np.ceil(servo.Ts / longest - 1e-9)))  # steps of mass and friction in a sample
    of_its_own = fmus or {}

    def part(name: str, model: str, sampled: bool = True) -> FmuPart:
        path = of_its_own.get(name) or block(model, trajectory.rotary)
        return FmuPart(name, path, every=every if sampled else 1)

    limits = {"u_min": -servo.force_limit, "u_max": servo.force_limit}
    start: dict[str, float | int | bool | str] = {
        "servo.m": plant.mass if trajectory.motion else servo.inertia_feedforward
    }
    start |= {f"servo.{name}": value for name, value in {**servo.gains, **limits, "Ts": servo.Ts}.items()}
    start |= {"velocity.Ts": servo.Ts, "velocity.window": servo.window, "velocity.v0": trajectory.v0}
    start |= {"axis.m": plant.mass, "axis.x0": trajectory.x0, "axis.v0": trajectory.v0, "axis.F_load": -plant.offset}
    if servo.quantum:
        start["encoder.q"] = servo.quantum

    parts: list[Part] = [FmuPart("reference", trajectory.reference, every=every), part("velocity", "Differentiator")]
    wires: list[str | Wire] = ["reference.r -> servo.r", "servo.u -> axis.F_drive"]
    sensed = {"x": "encoder.y" if servo.quantum else "axis.x", "v": "velocity.v"}
    wires += [f"{sensed['x']} -> velocity.x", *(f"{source} -> servo.{name}" for name, source in sensed.items())]
    if trajectory.motion or servo.velocity_feedforward:
        wires.append("reference.rd -> servo.rd")
    else:
        start["servo.rd"] = 0.0
    if trajectory.motion or servo.inertia_feedforward:
        wires.append("reference.rdd -> servo.rdd")
    else:
        start["servo.rdd"] = 0.0
    if compensator is None:
        start["servo.f"] = trajectory.offset
    else:
        added = part("compensator", compensator.model)
        parts.append(added)
        known = {**sensed, **{name: f"reference.{name}" for name in ("r", "rd", "rdd")}}
        taken = {port.name for port in added.inputs}
        wires += [f"{source} -> compensator.{name}" for name, source in known.items() if name in taken]
        if "u_prev" in taken:  # without the constant force: it is known, so an estimator must not see it
            wires.append(Wire("servo.u", "compensator.u_prev", offset=-trajectory.offset, delay=every))
        wires.append(Wire(f"compensator.{compensator.output}", "servo.f", offset=trajectory.offset))
        own = typed(added, {**limits, "Ts": servo.Ts, **compensator.values})
        start |= {f"compensator.{name}": value for name, value in own.items()}
    contact = part("friction", plant.friction, sampled=False)
    start |= {f"friction.{name}": value for name, value in typed(contact, plant.values).items()}
    parts += [part("servo", servo.law), part("axis", "Mass", sampled=False), contact]
    if servo.quantum:
        parts.append(part("encoder", "Quantiser"))
        wires.append("axis.x -> encoder.x")
    wires += ["axis.v -> friction.v", "friction.F -> axis.F_friction"]
    if "Fn0" in plant.values:  # the friction was identified at this normal force, which is constant
        loaded = [each for each in parts if isinstance(each, FmuPart) and "Fn" in {port.name for port in each.inputs}]
        start |= {f"{each.name}.Fn": plant.values["Fn0"] for each in loaded}
    if any(port.name == "F_ext" for port in contact.inputs):
        wires.append("axis.F_ext -> friction.F_ext")
    step = servo.Ts / every
    stop = trajectory.samples * servo.Ts
    master = _master(plant, step)
    experiment = Experiment(stop=stop, step=step, master=master, record=RECORDED, decimate=every)
    return System(parts, wires, start, experiment, "axis")


def with_gain(system: System, gain: float) -> System:
    """Return the system with another gain of the compensation; both share their parts, so run one at a time."""
    wires = [replace(wire, gain=gain) if wire.target == "servo.f" else wire for wire in system.wires]
    return System(system.parts.values(), wires, system.start, system.experiment, system.name)


def run_loop(system: System) -> Trace:
    """Run the system of an axis and return position and force."""
    result = system.run()
    # a row of the result has the position at its time and the force of the sampling period that ends there
    return Trace(
        q=np.asarray(result["axis.x"].to_numpy(), dtype=np.float64)[:-1],
        force=np.asarray(result["servo.u"].to_numpy(), dtype=np.float64)[1:],
    )
