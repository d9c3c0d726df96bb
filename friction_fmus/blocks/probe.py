"""The row table of a compiled block, its fingerprint, the groups of its variables, and their dependencies."""

import ctypes
import math
import random
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from friction_fmus.blocks.macros import block_header, constants, row_fields

_ROLES, _TYPES = constants("role", block_header()), constants("type", block_header())
TIME, INPUT, OUTPUT, LOCAL = (_ROLES[name] for name in ("TIME", "INPUT", "OUTPUT", "LOCAL"))
PARAMETER, FIXED, STATE = (_ROLES[name] for name in ("PARAMETER", "FIXED", "STATE"))
STATE_OUTPUT, DERIVATIVE = (_ROLES[name] for name in ("STATE_OUTPUT", "DERIVATIVE"))
REAL, INTEGER, BOOLEAN = (_TYPES[name] for name in ("REAL", "INTEGER", "BOOLEAN"))

_C_TYPES: dict[str, Any] = {
    "char*": ctypes.c_char_p,
    "double": ctypes.c_double,
    "double*": ctypes.POINTER(ctypes.c_double),
    "uint32_t": ctypes.c_uint32,
    "int32_t": ctypes.c_int32,
}


class _Row(ctypes.Structure):
    """``Row`` of block.h."""

    _fields_ = tuple((name, _C_TYPES[kind]) for name, kind in row_fields(block_header()))


@dataclass(frozen=True)
class BlockVariable:
    """One scalar variable of a block."""

    name: str
    unit: str
    text: str
    """Name as in the XML (elements of vectors are ``k[1]``, derivatives ``der(z)``), unit and description."""
    start: float
    min: float
    max: float
    nominal: float
    """Start value, limits and nominal value. The start value is NaN if a parameter provides the initial value."""
    role: int
    type: int
    """Constants of this module."""
    reference: int  # value reference
    origin: int
    """Value reference of the state (for derivatives) or of the parameter with the initial value (for state outputs)."""


@dataclass(frozen=True)
class BlockVariables:
    """Variables of a compiled block."""

    variables: tuple[BlockVariable, ...]  # variables in the order of the XML, time first
    guid: str  # hash of the rows, computed in the library
    sampled: bool  # whether the block acts at sample times
    exchanges: bool  # whether it can be used for model exchange
    events: int  # number of its event indicators


@dataclass(frozen=True)
class Description(BlockVariables):
    """A block's variables and structure."""

    dependencies: dict[int, tuple[int, ...]]
    initial_dependencies: dict[int, tuple[int, ...]]
    """For the value reference of each unknown, the value references of the knowns on which it depends: in step mode
    (inputs, continuous states, time) and in initialization mode (inputs, exact variables, time)."""
    violated: str  # relation of parameters that the start values violate; empty: none


def describe(library: Path, computed: Mapping[str, Iterable[str]] | None = None) -> Description:
    """Read the variables of a compiled block and probe its dependencies, which takes up to some seconds."""
    handle = ctypes.CDLL(str(library))
    rows, size = _read(handle)
    block = _Probe(handle, size, rows.variables, rows.sampled)
    found = block.dependencies(False), block.dependencies(True)
    if rows.sampled and not computed:  # commands act on what earlier samples have left, of which the probe has none
        commands = [v.name for v in rows.variables if (v.role, v.type) == (INPUT, BOOLEAN)]
        computed = {v.name: commands for v in rows.variables if (v.role, v.type) == (OUTPUT, REAL)}
    for dependencies, roles in zip(found, ((INPUT,), (INPUT, PARAMETER, FIXED, STATE)), strict=True):
        _add(dependencies, rows.variables, computed or {}, roles)
        _follow_limit(dependencies, rows.variables)
    return Description(rows.variables, rows.guid, rows.sampled, rows.exchanges, rows.events, *found, block.violated())


