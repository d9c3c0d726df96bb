"""What a compiled block says of itself: its rows, its fingerprint, and which variable depends on which."""

from __future__ import annotations

import ctypes
import math
import random
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

TIME, INPUT, OUTPUT, LOCAL, PARAMETER, FIXED, STATE, STATE_OUTPUT, DERIVATIVE = range(9)
REAL, INTEGER, BOOLEAN = range(3)


class _Row(ctypes.Structure):
    """``Row`` of block.h."""

    _fields_ = (
        *((name, ctypes.c_char_p) for name in ("name", "unit", "text")),
        *((name, ctypes.c_double) for name in ("start", "min", "max", "nominal")),
        ("starts", ctypes.POINTER(ctypes.c_double)),
        *((name, ctypes.c_uint32) for name in ("index", "length", "origin")),
        *((name, ctypes.c_int32) for name in ("role", "type")),
    )


@dataclass(frozen=True)
class Variable:
    """One scalar variable of a block.

    Attributes
    ----------
    name, unit, text : str
        Name as in the XML (elements of vectors are ``k[1]``, derivatives ``der(z)``), unit, description.
    start, min, max, nominal : float
        Start is NaN where the initial value is taken from a parameter.
    role, type : int
        The constants of this module.
    reference : int
        Value reference.
    origin : int
        Value reference of the state (derivatives) or of the parameter with the initial value (state outputs).
    """

    name: str
    unit: str
    text: str
    start: float
    min: float
    max: float
    nominal: float
    role: int
    type: int
    reference: int
    origin: int


@dataclass(frozen=True)
class Rows:
    """What a compiled block says of its variables.

    Attributes
    ----------
    variables : tuple of Variable
        In the order of the XML, time first.
    guid : str
        Hash of the rows, computed in the library.
    sampled : bool
        Whether it acts at sample times.
    """

    variables: tuple[Variable, ...]
    guid: str
    sampled: bool


@dataclass(frozen=True)
class Description(Rows):
    """A block's variables and structure.

    Attributes
    ----------
    dependencies, initial_dependencies : dict of int to tuple of int
        Value reference of an unknown -> those of the knowns it depends on, in step mode (inputs, continuous
        states, time) and in initialization mode (inputs, exact variables, time).
    """

    dependencies: dict[int, tuple[int, ...]]
    initial_dependencies: dict[int, tuple[int, ...]]


def describe(library: Path, computed: Mapping[str, Iterable[str]] | None = None) -> Description:
    """Read the variables of a compiled block and find out what depends on what, which takes up to some seconds.

    Parameters
    ----------
    library : Path
        The compiled block.
    computed : mapping of str to iterable of str, or None
        Outputs and what else they are computed from, where the source of the block tells it; a probe may miss what
        only matters at a limit.
    """
    handle = ctypes.CDLL(str(library))
    rows, size = _read(handle)
    block = _Probe(handle, size, rows.variables, rows.sampled)
    found = block.dependencies(False), block.dependencies(True)
    for dependencies, roles in zip(found, ((INPUT,), (INPUT, PARAMETER, FIXED, STATE)), strict=True):
        _add(dependencies, rows.variables, computed or {}, roles)
        _follow_limit(dependencies, rows.variables)
    return Description(rows.variables, rows.guid, rows.sampled, *found)


def read_rows(library: Path) -> Rows:
    """Return what a compiled block says of its variables."""
    return _read(ctypes.CDLL(str(library)))[0]


def _read(handle: ctypes.CDLL) -> tuple[Rows, int]:
    """Return the rows, and the number of values of the block."""
    handle.block_rows.restype = ctypes.POINTER(_Row)
    handle.block_rows.argtypes = (
        *(ctypes.POINTER(ctypes.c_size_t),) * 2,
        ctypes.POINTER(ctypes.c_int),
        ctypes.c_char_p,
    )
    count, size, sampled, guid = (
        ctypes.c_size_t(),
        ctypes.c_size_t(),
        ctypes.c_int(),
        ctypes.create_string_buffer(64),
    )
    rows = handle.block_rows(ctypes.byref(count), ctypes.byref(size), ctypes.byref(sampled), guid)

    variables = []
    for row in rows[: count.value]:
        name, unit, text = row.name.decode(), row.unit.decode(), row.text.decode()
        if row.role == DERIVATIVE:
            unit, text = _per_second(unit), f"time derivative of the {text}"
        for k in range(max(row.length, 1)):
            element = _element(name, k) if row.length else name
            start = row.starts[k] if row.starts else row.start
            limits = (row.min, row.max, row.nominal, row.role, row.type)
            variables.append(Variable(element, unit, text, start, *limits, row.index + k, row.origin + k))
    return Rows(tuple(variables), guid.value.decode(), bool(sampled.value)), size.value


def _add(
    dependencies: dict[int, tuple[int, ...]],
    variables: tuple[Variable, ...],
    computed: Mapping[str, Iterable[str]],
    roles: tuple[int, ...],
) -> None:
    """Adds what is known beforehand; the name of a vector stands for its elements."""
    references = {v.name: v.reference for v in variables}
    for output, names in computed.items():
        known = set(names)
        used = {v.reference for v in variables if v.role in roles and v.name.partition("[")[0] in known}
        unknown = references[output]
        dependencies[unknown] = tuple(sorted(used.union(dependencies[unknown])))


