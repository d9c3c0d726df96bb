"""One axis with any controller, any sample time and several compensators: what some effects share beside `_loop`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import pi
from types import MappingProxyType

import numpy as np

from _loop import TS, Array, inputs_of, simulate
from harness import Result, Wire
from harness.system.wire import parse_wire

Settings = Mapping[str, float]
Block = tuple[str, Settings]

SINE = ("r", "rd", "rdd")
"""Outputs of the blocks Sine, Multisine and Profile: position, velocity and acceleration."""


def cosine(A: float, f: float) -> Block:
    """A reference A cos(2 pi f t), amplitude in m and frequency in Hz."""
    return "Sine", {"amplitude[1]": A, "frequency[1]": f, "phase[1]": pi / 2.0}


def error(result: Result, since: float = 0.0, position: str = "reference.r") -> Array:
    """Reference minus position, from a time on [m]."""
    late = result["time"].to_numpy() > since + 1e-9
    return np.asarray((result[position] - result["mass.x"]).to_numpy()[late])


def follow(
    reference: Block,
    controller: Block,
    stop: float,
    *,
    added: Mapping[str, Block] = MappingProxyType({}),
    friction: Block | None = ("LuGre", MappingProxyType({})),
    mass: Settings = MappingProxyType({}),
    others: Mapping[str, Block] = MappingProxyType({}),
    wires: Sequence[str | Wire] = (),
    outputs: tuple[str, str, str] = SINE,
    Ts: float = TS,
    inner: int = 1,
    master: str = "newton",
) -> Result:
    """A mass that a controller leads along a reference, against friction.

    Parameters
    ----------
    reference, controller : tuple of str and mapping
        Block and start values; they are the parts ``reference`` and ``servo``.
    stop : float
        End of the run [s], rounded to samples.
    added : mapping of str to tuple
        Compensators, name of the part -> block and start values. The u of the first goes to the input f of the
        controller, that of the second to the input F_load of the mass, so that both are added.
    friction : tuple or None
        Block and start values of the part ``friction``.
    mass : mapping
        Start values of the part ``mass``, 1 kg at 0 if there are none.
    others, wires : mapping and sequence
        Further parts and their connections. A wire in `wires` replaces the usual one to the same input.
    outputs : tuple of str
        Outputs of the reference that are its position, velocity and acceleration.
    Ts : float
        Sample time of controller and compensators [s].
    inner : int
        Communication steps in a sample.
    master : str
        Who steps when.

    Returns
    -------
    xarray.Dataset
        ``reference.*``, ``servo.u``, ``mass.*``, ``friction.F`` and the outputs of the other parts, at the samples.
    """
    blocks = {"reference": reference, **others, **added, "servo": controller, "mass": ("Mass", mass)}
    blocks |= {"friction": friction} if friction else {}
    values = {f"{part}.{name}": value for part, (_, given) in blocks.items() for name, value in given.items()}
    sources = {name: f"reference.{port}" for name, port in zip(("r", "rd", "rdd"), outputs, strict=True)}
    sources |= {"x": "mass.x", "v": "mass.v", "u_prev": "mass.F_ext"}
    lines = {"mass.F_drive": "servo.u"} | dict(
        zip(("servo.f", "mass.F_load"), (f"{part}.u" for part in added), strict=False)
    )
    for part in (*added, "servo"):
        values[f"{part}.Ts"] = Ts
        lines |= {f"{part}.{name}": sources[name] for name in sorted(inputs_of(blocks[part][0]) & sources.keys())}
    if friction:
        lines |= {"friction.v": "mass.v", "mass.F_friction": "friction.F"}
    else:
        values["mass.F_friction"] = 0.0
    own = [wire if isinstance(wire, Wire) else parse_wire(wire) for wire in wires]
    usual = [Wire(source, target) for target, source in lines.items() if target not in {wire.target for wire in own}]
    models = {part: block for part, (block, _) in blocks.items()}
    result = simulate(models, [*usual, *own], values, stop, step=Ts / inner, master=master)
    return result.isel(time=slice(None, None, inner))