def read_variables(library: Path) -> BlockVariables:
    """Return the variables of a compiled block, without dependencies."""
    return _read(ctypes.CDLL(str(library)))[0]


def _read(handle: ctypes.CDLL) -> tuple[BlockVariables, int]:
    """Return the rows, and the number of values of the block."""
    handle.block_rows.restype = ctypes.POINTER(_Row)
    number = ctypes.POINTER(ctypes.c_size_t)
    handle.block_rows.argtypes = (number, number, ctypes.POINTER(ctypes.c_int), ctypes.c_char_p)
    count, size, traits = ctypes.c_size_t(), ctypes.c_size_t(), (ctypes.c_int * 3)()
    guid = ctypes.create_string_buffer(64)
    rows = handle.block_rows(ctypes.byref(count), ctypes.byref(size), traits, guid)

    variables = []
    for row in rows[: count.value]:
        name, unit, text = row.name.decode(), row.unit.decode(), row.text.decode()
        if row.role == DERIVATIVE:
            unit, text = _per_second(unit), f"time derivative of the {text.partition(';')[0]}"
        for k in range(max(row.length, 1)):
            element = _element(name, k) if row.length else name
            start = row.starts[k] if row.starts else row.start
            limits = (row.min, row.max, row.nominal, row.role, row.type)
            variables.append(
                BlockVariable(element, unit, text, start, *limits, row.index + k, getattr(row, "from") + k)
            )
    sampled, exchanges, events = traits
    block = BlockVariables(tuple(variables), guid.value.decode(), bool(sampled), bool(exchanges), events)
    return block, size.value


def _add(
    dependencies: dict[int, tuple[int, ...]],
    variables: tuple[BlockVariable, ...],
    computed: Mapping[str, Iterable[str]],
    roles: tuple[int, ...],
) -> None:
    """Add known dependencies; the name of a vector stands for its elements."""
    references = {v.name: v.reference for v in variables}
    for output, names in computed.items():
        known = set(names)
        used = {v.reference for v in variables if v.role in roles and v.name.partition("[")[0] in known}
        unknown = references[output]
        dependencies[unknown] = tuple(sorted(used.union(dependencies[unknown])))


def _follow_limit(dependencies: dict[int, tuple[int, ...]], variables: tuple[BlockVariable, ...]) -> None:
    """Give u_sat the dependencies of u: it states the active limit of u, which a probe away from the limits misses."""
    references = {v.name: v.reference for v in variables}
    flag, limited = references.get("u_sat", -1), references.get("u", -1)
    if {flag, limited} <= dependencies.keys():
        dependencies[flag] = tuple(sorted({*dependencies[flag], *dependencies[limited]}))


def _element(name: str, k: int) -> str:
    """Return the name of element k: k[1] for k, der(z[1]) for der(z)."""
    return f"{name[:-1]}[{k + 1}])" if name.startswith("der(") else f"{name}[{k + 1}]"


def _per_second(unit: str) -> str:
    """Return the unit of a derivative: m -> m/s, m/s -> m/s2; FMI allows one slash, then exponents."""
    if "/" not in unit:
        return f"{unit or 1}/s"
    above, below = unit.split("/")
    factors = below.split(".")
    for i, factor in enumerate(factors):
        if factor.rstrip("0123456789") == "s":
            factors[i] = f"s{int(factor[1:] or 1) + 1}"
            return f"{above}/{'.'.join(factors)}"
    return f"{above}/{below}.s"