def _follow_limit(dependencies: dict[int, tuple[int, ...]], variables: tuple[Variable, ...]) -> None:
    """u_sat says which limit u is at, so that it depends on what u does; a probe away from the limits sees nothing."""
    references = {v.name: v.reference for v in variables}
    if {"u", "u_sat"} <= references.keys():
        flag, limited = references["u_sat"], references["u"]
        dependencies[flag] = tuple(sorted({*dependencies[flag], *dependencies[limited]}))


def _element(name: str, k: int) -> str:
    """k[1] of k, der(z[1]) of der(z)."""
    return f"{name[:-1]}[{k + 1}])" if name.startswith("der(") else f"{name}[{k + 1}]"


def _per_second(unit: str) -> str:
    """m -> m/s, m/s -> m/s2: FMI's notation has one slash and exponents behind it."""
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
    """Finds dependencies by setting one value to NaN and, as comparisons swallow NaN, by moving it."""

    FAR = 1e9
    LARGE, FEW_POINTS, MOST_POINTS = 500, 60, 400  # a block with as many values takes minutes for more points

    def __init__(self, handle: ctypes.CDLL, size: int, variables: tuple[Variable, ...], sampled: bool) -> None:
        self._evaluate = handle.block_evaluate
        self._evaluate.restype = None
        self._evaluate.argtypes = (ctypes.POINTER(ctypes.c_double), ctypes.c_int)
        self._size = size
        self._variables = variables
        self._sampled = sampled
        self._random = random.Random(1)

    def dependencies(self, initial: bool) -> dict[int, tuple[int, ...]]:
        """Unknown -> knowns, both as value references."""
        unknown_roles = (OUTPUT, LOCAL, DERIVATIVE, STATE_OUTPUT)
        known_roles: tuple[int, ...] = (TIME, INPUT, STATE, STATE_OUTPUT)
        if initial:
            known_roles = (TIME, INPUT, PARAMETER, FIXED, STATE)
        elif self._sampled:
            known_roles = (TIME, INPUT)  # what a discrete output may be said to depend on
        unknowns = [v.reference for v in self._variables if v.role in unknown_roles]
        knowns = [v for v in self._variables if v.role in known_roles]
        found: dict[int, set[int]] = {reference: set() for reference in unknowns}
        points = self.MOST_POINTS if self._size < self.LARGE else self.FEW_POINTS
        for point in range(points):
            values = (ctypes.c_double * self._size)(*self._point(plain=point == 0))
            base = self._run(values, initial, unknowns)
            for known in knowns:
                poisons = [self._moved(known, values[known.reference])]
                if known.type == REAL:
                    # a limit that is far from being reached is met by one that is beyond everything; 0 is a flag's "no"
                    places = (-self.FAR, 0.0, self.FAR)
                    poisons += [math.nan, *(min(max(place, known.min), known.max) for place in places)]
                for poison in poisons:
                    after = self._run(values, initial, unknowns, (known.reference, poison))
                    if after != base:
                        for reference, one, two in zip(unknowns, base, after, strict=True):
                            if not _same(one, two):
                                found[reference].add(known.reference)
        states = {v.reference for v in self._variables if v.role == STATE_OUTPUT}
        for reference in states & found.keys() if not initial else ():
            found[reference] = {reference}  # a state is known as itself
        return {reference: tuple(sorted(knowns_of)) for reference, knowns_of in found.items()}

    def _point(self, plain: bool) -> list[float]:
        """Start values, or values drawn around them within their limits."""
        values = [0.0] * self._size
        for v in self._variables:
            start = 0.0 if math.isnan(v.start) else v.start
            values[v.reference] = start if plain else self._drawn(v, start)
        return values

    def _drawn(self, v: Variable, start: float) -> float:
        draw = self._random
        if v.type == BOOLEAN:
            return float(draw.random() < 0.5)
        if v.type == INTEGER:
            most = int(min(v.max, start + 10))  # often, as it brings all elements of vectors into play
            return float(most if draw.random() < 0.3 else draw.randint(int(max(v.min, start - 10)), most))
        if v.role in (PARAMETER, FIXED):
            value = start * draw.uniform(0.5, 2.0) if start != 0.0 else draw.choice((0.0, 1.0)) * draw.uniform(0.1, 2.0)
            if start < 0.0 < v.max and draw.random() < 0.5:  # a negative value may stand for "not given"
                value = -value
            return min(max(value, v.min), v.max)
        if v.role == TIME:
            return draw.uniform(0.0, 2.0)
        far = 8.0 if draw.random() < 0.25 else 1.0  # beyond the limits of saturations, too
        size = math.pow(10.0, draw.uniform(-6.0, far)) * (v.nominal if v.role in (STATE, STATE_OUTPUT) else 1.0)
        return draw.choice((0.0, 1.0, -1.0, 1.0, -1.0)) * size

    def _moved(self, v: Variable, value: float) -> float:
        if v.type == BOOLEAN:
            return 1.0 - value
        if v.type == INTEGER:
            return value + 1.0 if value + 1.0 <= v.max else value - 1.0
        moved = value * self._random.uniform(1.1, 3.0) if value else 10.0 ** self._random.uniform(-5.0, 1.0)
        return min(max(moved, v.min), v.max)

    def _run(
        self,
        values: ctypes.Array[ctypes.c_double],
        initial: bool,
        unknowns: list[int],
        changed: tuple[int, float] | None = None,
    ) -> list[float]:
        """The unknowns, with one of the values changed."""
        buffer = type(values).from_buffer_copy(values)
        if changed:
            buffer[changed[0]] = changed[1]
        self._evaluate(buffer, int(initial))
        return [buffer[reference] for reference in unknowns]


def _same(a: float, b: float) -> bool:
    return a == b or (math.isnan(a) and math.isnan(b))
