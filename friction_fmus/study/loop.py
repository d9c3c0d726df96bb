"""The recommended loop as a file, from which its C code is generated."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from friction_fmus.axis.loop import Compensator, Trajectory
from friction_fmus.axis.servo import Servo
from friction_fmus.blocks.catalogue import find
from friction_fmus.codegen.laws import law_of
from friction_fmus.codegen.loop_file import LAWS, SHARED, LoopFile, LoopLaw
from friction_fmus.lawkit.law import Kind
from harness import System


def without_code(servo: Servo, laws: Mapping[str, Compensator]) -> str:
    """Return a sentence that says why a loop cannot be written as one unit in C; empty if it can."""
    in_c = [name for name in (servo.law, *(law.model for law in laws.values())) if find(name).kind != "law"]
    if in_c:
        return f"There is no C code of the loop, because {in_c[0]} is a block in C; use the source code in its FMU."
    return ""


def recommended_loop(
    system: System,
    servo: Servo,
    laws: Mapping[str, Compensator],
    given: Mapping[str, Mapping[str, float | bool]],
    trajectory: Trajectory,
    path: Path,
) -> LoopFile:
    """Return the loop of an axis for which `without_code` gives no reason."""
    outputs = {"servo": Compensator(servo.law)} | dict(laws)
    start = {name: value for name, value in system.start.items() if not isinstance(value, str)}
    own = {name.partition(".")[2]: value for name, value in start.items() if name.startswith("servo.")}
    wires = {wire.target: wire for wire in system.wires}
    entries = {}
    for name in filter(outputs.__contains__, LAWS):
        law, parameters = law_of(outputs[name].model), own if name == "servo" else given[name]
        inputs = law.select(Kind.INPUT, Kind.OPTIONAL)
        places = {variable.name: f"{name}.{variable.name}" for variable in inputs}
        factor = [wire.gain for wire in system.wires if wire.source == f"{name}.{outputs[name].output}"]
        entries[name] = LoopLaw(
            outputs[name].model,
            {key: value for key, value in parameters.items() if key not in (*SHARED, *places)},
            {
                variable.name: float(start.get(places[variable.name], variable.starts[0]))
                for variable in inputs
                if places[variable.name] not in {*wires, "servo.f"}
                and (places[variable.name] in start or variable.kind is Kind.INPUT)
            },
            outputs[name].output,
            factor[0] if name == "compensator" and factor[0] != 1.0 else None,
        )
    offset = wires["servo.f"].offset if "servo.f" in wires else start["servo.f"]
    return LoopFile(
        entries,
        servo.Ts,
        -servo.force_limit,
        servo.force_limit,
        float(offset) or None,
        servo.window,
        float(start["velocity.v0"]) or None,
        trajectory.rotary,
        trajectory.table is not None,
        trajectory.table,
        path,
    )