class _Probe:
    """Search for dependencies: one value is set to NaN and, as comparisons hide NaN, also changed."""

    FAR = 1e9
    LARGE, FEW_POINTS, MOST_POINTS = 500, 60, 400  # for this number of values, more points would take minutes
    TOGETHER = 20  # number of points that are evaluated at once

    def __init__(self, handle: ctypes.CDLL, size: int, variables: tuple[BlockVariable, ...], sampled: bool) -> None:
        self._evaluate = handle.block_evaluate
        self._evaluate.restype = None
        self._evaluate.argtypes = (ctypes.c_void_p, ctypes.c_int)
        self._violated = handle.block_violated
        self._violated.restype = ctypes.c_char_p
        self._size = size
        self._variables = variables
        self._sampled = sampled
        self._random = random.Random(1)

    def violated(self) -> str:
        """Return the relation of parameters that the start values violate."""
        return (self._violated((ctypes.c_double * self._size)(*self._point(plain=True))) or b"").decode()

    def dependencies(self, initial: bool) -> dict[int, tuple[int, ...]]:
        """Return the knowns on which each output and derivative depends, both as value references."""
        import numpy as np  # imported here, as every command imports this module

        known_roles: tuple[int, ...] = (TIME, INPUT, STATE, STATE_OUTPUT)
        if initial:
            known_roles = (TIME, INPUT, PARAMETER, FIXED, STATE)
        elif self._sampled:
            known_roles = (TIME, INPUT)  # the dependencies that FMI allows for a discrete output
        itself = {v.reference: (v.reference,) for v in self._variables if v.role == STATE_OUTPUT and not initial}
        probed = [v.reference for v in self._variables if v.role in (OUTPUT, STATE_OUTPUT, DERIVATIVE)]
        unknowns = [reference for reference in probed if reference not in itself]
        knowns = [v for v in self._variables if v.role in known_roles]
        places, others = np.array([v.reference for v in knowns]), [self._poisons(v) for v in knowns]
        found = np.zeros((len(knowns), len(unknowns)), dtype=bool)
        done, points = 0, self.MOST_POINTS if self._size < self.LARGE else self.FEW_POINTS
        while done < points:
            # the first points find most dependencies, which need not be tried again
            count = min(done + 1, self.TOGETHER, points - done) if self._size < self.LARGE else 1
            values, moved = np.empty((count, self._size)), np.empty((count, len(knowns)))
            for i in range(count):
                point = self._point(plain=done + i == 0)
                values[i], moved[i] = point, [self._moved(v, point[v.reference]) for v in knowns]
            done += count
            left = np.flatnonzero(~found.all(axis=1)).tolist()
            trials = [(known, poison) for known in left for poison in (math.inf, *others[known])]  # inf: moved
            if not trials:
                continue
            changed, poison = np.array([known for known, _ in trials]), np.array([each for _, each in trials])
            table = np.repeat(values[:, np.newaxis], len(trials) + 1, axis=1)  # the last row of a point is unchanged
            table[:, np.arange(len(trials)), places[changed]] = np.where(np.isinf(poison), moved[:, changed], poison)
            for row in range(table.ctypes.data, table.ctypes.data + table.nbytes, table.strides[1]):
                self._evaluate(row, initial)
            after = table[:, :, unknowns]
            differs = (after != after[:, -1:]) & ~(np.isnan(after) & np.isnan(after[:, -1:]))
            trial, unknown = np.nonzero(differs.any(axis=0))
            found[changed[trial], unknown] = True
        return {
            reference: tuple(sorted(places[row].tolist())) for reference, row in zip(unknowns, found.T, strict=True)
        } | itself

    def _poisons(self, v: BlockVariable) -> tuple[float, ...]:
        """Return values for a real known: NaN, huge values, which reach limits, and 0, which is the "no" of a flag."""
        places = (-self.FAR, 0.0, self.FAR) if v.type == REAL else ()
        return (math.nan, *(min(max(place, v.min), v.max) for place in places)) if places else ()

    def _point(self, plain: bool) -> list[float]:
        """Return start values, or random values around them within their limits."""
        values = [0.0] * self._size
        for v in self._variables:
            start = 0.0 if math.isnan(v.start) else v.start
            values[v.reference] = start if plain else self._drawn(v, start)
        return values

    def _drawn(self, v: BlockVariable, start: float) -> float:
        draw = self._random
        if v.type == BOOLEAN:
            return float(draw.random() < 0.5)
        if v.type == INTEGER:
            least, most = int(max(v.min, start - 10)), int(min(v.max, start + 10))
            return float(draw.choice((least, most, draw.randint(least, most))))  # most: all elements of vectors
        if v.role in (PARAMETER, FIXED):
            value = start * draw.uniform(0.5, 2.0) if start != 0.0 else draw.choice((0.0, 1.0)) * draw.uniform(0.1, 2.0)
            if start < 0.0 < v.max and draw.random() < 0.5:  # a negative value may mean "not given"
                value = -value
            return min(max(value, v.min), v.max)
        if v.role == TIME:
            return draw.uniform(0.0, 2.0)
        far = 8.0 if draw.random() < 0.25 else 1.0  # also beyond the limits of saturations
        size = math.pow(10.0, draw.uniform(-6.0, far)) * (v.nominal if v.role in (STATE, STATE_OUTPUT) else 1.0)
        return draw.choice((0.0, 1.0, -1.0, 1.0, -1.0)) * size

    def _moved(self, v: BlockVariable, value: float) -> float:
        if v.type == BOOLEAN:
            return 1.0 - value
        if v.type == INTEGER:
            return value + 1.0 if value + 1.0 <= v.max else value - 1.0
        moved = value * self._random.uniform(1.1, 3.0) if value else 10.0 ** self._random.uniform(-5.0, 1.0)
        return min(max(moved, v.min), v.max)


