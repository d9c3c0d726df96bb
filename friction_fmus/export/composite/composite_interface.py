"""The inputs and outputs of a composite FMU, and the part inside it that passes its inputs on."""

import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any, Final

import numpy as np

from harness.compiling.platforms import Platform, assembly
from harness.compiling.toolchain import included
from harness.errors import BuildError, UnknownNameError, nearest
from harness.parts.callable_part import CallablePart
from harness.parts.fmu import FmuPart
from harness.parts.part import Part, Port, StartValue
from harness.parts.series import SeriesPart
from harness.system.assembly import Assembled, Assembly, assembled
from harness.system.graph import recorded_names
from harness.system.wire import Wire, find_part, split_name

_TEXTS: Final = (".c", ".h", ".inc")

WRAPPER: Final = """\
/* The FMU {identifier}, with the function prefix {prefix}, also if the header defines none. */
{renames}#undef FMI2_OVERRIDE_FUNCTION_PREFIX
#include "fmi2Functions.h"
#undef fmi2FullName
#define fmi2FullName(name) {prefix}##name
#include "{file}"
"""

_WRITABLE: Final = re.compile(
    r'^\s*\.(?:data|bss|comm|lcomm|zerofill|section\s+"?(?:\.data(?!\.rel\.ro)|\.bss|\.tbss|\.tls|__DATA,__(?!const)))\b',
    re.M,
)
"""Assembly of data that a program can change."""


@dataclass(frozen=True)
class PartCode:
    """The sources of an FMU, which several parts may use."""

    folder: str  # folder of the sources, which distinguishes this FMU from others in the composite
    prefix: str  # prefix of its functions
    identifier: str  # model identifier
    guid: str  # GUID
    files: Mapping[str, str]  # text of each source file
    compiled: tuple[str, ...]  # the files to compile
    own: bool  # whether this project has generated the FMU; warnings of the compiler are errors then
    single: bool  # whether each part needs a copy of the code: it has data outside of instances
    symbols: tuple[str, ...] = ()  # symbols that get the prefix, as other parts may define symbols of the same name

    @property
    def sources(self) -> dict[str, str]:
        """All files by path, with a wrapper for each compiled one."""
        return self.wrappers | {f"{self.folder}/{name}": text for name, text in self.files.items()}

    @property
    def wrappers(self) -> dict[str, str]:
        """The files to compile: each includes a source file of the FMU."""
        found = {}
        renames = "".join(f"#define {symbol} {self.prefix}{symbol}\n" for symbol in self.symbols)
        for number, name in enumerate(self.compiled, start=1):
            suffix = f"_{number}" if len(self.compiled) > 1 else ""
            found[f"part_{self.folder}{suffix}.c"] = WRAPPER.format(
                identifier=self.identifier, prefix=self.prefix, file=f"{self.folder}/{name}", renames=renames
            )
        return found


def part_codes(parts: Mapping[str, Part], name: str, platforms: Sequence[Platform]) -> dict[str, PartCode]:
    """Return the sources of each part that is an FMU; parts with equal FMUs share them if they can."""
    codes: dict[str, PartCode] = {}
    given_of: dict[Path, tuple[str, str, dict[str, str], tuple[str, ...], bool, bool]] = {}
    owners: dict[str, tuple[str, str]] = {}
    for part in parts.values():
        if isinstance(part, FmuPart):
            given = given_of.get(part.path) or given_of.setdefault(part.path, _read(part))
            same = (each for each in codes.values() if (each.guid, each.files, each.compiled) == given[1:4])
            code = next(same, None)
            if code is None or code.single:
                taken = {each.folder for each in codes.values()}
                folder = next(
                    folder for k in range(len(taken) + 1) if (folder := given[0] + f"_{k + 1}" * (k > 0)) not in taken
                )
                code = PartCode(folder, f"{name}_{folder}_", *given)
                if not (code.own and len(code.compiled) == 1):  # a block of this project has only functions of FMI
                    code = _apart(code, part.name, platforms, owners)
            codes[part.name] = code
    return codes


def _apart(code: PartCode, part: str, platforms: Sequence[Platform], owners: dict[str, tuple[str, str]]) -> PartCode:
    """Return the code with a prefix for each symbol that other code could define as well."""
    # The linker takes one of two weak or common symbols without a message, and the parts then share it.
    targets = dict.fromkeys((None, *(target for platform in platforms for target in platform.targets)))
    symbols, writes = _defined(code, part, targets)
    code = replace(code, symbols=tuple(sorted(symbols)), single=code.single or writes)
    for symbol in sorted(_defined(code, part, targets)[0] | {f"{code.prefix}{each}" for each in symbols}):
        known = not symbol.startswith("__") or any(symbol in text for text in code.files.values())
        other, folder = owners.setdefault(symbol, (part, code.folder))
        if known and folder != code.folder:
            raise BuildError(
                f"'{other}' and '{part}' both define the symbol {symbol}, so that they would share it: declare it "
                "static or rename it in the sources of one of them"
            )
    return code


