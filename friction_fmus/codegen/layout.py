"""Laws to export by name, and their layout in C: its structs, and which of their members are pairs of floats."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

from casadi import Function

from friction_fmus.axis.position_map import PositionMap
from friction_fmus.blocks.axis_units import Words, words_of
from friction_fmus.blocks.catalogue import find, listing
from friction_fmus.errors import FrictionError, UnknownNameError, did_you_mean
from friction_fmus.lawkit.declarations import FAULT, PARAMETERS
from friction_fmus.lawkit.emit.branches import Weight, in_pairs, positions, rounded
from friction_fmus.lawkit.emit.c_text import Kernel, Lows, Real, kernel
from friction_fmus.lawkit.emit.names import Named
from friction_fmus.lawkit.emit.operations import CONDITIONS, LIBM, Node, graph
from friction_fmus.lawkit.law import ANGLE, BOOLEANS, LENGTH, NO_UNIT, VECTORS, Kind, Law, LawVariable, discover_laws

NONE: Mapping[int, str] = MappingProxyType({})

_INDENT = "    "  # marks the equations
_START = re.compile(r"(?:[\w ]+:\s+)?([A-Za-z]\w*?)_?(?:\([^)]*\)|\[[^\]]*\])?'*\s+(?:=|becomes)\s")


@dataclass(frozen=True)
class Equation:
    """An equation."""

    number: int  # its number, counted from 1
    name: str  # the variable on its left-hand side
    lines: tuple[str, ...]  # its text
    last: int  # index of its last line in the documentation
    prefix: str = ""  # prefix of the variable in the code

    @property
    def text(self) -> str:
        """The equation in one line, with its number."""
        return f"({self.number}) {re.sub(r' +', ' ', ' '.join(self.lines)).rstrip(',')}"


def equations_of(documentation: str, prefixes: Mapping[int, str] = NONE) -> tuple[Equation, ...]:
    """Return the equations of a documentation page; an indented line with ``name =`` or ``name becomes`` begins one."""
    prefix = ""
    found: list[Equation] = []
    inside = False
    for index, line in enumerate(documentation.splitlines()):
        prefix = prefixes.get(index, prefix)
        inside = inside and bool(line.strip())
        if not line.startswith(_INDENT):
            continue
        text = line.strip()
        start = _START.match(text)
        if start:
            found.append(Equation(len(found) + 1, start[1], (text,), index, prefix))
            inside = True
        elif inside:
            last = found.pop()
            found.append(Equation(last.number, last.name, (*last.lines, text), index, prefix))
    return tuple(found)


def numbered(documentation: str) -> str:
    """Return the documentation with the number of each equation at its end."""
    lines = documentation.splitlines()
    for equation in equations_of(documentation):
        lines[equation.last] += f"   ({equation.number})"
    return "\n".join(lines)


def placed(
    equations: tuple[Equation, ...],
    nodes: Sequence[Node],
    named: Sequence[Named],
    results: Mapping[str, int],
    commands: Collection[int],
) -> tuple[dict[int, list[str]], list[str]]:
    """Return the comments for operations."""
    # An equation whose left-hand side is no variable of the law is added to one that contains this side: to the next
    # equation, or else to one before it.
    own = [_node(equation.prefix + equation.name, nodes, named, results, commands) for equation in equations]
    places = range(len(equations))
    for place in (*reversed(places), *places):  # in both directions, as an equation may belong to one of the same kind
        for other in (place + 1, *range(place - 1, -1, -1)):
            if own[place] is None and other in places and _belongs(equations[place], equations[other]):
                own[place] = own[other]
    comments: dict[int, list[str]] = {}
    for node, equation in zip(own, equations, strict=True):
        if node is not None:
            comments.setdefault(node, []).append(equation.text)
    return comments, [equation.text for node, equation in zip(own, equations, strict=True) if node is None]


def _belongs(equation: Equation, other: Equation) -> bool:
    """Return whether another equation of the same law contains the left-hand side."""
    return equation.prefix == other.prefix and re.search(rf"\b{equation.name}\b", other.text) is not None


def _node(
    name: str, nodes: Sequence[Node], named: Sequence[Named], results: Mapping[str, int], commands: Collection[int]
) -> int | None:
    """Return the operation that computes a variable, before a disabled law replaces it by zero."""
    own = [entry.node for entry in named if entry.name == name and not entry.depth]
    node = results.get(name, own[0] if own else -1)
    while node >= 0 and nodes[node].operation in ("SELECT", "IF_ELSE_ZERO") and _commanded(nodes, node, commands):
        node = nodes[node].arguments[1]
    if node < 0 or nodes[node].operation in ("CONST", "INPUT", *CONDITIONS):
        return None
    return node


def _commanded(nodes: Sequence[Node], select: int, commands: Collection[int]) -> bool:
    condition = nodes[nodes[select].arguments[0]]
    return condition.operation == "INPUT" and int(condition.value) in commands


INPUTS = (Kind.INPUT, Kind.OPTIONAL, Kind.COMMAND)
STATES = (Kind.STATE, Kind.STATES)

Values = Mapping[str, tuple[float, ...]]

_SELECTS = {"SELECT", "IF_ELSE_ZERO", "SIGN", "NEG", "FABS", "FMIN", "FMAX"}

EMPTY: Mapping[int, Sequence[str]] = MappingProxyType({})


@dataclass(frozen=True)
class Export:
    """A law with the settings of its export."""

    law: Law
    real: Real
    prefix: str
    """Prefix of files, types and functions."""
    start: Values  # start values of inputs, states and parameters by variable
    rotary: bool = False  # whether the law has the units of a rotary axis
    table: PositionMap | None = None  # force over position, for the input ``f_known`` of a loop

    @property
    def words(self) -> Words:
        """Nouns and units of the axis."""
        return words_of(self.rotary)

    @property
    def groups(self) -> dict[str, tuple[LawVariable, ...]]:
        """Members of the structs by the name of the struct, in the order of the arguments of ``step``."""
        return {
            "parameters": self.law.select(*PARAMETERS),
            "states": self.law.select(*STATES),
            "inputs": self.law.select(*INPUTS),
            "outputs": (*self.law.select(Kind.OUTPUT), FAULT),
        }

    @property
    def taken(self) -> Iterable[str]:
        """Names that the constants and variables of a function must not have."""
        return self.groups

    @property
    def tracks(self) -> bool:
        """Whether the law can start from a force, given by its inputs ``track`` and ``u_track``."""
        return {"track", "u_track"} <= {variable.name for variable in self.groups["inputs"]}

    @cached_property
    def kernel(self) -> Kernel:
        """One sample as statements on the structs."""
        remarks, others = self._remarks
        found = self.statements(self.law.function, self.law.given, self.results, self._lows, self.named, remarks)
        return replace(found, lines=(*self.real.comment_lines(others), *found.lines))

    @property
    def _remarks(self) -> tuple[dict[int, list[str]], list[str]]:
        """Equations of the law by the operation that computes them, and the others."""
        nodes, numbers = graph(self.law.function)
        results: dict[str, int] = {}
        for (variable, _), number in zip(_scalars(self.law.results), numbers, strict=True):
            results.setdefault(variable.name, number)
        commands = {i for i, (v, _) in enumerate(_scalars(self.law.given)) if v.kind is Kind.COMMAND}
        equations = equations_of(self.law.documentation, self.law.prefixes)
        return placed(equations, nodes, self.named, results, commands)

    @cached_property
    def named(self) -> tuple[Named, ...]:
        """Names of the intermediate results."""
        function, labels = self.law.intermediate()
        count = len(graph(self.law.function)[0])
        found = graph(function)[1][self.law.function.n_out() :]  # both graphs begin with the same nodes
        return tuple(
            Named(label.name, node, label.depth, label.assigned)
            for label, node in zip(labels, found, strict=True)
            if node < count
        )

    @property
    def results(self) -> list[str]:
        """C expressions of the scalars that a sample writes, in the order of the law's function."""
        return [place for variable in self.law.results for place in self.places(variable)]

    @cached_property
    def pairs(self) -> frozenset[str]:
        """Names of the variables that are pairs of floats: absolute positions and related parameters."""
        wide, written = self._positions
        read, results = _scalars(self.law.given), _scalars(self.law.results)
        return frozenset([read[i][0].name for i in wide] + [results[i][0].name for i in written])

    @property
    def overflowing(self) -> tuple[LawVariable, ...]:
        """The results that may overflow: all but truth values and those that select among arguments and constants."""
        nodes, results = graph(self.law.function)
        bounded: list[bool] = []
        for node in nodes:
            selected = node.arguments[1:] if node.operation in ("SELECT", "IF_ELSE_ZERO") else node.arguments
            inside = node.operation in _SELECTS and all(bounded[i] for i in selected)
            bounded.append(node.is_leaf or node.operation in CONDITIONS or inside)
        scalars = zip(_scalars(self.law.results), results, strict=True)
        found = {v.name for (v, _), number in scalars if not bounded[number] and not is_flag(v)}
        return tuple(v for v in self.law.results if v.name in found)

    @property
    def positions(self) -> tuple[LawVariable, ...]:
        """The inputs that are absolute positions."""
        return tuple(v for v in self.law.select(Kind.INPUT, Kind.OPTIONAL) if _is_length(v))

    @property
    def rounded(self) -> tuple[str, ...]:
        """Functions of the C library that receive an absolute position rounded to one float."""
        given = {i: Weight(1.0) for i, (v, _) in enumerate(_scalars(self.law.given)) if v in self.positions}
        found = rounded(graph(self.law.function)[0], given | dict(self._positions[0]))
        return tuple(sorted(LIBM[operation] + self.real.suffix for operation in found & LIBM.keys()))

    @cached_property
    def _positions(self) -> tuple[Mapping[int, Weight], set[int]]:
        """Indices of the arguments and of the results that are pairs."""
        if not self.real.bound:
            return {}, set()
        read = _scalars(self.law.given)
        argument = {(v.name, element): i for i, (v, element) in enumerate(read)}
        lengths = {i: (v.name, element) for i, (v, element) in enumerate(_scalars(self.law.results)) if _is_length(v)}
        return positions(
            *graph(self.law.function),
            [i for i, (v, _) in enumerate(read) if v in self.positions],
            [i for i, (v, _) in enumerate(read) if v.kind in PARAMETERS and (_is_length(v) or v.unit == NO_UNIT)],
            {i: argument[scalar] for i, scalar in lengths.items() if scalar in argument},
            [i for i, scalar in lengths.items() if scalar not in argument],
            {i: argument[v.name, e] for i, (v, e) in enumerate(_scalars(self.law.results)) if v.sums},
        )

    @property
    def wide_nodes(self) -> list[bool]:
        """Whether each operation of the law's function is computed in pairs."""
        nodes, results = graph(self.law.function)
        wide, written = self._positions
        return in_pairs(nodes, wide, {results[i] for i in written})

    @property
    def _lows(self) -> Lows | None:
        """Return the lower parts by index of the argument and of the result."""

        def by_number(variables: Sequence[LawVariable]) -> dict[int, str]:
            scalars = [low for variable in variables for low in self.lows(variable) or [""] * len(variable.starts)]
            return {i: low for i, low in enumerate(scalars) if low}

        if not self.pairs:
            return None
        return Lows(self._positions[0], by_number(self.law.given), by_number(self.law.results))

    def lows(self, variable: LawVariable) -> list[str]:
        """Return the C expressions of the lower parts of a variable's scalars; empty unless it is a pair."""
        places = self.places(variable) if variable.name in self.pairs else []
        return [re.sub(r"\w+(?=\[|$)", r"\g<0>_low", place, count=1) for place in places]

    @property
    def result_lows(self) -> dict[int, str]:
        """Return the C expressions of the lower parts of `results`, by index, for those that are pairs."""
        return dict(self._lows.writes) if self._lows else {}

    def statements(
        self,
        function: Function,
        given: Sequence[LawVariable],
        writes: Sequence[str],
        lows: Lows | None = None,
        named: Sequence[Named] = (),
        remarks: Mapping[int, Sequence[str]] = EMPTY,
        flags: Sequence[str] = (),
    ) -> Kernel:
        """Return a function of variables of the structs as statements; see `kernel`."""
        scalars = [variable for variable in given for _ in variable.starts]
        return kernel(
            function,
            [place for v in given for place in self.places(v)],
            writes,
            real=self.real,
            conditions=[i for i, variable in enumerate(scalars) if is_flag(variable)],
            positive=[i for i, variable in enumerate(scalars) if variable.min >= 0.0],
            lows=lows,
            named=named,
            remarks=remarks,
            taken=self.taken,
            flags=[*flags, *(place for v in self.groups["states"] if v.flag for place in self.places(v))],
        )

    def places(self, variable: LawVariable) -> list[str]:
        """Return the C expressions of a variable's scalars, by way of pointers with the names of the structs."""
        group = next(name for name, members in self.groups.items() if variable in members)
        return variable.places(f"{group}->{variable.name}")

    def member(self, variable: LawVariable) -> str:
        """Return the declaration of a member."""
        kind = "bool" if is_flag(variable) else self.real.name
        return f"{kind} {variable.name}{f'[{len(variable.starts)}]' if variable.kind in VECTORS else ''}"


