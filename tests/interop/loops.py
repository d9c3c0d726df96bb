"""A closed loop for every block of the catalogue, put together by the names of the ports."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path

import fmpy
import numpy as np
from fmpy.model_description import ModelDescription, ScalarVariable

from friction_fmus import catalogue
from harness import FmuPart, System

STEP, STOP = 2.5e-4, 0.1  # s; four steps to a sample of a controller
EVERY = 8
"""Trajectories are compared after every so many steps of size STEP."""

Value = float | int | bool
Trajectories = Mapping[str, np.ndarray]

PARTS = {"reference": "Profile", "controller": "PID", "mass": "Mass", "friction": "LuGre"}
REAL_PARTS = {"reference": "Profile", "load": "Cogging", "mass": "Mass", "friction": "LuGre"}
"""The same without Booleans: the force comes from a cogging drive."""

CHANGED = {
    "mass.m": 1.25,
    "mass.v0": 0.02,
    "mass.v1_0": 0.02,
    "mass.k": 500.0,
    "reference.j_max": 40.0,
    "friction.Fc": 0.9,
    "load.base": 1.5,
    "first.amplitude": 0.1,
    "first.mode": 3,
    "first.periodic": 0,
}
"""Parameters that are set, in loops that have them."""

CHAINS = ("BurridgeKnopoff", "FrenkelKontorova", "FrenkelKontorovaTomlinson")
"""Without units: they close a loop among themselves."""

FEEDS = {
    "r": ("prefilter.r_out", "reference.r", "reference.x"),
    "rd": ("prefilter.rd_out", "reference.rd", "reference.xd"),
    "rdd": ("reference.rdd", "reference.xdd"),
    "jerk": ("reference.rddd",),
    "x": ("sensor.x_measured", "sensor.y", "sensor.x_mean", "mass.x", "mass.x1"),
    "v": ("sensor.v_measured", "sensor.v", "mass.v", "mass.v2"),
    "f": ("addition.u", "prefilter.u_hat"),
    "u_prev": ("mass.F_ext", "mass.F_ext1"),
    "u": ("controller.u", "load.F"),
    "F_drive": ("actuator.F", "controller.u", "load.F"),
    "F_load": ("load.F", "load.F_position"),
    "u1": ("mass.x",),
    "F_friction": ("friction.F",),
    "F_friction2": ("friction.F",),
    "v_support": ("reference.rd", "reference.xd"),
    "v_belt": ("reference.rd",),
    "a_belt": ("reference.rdd",),
}
"""Port -> outputs that may drive it; the first that the loop has does."""

FEEDS_OF = {
    "friction": {"v": ("mass.v_rel", "mass.v2", "mass.v"), "F_ext": ("mass.F_ext", "mass.F_ext2"), "Fn": ("load.Fn",)},
    "sensor": {"u": ("mass.x",)},
}
"""The same for the ports of one part."""


@cache
def description(fmu: Path) -> ModelDescription:
    """What an FMU says of itself."""
    return fmpy.read_model_description(str(fmu))


@cache
def variables(fmu: Path) -> Mapping[str, ScalarVariable]:
    """The variables of an FMU by name."""
    return {v.name: v for v in description(fmu).modelVariables}


def ports(fmu: Path, causality: str, type: str | None = None) -> list[str]:
    """Names of the inputs or outputs, of all types or of one."""
    return [name for name, v in variables(fmu).items() if v.causality == causality and type in (None, v.type)]


def start_value(v: ScalarVariable) -> Value:
    """The start value of a variable in Python's type."""
    if v.type == "Boolean":
        return v.start == "true"
    return float(v.start) if v.type == "Real" else int(v.start)


@dataclass(frozen=True)
class Loop:
    """FMUs by the names of the parts, (output, input) of the wires, and start values."""

    fmus: Mapping[str, Path]
    wires: tuple[tuple[str, str], ...]
    start: Mapping[str, Value]

    def variable(self, name: str) -> ScalarVariable:
        """The variable ``part.name``."""
        part, name = name.split(".", 1)
        return variables(self.fmus[part])[name]

    def outputs(self) -> list[str]:
        """All Real outputs, ``part.port``."""
        return [f"{part}.{name}" for part, fmu in self.fmus.items() for name in ports(fmu, "output", "Real")]

    def feed_through(self) -> dict[str, list[str]]:
        """Real outputs that inputs change without a step, with these inputs; held outputs are none."""
        found = {
            f"{part}.{unknown.variable.name}": [
                f"{part}.{known.name}" for known in unknown.dependencies if known.causality == "input"
            ]
            for part, fmu in self.fmus.items()
            for unknown in description(fmu).outputs
            if unknown.variable.variability != "discrete"
        }
        return {output: inputs for output, inputs in found.items() if inputs}

    def states(self) -> list[str]:
        """The Real outputs without feed-through."""
        return [name for name in self.outputs() if name not in self.feed_through()]

    def real(self) -> Loop:
        """The same without start values of other types than Real."""
        return replace(self, start={name: value for name, value in self.start.items() if isinstance(value, float)})

    @cached_property
    def jacobi(self) -> Trajectories:
        """What the harness gives with the master jacobi."""
        return self.own("jacobi")

    def own(self, master: str, order: Iterable[str] = ()) -> Trajectories:
        """The trajectories that the harness gives, at the start and after every EVERY steps."""
        with System(
            [FmuPart(part, fmu) for part, fmu in self.fmus.items()],
            [f"{source} -> {target}" for source, target in self.wires],
            self.start,
        ) as system:
            result = system.run(stop=STOP, step=STEP, master=master, order=tuple(order), decimate=EVERY)
            return {name: result[name].to_numpy() for name in self.outputs()}

    def first_inputs(self) -> dict[str, float]:
        """Wired inputs at the start, for importers that exchange nothing during initialisation."""
        return {target: float(self.jacobi[source][0]) for source, target in self.wires}


