"""Export of the recommended compensator: FMU, C code, the whole axis as SSP, and parameters as SSV."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from friction_fmus.axis.loop_assembly import (
    FRICTION,
    OF_LOAD,
    block,
    drive_input,
    load_feedforward,
    typed,
    viscous_beside,
    with_friction,
)
from friction_fmus.axis.servo import Compensator, Servo, Trajectory
from friction_fmus.axis.servo_loop import accurate, closed_loop, recorded, with_gain
from friction_fmus.blocks.axis_units import Words, domain_of
from friction_fmus.blocks.catalogue import find
from friction_fmus.codegen.law_export import export_law
from friction_fmus.codegen.layout import law_of
from friction_fmus.codegen.servo_law import LAWS, LOOP_FILE, SHARED, LoopFile, LoopLaw, loop_text
from friction_fmus.errors import BuildError
from friction_fmus.export.block_fmu import build
from friction_fmus.export.identified_axis import AxisLoop, IdentifiedAxis, in_folder
from friction_fmus.export.targets import generic, write_file
from friction_fmus.identification import Record
from friction_fmus.identification.result_files import identified_axis
from friction_fmus.lawkit.emit.syntax import wrapped
from friction_fmus.lawkit.law import Kind
from friction_fmus.study.comparison import Comparison
from friction_fmus.study.compensators import TABLE
from friction_fmus.study.evaluation import AxisBench, Scheme, with_table
from friction_fmus.study.model_ranking import IdentifiedModel
from friction_fmus.study.recommendation import AS_MEASURED
from friction_fmus.study.study_result import WrittenFile
from harness import ExperimentError, FmuPart, Parameter, ParameterSet, System, Wire, open_archive, write_ssv
from harness.storage.files import make_folder
from harness.system.wire import parse_wire, split_name

REFERENCE: Final = "reference.r"
ERROR: Final = "tracking_error"  # part with the reference minus the position


def with_tracking_error(system: System) -> System:
    """Return the system of an axis with a part that computes the tracking error, and with more recorded variables."""
    assert system.experiment is not None
    # at the samples only, because the reference has its new value only then
    part = FmuPart(ERROR, block("Sum"), every=system.experiment.decimate)
    parts, (position, force) = [*system.parts.values(), part], recorded(system.parts)
    wires: list[str | Wire] = [*system.wires, f"{REFERENCE} -> {ERROR}.u1", f"{position} -> {ERROR}.u2"]
    start = {**system.start, f"{ERROR}.gain[2]": -1.0}
    experiment = replace(system.experiment, record=(REFERENCE, position, f"{ERROR}.y", force))
    return System(parts, wires, start, experiment, system.name)


MACHINE: Final = ("axis", FRICTION, OF_LOAD, "position", "motor", "transmission")  # parts of the machine

PLANT: Final = (*MACHINE, "encoder", "measured", "noise", ERROR)
"""Parts that stand for the machine or compute the tracking error; the README has the connections of all others."""

SUMS: Final = ("force", "unexplained")
"""Parts that add their inputs u1, u2, ..., multiplied by gain[1], gain[2], ... (1 if not in the table)."""

NOTHING: Final = (
    "# Recommended compensator\n\nNo compensator is recommended: `axis.ssp` contains the servo without one.\n"
)
"""README if nothing is recommended."""

ADDED: Final = ("compensator", "feedforward")  # parts that are added to the servo


@dataclass(frozen=True)
class Figures:
    """Figures of the report that the files reproduce."""

    rms: float  # tracking error [m or rad]
    unit: str  # unit of the position


def wiring(system: System, servo: Servo, figures: Figures | None, no_code: str, u: Words) -> str:
    """Return the README of the folder of the recommendation."""
    assert system.experiment is not None
    every = round(servo.Ts / system.experiment.step)
    wires = [wire for wire in map(parse_wire, system.wires) if split_name(wire.target)[0] not in PLANT]
    lines = ["# Recommended compensator"]
    for text in _paragraphs(system, servo, wires, figures, no_code, u):
        lines += ["", wrapped(text)]
    lines += ["", "| input | value | delay [samples] |", "|---|---|--:|"]
    lines += [f"| `{wire.target}` | {_value(wire)} | {wire.delay // every} |" for wire in wires]
    for target, value in sorted(_constants(system)):
        lines.append(f"| `{target}` | {value!r} | 0 |")
    return "\n".join(lines) + "\n"


def _paragraphs(
    system: System, servo: Servo, wires: list[Wire], figures: Figures | None, no_code: str, u: Words
) -> Iterator[str]:
    """Yield the paragraphs above the table."""
    yield (
        f"The laws are sampled every {servo.Ts:g} s, together with the servo. The table lists every input of the "
        "sampled parts of `axis.ssp`, in the units of the axis."
    )
    for wire in wires:
        part, output = split_name(wire.source)
        if part in ADDED and output != "u" and split_name(wire.target)[0] in ("servo", *SUMS):
            yield f"Use the output `{output}` of `{part}`. Its output `u` is for use without the servo."
    if "table" in system.parts:
        yield (
            f"`table` is the identified {u.force} at the reference position: subtract it. `PositionMap.fmu` contains "
            "the table."
        )
    sums = [f"`{name}.y`" for name in SUMS if name in system.parts]
    if sums:
        yield f"{' and '.join(sums)} = gain[1] u1 + gain[2] u2 + ..., where a gain that is not in the table is 1."
    if any(wire.source == "servo.u" for wire in wires):
        yield f"`servo.u` is the {u.force} of the drive after all limits; a delay of 1 stands for the previous sample."
    yield (
        "Start all parts together, with the axis at rest on the reference, as in the run of the report: only then do "
        "the start values of the laws fit the motion."
    )
    table = "`loop_table(r, rd)` to `f_known`, " if "table" in system.parts else ""
    yield no_code or (
        f"`c/` contains all of this as one function, from `{LOOP_FILE}`: servo, laws, velocity, sums, limits and "
        f"delays. Once per sample, assign reference and measured position to `loop_inputs`, {table}call `loop_step`, "
        "and pass `u` to the drive."
    )
    for name, what in (("notch", "filter"), ("current", "current loop")):
        if name in system.parts:
            code = "" if no_code else "; `c/` does not contain it"
            yield f"`{name}` is the {what} of the drive behind `servo.u`{code}."
    if figures is not None:
        yield (
            f"The tracking error of the report is {figures.rms:.4g} {figures.unit} rms; `friction-fmus run axis.ssp` "
            "repeats its run."
        )


def _value(wire: Wire) -> str:
    """Return gain, source and offset as a formula with all digits."""
    gain = "" if wire.gain == 1.0 else f"{wire.gain!r} × "
    sign = "+" if wire.offset >= 0.0 else "-"
    offset = "" if wire.offset == 0.0 else f" {sign} {abs(wire.offset)!r}"
    return f"{gain}`{wire.source}`{offset}"


def _constants(system: System) -> Iterator[tuple[str, float]]:
    """Yield the inputs of sampled parts that are constant, with their values."""
    for name, part in system.parts.items():
        if name in PLANT or not isinstance(part, FmuPart):
            continue
        inputs = {port.name for port in part.inputs} | {f"gain[{i}]" for i in (1, 2, 3) if name in SUMS}
        for target, value in system.start.items():
            if split_name(target)[0] == name and split_name(target)[1] in inputs and not isinstance(value, str):
                yield target, float(value)


def export_composites(folder: Path, whole: System) -> tuple[WrittenFile, ...]:
    """Write ``axis.fmu`` and ``servo_axis.fmu``, which solve the loop of mass and friction inside."""
    parts = [part for name, part in whole.parts.items() if name in MACHINE]
    wires = [wire for wire in whole.wires if {end[0] for end in wire.ends} <= set(MACHINE)]
    start = {name: value for name, value in whole.start.items() if split_name(name)[0] in MACHINE}
    drive = drive_input(whole.parts)
    machine = System(parts, wires, {**start, drive: 0.0}, whole.experiment, "axis")
    machine.to_fmu(folder / "axis.fmu", inputs=[drive])
    references = sorted({wire.source for wire in whole.wires if split_name(wire.source)[0] == "reference"})
    whole.to_fmu(folder / "servo_axis.fmu", inputs=references)
    inputs = ", ".join(f"`{name}`" for name in references)
    return (
        WrittenFile(
            f"{folder.name}/axis.fmu",
            "The axis with the identified friction as one FMU for any simulator at any step; connect the drive to "
            f"`{drive}`",
        ),
        WrittenFile(
            f"{folder.name}/servo_axis.fmu", f"The same with servo and compensator; connect the reference to {inputs}"
        ),
    )


def without_code(servo: Servo, laws: Mapping[str, Compensator]) -> str:
    """Return a sentence that says why a loop cannot be written as one unit in C; empty if it can."""
    in_c = [name for name in (servo.law, *(law.model for law in laws.values())) if not find(name).is_law]
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
    outputs = {"servo": Compensator(servo.law), **laws}
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
        servo.velocity_filter.order if servo.velocity_filter is not None else 0,
        servo.velocity_filter.cutoff if servo.velocity_filter is not None else 0.0,
        trajectory.rotary,
        trajectory.table is not None,
        trajectory.table,
        path,
    )


OWN: Final = "recommended"  # folder of the files of the recommendation


def export_recommended(
    out: Path, bench: AxisBench, scheme: Scheme, name: str, citation: str, figures: Figures | None = None
) -> tuple[WrittenFile, ...]:
    """Write the files needed to use the recommended compensator."""
    folder, u = out / OWN, bench.trajectory.words
    make_folder(folder)
    written: list[WrittenFile] = []
    both = scheme.compensator, scheme.feedforward
    if scheme.compensator is None:
        both = both[::-1]
    load = load_feedforward(bench.plant) if bench.trajectory.motion else None
    recommends = any(both) or scheme.table or scheme.servo != bench.servo or load is not None
    if recommends:
        both = with_friction(scheme.servo, *both)
    named = zip(("load", *ADDED), (load, *both), strict=True)
    laws = {part: law for part, law in named if law is not None}
    fmus: dict[str, Path] = {}
    chosen: dict[str, Mapping[str, float | bool]] = {}
    has_gain = True
    for part, law in laws.items():
        limits = {"u_min": -bench.servo.force_limit, "u_max": bench.servo.force_limit}
        gain = {"gain": scheme.gain} if law is scheme.compensator else {}
        given = {**limits, **gain, **law.values, "Ts": bench.servo.Ts}
        values = typed(FmuPart("law", block(law.model, bench.trajectory.rotary)), given)
        if part == "compensator":
            has_gain = "gain" in values
        fmus[part] = build(law.model, folder, values, domain=domain_of(bench.trajectory.rotary))
        written.append(WrittenFile(_path(out, fmus[part]), f"{law.model} with the parameters of the axis"))
        parameters = _parameters(fmus[part], values)
        write_ssv(ParameterSet(f"{name} {law.model}", parameters, _cited(citation)), folder / f"{part}.ssv")
        written.append(WrittenFile(f"{OWN}/{part}.ssv", f"Parameters of {law.model}, SSP 1.0"))
        chosen[part] = values
    compensator = laws.get("compensator")
    second = laws.get("feedforward")
    table = bench.plant.position
    if scheme.table and table is not None:
        fmus["table"] = table.to_fmu(folder, TABLE.name, bench.trajectory.rotary)
        written.append(
            WrittenFile(_path(out, fmus["table"]), f"{u.force.capitalize()} over position; connected to the reference")
        )
    trajectory = with_table(bench, scheme)
    with closed_loop(scheme.servo, bench.plant, trajectory, compensator, fmus, feedforward=second) as system:
        inside = compensator is None or (compensator.output == "u" and has_gain)
        whole = system if inside else with_gain(system, scheme.gain)
        whole, _ = accurate(with_tracking_error(whole))
        whole.to_ssp(folder / "axis.ssp")
        title = f"SSP archive of the whole axis: reference, compensator, servo, {u.mass}, friction"
        written.append(WrittenFile(f"{OWN}/axis.ssp", title))
        written += export_composites(folder, whole)
        missing = without_code(scheme.servo, laws)
        if recommends and not missing:
            loop = recommended_loop(whole, scheme.servo, laws, chosen, trajectory, folder / LOOP_FILE)
            written += _controller(out, loop, f"Recommended loop of {name}")
        text = wiring(whole, scheme.servo, figures, missing, u) if recommends else NOTHING
        write_file(text, folder / "README.md")
        written.append(WrittenFile(f"{OWN}/README.md", "Connections of the compensator, as co-simulated"))
    return tuple(written)


def _controller(out: Path, loop: LoopFile, heading: str) -> list[WrittenFile]:
    """Write the file of a loop and its C code."""
    write_file(loop_text(loop, heading), loop.path)
    files = export_law(loop.path, loop.path.parent / "c")
    text = "Servo and compensation as one C function, with unit test and cost"
    return [
        WrittenFile(_path(out, loop.path), "Servo and compensation with their parameters, for `friction-fmus codegen`"),
        *(WrittenFile(_path(out, file), text) for file in files),
    ]


def export_models(out: Path, models: Sequence[IdentifiedModel], rotary: bool, citation: str) -> tuple[WrittenFile, ...]:
    """Write the best model as FMU, and the parameters of every identified model as SSV."""
    written = []
    folder = out / "models"
    make_folder(folder)
    for found in models:
        if found.row.rank is None:
            continue
        identifier = found.row.name.replace(" + ", "And")
        path = block(found.block, rotary)
        values = typed(FmuPart("friction", path), found.values)
        if found.row.rank == 1:
            own = build(found.block, folder, values, identifier, domain=domain_of(rotary))
            written.append(WrittenFile(_path(out, own), f"FMU of the best friction model, {found.row.name}"))
            if found.position_map is not None:
                own = found.position_map.to_fmu(folder, f"{identifier}PositionMap", rotary)
                written.append(WrittenFile(_path(out, own), "FMU of its cogging and position-dependent friction"))
        file = folder / f"{identifier}.ssv"
        write_ssv(ParameterSet(identifier, _parameters(path, values), _cited(citation)), file)
        written.append(WrittenFile(_path(out, file), f"Parameters of {found.row.name}, SSP 1.0"))
        if beside := viscous_beside(FmuPart("friction", path), found.plant):
            file = folder / f"{identifier}Viscous.ssv"
            parameters = _parameters(block("Viscous", rotary), {"Fv": beside})
            write_ssv(ParameterSet(f"{identifier}Viscous", parameters, _cited(citation)), file)
            written.append(WrittenFile(_path(out, file), f"Viscous friction beside {found.row.name}, SSP 1.0"))
    return tuple(written)


def identified_axes(
    models: Sequence[IdentifiedModel], record: Record, servo: Servo | None, comparison: Comparison | None
) -> tuple[IdentifiedAxis, ...]:
    """Return the axis with each identified model, for the targets of `export`."""
    loop, limit, mass = None, None if servo is None else servo.force_limit, 0.0 if servo is None else servo.mass or 0.0
    if servo is not None and comparison is not None:
        metrics = {row.name: row.metrics for row in comparison.rows}
        metrics |= {rung.title: rung.metrics for rung in comparison.ladder[:1]}
        law = comparison.recommended.name
        errors = [None if found is None else found.rms for found in map(metrics.get, (AS_MEASURED, "none", law))]
        loop = AxisLoop(f"{OWN}/axis.ssp", servo.gains, law, *errors)
    axes = []
    for found in models:
        if found.row.rank is not None:
            both = found.mass or mass, found.offset
            about = found.row.name, found.block, {**found.values, **found.terms}, *both, found.position_map
            axes.append(replace(identified_axis([record], record.citation, *about), force_limit=limit, loop=loop))
    return tuple(axes)


def export_sheet(out: Path, axis: IdentifiedAxis) -> tuple[WrittenFile, ...]:
    """Write the parameters of the axis for a drive that runs no code, unless they cannot be simulated."""
    try:
        files = generic.write(in_folder(axis, out), out / OWN)
    except (BuildError, ExperimentError):  # the reference stands, or the simulation is inaccurate
        return ()
    what = "Parameters for a drive that runs no code; `friction-fmus export` writes those of some makers"
    return tuple(WrittenFile(_path(out, file), what) for file in files)


def _parameters(path: Path, values: Mapping[str, float | int | bool]) -> dict[str, Parameter]:
    known = {port.name: port for port in FmuPart("block", path).parameters}
    about = open_archive(path).variables
    return {
        name: Parameter(
            value, known[name].unit if known[name].type == "Real" else None, description=about[name].description or ""
        )
        for name, value in values.items()
    }


def _cited(citation: str) -> str:
    return f"Identified from the record of {citation}" if citation else ""


def _path(out: Path, file: Path) -> str:
    return file.relative_to(out).as_posix()