def _defined(code: PartCode, part: str, targets: Iterable[str | None]) -> tuple[set[str], bool]:
    """Return the symbols without prefix that other files can see, and whether the code keeps data in static memory."""
    symbols, writes = set[str](), False
    files = code.sources
    for target in targets:
        for unit in code.wrappers:
            try:
                text = assembly(target, unit, included(unit, files))
            except BuildError as error:
                machine = f" for {target}" if target else ""
                raise BuildError(f"the FMU of '{part}' cannot be a part of a composite{machine}: {error}") from error
            symbols |= _symbols(text, "macos" in (target or sys.platform.replace("darwin", "macos")))
            writes = writes or _WRITABLE.search(text) is not None
    return {symbol for symbol in symbols if not symbol.startswith(code.prefix)}, writes


def _symbols(text: str, underscores: bool) -> set[str]:
    """Return the symbols that assembly defines and other files can see."""
    name = r'"?([^\s",#;@]+)'
    seen = set(re.findall(rf"^\s*\.(?:globl|weak|comm)\s+{name}", text, re.M))
    local = set(re.findall(rf"^\s*\.local\s+{name}", text, re.M))
    placed = set(re.findall(rf'^{name}"?:', text, re.M))
    placed |= set(re.findall(rf"^\s*\.(?:comm\s+|zerofill\s+[^,]+,[^,]+,){name}", text, re.M))
    found = (symbol.removeprefix("_") if underscores else symbol for symbol in seen & placed - local)
    return {symbol for symbol in found if symbol.replace("$", "_").isidentifier()}


def _read(part: FmuPart) -> tuple[str, str, dict[str, str], tuple[str, ...], bool, bool]:
    """Return identifier, GUID, sources, the files to compile, and whether it is our FMU and used once only."""
    root = part.archive.root
    version = root.get("fmiVersion")
    if version != "2.0":
        raise BuildError(
            f"'{part.name}' is an FMI {version} FMU, but a composite FMU is made of FMI 2.0 FMUs: export "
            f"{part.path.name} as FMI 2.0"
        )
    simulation = root.find("CoSimulation")
    assert simulation is not None, "the part has checked its archive"
    listed = tuple(str(file.get("name")) for file in simulation.iterfind("SourceFiles/File"))
    members = sorted(member for member in part.archive.names if not member.endswith("/"))
    _check(part.name, part.path, members, listed)
    sources = (name for name in members if name.startswith("sources/") and PurePosixPath(name).suffix in _TEXTS)
    try:
        files = {k.removeprefix("sources/"): data.decode() for k, data in part.archive.read(*sources).items()}
    except UnicodeDecodeError as error:
        raise BuildError(f"'{part.name}' has a source that is not a text in UTF-8: convert it") from error
    once = simulation.get("canBeInstantiatedOnlyOncePerProcess") in ("true", "1")
    return str(simulation.get("modelIdentifier")), str(root.get("guid")), files, listed, part.strict, once


def _check(name: str, path: Path, members: list[str], listed: tuple[str, ...]) -> None:
    absent = next((file for file in listed if f"sources/{file}" not in members), None)
    if absent is not None:
        raise BuildError(f"'{name}' lists the source {absent}, which {path} does not contain: export it again")
    if not listed:
        raise BuildError(
            f"'{name}' carries no sources, so it cannot be compiled into a composite FMU: export {path.name} with "
            "its sources"
        )
    if any(member.startswith("resources/") for member in members):
        raise BuildError(f"'{name}' needs the resources of {path.name}, which a composite FMU does not contain")
    other = next((file for file in listed if not file.endswith((".c", ".h"))), None)
    if other is not None:
        raise BuildError(f"'{name}' has the source {other}, which is not C: a composite FMU can contain C only")
    if not all(re.fullmatch(r"[\w./-]+", file) for file in listed):
        raise BuildError(f"'{name}' has a source file with an unusual name: rename it to letters, digits and _")


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
    scalars = part.archive.root.iterfind("ModelVariables/ScalarVariable")
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


class InputsPart(CallablePart):
    """The inputs of a composite FMU, as outputs of a part that exists in C only."""

    def __init__(self, name: str, ports: Sequence[Port]) -> None:
        super().__init__(name, lambda t, u, x: np.full(len(ports), np.nan), outputs=ports)