def _scalars(variables: Sequence[LawVariable]) -> list[tuple[LawVariable, int]]:
    """Return every variable once per scalar, with the index of the element."""
    return [(variable, element) for variable in variables for element in range(len(variable.starts))]


def is_flag(variable: LawVariable) -> bool:
    """Return whether a variable is a truth value."""
    return variable.flag or variable.kind in (*BOOLEANS, Kind.FLAG)


def _is_length(variable: LawVariable) -> bool:
    """Return whether a variable may be an absolute position."""
    return variable.unit in (LENGTH, ANGLE)


def law_of(model: str | Path) -> Law:
    """Return a law."""
    block = find(model)
    if not block.is_law:
        laws = [entry.name for entry in listing().values() if entry.path.suffix == ".py"]
        near = [name for name in laws if name.startswith(block.name)]
        what = f"in C: copy {block.path}" if block.family else f"a {block.kind} block"
        hint = f"; did you mean {' or '.join(near)}?" if near else ""
        raise FrictionError(f"{block.name} is {what}, but codegen exports compensators written in Python{hint}")
    return next(law for law in discover_laws(block.path) if law.name == block.name)


def start_values(law: Law, start: Mapping[str, float | bool]) -> dict[str, tuple[float, ...]]:
    """Return the start values of a law by variable, with some changed; that of Fn is Fn0 unless it is given."""
    values = {variable.name: variable.starts for variable in law.given}
    if "Fn0" in start and "Fn" in values:
        start = {"Fn": start["Fn0"], **start}
    for name, value in start.items():
        _set(law, values, name, value)
    if broken := law.conditions.violated(values):
        raise FrictionError(f"{law.name} requires {broken[0]}, which the given values violate")
    return values


def _set(law: Law, values: dict[str, tuple[float, ...]], name: str, value: float | bool) -> None:
    element = re.fullmatch(r"(\w+)\[(\d+)\]", name)
    plain = element[1] if element else name
    variable = next((v for v in law.given if v.name == plain), None)
    if variable is None or (variable.kind in VECTORS) != bool(element):
        names = [v.name for v in law.given]
        raise UnknownNameError(f"{law.name} has no variable {name!r} with a start value{did_you_mean(plain, names)}")
    place = int(element[2]) - 1 if element else 0
    if not 0 <= place < len(variable.starts):
        raise UnknownNameError(
            f"There is no variable {name!r}; the elements of {plain} are 1 to {len(variable.starts)}"
        )
    if variable.kind in BOOLEANS and value not in (0.0, 1.0):
        raise FrictionError(f"{name} = {value:g} is not a Boolean; give true or false")
    if not (variable.min <= value <= variable.max and abs(value) < float("inf")):
        raise FrictionError(
            f"{name} = {value:g} lies outside [{variable.min:g}, {variable.max:g}]; choose a value inside"
        )
    changed = list(values[plain])
    changed[place] = float(value)
    values[plain] = tuple(changed)
