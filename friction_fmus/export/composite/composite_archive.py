"""The archive of a composite FMU."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from friction_fmus.blocks.catalogue import drawn
from friction_fmus.export.composite.c_tables import table_file
from friction_fmus.export.composite.composite_description import (
    TERMINALS,
    Texts,
    composite_description,
    composite_terminals,
    documentation,
    start_dependencies,
    step_dependencies,
)
from friction_fmus.export.composite.composite_interface import (
    check_parts,
    choose_interface,
    composite_variables,
    exchange_fault,
    opened,
    part_codes,
    without_sources,
)
from friction_fmus.export.targets import SourceFmu, choose_target
from harness.compiling.engine_library import sources as engine_sources
from harness.compiling.platforms import Platform, select
from harness.compiling.toolchain import guid_of, source_folder
from harness.errors import BuildError, ExperimentError
from harness.masters import best_first, find_master
from harness.parts.fmu import FmuPart
from harness.run import run
from harness.storage.files import stamped
from harness.storage.zip_file import zipped
from harness.system.assembly import Assembled, Assembly
from harness.system.experiment import COUPLING_TOLERANCE, LOOP_TOLERANCE, STEP_TOLERANCE, Experiment
from harness.system.graph import check_loops, find_feedthrough, make_plan, state_outputs, stepping_order
from harness.system.initialisation import start_order
from harness.values import is_number

_HEADERS: Final = ("fmi2_modes.h", "fmi2_calls.h", "fmi2_saved.h")


def compose(
    system: Assembly,
    path: Path,
    name: str | None,
    platforms: Sequence[str],
    target: str,
    options: Mapping[str, Any],
    **settings: Any,
) -> None:
    """Write a system as one FMU, or for another target; see `System.to_fmu`."""
    for key, names in {"platforms": platforms, **settings}.items():
        if isinstance(names, str) and key.endswith("s"):
            raise BuildError(f"{key} is the text {names!r}: give a list of names")
    chosen, given = choose_target("fmu", target, options, platforms)
    _check_path(path, system, chosen.ending)
    identifier = path.name.removesuffix(chosen.ending) if name is None else name
    chosen.write(composite_source(system, identifier, select(tuple(platforms)), **settings), path, **given)


def composite_source(
    system: Assembly,
    identifier: str,
    platforms: Sequence[Platform],
    *,
    step: float | None = None,
    master: str | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> SourceFmu:
    """Return a system, of which targets make what they write; see `System.to_fmu`."""
    if not re.fullmatch(r"[A-Za-z_]\w{0,99}", identifier, re.ASCII):
        raise BuildError(
            f"{identifier!r} cannot be the name of an FMU: give a name of letters, digits and _, with a letter first"
        )
    experiment = _experiment(system, step, master)
    inner, taken = without_sources(system, inputs)
    check_parts(inner)
    interface = choose_interface(inner, taken, inputs, outputs)
    texts = [key for key, value in inner.start.items() if isinstance(value, str)]
    if texts:
        raise BuildError(f"the start value {texts[0]} is a text, which a composite FMU cannot set: remove it")
    codes = part_codes(inner.parts, identifier, platforms)
    find_feedthrough(system, experiment)
    _start(inner, experiment)
    whole = opened(inner, interface)
    source = next((part for part in whole.parts if part not in inner.parts), None)
    order = [part for part in experiment.order or stepping_order(system.parts, system.wires) if part in inner.parts]
    order += [source] if source is not None else []
    plan = make_plan(whole, replace(experiment, order=tuple(order)), state_outputs(whole.parts))
    check_loops(whole.parts, whole.wires, implicit=True)
    start = start_order(plan, inner.parts, [wire for wire in inner.wires if wire.ends[0][0] in inner.parts])
    if source is not None:
        start = replace(start, order=(len(plan.parts) - 1, *start.order))
    exchanges = exchange_fault(inner) is None
    variables = composite_variables(inner, interface, exchanges=exchanges)
    tolerance = experiment.loop_tolerance or LOOP_TOLERANCE
    error = (experiment.coupling_tolerance or COUPLING_TOLERANCE) if find_master(experiment.master).adapts else 0.0
    step_tolerance = experiment.step_tolerance or STEP_TOLERANCE

    def tables(guid: str) -> str:
        return table_file(identifier, guid, whole, plan, start, codes, variables, error, tolerance, step_tolerance)

    files = {**_shell(), **{key: text for code in codes.values() for key, text in code.sources.items()}}
    if f"{identifier}.c" in files:
        raise BuildError(f"{identifier!r} is also the name of a source of a part: give the FMU another name")
    units = (f"{identifier}.c", *dict.fromkeys(key for code in codes.values() for key in code.wrappers))
    made = _time_stamp(system)

    def description(guid: str) -> bytes:
        return composite_description(
            Texts(identifier, guid, _summary(inner), made, units, exchanges),
            inner.parts,
            variables,
            step_dependencies(inner, variables),
            start_dependencies(inner, variables),
            experiment,
        )

    guid = guid_of(files, tables(""), description("").decode())
    files[f"{identifier}.c"] = tables(guid)
    members: dict[str, bytes] = {"modelDescription.xml": description(guid)}
    members |= {f"sources/{key}": text.encode() for key, text in files.items()}
    members |= documentation(inner, identifier, _summary(inner), codes, variables)
    png, svg = (file.read_bytes() for file in drawn("composite"))
    members |= {"model.png": png, f"{TERMINALS}/icon.png": png, f"{TERMINALS}/icon.svg": svg}
    members[f"{TERMINALS}/terminalsAndIcons.xml"] = composite_terminals(inner, variables)
    quiet = {key for code in codes.values() if not code.own for key in code.wrappers}
    return SourceFmu(identifier, zipped(members, made), platforms, quiet=quiet)


def _check_path(path: Path, system: Assembly, ending: str) -> None:
    """Raise an error if the FMU or its folder cannot have this path, or would replace a part of its own."""
    if ending == ".fmu" and path.suffix.lower() != ending:
        raise BuildError(f"{path} is not the name of an FMU: give a name that ends in .fmu")
    if ending != ".fmu" and path.suffix.lower() == ".fmu":
        raise BuildError(f"the target makes a folder, but {path} names an FMU: give {path.stem}{ending}")
    for part in system.parts.values():
        if isinstance(part, FmuPart) and part.path.resolve() == path.resolve():
            raise BuildError(f"{path} is the part '{part.name}' of the system: give the FMU another name")


def _start(system: Assembled, experiment: Experiment) -> None:
    """Start the parts once: an FMU with start values that a part rejects could not be used."""
    inner = [wire for wire in system.wires if wire.ends[0][0] in system.parts]
    run(replace(system, wires=inner), replace(experiment, stop=experiment.start, order=(), record=()))


def _experiment(system: Assembly, step: float | None, master: str | None) -> Experiment:
    """Return the experiment inside the FMU: its master solves loops."""
    known = best_first(lambda each: each.composed)
    if master is not None and master not in known:
        raise BuildError(f"a composite FMU cannot contain the master {master!r}: give {' or '.join(known)}")
    experiment = system.experiment
    if step is not None and not (is_number(step) and 0.0 < step < math.inf):
        raise ExperimentError(f"the step is {step} s: give a positive number of seconds")
    if experiment is None and step is None:
        raise ExperimentError(f"the system '{system.name}' has no experiment: give a step")
    if experiment is not None and experiment.manipulators:
        raise BuildError(
            f"the experiment of '{system.name}' has the manipulator {experiment.manipulators[0]}, which a composite "
            "FMU cannot contain: remove it"
        )
    chosen = master or (experiment.master if experiment and experiment.master in known else known[0])
    if experiment is None:
        assert step is not None
        return Experiment(stop=1000.0 * step, step=step, master=chosen)
    if step is not None and step != experiment.step:
        ticks = max(1, round((experiment.stop - experiment.start) / step))
        experiment = replace(experiment, step=step, stop=experiment.start + ticks * step)
    return replace(experiment, master=chosen, extrapolation=0)


def _shell() -> dict[str, str]:
    """Return the C files that every composite FMU contains: the FMI shell and the engine."""
    folder = source_folder()
    paths = [*(folder / header for header in _HEADERS), *sorted((folder / "composite").glob("*.h"))]
    found = {path.name: path.read_text(encoding="utf-8") for path in paths}
    engine = engine_sources()
    pending = ["newton.h", "tick.h"]
    while pending:
        name = pending.pop()
        if name not in found:
            found[name] = engine[name]
            pending += re.findall(r'^#include "([^"]+)"', found[name], re.M)
    return found


def _time_stamp(system: Assembly) -> str:
    """Return ``SOURCE_DATE_EPOCH`` if set, or else the latest time at which a part was made."""
    if given := stamped():
        return given
    made = [
        str(part.archive.description.generationDateAndTime or "")
        for part in system.parts.values()
        if isinstance(part, FmuPart)
    ]
    known = [stamp for stamp in made if re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", stamp)]
    return max(known, default="1980-01-01T00:00:00Z")


def _summary(system: Assembly) -> str:
    kinds = [
        f"{name} ({part.archive.description.modelName})" if isinstance(part, FmuPart) else f"{name} (recorded series)"
        for name, part in system.parts.items()
    ]
    return f"{system.name}: {', '.join(kinds)}"