@dataclass(frozen=True)
class Interface:
    """What a composite FMU shows of its system."""

    inputs: Mapping[str, Port]  # inputs of parts, and outputs of sources that the FMU does not contain
    outputs: tuple[str, ...]  # outputs of parts that are outputs of the FMU


def without_sources(system: Assembly, inputs: Sequence[str] | None) -> tuple[Assembled, dict[str, Port]]:
    """Return the system without the parts whose outputs are inputs of the FMU, and these inputs."""
    chosen = list(inputs or ())
    outputs = {
        f"{name}.{port.name}": port for name, part in system.parts.items() if not part.inputs for port in part.outputs
    }
    taken = {name: outputs[name] for name in chosen if name in outputs}
    removed = {split_name(name)[0] for name in taken}
    for wire in system.wires:
        if wire.ends[0][0] in removed and wire.source not in taken:
            raise BuildError(
                f"'{wire.ends[0][0]}' becomes inputs of the FMU, but {wire.source} also drives {wire.target}: list "
                f"{wire.source} among the inputs too"
            )
    parts = {name: part for name, part in system.parts.items() if name not in removed}
    start = {name: value for name, value in system.start.items() if split_name(name)[0] not in removed}
    return assembled(system, parts=parts, start=start), taken


def choose_interface(
    system: Assembled, taken: Mapping[str, Port], inputs: Sequence[str] | None, outputs: Sequence[str] | None
) -> Interface:
    """Return the inputs and outputs of a composite FMU."""
    driven = {wire.target: wire.source for wire in system.wires}
    ports = {f"{part.name}.{port.name}": port for part in system.parts.values() for port in part.inputs}
    free = {**taken, **{name: port for name, port in ports.items() if name not in driven}}
    chosen = list(free) if inputs is None else list(inputs)
    for number, name in enumerate(chosen):
        if name in chosen[:number]:
            raise BuildError(f"the input {name} is listed twice: list it once")
        if name in driven:
            raise BuildError(f"the input {name} is driven by {driven[name]}: list unconnected inputs")
        if name not in free:
            owner, port_name = split_name(name)
            find_part(system.parts, owner, "inputs")
            raise UnknownNameError(f"'{owner}' has no input '{port_name}' (in inputs): {nearest(name, free)}")
    shown = recorded_names(system.parts, ("*",) if outputs is None else outputs, "outputs")
    known = {f"{part.name}.{port.name}" for part in system.parts.values() for port in part.outputs}
    for name in shown:
        if name not in known:
            raise UnknownNameError(f"{name} is not an output of its part (in outputs): {nearest(name, known)}")
    if len(set(outputs or ())) < len(outputs or ()):
        twice = next(name for name in outputs or () if list(outputs or ()).count(name) > 1)
        raise BuildError(f"the output {twice} is listed twice: list it once")
    return Interface({name: free[name] for name in chosen}, tuple(shown))


def check_parts(system: Assembled) -> None:
    """Raise an error for a part that cannot be compiled into an FMU."""
    if not any(isinstance(part, FmuPart) for part in system.parts.values()):
        raise BuildError(f"the system '{system.name}' contains no FMU: add one")
    for part in system.parts.values():
        if not isinstance(part, (FmuPart, SeriesPart)):
            raise BuildError(
                f"'{part.name}' is a part in Python, which cannot be compiled: replace it with a law or a .c file"
            )
        if isinstance(part, FmuPart) and part.archive.exchange:
            raise BuildError(
                f"'{part.name}' is an FMU for model exchange, whose solver a composite FMU does not contain: export "
                f"{part.path.name} for co-simulation"
            )
        if not part.saves:
            raise BuildError(
                f"'{part.name}' cannot save its state, so a composite FMU could not refuse a step: use another FMU"
            )


def opened(system: Assembled, interface: Interface) -> Assembled:
    """Return the system with a part that drives the inputs, if there are any."""
    if not interface.inputs:
        return system
    name = "inputs"
    while name in system.parts:
        name += "_"
    ports = [
        Port(dotted, port.unit, port.type, system.start.get(dotted, port.start), base=port.base)
        for dotted, port in interface.inputs.items()
    ]
    inner = {f"{part.name}.{port.name}" for part in system.parts.values() for port in part.inputs}
    wires = [
        replace(wire, source=f"{name}.{wire.source}") if wire.source in interface.inputs else wire
        for wire in system.wires
    ]
    wires += [Wire(f"{name}.{dotted}", dotted) for dotted in interface.inputs if dotted in inner]
    start = {key: value for key, value in system.start.items() if key not in interface.inputs}
    return replace(system, parts={**system.parts, name: InputsPart(name, ports)}, wires=wires, start=start)


