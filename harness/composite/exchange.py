"""Whether a composite FMU is for model exchange too, and the states that it has then."""

from __future__ import annotations

from lxml import etree

from harness.parts.fmu import FmuPart
from harness.storage.zip_file import open_zip, read_zip
from harness.system.assembly import Assembly


def exchange_fault(system: Assembly) -> str | None:
    """Return why the FMU of a system is for co-simulation only; None if it is for model exchange too."""
    for name, part in system.parts.items():
        if isinstance(part, FmuPart) and part.archive.description.modelExchange is None:
            return f"{name} is for co-simulation only"
        if part.every != 1:
            return f"{name} steps every {part.every} steps"
    late = next((wire for wire in system.wires if wire.delay), None)
    return None if late is None else f"the connection {late} has a delay"


def states(part: FmuPart) -> dict[str, str]:
    """Return the derivatives of an FMU by name, each with its state, in the order of its state vector."""
    found = (unknown.variable for unknown in part.archive.description.derivatives)
    return {variable.name: variable.derivative.name for variable in found}


def reinitialised(part: FmuPart) -> set[str]:
    """Return the states of an FMU that its events may change, which fmpy does not read."""
    with open_zip(part.path) as archive:
        root = etree.fromstring(read_zip(archive, "modelDescription.xml"))
    scalars = root.iterfind("ModelVariables/ScalarVariable")
    return {
        str(scalar.get("name"))
        for scalar in scalars
        if any(real.get("reinit") in ("true", "1") for real in scalar.iterfind("Real"))
    }


def inner_name(part: str, own: str) -> str:
    """Return the name of a variable of a part in the composite: "part.x", or "der(part.x)" of a derivative."""
    depth = 0
    while own.startswith("der(") and own.endswith(")"):
        own, depth = own[4:-1], depth + 1
    return "der(" * depth + f"{part}.{own}" + ")" * depth