def parts_with(block: str, fmu: Path, others: Mapping[str, str]) -> dict[str, str]:
    """Models of a loop with this block: in the place of another one if it can take it, else between them."""
    kind, inputs, outputs = catalogue()[block].kind, ports(fmu, "input"), ports(fmu, "output")
    if kind == "friction" and "v" in outputs:  # with the mass inside
        return {part: model for part, model in others.items() if part != "friction"} | {"mass": block}
    if kind == "friction":
        role = "friction"
    elif "F_friction" in inputs or "F_friction2" in inputs:
        role = "mass"
    elif kind == "plant":
        role = "actuator" if "u" in inputs else "load"
    elif kind == "signal":
        role = "sensor" if inputs else "reference"
    elif "r_out" in outputs:
        role = "prefilter"
    else:
        role = "controller" if "x" in inputs and ("f" in inputs or {"r", "rdd"} <= set(inputs)) else "addition"
    return {**others, role: block}


def closed_loop(block: str, find: Callable[[str], Path], others: Mapping[str, str] = PARTS) -> Loop:
    """The loop that a block takes part in with others; `find` gives the FMU of a model."""
    if block in CHAINS:
        return ring(find)
    fmus = {part: find(model) for part, model in parts_with(block, find(block), others).items()}
    made = {f"{part}.{name}" for part, fmu in fmus.items() for name in ports(fmu, "output")}
    wires, start = [], {}
    for part, fmu in fmus.items():
        inputs = ports(fmu, "input")
        feeds = FEEDS | FEEDS_OF.get(part, {})
        if part == "mass":  # the drive goes to what there is for it
            feeds = feeds | {next(p for p in ("F_drive", "F_ext", "F_load") if p in inputs): FEEDS["F_drive"]}
        for port in inputs:
            sources = [name for name in feeds.get(port, ()) if name in made and not name.startswith(f"{part}.")]
            if sources:
                wires.append((sources[0], f"{part}.{port}"))
            else:
                start[f"{part}.{port}"] = start_value(variables(fmu)[port])
        start |= {name: value for name, value in CHANGED.items() if name in {f"{part}.{v}" for v in variables(fmu)}}
    if any(port.endswith(".u_prev") for _, port in wires):
        start.pop("mass.v0", None)  # from rest: else the start is an algebraic loop, which every master solves its way
    return Loop(fmus, tuple(wires), start)


def ring(find: Callable[[str], Path]) -> Loop:
    """Two chains, each moved by the friction that the other one's velocity makes."""
    fmus = {
        "first": find("FrenkelKontorova"),
        "fault": find("BurridgeKnopoff"),
        "second": find("FrenkelKontorova"),
        "contact": find("FrenkelKontorovaTomlinson"),
    }
    wires = (
        ("first.v", "fault.v"),
        ("fault.F", "second.F_drive"),
        ("second.v", "contact.v"),
        ("contact.F", "first.F_drive"),
    )
    return Loop(fmus, wires, {name: value for name, value in CHANGED.items() if name.startswith("first.")})


def all_loops(find: Callable[[str], Path], blocks: Iterable[str], others: Mapping[str, str] = PARTS) -> dict[str, Loop]:
    """The loops that all the blocks take part in, each once, by the name of a block in it."""
    loops: dict[str, Loop] = {}
    for block in blocks:
        made = closed_loop(block, find, others)
        if made not in loops.values():
            loops[block] = made
    return loops


def beside_each_other(loops: Mapping[str, Loop]) -> Loop:
    """One system of all loops; the part ``mass`` of the loop of LuGre is ``LuGre_mass``."""
    fmus, wires, start = {}, [], {}
    for block, one in loops.items():
        fmus |= {f"{block}_{part}": fmu for part, fmu in one.fmus.items()}
        wires += [(f"{block}_{source}", f"{block}_{target}") for source, target in one.wires]
        start |= {f"{block}_{name}": value for name, value in one.start.items()}
    return Loop(fmus, tuple(wires), start)


def of_loop(block: str, trajectories: Trajectories) -> Trajectories:
    """The trajectories of one loop out of those of `beside_each_other`."""
    return {name[len(block) + 1 :]: x for name, x in trajectories.items() if name.startswith(f"{block}_")}