@dataclass(frozen=True)
class CompositeVariable:
    """A variable of a composite FMU."""

    name: str  # "part.variable"
    part: str  # the part; empty for the time
    port: Port  # type, unit and limits
    reference: int  # value reference in the part's FMU, or column of a recorded series
    causality: str
    variability: str
    """As in the model description."""
    initial: str | None = None  # "exact" or "calculated"; None for an input and the time
    start: StartValue | None = None  # start value, if it has one
    early: bool = False  # whether it can be set before the first step only
    type_name: str | None = None
    quantity: str | None = None
    """The part's declared type of a Real, and its quantity."""
    state: str | None = None  # the state of which this is the derivative

    @property
    def inner(self) -> str:
        """The name with that of the part in front: "part.der(x)"."""
        return f"{self.part}.{self.port.name}" if self.part else self.name


def composite_variables(system: Assembly, interface: Interface, *, exchanges: bool) -> list[CompositeVariable]:
    """Return the time, and the inputs, outputs, parameters and local variables of all parts."""
    found = [
        CompositeVariable("time", "", Port("time", "s", description="simulation time"), 0, "independent", "continuous")
    ]
    wired = {wire.target for wire in system.wires}
    for name, part in system.parts.items():
        if isinstance(part, FmuPart):
            found += _of_fmu(name, part, system.start, interface, wired, exchanges)
        else:
            found += _of_series(name, part, interface)
    known = {variable.name for variable in found}
    for name, port in interface.inputs.items():  # outputs of sources that the FMU does not contain
        if name not in known:
            variability = "continuous" if port.type == "Real" else "discrete"
            found.append(CompositeVariable(name, "", port, 0, "input", variability, start=port.start or 0.0))
    inputs = [variable for variable in found if variable.causality == "input"]
    outputs = [variable for variable in found if variable.causality == "output"]
    rest = [variable for variable in found if variable.causality not in ("input", "output")]
    by_name = {variable.name: variable for variable in found}
    return [
        rest[0],
        *(by_name[name] for name in interface.inputs if by_name[name] in inputs),
        *(by_name[name] for name in interface.outputs if by_name[name] in outputs),
        *rest[1:],
    ]


def _of_series(name: str, part: Part, interface: Interface) -> Iterable[CompositeVariable]:
    for column, port in enumerate(part.outputs):
        causality = "output" if f"{name}.{port.name}" in interface.outputs else "local"
        variability = "discrete" if port.held else "continuous"
        yield CompositeVariable(f"{name}.{port.name}", name, port, column, causality, variability, "calculated")


def _of_fmu(
    name: str, part: FmuPart, start: Mapping[str, StartValue], interface: Interface, wired: set[str], exchanges: bool
) -> Iterable[CompositeVariable]:
    derivatives = states(part) if exchanges else {}
    for own, variable in part.archive.variables.items():
        port, dotted = part.archive.ports[own], inner_name(name, own)
        if port.type == "String" or variable.causality == "independent" or variable.variability == "constant":
            continue
        if dotted in wired or (own.startswith("der(") and own not in derivatives):
            continue
        role = _role(variable, dotted, interface)
        if role is None:
            continue
        causality, variability, initial, early = role
        value = start.get(dotted, port.start) if initial == "exact" or causality == "input" else None
        yield CompositeVariable(
            dotted,
            name,
            port,
            int(variable.valueReference),
            causality,
            variability,
            initial,
            (0.0 if value is None else value) if initial == "exact" or causality == "input" else None,
            early,
            variable.declaredType.name if variable.declaredType is not None and port.type == "Real" else None,
            variable.quantity or getattr(variable.declaredType, "quantity", None),
            inner_name(name, derivatives[own]) if own in derivatives else None,
        )


def _role(variable: Any, dotted: str, interface: Interface) -> tuple[str, str, str | None, bool] | None:
    """Return causality, variability and initial, and whether it can be set before the first step only."""
    real = variable.type == "Real"
    variability = variable.variability or ("continuous" if real else "discrete")
    if variable.causality == "input":
        if dotted in interface.inputs:
            return "input", variability, None, False
        return "parameter", "tunable", "exact", False
    if variable.causality == "parameter":
        return "parameter", variability, "exact", variability == "fixed"
    shown = variable.causality == "output" and dotted in interface.outputs
    exact = variable.initial in ("exact", "approx")
    causality = "output" if shown else "local"
    return causality, variability, "exact" if exact else "calculated", exact
