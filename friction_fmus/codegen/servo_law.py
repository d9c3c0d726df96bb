"""Laws made of laws: a servo with feedforward and compensator, to the last bit as a system of separate FMUs."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from math import pi
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, TypeAlias

import tomli_w
from casadi import SX, Function, exp, if_else, symvar, tan

from friction_fmus.axis.position_map import Grid, PositionMap
from friction_fmus.axis.servo import BUTTERWORTH
from friction_fmus.blocks.axis_units import words_of
from friction_fmus.blocks.block_declarations import About
from friction_fmus.blocks.catalogue import find
from friction_fmus.codegen.layout import law_of, start_values
from friction_fmus.errors import FrictionError, UnknownNameError, did_you_mean
from friction_fmus.lawkit.declarations import (
    PARAMETERS,
    VECTORS,
    Command,
    Conditions,
    Input,
    Kind,
    LawVariable,
    Output,
    Parameter,
    SampleTime,
    State,
)
from friction_fmus.lawkit.emit.syntax import wrapped
from friction_fmus.lawkit.law import Law, check_variables
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import clip, filled
from friction_fmus.lawkit.quantities import FORCE, FREQUENCY, LENGTH, NO_UNIT, VELOCITY, Unit
from friction_fmus.lawkit.results import Label, Results, function_of
from harness.storage.toml_file import TomlTable, read_table
from harness.values import finite, flag, text

_STATES = (Kind.STATE, Kind.STATES)


class Composition:
    """A law under construction; variables of a part have its name as prefix, so that they remain different."""

    def __init__(self) -> None:
        self._variables: dict[str, LawVariable] = {}
        self._symbols: dict[str, list[SX]] = {}
        self._results: dict[str, list[SX]] = {}
        self._labels: list[Label] = []
        self._held: dict[str, SX] = {}

    def declare(self, variable: LawVariable) -> list[SX]:
        """Add a variable and return its symbols."""
        if variable.name in self._variables:
            raise FrictionError(f"Two variables of the composed law are called {variable.name}; rename one in its law")
        self._variables[variable.name] = variable
        self._symbols[variable.name] = [SX.sym(scalar) for scalar in variable.scalars]
        return self._symbols[variable.name]

    def label(self, name: str, value: SX) -> SX:
        """Name an intermediate result and return it."""
        self._labels.append(Label(name, value, 0, assigned=True))
        return value

    def result(self, name: str, *values: SX) -> None:
        """Set the next value of a state, or of all its elements, or the value of an output."""
        self._results[name] = list(values)

    def output(self, variable: LawVariable, value: SX) -> None:
        """Add an output."""
        self.declare(variable)
        self.result(variable.name, value)

    def apply(self, part: str, law: Law, connected: Mapping[str, SX], shared: Mapping[str, str]) -> dict[str, SX]:
        """Compute a law in every sample and return its outputs."""
        own = {v.name: shared.get(v.name, f"{part}_{v.name}") for v in law.select(*PARAMETERS, *_STATES)}
        given: list[SX] = []
        for variable in law.given:
            if variable.name not in own:
                given.append(connected[variable.name])
            elif variable.name in shared:
                given += self._symbols[shared[variable.name]]
            else:
                given += self.declare(replace(variable, name=own[variable.name]))
        function, labels = law.intermediate()
        values = iter(function.call(given))
        outputs: dict[str, SX] = {}
        for variable in law.results:
            scalars = [next(values) for _ in variable.starts]
            if variable.kind is Kind.OUTPUT:
                outputs[variable.name] = scalars[0]
                self._labels.append(Label(f"{part}_{variable.name}", scalars[0], 0, assigned=False))
            else:
                self.result(own[variable.name], *scalars)
        named = [replace(at, name=f"{part}_{at.name}", value=value) for at, value in zip(labels, values, strict=True)]
        self._labels += named
        self._hold(law.conditions, own)
        return outputs

    def _hold(self, conditions: Conditions, own: Mapping[str, str]) -> None:
        """Add the conditions of a law."""
        given = [symbol for parameter in conditions.parameters for symbol in self._symbols[own[parameter.name]]]
        for written, held in zip(conditions.texts, conditions.function.call(given), strict=True):
            self._held[re.sub(r"\b[A-Za-z]\w*\b", lambda found: own.get(found[0], found[0]), written)] = held

    def law(
        self, name: str, summary: str, source: str, documentation: str, path: Path, prefixes: Mapping[int, str]
    ) -> Law:
        """Return the law, without variables that have no effect on its outputs."""
        where = f"{path.name}: law {name}"
        needed = self._needed()
        variables = self._in_table_order(needed)
        check_variables(where, variables, About())
        given = [variable for variable in variables if variable.kind is not Kind.OUTPUT]
        written = [v for v in variables if v.kind is Kind.OUTPUT] + [v for v in variables if v.kind in _STATES]
        results = Results(
            tuple(symbol for variable in given for symbol in self._symbols[variable.name]),
            tuple(value for variable in written for value in self._results[variable.name]),
            tuple(scalar for variable in given for scalar in variable.scalars),
            tuple(
                scalar if variable.kind is Kind.OUTPUT else f"{scalar}_next"
                for variable in written
                for scalar in variable.scalars
            ),
        )
        labels = tuple(label for label in self._labels if _symbols_in([label.value]) <= needed)
        traced = Function("intermediate", results.arguments, [*results.expressions, *(at.value for at in labels)])
        found = Law(
            name,
            summary,
            source,
            documentation,
            variables,
            function_of(where, name, results),
            path,
            self._conditions(variables, needed),
            About(),
            {},
            lambda _: found,
            lambda: (traced, labels),
            prefixes,
        )
        return found

    def _needed(self) -> set[str]:
        """Return the names of the symbols on which the outputs depend, in this or a later sample."""
        outputs = [value for v in self._variables.values() if v.kind is Kind.OUTPUT for value in self._results[v.name]]
        found: set[str] = set()
        new = _symbols_in(outputs)
        while new:
            found |= new
            states = [v.name for v in self._variables.values() if v.kind in _STATES and new & {*v.scalars}]
            new = _symbols_in(value for state in states for value in self._results[state]) - found
            # the elements of a vector stay together
            new |= {scalar for state in states for scalar in self._variables[state].scalars} - found
        return found

    def _in_table_order(self, needed: set[str]) -> tuple[LawVariable, ...]:
        """Return inputs, outputs, then states and parameters, the sample time last."""
        kinds = ((Kind.INPUT, Kind.OPTIONAL), (Kind.COMMAND,), (Kind.OUTPUT,))
        first = {kind for group in kinds for kind in group} | {Kind.SAMPLE_TIME}
        groups = [[v for v in self._variables.values() if v.kind in group] for group in kinds]
        groups.append([v for v in self._variables.values() if v.kind not in first])
        groups.append([v for v in self._variables.values() if v.kind is Kind.SAMPLE_TIME])
        kept = (Kind.OUTPUT, Kind.SAMPLE_TIME)
        return tuple(v for group in groups for v in group if v.kind in kept or needed & {*v.scalars})

    def _conditions(self, variables: tuple[LawVariable, ...], needed: set[str]) -> Conditions:
        """Return the conditions on the remaining parameters."""
        held = {text: value for text, value in self._held.items() if _symbols_in([value]) <= needed}
        parameters = tuple(variable for variable in variables if variable.kind in PARAMETERS)
        symbols = [symbol for parameter in parameters for symbol in self._symbols[parameter.name]]
        return Conditions(tuple(held), parameters, Function("conditions", symbols, list(held.values())))


def _symbols_in(values: Iterable[SX]) -> set[str]:
    return {symbol.name() for value in values for symbol in symvar(value)}


LOOP_FILE: Final = "loop.toml"  # name of the file that a study writes
LAWS: Final = ("load", "feedforward", "compensator", "servo")  # tables of the laws, in the order of computation
WHOLE: Final = ("load", "servo")  # laws of which no output is chosen and multiplied
SHARED: Final = ("Ts", "u_min", "u_max")  # of all laws, unless the file gives the limit of one
MOST: Final = 64  # largest number of samples over which the velocity is computed

Numbers: TypeAlias = Mapping[str, float | bool]

_STUDY: Final = ("data", "columns", "windows", "identify", "compensation")
_COLUMNS: Final = ("cogging", "friction")
_FLAGS: Final = ("rotary", "known_force")
_SETTINGS: Final = ("Ts", "u_min", "u_max", "offset", "window", "v0", "filter_order", "filter_cutoff", *_FLAGS)


@dataclass(frozen=True)
class LoopLaw:
    """A law of a loop."""

    law: str  # its name, or the path of its file
    parameters: Numbers = field(default_factory=dict)  # ``W[1]`` for a vector; others have start values
    connections: Mapping[str, float | str] = field(default_factory=dict)
    """Constant inputs, and inputs that are connected to another input of the loop."""
    output: str = "u"  # the output that is added to the force of the servo
    factor: float | None = None  # factor of this output; None for 1


@dataclass(frozen=True)
class LoopFile:
    """A servo with compensation."""

    laws: Mapping[str, LoopLaw]  # by table: ``servo``, and optionally ``load``, ``feedforward`` and ``compensator``
    Ts: float  # sample time [s]
    u_min: float  # lower limit of the force [N]
    u_max: float  # upper limit of the force [N]
    offset: float | None = None  # constant force that is added [N]; None for none
    window: int = 0  # number of samples over which the velocity is computed; 0 if it is an input
    v0: float | None = None  # velocity before the first sample [m/s]; None for rest
    filter_order: int = 0
    filter_cutoff: float = 0.0
    """Order, 1 or 2, and frequency of the low-pass filter of this velocity [Hz]; 0 for none."""
    rotary: bool = False  # whether the axis is rotary; read m as rad, N as N.m and kg as kg.m2
    known_force: bool = False  # whether there is an input for a force that is added and hidden from estimators
    table: PositionMap | None = None  # force over position, which is compensated at the reference as a known force
    path: Path = Path(LOOP_FILE)  # the file


def read_loop(path: Path) -> LoopFile:
    """Read the file of a loop."""
    if not path.is_file():
        raise FrictionError(
            f"{path} does not exist; write it, or use recommended/{LOOP_FILE} of a study that recommends a compensation"
        )
    content = read_table(path, FrictionError)
    if "loop" not in content and any(name in content for name in _STUDY):
        raise FrictionError(
            f"{path} describes a study, not a loop; run `friction-fmus study {path.name} -o out` and use "
            f"out/recommended/{LOOP_FILE}, which the study writes if it recommends a compensation"
        )
    content.known(("loop", *LAWS, "table"), "table")
    tables = {name: TomlTable(value, f"{path}, [{name}],", FrictionError) for name, value in content.content.items()}
    for name in ("loop", "servo"):
        if name not in tables:
            raise FrictionError(f"{path} has no table [{name}]; add it")
    settings = tables["loop"]
    settings.known(_SETTINGS)
    flags = {key: settings.take(key, flag, "true or false") for key in _FLAGS if key in settings}
    needed = ("Ts", "u_min", "u_max")
    values = {key: _finite(settings, key) for key in (*needed, *settings) if key not in flags}
    if values["Ts"] < 1e-9:
        raise FrictionError(f"{settings.where} has Ts = {values['Ts']:g}; give a sample time of at least 1e-9 s")
    if values["u_min"] > values["u_max"]:
        raise FrictionError(f"{settings.where} has u_min above u_max; exchange them")
    window = values.get("window", 0.0)
    if window not in range(MOST + 1):
        raise FrictionError(f"{settings.where} has window = {window:g}; give an integer number of samples up to {MOST}")
    order, cutoff = values.get("filter_order", 0.0), values.get("filter_cutoff", 0.0)
    if order not in (0, 1, 2) or (order and not (window and 0.0 < cutoff < 0.5 / values["Ts"])):
        raise FrictionError(
            f"{settings.where} has filter_order = {order:g} and filter_cutoff = {cutoff:g}; give an order of 1 or 2, a "
            "frequency below half of the sample rate, and a window"
        )
    return LoopFile(
        {name: _law_table(tables[name], name) for name in LAWS if name in tables},
        values["Ts"],
        values["u_min"],
        values["u_max"],
        values.get("offset"),
        int(window),
        values.get("v0"),
        int(order),
        cutoff,
        path=path,
        table=_position_map(tables["table"]) if "table" in tables else None,
        **{**flags, **({"known_force": True} if "table" in tables else {})},
    )


def loop_text(loop: LoopFile, heading: str) -> str:
    """Return the file of a loop with a heading as comment."""
    settings = {key: getattr(loop, key) for key in _SETTINGS}
    # 0.0 is not a missing limit, offset or factor
    given = {key: value for key, value in settings.items() if value != getattr(LoopFile, key, None)}
    content: dict[str, Any] = {"loop": given}
    for name, law in loop.laws.items():
        own = {"law": law.law, **({"output": law.output} if name not in WHOLE else {})}
        groups = {"factor": law.factor, "parameters": dict(law.parameters), "connections": dict(law.connections)}
        content[name] = own | {key: value for key, value in groups.items() if value not in (None, {})}
    if loop.table is not None:
        grid, table = loop.table.grid, loop.table
        columns = {name: [float(value) for value in getattr(table, name)] for name in _COLUMNS}
        numbers = {"begin": grid.begin, "spacing": grid.spacing, "periodic": grid.periodic, "v_sign": table.v_sign}
        content["table"] = numbers | columns
    return f"# {heading}\n# C code: friction-fmus codegen {loop.path.name} -o c\n\n{tomli_w.dumps(content)}"


def _position_map(table: TomlTable) -> PositionMap:
    table.known(("begin", "spacing", "periodic", "v_sign", *_COLUMNS))
    begin, spacing, v_sign = (_finite(table, key) for key in ("begin", "spacing", "v_sign"))
    periodic = table.take("periodic", flag, "true or false")
    cogging, friction = (_numbers(table, key) for key in _COLUMNS)
    return PositionMap(Grid(begin, spacing, len(cogging), periodic), cogging, friction, v_sign)


def _numbers(table: TomlTable, key: str) -> tuple[float, ...]:
    values = table.take(key, lambda value: value if isinstance(value, list) else None, "a list of numbers")
    elements = {f"{key}[{i}]": value for i, value in enumerate(values, start=1)}
    return tuple(_finite(TomlTable(elements, table.where, table.error), element) for element in elements)


def _law_table(table: TomlTable, name: str) -> LoopLaw:
    table.known(("law", "parameters", "connections", *(("output", "factor") if name not in WHOLE else ())))
    law = table.take("law", text, "the name of a law")
    output = table.take("output", text, "the name of an output of the law", "u")
    parameters, connections = (
        TomlTable(table.content.get(key, {}), f"{table.where} {key},", table.error)
        for key in ("parameters", "connections")
    )
    for own, kind in ((parameters, bool), (connections, str)):
        for key, value in own.content.items():
            if not isinstance(value, kind):
                _finite(own, key)
    factor = _finite(table, "factor") if "factor" in table else None
    return LoopLaw(law, parameters.content, connections.content, output, factor)


def _finite(table: TomlTable, key: str) -> float:
    return table.take(key, finite, "a finite number")


INPUTS: Final = (Kind.INPUT, Kind.OPTIONAL, Kind.COMMAND)

SIGNALS: Final[Mapping[str, Any]] = {
    "r": variables.R,
    "rd": variables.RD,
    "rdd": variables.RDD,
    "x": variables.X,
    "v": variables.V,
    "enable": Command(True, "false: u = 0 and all laws are disabled"),
    "reset": Command(False, "true: all laws are reset"),
}
"""Inputs of a loop; inputs of laws with these names are connected to them."""

KNOWN: Final = Input(FORCE, 0.0, "known {force}, which is added to the other {force}s and hidden from the compensator")
"""Input of a loop for a further feedforward, such as a table over position."""

TAKING_OVER: Final = ("track", "u_track")  # inputs of the servo; its memory then contains the jumps of other laws too
Named: TypeAlias = tuple[str, SX]  # a signal with its name or formula

EMPTY: Final[Mapping[str, Named]] = MappingProxyType({})


def loop_law(loop: LoopFile) -> Law:
    """Return a loop as one law."""
    return _Loop(loop).law()


class _Loop:
    """A loop under construction."""

    def __init__(self, loop: LoopFile) -> None:
        self._loop = loop
        self._laws = {name: _law(loop, name) for name in LAWS if name in loop.laws}
        self._parts = Composition()
        self._words = words_of(loop.rotary)
        self._equations: list[str] = []
        self._sections: dict[str, str] = {}
        self._outputs: list[tuple[LawVariable, SX]] = []
        self._normal_force: dict[str, Named] = {}
        # all inputs first, in the order of the members of the struct; those without effect are omitted later
        inputs = {name: variable for name, variable in SIGNALS.items() if name != "v" or not loop.window}
        self._signals = {name: self._declared(name, variable) for name, variable in inputs.items()}
        self._Ts = self._declared("Ts", replace(SampleTime(), start=loop.Ts))
        self._u_min = self._declared("u_min", replace(variables.U_MIN, start=loop.u_min))
        self._u_max = self._declared("u_max", replace(variables.U_MAX, start=loop.u_max))

    def law(self) -> Law:
        """Return the law."""
        loop, parts = self._loop, self._parts
        if loop.window:
            self._signals["v"] = self._velocity(loop.window)
        u_last = self._declared("u_last", State(FORCE, 0.0, "u in the previous sample"))
        offset = self._number("offset", loop.offset, FORCE, "constant part of u, unknown to the laws")
        seen = ("u_last", u_last) if offset is None else ("u_last - offset", u_last - offset)
        forces: dict[str, SX] = {}
        load = {"load_u": self._load()} if "load" in self._laws else {}
        if "feedforward" in self._laws:
            text, force = self._force("feedforward", seen)
            forces[text] = force
            seen = self._without(seen, "last_feedforward", text, force)
        for text, force in load.items():
            seen = self._without(seen, "last_load", text, force)
        known = self._declared("f_known", KNOWN) if loop.known_force else None
        if known is not None:
            seen = self._without(seen, "last_known", "f_known", known)
        others = {**forces, **load, **({} if known is None else {"f_known": known})}
        others |= {} if offset is None else {"offset": offset}
        if "compensator" in self._laws:
            text, force = self._force("compensator", seen, self._taken_over(others))
            forces[text] = force
        forces |= others
        f = SX(0.0)
        if forces:
            f = parts.label("f", sum(forces.values(), f))
            self._equations.append(f"f = {' + '.join(forces)}")
        found = self._apply("servo", {"f": ("f", f), "u_prev": ("u_last", u_last)})
        parts.result("u_last", found["u"])
        for name in ("u_sat", "u"):
            if name in found:
                self._outputs.insert(0, (_named(name, _output(self._laws["servo"], name)), found[name]))
        for variable, value in self._outputs:
            parts.output(variable, value)
        documentation, prefixes = self._documentation()
        return parts.law("Loop", self._summary(), "the papers named with each law", documentation, loop.path, prefixes)

    def _without(self, seen: Named, state: str, text: str, force: SX) -> Named:
        """Return the fed back force without a force of the previous sample."""
        last = self._declared(state, State(FORCE, 0.0, f"{text} in the previous sample"))
        self._parts.result(state, force)
        return f"{seen[0]} - {state}", seen[1] - last

    def _declared(self, name: str, variable: LawVariable) -> SX:
        (symbol,) = self._parts.declare(_named(name, variable))
        return symbol

    def _number(self, name: str, value: float | None, unit: Unit, text: str) -> SX | None:
        """Return a parameter of the loop, or None if the file does not give it."""
        return None if value is None else self._declared(name, Parameter(unit, value, text))

    def _velocity(self, window: int) -> SX:
        """Return the velocity over `window` samples as the block Differentiator; x moved at v0 before the first one."""
        x, parts = self._signals["x"], self._parts
        v0 = self._number("v0", self._loop.v0, VELOCITY, "velocity before the first sample")
        past = parts.declare(_named("x_past", State(LENGTH, (0.0,) * window, "x in the previous samples")))
        begun = self._declared("begun", variables.RUNNING)
        before = [x if v0 is None else x - i * v0 * self._Ts for i in range(1, window + 1)]
        missed = self._declared("missed", variables.MISSED)
        last = filled(x, [if_else(begun, kept, start) for kept, start in zip(past, before, strict=True)], missed)
        v = (x - last[-1]) / (window * self._Ts)
        order = self._loop.filter_order
        v = parts.label("v", self._filtered(v, begun) if order else v)
        parts.result("x_past", x, *last[:-1])
        parts.result("begun", SX(1.0))
        parts.result("missed", SX(0.0))
        self._outputs.append((_named("v", Output(VELOCITY, f"velocity over {window} samples")), v))
        behind = f", behind a low-pass filter of order {order}" if order else ""
        self._equations.append(f"v = (x - x[k-{window}])/({window} Ts){behind}")
        return v

    def _filtered(self, v: SX, begun: SX) -> SX:
        """Return a velocity behind the low-pass filter, in direct form II transposed; see `filtered`."""
        text, order = "cut-off frequency of the low-pass filter of v", self._loop.filter_order
        cutoff = self._declared("filter_cutoff", Parameter(FREQUENCY, self._loop.filter_cutoff, text, min=1e-9))
        keep, q = exp(-2.0 * pi * cutoff * self._Ts), 1.0 / tan(pi * cutoff * self._Ts)
        d = 2.0 * BUTTERWORTH * q
        b0 = 1.0 - keep if order == 1 else 1.0 / (q * q + d + 1.0)
        b = [b0, SX(0.0)] if order == 1 else [b0, 2.0 * b0, b0]
        a = [-keep] if order == 1 else [2.0 * (1.0 - q * q) * b0, (q * q - d + 1.0) * b0]
        state = [SX(0.0)]  # at rest with the first v, from the last one to the first one
        for i in range(order, 0, -1):
            kept = self._declared(f"v_memory_{i}", State(VELOCITY, 0.0, "memory of the low-pass filter of v"))
            state.insert(0, if_else(begun, kept, (b[i] - a[i - 1]) * v + state[0]))
        found = b0 * v + state[0]
        for i in range(1, order + 1):
            self._parts.result(f"v_memory_{i}", b[i] * v - a[i - 1] * found + state[i])
        return found

    def _taken_over(self, others: Mapping[str, SX]) -> dict[str, Named]:
        """Return the inputs with which an estimator takes over: its estimate is u_track without the other forces."""
        law, taken = self._laws["compensator"], self._loop.laws["compensator"].connections
        has = {*TAKING_OVER}
        if not {"u_prev", *has} <= {*_inputs(law)} or not has <= {*_inputs(self._laws["servo"])} or has & {*taken}:
            return {}
        inputs = {variable.name: variable for variable in self._laws["servo"].select(*INPUTS)}
        track, u_track = (self._signal(name, inputs[name]) for name in TAKING_OVER)
        force = clip(u_track, self._u_min, self._u_max) - sum(others.values(), SX(0.0))
        text = " - ".join(["u_track", *others])
        gain = next((v for v in law.given if v.name == "gain"), None)
        if gain is not None:
            force *= self._declared("compensator_gain", gain)
            text = f"compensator_gain ({text})" if others else f"compensator_gain {text}"
        found = {"track": ("track", track), "u_track": (text, force)}
        at = {"r": ("x", self._signals["x"]), "rd": ("v", self._signals["v"]), "rdd": ("0", SX(0.0))}
        for name, (place, value) in at.items() if self._loop.laws["compensator"].output == "F_hat" else ():
            if name in _inputs(law) and name not in taken:
                found[name] = (f"{name}, or {place} while track is true", if_else(track, value, self._signals[name]))
        return found

    def _signal(self, name: str, variable: LawVariable) -> SX:
        """Return an input of the loop, which is declared at its first use."""
        if name not in self._signals:
            self._signals[name] = self._declared(name, variable)
        return self._signals[name]

    def _load(self) -> SX:
        """Compute the law of the load, whose normal force is that of the other laws, and return its force."""
        found = self._apply("load", {})
        for output in ("u", "Fn"):
            if output not in found:
                raise FrictionError(
                    f"{self._where('load')} names {self._laws['load'].name}, which has no output {output}; choose "
                    "LoadFeedforward, or a law of your own with force u and normal force Fn"
                )
            self._outputs.append((_named(f"load_{output}", _output(self._laws["load"], output)), found[output]))
        self._normal_force = {"Fn": ("load_Fn", found["Fn"])}
        return found["u"]

    def _force(self, name: str, seen: Named, taken_over: Mapping[str, Named] = EMPTY) -> Named:
        """Compute a law before the servo, and return its force."""
        entry, law = self._loop.laws[name], self._laws[name]
        forces = [variable.name for variable in law.select(Kind.OUTPUT) if variable.unit == FORCE]
        if entry.output not in forces:
            raise FrictionError(
                f"{self._where(name)} has output = {entry.output!r}, but the outputs of {law.name} with a force are "
                f"{', '.join(forces)}; choose one of them"
            )
        text, value = seen
        loaded = {} if "Fn" in entry.connections else self._normal_force
        u_prev = text, self._parts.label(f"{name}_u_prev", value)
        found = self._apply(name, {"u_prev": u_prev, **loaded, **taken_over})
        for output in dict.fromkeys((entry.output, "F_hat")):
            if output in found:
                self._outputs.append((_named(f"{name}_{output}", _output(law, output)), found[output]))
        factor = self._number(
            f"factor_{name}", entry.factor, NO_UNIT, f"factor of {name}_{entry.output} in the {{force}}"
        )
        if factor is None:
            return f"{name}_{entry.output}", found[entry.output]
        return f"factor_{name} {name}_{entry.output}", factor * found[entry.output]

    def _apply(self, name: str, computed: Mapping[str, Named]) -> Mapping[str, SX]:
        """Compute a law and return its outputs."""
        entry, law = self._loop.laws[name], self._laws[name]
        self._check_connections(name, computed)
        given = {
            variable.name: self._value(name, variable, entry.connections.get(variable.name), computed)
            for variable in law.select(*INPUTS)
        }
        shared = {parameter: parameter for parameter in SHARED if parameter not in entry.parameters}
        if name == "compensator" and "u_track" in computed:
            shared["gain"] = "compensator_gain"
        summary = self._words.fill(law.summary)
        title = f"{name} is {law.name}: {summary}. {law.source}. Its variables have the prefix {name}_."
        others = [f"    {each} = {text}" for each, (text, _) in given.items() if text != each]
        equations = re.findall(r"(?:^    .*\n?)+", law.documentation, re.M)
        self._sections[f"{name}_"] = "\n\n".join(
            filter(None, [wrapped(title, width=116), "\n".join(others), *(lines.rstrip() for lines in equations)])
        )
        return self._parts.apply(name, law, {each: value for each, (_, value) in given.items()}, shared)

    def _check_connections(self, name: str, computed: Mapping[str, Named]) -> None:
        inputs, law = _inputs(self._laws[name]), self._laws[name].name
        if name == "servo" and "f" not in inputs and not computed["f"][1].is_constant():
            raise FrictionError(
                f"{self._where(name)} names {law}, which has no input f for the force of other laws; choose a servo "
                "with this input, such as CascadePPI or PID"
            )
        choices = [each for each in inputs if each not in computed]
        for each in self._loop.laws[name].connections:
            if each not in choices:
                raise FrictionError(
                    f"{self._where(name)} connects {each}, but {law} has no such input to connect"
                    f"{did_you_mean(each, choices)}; choose from {', '.join(choices)}"
                )

    def _value(
        self, name: str, variable: LawVariable, given: float | str | None, computed: Mapping[str, Named]
    ) -> Named:
        """Return an input of a law: as given, computed, connected by its name, constant, or a new input of the loop."""
        if isinstance(given, str) and given != variable.name:
            if given not in self._signals:
                raise FrictionError(
                    f"{self._where(name)} connects {variable.name} to {given!r}, which is not an input of the loop"
                    f"{did_you_mean(given, self._signals)}; choose from {', '.join(self._signals)}, or give a number"
                )
            return given, self._signals[given]
        if isinstance(given, float | int):
            return f"{given:g}", SX(float(given))
        if variable.name in computed:
            return computed[variable.name]
        takes_over = name == "servo" and variable.name in TAKING_OVER
        if variable.name not in self._signals and given is None and variable.kind is not Kind.INPUT and not takes_over:
            return f"{variable.starts[0]:g}", SX(variable.starts[0])
        return variable.name, self._signal(variable.name, variable)

    def _where(self, name: str) -> str:
        return f"{self._loop.path}, [{name}],"

    def _summary(self) -> str:
        others = [law.name for name, law in self._laws.items() if name != "servo"]
        return self._laws["servo"].name + (f" with {' and '.join(others)}" if others else "")

    def _documentation(self) -> tuple[str, dict[int, str]]:
        """Return the documentation, and the prefixes of variables by its line."""
        text = (
            f"One sample of a position loop. The laws are computed in the order {', '.join(self._laws)}, each with the "
            "results of those before it."
        )
        equations = "\n".join(f"    {equation}" for equation in self._equations)
        limits = self._words.fill(
            "The limits u_min and u_max apply to the sum of all {force}s: the servo stops its integral while the sum "
            "is limited, and estimators receive the limited sum of the previous sample, which the drive must apply. "
            "Start with the axis at rest."
        )
        pages = ["\n\n".join(filter(None, [wrapped(text, width=116), equations, wrapped(limits, width=116)]))]
        prefixes = {}
        for prefix, section in self._sections.items():
            prefixes["\n\n".join([*pages, ""]).count("\n")] = prefix
            pages.append(section)
        return "\n\n".join(pages), prefixes


def _law(loop: LoopFile, name: str) -> Law:
    """Return a law of a loop with its start values."""
    entry, where = loop.laws[name], f"{loop.path}, [{name}]"
    path = loop.path.parent / entry.law
    try:
        block = find(path if path.suffix in (".py", ".c") else entry.law)
        if not block.is_law:
            raise FrictionError(
                f"{block.name} is written in C and cannot be joined with the laws; choose a law, or compute it beside "
                "the loop and pass its force to f_known, an input with known_force = true in [loop]"
            )
        law = law_of(block.path if path.suffix == ".py" else entry.law).with_room(entry.parameters)
        known = [v.name for v in law.select(*PARAMETERS) if v.kind is not Kind.SAMPLE_TIME]
        for parameter in entry.parameters:
            if parameter.partition("[")[0] not in known:
                raise UnknownNameError(f"{law.name} has no parameter {parameter!r}{did_you_mean(parameter, known)}")
        values = start_values(law, {**entry.parameters, "Ts": loop.Ts})
    except FrictionError as error:
        raise FrictionError(f"{where}: {error}") from error
    starts = {v.name: values[v.name] if v.kind in VECTORS else values[v.name][0] for v in law.given}
    return replace(law, variables=tuple(replace(v, start=starts.get(v.name, v.start)) for v in law.variables))


def _named(name: str, variable: LawVariable) -> LawVariable:
    return replace(variable, name=name)


def _inputs(law: Law) -> list[str]:
    return [variable.name for variable in law.select(*INPUTS)]


def _output(law: Law, name: str) -> LawVariable:
    """Return an output of a law."""
    return next(variable for variable in law.select(Kind.OUTPUT) if variable.name == name)
