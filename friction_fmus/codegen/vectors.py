"""Test vectors of an exported law: inputs of one run, and its outputs computed in double by casadi."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate, pairwise
from typing import Any, Final

import numpy as np

from friction_fmus.codegen.layout import INPUTS, STATES, Export
from friction_fmus.codegen.sources import unit_text
from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.declarations import PARAMETERS
from friction_fmus.lawkit.emit.c_text import DOUBLE
from friction_fmus.lawkit.emit.graph import CALLS, COMPARE, LOGIC, Node, graph
from friction_fmus.lawkit.law import BOOLEANS, VECTORS, Kind, Law, Variable

RUNS = 17
"""Number of runs; the first one is exact."""

_ROUNDING_MARGIN = 4.0  # of a decision over the largest deviation of its sides
_SAME = 1e-3  # relative difference of results between both sides of a decision that does not matter
_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    **{"ADD": np.add, "SUB": np.subtract, "MUL": np.multiply, "DIV": np.divide, "NEG": np.negative, "SQ": np.square},
    **{"TWICE": lambda a: 2.0 * a, "INV": lambda a: 1.0 / a, "SIGN": np.sign, "FMIN": np.fmin, "FMAX": np.fmax},
    **{"LT": np.less, "LE": np.less_equal, "EQ": np.equal, "NE": np.not_equal, "AND": np.logical_and},
    **{"OR": np.logical_or, "NOT": np.logical_not, "SELECT": lambda c, a, b: np.where(c != 0.0, a, b)},
    **{"IF_ELSE_ZERO": lambda c, a: np.where(c != 0.0, a, 0.0), "POW": np.power, "CONSTPOW": np.power},
    **{"ASIN": np.arcsin, "ACOS": np.arccos, "ATAN": np.arctan, "ASINH": np.arcsinh, "ACOSH": np.arccosh},
    **{"ATANH": np.arctanh, "ATAN2": np.arctan2, "FABS": np.fabs, "REMAINDER": lambda a, b: a - b * np.rint(a / b)},
}
_EXACT = {*COMPARE, *LOGIC, "NOT", "SELECT", "IF_ELSE_ZERO", "NEG", "TWICE", "SIGN", "FMIN", "FMAX", "FABS", "FLOOR"}
_EXACT |= {"CEIL", "INPUT", "COPYSIGN"}
_JUMPS = {*COMPARE, "SIGN", "FLOOR", "CEIL"}


class Rounding:
    """Samples of a law whose operations are rounded at random."""

    def __init__(self, export: Export) -> None:
        """Read the operations."""
        self._nodes, self._results = graph(export.law.function)
        self._outputs = len(export.law.select(Kind.OUTPUT))
        labels = [variable for variable in export.law.given for _ in variable.starts]
        self._states = [i for i, variable in enumerate(labels) if variable.kind in STATES]
        self._random = np.random.default_rng(0)
        unit = 2.0**-53 if export.real is DOUBLE else 2.0**-24
        self._units = [
            (2.0**-46 if wide else 2.0 * unit if node.operation in CALLS else unit) * _is_rounded(node, export)
            for node, wide in zip(self._nodes, export.wide_nodes, strict=True)
        ]

    def sample(self, given: np.ndarray) -> tuple[np.ndarray, bool]:
        """Return the results of a sample, and whether rounding makes a decision that matters."""
        values = self._values(given, {}, self._units)
        found = values[self._results]
        near = [i for i, node in enumerate(self._nodes) if node.operation in _JUMPS and self._is_near(node, values)]
        if not near:
            return found, False
        each = dict(zip(near, np.eye(len(near), dtype=bool), strict=True))
        others = self._values(np.repeat(given[:, :1], len(near), axis=1), each, [0.0] * len(self._nodes))[self._results]
        size = np.abs(others) + np.abs(found[:, :1])
        alike = (values[near] == values[near][:, :1]).all(axis=0)  # runs with the decisions of the exact one
        spread = np.max(np.abs(found - found[:, :1])[:, alike], axis=1, keepdims=True)
        matters = ~(np.abs(others - found[:, :1]) <= _SAME * size + _ROUNDING_MARGIN * spread).all(axis=0)
        decided = {number: np.arange(RUNS) % 2 == 1 for number, counts in zip(near, matters, strict=True) if counts}
        return (self._values(given, decided, self._units)[self._results], True) if decided else (found, False)

    def after(self, given: np.ndarray, results: np.ndarray) -> np.ndarray:
        """Return the arguments of the next sample, with the same inputs."""
        following = given.copy()
        following[self._states] = results[self._outputs :]
        return following

    def _values(self, given: np.ndarray, flipped: Mapping[int, np.ndarray], units: Sequence[float]) -> np.ndarray:
        """Return the values of all operations, with the other decision where it is flipped."""
        values = np.empty((len(self._nodes), given.shape[1]))
        noise = self._random.uniform(-1.0, 1.0, values.shape) * np.reshape(units, (-1, 1))
        noise[:, 0] = 0.0
        with np.errstate(all="ignore"):
            for i, node in enumerate(self._nodes):
                if node.operation == "INPUT":
                    values[i] = given[int(node.value)]
                elif node.operation == "CONST":
                    values[i] = node.value
                else:
                    function = _FUNCTIONS.get(node.operation) or getattr(np, node.operation.lower())
                    values[i] = function(*(values[argument] for argument in node.arguments))
                if i in flipped:
                    values[i] = np.where(flipped[i], _other_class(node, values, i), values[i])
                if units[i]:
                    # integers such as counts have no rounding errors
                    values[i] *= 1.0 + np.where(values[i] == np.round(values[i]), 0.0, noise[i])
        return values

    def _is_near(self, node: Node, values: np.ndarray) -> bool:
        """Return whether the sides of a decision are as close as rounding."""
        first = values[node.arguments[0]]
        if node.operation in COMPARE:
            gap = first - values[node.arguments[1]]
        else:
            gap = first if node.operation == "SIGN" else first - np.round(first)
        spread = np.max(np.abs(gap - gap[0]))
        return bool(spread > 0.0 and abs(gap[0]) <= _ROUNDING_MARGIN * spread)


def _is_rounded(node: Node, export: Export) -> bool:
    if node.operation == "CONST":
        return export.real is not DOUBLE and float(np.float32(node.value)) != node.value
    return node.operation not in _EXACT


def _other_class(node: Node, values: np.ndarray, number: int) -> np.ndarray:
    """Return the other side of a decision."""
    value: np.ndarray = values[number]
    first: np.ndarray = values[node.arguments[0]]
    if node.operation in COMPARE:
        return 1.0 - value
    return -value if node.operation == "SIGN" else value + np.where(first > np.round(first), -1.0, 1.0)


SEGMENTS: Final = (
    ("at rest", 2, 0.0),
    ("forward, 10 mm/s", 7, 1e-2),
    ("backward, 10 mm/s", 7, -1e-2),
    ("at rest", 3, 0.0),
    ("forward, 0.1 m/s", 6, 0.1),
    ("backward, 0.1 m/s", 6, -0.1),
    ("forward, 1 mm/s", 2, 1e-3),
    ("backward, 1 mm/s", 2, -1e-3),
    ("forward, 1 mm/s", 2, 1e-3),
    ("to the upper limit", 2, 0.1),
    ("to the lower limit", 3, -0.5),
    ("forward, 10 mm/s", 4, 1e-2),
    ("commands switched off", 2, 1e-2),
    ("commands at their start values", 3, -1e-2),
    ("commands switched on one by one, with a sample between them", 6, -1e-2),
    ("commands at their start values", 2, 1e-2),
)
"""Text, number of samples and peak velocity [m/s or rad/s] of each part of the motion."""

EXACT: Final = frozenset({"fabs", "floor", "ceil", "sqrt", "fma", "copysign"})
"""Functions of the C library that IEEE 754 determines to the last bit."""

N: Final = sum(count for _, count, _ in SEGMENTS)
"""Number of samples."""

_ORIGIN: Final = 0.3  # m; far enough from zero to need the lower part of a pair
_REACH: Final = (1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6)  # factors of the inputs on the way to a limit
_FACTORS: Final = (1.0, 0.9, 1.1, 0.7, 1.3, 0.5, 0.0)  # of the change of inputs, for another decision
_MARGIN: Final = 4.0  # of the tolerance over the largest deviation of runs with random rounding
# by unit; a length is near the difference of two positions, so that a dead-band of this size has an effect
_OTHER: Final = {"m": 5e-5, "rad": 5e-5, "m/s": 1e-3, "rad/s": 1e-3, "kg": 1.0}  # by unit
_MOST: Final = 64.0  # largest count
_CHANGE: Final = 0.01  # of a parameter that the samples must show


@dataclass(frozen=True)
class Vectors:
    """Samples of one run that starts with the start values of the export."""

    given: Mapping[str, np.ndarray]
    """Inputs by name, as the type of the export holds them."""
    expected: np.ndarray
    """Outputs in double."""
    allowed: np.ndarray
    """Largest difference of an output from its expected value."""
    relative: float
    """Smallest tolerance relative to an output; 0 if outputs must equal the expected values."""
    limited: bool
    """Whether an output reaches ``u_min`` and ``u_max``."""
    untested: tuple[str, ...]
    """Parameters whose change by 1 % no output shows."""
    repeated: tuple[int, ...]
    """Samples, counted from 1, that repeat the inputs before because an output would not be finite."""
    doubtful: tuple[int, ...]
    """Samples, counted from 1, in which rounding makes a decision that matters."""
    second: Vectors | None = None
    """Samples of another run with the parameters `settings`, which switch on the terms that the start values omit."""
    settings: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    """These parameters."""

    @property
    def exact(self) -> bool:
        """Whether outputs must be equal to the expected values."""
        return self.relative == 0.0


def parts() -> list[tuple[int, int, str]]:
    """Return the first and the last sample of each part of the motion, counted from 1, and its text."""
    ends = accumulate((count for _, count, _ in SEGMENTS), initial=0)
    return [(a + 1, b, text) for (a, b), (text, _, _) in zip(pairwise(ends), SEGMENTS, strict=True)]


def inputs(export: Export) -> dict[str, np.ndarray]:
    """Return the inputs of the test vectors of an export."""
    run = _Run(export)
    return _decided(export, run, _finite(export, run, _inputs(export, _reach(export, run)[0]))[0])[0]


def vectors(export: Export) -> Vectors:
    """Return the test vectors of an export."""
    first, settings = _vectors(export), _others(export)
    if not settings:
        return first
    second = _vectors(replace(export, start={**export.start, **settings}))
    shown = [name for name in first.untested if name in settings or name in second.untested]
    return replace(first, second=second, settings=settings, untested=tuple(shown))


def _others(export: Export) -> dict[str, tuple[float, ...]]:
    """Return other values of the parameters that are 0, 1, switches or counts, if the law accepts them."""
    found: dict[str, tuple[float, ...]] = {}
    given = _inputs(export, 1.0)
    for variable in export.law.select(*PARAMETERS):
        for values in _other(variable, export.start[variable.name]):
            other = {**export.start, **found, variable.name: values}
            plain = {v.name: other[v.name] if v.kind in VECTORS else other[v.name][0] for v in export.law.given}
            if export.law.conditions.violated({v.name: plain[v.name] for v in export.law.select(*PARAMETERS)}):
                continue
            if np.isfinite(_Run(replace(export, start=other)).outputs(given)).all():
                found[variable.name] = values
                break
    return found


def _other(variable: Variable, start: tuple[float, ...]) -> Iterator[tuple[float, ...]]:
    """Return other values of a parameter that is 0, 1, a switch or a count, to be tried in turn."""
    if variable.kind in BOOLEANS:
        yield tuple(1.0 - value for value in start)
    elif not any(start):
        for size in (_OTHER.get(unit_text(variable), 0.5), 2.0):  # a pair of zeros must be outside the unit circle
            yield tuple(min(max(size * (1.0 + 0.1 * (i % 3)), variable.min), variable.max) for i in range(len(start)))
    elif len(start) == 1 and unit_text(variable) == "":
        if start[0] == 1.0 and variable.min <= 0.75:
            yield (0.75,)
        elif start[0] > 1.0 and start[0].is_integer() and variable.max <= _MOST:  # a count
            yield (variable.max if start[0] < variable.max else 0.5 * variable.max,)


def _vectors(export: Export) -> Vectors:
    run = _Run(export)
    reach, limited = _reach(export, run)
    given, repeated = _finite(export, run, _inputs(export, reach))
    given, deviation, doubtful = _decided(export, run, given)
    expected = run.outputs(given)
    outputs = export.law.select(Kind.OUTPUT)
    # a pair holds a position; its resolution is the resolution of the motion about the first one
    offsets = np.array([row if v.name in export.pairs else 0.0 for v, row in zip(outputs, expected[0], strict=True)])
    values = expected - offsets
    functions = {name.removesuffix(export.real.suffix) for name in export.kernel.functions}
    relative = 3e-5 if export.real is not DOUBLE else 0.0 if functions <= EXACT else 1e-12
    size = np.array([np.median(np.abs(column[column != 0.0])) if column.any() else 0.0 for column in values.T])
    allowed = relative * np.maximum(np.abs(values), size)
    if relative:
        allowed = np.maximum(allowed, _MARGIN * deviation)
    untested = tuple(
        variable.name
        for variable in export.law.select(*PARAMETERS)
        if (np.abs(run.outputs(given, changed=variable) - expected) <= allowed).all()
    )
    return Vectors(given, expected, allowed, relative, limited, untested, repeated, doubtful)


def _decided(
    export: Export, run: _Run, given: Mapping[str, np.ndarray]
) -> tuple[dict[str, np.ndarray], np.ndarray, tuple[int, ...]]:
    """Return inputs with which rounding makes no decision that matters, as far as possible."""
    rounding = Rounding(export)
    names = [v.name for v in export.law.select(*INPUTS)]
    reals = [v for v in export.law.select(*INPUTS) if v.kind not in BOOLEANS]
    found = {name: column.copy() for name, column in given.items()}
    arguments = np.repeat(run.start[:, np.newaxis], RUNS, axis=1)
    deviation = np.zeros((N, len(export.law.select(Kind.OUTPUT))))
    doubtful = []
    for k in range(N):
        for factor in _FACTORS:
            for variable in reals if k else ():
                column, before = given[variable.name], found[variable.name][k - 1]
                moved = np.array([before + factor * (column[k] - column[k - 1])])
                found[variable.name][k] = column[k] if factor == 1.0 else _held(export, variable, moved)[0]
            arguments[run.inputs] = np.array([found[name][k] for name in names]).reshape(-1, 1)
            results, decides = rounding.sample(arguments)
            if not (decides and k):
                break
        else:
            doubtful.append(k + 1)
        deviation[k] = np.max(np.abs(results[: deviation.shape[1]] - results[: deviation.shape[1], :1]), axis=1)
        arguments = rounding.after(arguments, results)
    return found, deviation, tuple(doubtful)


def _reach(export: Export, run: _Run) -> tuple[float, bool]:
    """Return the smallest factor of the inputs with which an output reaches both of its limits; 1 if none does."""
    limits = [export.start[name][0] for name in ("u_max", "u_min") if name in export.start]
    if len(limits) < 2:
        return 1.0, False
    first = min(first for first, _, text in parts() if text.endswith("limit"))
    for factor in _REACH:
        found = run.outputs(_inputs(export, factor))[first - 1 :]
        if np.isfinite(found).all() and all((found == run.rounded(limit)).any() for limit in limits):
            return factor, True
    return 1.0, False


def _finite(export: Export, run: _Run, given: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], tuple[int, ...]]:
    """Return the inputs with repeated samples in place of those with outputs that are not finite, and their numbers."""
    given = {name: column.copy() for name, column in given.items()}
    repeated: list[int] = []
    while True:
        found = run.outputs(given)
        wrong = ~(np.isfinite(found) & (np.abs(found) <= export.real.largest)).all(axis=1)
        if not wrong.any():
            return given, tuple(repeated)
        k = int(np.argmax(wrong))
        if k == 0 or (repeated and k + 1 <= repeated[-1]):
            raise FrictionError(
                f"{export.law.name} has an output that is not finite in sample {k + 1} of its unit test, where the "
                f"inputs are {', '.join(f'{name} = {column[k]:g}' for name, column in given.items())}; correct the law "
                "or its start values"
            )
        repeated.append(k + 1)
        for column in given.values():
            column[k] = column[k - 1]


def _inputs(export: Export, reach: float) -> dict[str, np.ndarray]:
    """Return the inputs by name; the inputs with the same unit follow one another with a lag of one sample."""
    Ts = export.start["Ts"][0]
    speed, way, other = _motion(reach)
    change = np.append(0.0, np.diff(speed))
    position = np.round(Ts * np.cumsum(speed), 10)
    found: dict[str, np.ndarray] = {}
    for variable in export.law.select(*INPUTS):
        start = variable.starts[0]
        earlier = [v for v in export.law.select(*INPUTS) if v.name in found]
        if variable.kind in BOOLEANS:
            switched = (
                "commands switched off" if start else "commands switched on one by one, with a sample between them"
            )
            moments = [k for k, text in enumerate(way) if text == switched][:: 1 if start else 2]
            if not start:
                moments = [moments[sum(v.kind in BOOLEANS and not v.starts[0] for v in earlier) % len(moments)]]
            found[variable.name] = np.where(np.isin(np.arange(N), moments), 1.0 - start, start)
            continue
        unit = unit_text(variable)
        before = sum(unit_text(v) == unit for v in earlier)
        shape, offset = {
            **dict.fromkeys(("m", "rad"), (position, _ORIGIN)),
            **dict.fromkeys(("m/s", "rad/s"), (speed, 0.0)),
            **dict.fromkeys(("m/s2", "rad/s2"), (np.round(change / 1e-2, 4), 0.0)),
        }.get(unit, (0.7 * max(abs(start), 1.0) * other, start))
        lagged = np.append(np.full(before, shape[0]), shape[: N - before])
        values = np.round(offset + (1.0 - 0.02 * before) * lagged, 12)
        found[variable.name] = _held(export, variable, values)
    return found


def _motion(reach: float) -> tuple[np.ndarray, list[str], np.ndarray]:
    """Return velocity, text of the part, and the shape of all other inputs, by sample."""
    speed, text, other = [], [], []
    for title, count, peak in SEGMENTS:
        phase = np.pi * np.arange(1, count + 1) / (count + 1)
        factor = reach if title.endswith("limit") else 1.0
        speed += list(factor * peak * np.sin(phase))
        other += list(factor * np.sign(peak) * (0.6 + 0.4 * np.cos(phase)) if peak else np.full(count, 0.4))
        text += [title] * count
    return np.round(speed, 6), text, np.round(other, 4)


def _held(export: Export, variable: Variable, values: np.ndarray) -> np.ndarray:
    """Return values as the export holds them: in double, in float, or in a pair of floats."""
    if export.real is DOUBLE or variable.kind in BOOLEANS:
        return values
    high = values.astype(np.float32).astype(float)
    return high + (values - high).astype(np.float32) if variable.name in export.pairs else high


class _Run:
    """Runs of the law in double from its start values, with the states fed back."""

    def __init__(self, export: Export) -> None:
        law = export.law
        labels = [variable for variable in law.given for _ in variable.starts]
        self._export = export
        self.start = np.concatenate([_held(export, v, np.array(export.start[v.name])) for v in law.given])
        self._names = [v.name for v in labels]
        self.inputs = [i for i, v in enumerate(labels) if v.kind in INPUTS]
        self._states = [i for i, v in enumerate(labels) if v.kind in STATES]
        self._evaluator = _Evaluator(law)

    def rounded(self, value: float) -> float:
        """Return a number in the type of the export."""
        return value if self._export.real is DOUBLE else float(np.float32(value))

    def outputs(self, given: Mapping[str, np.ndarray], *, changed: Variable | None = None) -> np.ndarray:
        """Return the outputs of every sample."""
        arguments = self.start.copy()
        if changed is not None:
            mine = [name == changed.name for name in self._names]
            values = arguments[mine]
            if changed.kind in BOOLEANS:
                arguments[mine] = 1.0 - values
            else:
                arguments[mine] = np.where(values == 0.0, _CHANGE, values * (1.0 + _CHANGE))
        count = len(self._export.law.select(Kind.OUTPUT))
        found = np.empty((N, count))
        for k, row in enumerate(_rows(given, [self._names[i] for i in self.inputs])):
            arguments[self.inputs] = row
            results = self._evaluator(arguments)
            found[k], arguments[self._states] = results[:count], results[count:]
        return found


def _rows(given: Mapping[str, np.ndarray], names: list[str]) -> Iterator[list[float]]:
    return ([float(given[name][k]) for name in names] for k in range(N))


class _Evaluator:
    """One sample of a law by casadi."""

    def __init__(self, law: Law) -> None:
        self._buffer, self._evaluate = law.function.buffer()
        self._given = np.zeros(law.function.n_in())
        self._found = np.zeros(law.function.n_out())
        for i in range(self._given.size):
            self._buffer.set_arg(i, memoryview(self._given[i : i + 1]))  # type: ignore[call-arg, arg-type]
        for i in range(self._found.size):
            self._buffer.set_res(i, memoryview(self._found[i : i + 1]))  # type: ignore[call-arg, arg-type]

    def __call__(self, arguments: np.ndarray) -> np.ndarray:
        self._given[:] = arguments
        self._evaluate()
        return self._found.copy()
