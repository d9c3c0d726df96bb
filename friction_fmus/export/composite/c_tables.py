"""The C file of a composite FMU: the plan of the harness as tables."""

import math
from collections.abc import Iterable, Mapping, Sequence
from textwrap import shorten

import numpy as np

from friction_fmus.export.composite.composite_description import provides_derivatives
from friction_fmus.export.composite.composite_interface import (
    CompositeVariable,
    InputsPart,
    PartCode,
    exchange_fault,
    states,
)
from harness.engine.defect import UNRESOLVED
from harness.engine.manipulate import delay_length
from harness.engine.native import Engine
from harness.masters.newton import FINEST, FINEST_ADAPTIVE, Loops
from harness.parts.fmu import FmuPart
from harness.parts.part import TYPE_ORDER, Part
from harness.parts.series import SeriesPart
from harness.system.assembly import Assembled
from harness.system.graph import instantaneous
from harness.system.initialisation import StartOrder
from harness.system.plan import Plan, Schedule
from harness.system.wire import split_name


def c_number(value: float) -> str:
    """Return a constant of type double, the same to the last bit."""
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    return repr(float(value))


def c_string(text: str) -> str:
    """Return a C string; octal escapes hold what C99 does not, and break trigraphs."""
    plain = (chr(byte) if 32 <= byte < 127 and chr(byte) not in '"\\?' else f"\\{byte:03o}" for byte in text.encode())
    return '"' + "".join(plain) + '"'


def c_reals(name: str, values: Iterable[float]) -> list[str]:
    """Return the lines of an array of doubles; one without values gets a zero, as C has no empty arrays."""
    texts = [c_number(float(value)) for value in values] or ["0.0"]
    return _array(f"double {name}", texts)


def c_integers(name: str, values: Iterable[int], kind: str = "int64_t") -> list[str]:
    """Return the lines of an array of integers, as `c_reals`."""
    return _array(f"{kind} {name}", [str(int(value)) for value in values] or ["0"])


def _array(declaration: str, texts: Sequence[str]) -> list[str]:
    rows = [f"    {', '.join(texts[i : i + 12])}," for i in range(0, len(texts), 12)]
    return [f"static const {declaration}[] = {{", *rows, "};"]


def c_rows(declaration: str, rows: Sequence[str], empty: str) -> list[str]:
    """Return the lines of an array of these rows; without rows, `empty` is its only one."""
    return [f"static const {declaration}[] = {{", *(rows or [f"    {empty},"]), "};"]


_SETTINGS = {True: "SET_EARLY", False: "SET_ALWAYS"}


def table_file(
    name: str,
    guid: str,
    system: Assembled,
    plan: Plan,
    start: StartOrder,
    codes: Mapping[str, PartCode],
    variables: Sequence[CompositeVariable],
    error: float,
    tolerance: float,
    step_tolerance: float,
) -> str:
    """Return the text of the C file."""
    loops = Loops(Engine(plan, ()), tolerance, error)
    writer = _Writer(system, plan, loops, start, codes, variables)
    lines = [
        "/* Generated: the plan of a system as tables. composite.h runs it. */",
        f"#define MODEL {name}",
        f'#define GUID "{guid}"',
        f"#define MODEL_EXCHANGE {int(exchange_fault(system) is None)}",
        '#include "composite_parts.h"',
        "",
        *writer.constants(),
        f"#define STEP_SIZE {c_number(plan.step)}",
        f"#define LOOP_TOLERANCE {c_number(tolerance)}",
        f"#define LOOP_ERROR {c_number(error)}",
        f"#define STEP_TOLERANCE {c_number(step_tolerance)}",
        f"#define UNRESOLVED {c_number(UNRESOLVED)}",
        f"#define FINEST {c_number(FINEST_ADAPTIVE if error > 0.0 else FINEST)}",
        "",
        *writer.functions(),
        *writer.series(),
        *writer.parts(),
        *writer.connections(),
        *writer.loops(),
        *writer.starts(),
        *writer.variables(),
        '#include "composite.h"',
    ]
    return "\n".join(lines) + "\n"


def _brief(loop: str) -> str:
    """Return the connections of a loop, of a long one the first: C99 allows texts of 4095 characters."""
    return shorten(loop, 1000, placeholder=" ...")


