"""An axis that only its drive force moves, without its servo."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from friction_fmus.axis.assembly import block, constant_force, typed, viscous_beside
from friction_fmus.axis.loop import FINEST, master_of
from friction_fmus.axis.servo import Plant
from harness import Experiment, FmuPart, Part, SeriesPart, System, Wire
from harness.parts.part import StartValue

Array = NDArray[np.float64]

TOLERANCE = 1e-6
"""Residual of the loop of mass and friction over the size of the values."""


def free_axis(
    plant: Plant,
    t: Array,
    force: Array,
    trend: Array,
    *,
    rotary: bool = False,
    contact: Path | None = None,
    longest: float = FINEST,
) -> System:
    """Return mass and friction of an axis, driven by a recorded force."""
    Ts = float((t[-1] - t[0]) / (len(t) - 1))
    every = max(1, int(np.ceil(Ts / longest - 1e-9)))

    def part(name: str, model: str, own: Path | None = None) -> FmuPart:
        return FmuPart(name, own or block(model, rotary))

    mass, friction = part("axis", "Mass"), part("friction", plant.friction, contact)
    columns = {"u": force, "trend": trend}
    drive = SeriesPart("drive", Ts * np.arange(len(t)), columns, interpolation="previous", beyond="hold")
    drive.every = every
    parts: list[Part] = [drive, part("force", "Sum"), mass, friction]
    wires: list[str | Wire] = ["drive.u -> force.u1", "drive.trend -> force.u2", "force.y -> axis.F_drive"]
    wires += ["axis.v -> friction.v", "friction.F -> axis.F_friction"]
    if any(port.name == "F_ext" for port in friction.inputs):
        wires.append("axis.F_ext -> friction.F_ext")
    start: dict[str, StartValue] = {"axis.m": plant.mass, "force.gain[2]": 0.0}
    start |= constant_force(plant, -plant.offset)
    start["axis.d"] = viscous_beside(friction, plant)
    start |= {f"friction.{name}": value for name, value in typed(friction, plant.values).items()}
    if plant.position is not None:
        parts.append(FmuPart("position", plant.position.fmu(rotary)))
        start |= {f"position.{name}": value for name, value in plant.position.start.items()}
        wires += ["axis.x -> position.x", "axis.v -> position.v"]
        wires.append(Wire("position.F_position", "axis.F_load", delay=1))
    step = Ts / every
    stop = Ts * (len(t) - 1)
    experiment = Experiment(
        stop=stop,
        step=step,
        master=master_of(plant, step),
        record=("axis.x", "axis.v"),
        decimate=every,
        loop_tolerance=TOLERANCE,
    )
    return System(parts, wires, start, experiment, "free axis")


def run_free(system: System, start: Mapping[str, StartValue], begin: float, end: float) -> tuple[Array, Array]:
    """Run a free axis from one sample to another and return position and velocity at all samples."""
    result = system.with_start(start).run(start=begin, stop=end)
    return (
        np.asarray(result["axis.x"].to_numpy(), dtype=np.float64),
        np.asarray(result["axis.v"].to_numpy(), dtype=np.float64),
    )