GROUPS = {
    "Inputs": (INPUT,),
    "Outputs": (OUTPUT, STATE_OUTPUT),
    "Internal variables": (STATE, LOCAL, DERIVATIVE),
    "Parameters": (PARAMETER,),
    "Fixed parameters": (FIXED,),
}
"""Title of each group and the roles in it; fixed parameters cannot be changed during a run."""


@dataclass(frozen=True)
class VariableRow:
    """A variable, or the elements of a vector."""

    name: str
    unit: str
    text: str
    """Name (``k[1...10]`` for a vector), unit or type, and description."""
    starts: tuple[str, ...]  # start values; one if all are equal, none for computed variables
    limits: str  # range of accepted values; empty if there are no limits


def variable_groups(rows: BlockVariables) -> dict[str, tuple[VariableRow, ...]]:
    """Return the groups that are not empty, in the order of `GROUPS`."""
    groups = {}
    for title, roles in GROUPS.items():
        members = [v for role in roles for v in rows.variables if v.role == role]
        if entries := tuple(_entry(list(same)) for _, same in groupby(members, _vector)):
            groups[title] = entries
    return groups


def _vector(v: BlockVariable) -> str:
    """Return the name without the index of the element."""
    return re.sub(r"\[\d+\]", "[]", v.name)


def _entry(elements: list[BlockVariable]) -> VariableRow:
    first, last = elements[0], elements[-1]
    name = first.name
    if last is not first:
        name = re.sub(r"\[1\]", f"[1...{len(elements)}]", name)
    given = first.role in (INPUT, PARAMETER, FIXED, STATE)
    starts = tuple(_value(v.start, v.type) for v in elements) if given else ()
    low, high = (_value(limit, first.type) if math.isfinite(limit) else "" for limit in (first.min, first.max))
    limits = f"{low} to {high}" if low and high else f"at least {low}" if low else f"at most {high}" if high else ""
    return VariableRow(
        name,
        {INTEGER: "Integer", BOOLEAN: "Boolean"}.get(first.type, first.unit),
        first.text,
        starts[:1] if len(set(starts)) == 1 else starts,
        limits if given and first.type != BOOLEAN else "",
    )


def _value(value: float, type_: int) -> str:
    if type_ == BOOLEAN:
        return "true" if value else "false"
    return str(int(value)) if type_ == INTEGER else f"{value:g}"