class _Writer:
    """The tables of a composite."""

    def __init__(
        self,
        system: Assembled,
        plan: Plan,
        loops: Loops,
        start: StartOrder,
        codes: Mapping[str, PartCode],
        variables: Sequence[CompositeVariable],
    ) -> None:
        self._system, self._plan, self._loops, self._start = system, plan, loops, start
        self._codes, self._variables = codes, variables
        self._exchanges = exchange_fault(system) is None
        self._index = {part.name: index for index, part in enumerate(plan.parts)}
        self._lengths = {int(i): delay_length(plan, int(i), int(plan.delays[i])) for i in np.flatnonzero(plan.delays)}
        self._inputs = [variable for variable in variables if variable.causality == "input"]
        self._sources = [part for part in plan.parts if not isinstance(part, FmuPart)]
        self._starts = [
            (name, value)
            for name, value in system.start.items()
            if system.parts[split_name(name)[0]] in plan.parts and not isinstance(value, str)
        ]

    def constants(self) -> list[str]:
        plan, loops = self._plan, self._loops
        inputs = next((i for i, part in enumerate(plan.parts) if isinstance(part, InputsPart)), -1)
        sizes = {
            "PARTS": len(plan.parts),
            "INPUT_PART": inputs,
            "SOURCES": len(self._sources),
            "INPUTS": len(self._inputs),
            "SIGNALS": len(plan.signals),
            "MAPPED": 0 if plan.plain else len(plan.signals),
            "PAST": sum(self._lengths.values()),
            "DELAYS": len(self._lengths),
            "LINES": len(loops.wires),
            "GROUPS": len(loops.rows),
            "UNKNOWNS": len(loops.unknowns),
            "MOST": max((row.unknowns for row in loops.rows), default=0),
            "HELD": len(loops.held),
            "STATE_OUTPUTS": len(loops.states),
            "ROOTS": len(self._start.roots),
            "START_LOOP": int(self._start.is_loop),
            "LATE_LOOP": int(self._start.is_late_loop),
            "START_VALUES": len(self._starts),
            "VARIABLES": len(self._variables),
            "DIRECT": len(self._direct()),
            "STATES": sum(len(self._states(part)) for part in plan.parts),
            "INDICATORS": sum(self._indicators(part) for part in plan.parts),
            "PROVIDES_DERIVATIVES": int(provides_derivatives(self._system.parts)),
            "CHECKED": max(
                int(last)
                for part, (_, last) in zip(plan.parts, plan.outputs, strict=True)
                if not isinstance(part, InputsPart)
            ),
        }
        return ["enum {", *(f"    {key} = {value}," for key, value in sizes.items()), "};"]

    def functions(self) -> list[str]:
        found = []
        for code in {code.folder: code for code in self._codes.values()}.values():
            direct = f"{code.prefix}blockDirect" if code.own and "fmi2_direct.h" in code.files else "NULL"
            found += [
                f"PART_FUNCTIONS({code.prefix})",
                f"static const PartFunctions functions_of_{code.folder} = "
                f"FUNCTIONS_OF({code.prefix}, {c_string(code.guid)}, {direct});",
            ]
            if self._exchanges:
                found += [
                    f"EXCHANGE_FUNCTIONS({code.prefix})",
                    f"static const ExchangeFunctions exchange_of_{code.folder} = EXCHANGE_OF({code.prefix});",
                ]
        return found

    def series(self) -> list[str]:
        found = []
        for part in self._sources:
            if isinstance(part, SeriesPart):
                n = self._index[part.name]
                table = part.table()
                found += [
                    *c_reals(f"times_{n}", table.times),
                    *c_reals(f"values_{n}", table.values.reshape(-1)),
                    *c_reals(f"slopes_{n}", table.slopes.reshape(-1)),
                    f"static const Series series_{n} = {{times_{n}, values_{n}, slopes_{n}, {len(table.times)}, "
                    f"{table.values.shape[1]}, {c_number(table.slack)}, {c_number(table.end)}}};",
                ]
        return found

    def parts(self) -> list[str]:
        plan, found, rows = self._plan, [], []
        for index, part in enumerate(plan.parts):
            inputs = self._references(part, *plan.inputs[index])
            outputs = self._references(part, *plan.outputs[index])
            found += c_integers(f"inputs_{index}", inputs, "uint32_t")
            found += c_integers(f"outputs_{index}", outputs, "uint32_t")
            functions = f"&functions_of_{self._codes[part.name].folder}" if part.name in self._codes else "NULL"
            exchange = functions.replace("functions", "exchange") if self._exchanges else "NULL"
            table = f"&series_{index}" if isinstance(part, SeriesPart) else "NULL"
            flags = part.archive.description.coSimulation if isinstance(part, FmuPart) else None
            numbers = (
                *(self._ranges(*plan.inputs[index]), self._ranges(*plan.outputs[index])),
                *(str(int(x)) for x in (plan.every[index], plan.phase[index], part.sampled)),
                *(str(int(bool(flags is not None and flags.canInterpolateInputs))), exchange),
                *(str(len(self._states(part))), str(self._indicators(part))),
            )
            rows.append(
                f"    {{{c_string(part.name)}, {functions}, {table}, inputs_{index}, outputs_{index}, "
                f"{', '.join(numbers)}}},"
            )
        return [*found, "static const PartData part_data[] = {", *rows, "};"]

    def connections(self) -> list[str]:
        plan, loops = self._plan, self._loops
        delays = []
        for i in self._lengths:
            target = next(part for part, (first, last) in enumerate(plan.inputs) if first <= i < last)
            fresh = plan.fresh_inputs(Schedule(implicit=True))[i]
            row = (i, self._lengths[i], plan.every[target], plan.phase[target], fresh)
            first = plan.initials[i]
            numbers = f"{int(not np.isnan(first))}, {c_number(np.nan_to_num(first))}"
            delays.append(f"    {{{', '.join(str(int(x)) for x in row)}, {numbers}}},")
        begins = np.searchsorted([wire.target for wire in loops.wires], range(len(plan.parts) + 1))
        lines = [f"    {{{', '.join(map(str, line))}}}," for line in loops.line_data()]
        return [
            *c_integers("source_of", plan.sources),
            *c_reals("wire_gains", plan.wire_gains),
            *c_reals("wire_offsets", plan.wire_offsets),
            *c_rows("DelayData delay_data", delays, "{0, 0, 0, 0, 0, 0, 0.0}"),
            *c_integers("line_inputs", [wire.input for wire in loops.wires]),
            *c_integers("lines_from", begins),
            *c_rows("LineData line_data", lines, "{0, 0, 0, 0}"),
        ]

    def loops(self) -> list[str]:
        plan, loops = self._plan, self._loops
        groups = [f"    {{{', '.join(str(getattr(row, field)) for field, *_ in row._fields_)}}}," for row in loops.rows]
        contacts = [f"    {{{', '.join(map(str, contact))}}}," for contact in loops.contacts]
        states = [f"    {{{output}, {unit}}}," for output, unit in loops.states]
        names = [f"    {c_string(_brief(loops.shown(number)))}," for number in range(len(loops.rows))]
        lines = [f"    {c_string(f'{plan.names[wire.output]} -> {plan.names[wire.input]}')}," for wire in loops.wires]
        return [
            *c_rows("Group group_data", groups, "{0}"),
            *c_rows("Contact contact_data", contacts, "{0}"),
            *c_integers("load_inputs", loops.loads),
            *c_rows("StateOutput state_data", states, "{0}"),
            *c_rows("char *const loop_names", names, '""'),
            *c_rows("char *const line_names", lines, '""'),
            *c_integers("part_order", loops.order),
            *c_integers("group_lines", loops.lines),
            *c_integers("continuous", [part.moves for part in plan.parts]),
            *c_integers("unknown_outputs", loops.unknowns),
            *c_integers("held_inputs", loops.held),
        ]

    def starts(self) -> list[str]:
        plan, start = self._plan, self._start
        drivers = {int(i) for i in range(len(plan.signals)) if self._from_outside(i)}
        own = [float(plan.ports[name].start or 0.0) for name in plan.names]
        rows = []
        for name, value in self._starts:
            owner, port = split_name(name)
            part = self._plan.parts[self._index[owner]]
            assert isinstance(part, FmuPart), "a series has no start values"
            kind = TYPE_ORDER.index(part.archive.ports[port].type)
            reference = part.archive.variables[port].valueReference
            rows.append(f"    {{{self._index[owner]}, {kind}, {reference}, {c_number(float(value))}}},")
        return [
            *c_integers("start_order", start.order),
            *c_integers("root_signals", start.roots),
            f"static const char *const start_loop_name = {c_string(_brief(start.loop))};",
            *c_integers("from_outside", [int(i in drivers) for i in range(len(plan.signals))]),
            *c_integers("input_of_signal", self._input_of_signal()),
            *c_integers("direct_parts", self._direct()),
            *c_reals("own_starts", own),
            *c_reals("input_starts", [float(variable.start or 0.0) for variable in self._inputs]),
            *c_rows("StartValue start_values", rows, "{0, 0, 0, 0.0}"),
        ]

    def variables(self) -> list[str]:
        plan, rows = self._plan, []
        inputs = [variable.name for variable in self._inputs]
        ends = [(wire.ends[0][1], wire.ends[1][0]) for wire in self._system.wires]
        moved = {source for source, target in ends if not self._system.parts[target].sampled}
        kept = {v.state for v in self._variables}
        exchanged = {name: i for i, name in enumerate(plan.names) if i < int(plan.outputs.max(initial=0))}
        for v in self._variables:
            is_input, is_output = v.causality == "input", v.causality == "output"
            setting = "SET_ALWAYS" if is_input else _SETTINGS[v.early] if v.start is not None else "SET_NEVER"
            reference = inputs.index(v.name) if is_input else v.reference
            finite = v.port.type == "Real" and (not is_input or v.name in moved)
            row = (
                *(c_string(v.name), self._index[v.part] if v.part else -1, exchanged.get(v.name, -1), reference),
                *(TYPE_ORDER.index(v.port.type), setting, *map(c_number, v.port.limits)),
                *(int(is_input), int(is_output), int(v.name in kept), int(finite)),
            )
            rows.append(f"    {{{', '.join(str(x) for x in row)}}},")
        return ["static const Variable variables[] = {", *rows, "};"]

    def _states(self, part: Part) -> Mapping[str, str]:
        return states(part) if self._exchanges and isinstance(part, FmuPart) else {}

    def _indicators(self, part: Part) -> int:
        if not self._exchanges or not isinstance(part, FmuPart):
            return 0
        return int(part.archive.description.numberOfEventIndicators or 0)

    def _input_of_signal(self) -> list[int]:
        """Return for each signal the number of the input of the FMU that it is, or -1."""
        inputs = {f"{part.name}.{port.name}": port.name for part in self._sources for port in part.outputs}
        numbers = {variable.name: number for number, variable in enumerate(self._inputs)}
        return [numbers.get(inputs.get(name, ""), -1) for name in self._plan.names]

    def _direct(self) -> list[int]:
        """Return the continuous parts with outputs that depend directly on inputs of the FMU, in stepping order."""
        parts, wires = self._plan.parts, instantaneous(self._system.parts, self._system.wires)
        reached = {part.name for part in parts if isinstance(part, InputsPart)}
        found = []
        for index in self._start.order:
            part = parts[index]
            used = {port for ports in part.dependencies.values() for port in ports}
            drivers = {wire.ends[0][0] for wire in wires if wire.ends[1][0] == part.name and wire.ends[1][1] in used}
            if isinstance(part, FmuPart) and not part.sampled and drivers & reached:
                reached.add(part.name)
                found.append(index)
        return found

    def _references(self, part: Part, first: int, last: int) -> list[int]:
        names = [split_name(name)[1] for name in self._plan.names[first:last]]
        if isinstance(part, FmuPart):
            return [int(part.archive.variables[name].valueReference) for name in names]
        if isinstance(part, InputsPart):
            inputs = [variable.name for variable in self._inputs]
            return [inputs.index(name) for name in names]
        columns = [port.name for port in part.outputs]
        return [columns.index(name) for name in names]

    def _ranges(self, first: int, last: int) -> str:
        types = [self._plan.ports[name].type for name in self._plan.names[first:last]]
        places = np.cumsum([first, *(types.count(kind) for kind in TYPE_ORDER[:3])])
        return "{" + ", ".join(str(int(place)) for place in places) + "}"

    def _from_outside(self, signal: int) -> bool:
        """Return whether a connected input is driven by a part without inputs of its own."""
        source = self._plan.owners.get(int(self._plan.sources[signal]))
        connected = any(first <= signal < last for first, last in self._plan.inputs)
        return connected and source is not None and isinstance(self._plan.parts[source], InputsPart)
