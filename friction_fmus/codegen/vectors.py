"""Test vectors of an exported law: inputs of one run, and its outputs computed in double by casadi."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from friction_fmus.codegen.layout import INPUTS, STATES, Export, Values
from friction_fmus.codegen.sources import unit_text
from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.declarations import PARAMETERS
from friction_fmus.lawkit.emit.c_text import DOUBLE
from friction_fmus.lawkit.emit.operations import CALLS, COMPARE, LOGIC, Node, graph
from friction_fmus.lawkit.law import BOOLEANS, VECTORS, Kind, LawVariable
from friction_fmus.lawkit.results import Evaluator

LOST: Final = 2  # number of samples with an invalid input, one after the other
_CELLS: Final = 2**19  # of a table in memory
_CHANGE: Final = 0.01  # of a parameter
_WRONG: Final[Mapping[str, Callable[..., Any]]] = {
    **{"ADD": np.subtract, "SUB": np.add, "MUL": np.divide, "DIV": np.multiply, "TWICE": lambda a: 2.0 / a},
    **{"LT": np.greater, "LE": np.greater_equal, "AND": np.logical_or, "OR": np.logical_and},
}


class Run:
    """A run of a law, with the states fed back."""

    # It begins with the start values of the export, but for `settings`. Before the sample `lost`, if it is not 0, there
    # are `LOST` samples with an invalid input.

    def __init__(self, export: Export, settings: Values = MappingProxyType({}), lost: int = 0) -> None:
        law, start = export.law, {**export.start, **settings}
        self.settings, self.lost = settings, lost
        labels = [variable for variable in law.given for _ in variable.starts]
        self.start = np.concatenate([held(export, v, np.array(start[v.name])) for v in law.given])
        self._names = [v.name for v in export.law.select(*INPUTS)]
        self._inputs = [i for i, v in enumerate(labels) if v.kind in INPUTS]
        self._states = [i for i, v in enumerate(labels) if v.kind in STATES]
        self._tally = [i for i, v in enumerate(labels) if v.tally]
        self._evaluator = Evaluator(law.function)
        self._outputs = len(law.select(Kind.OUTPUT))

    def enter(self, arguments: np.ndarray, given: Mapping[str, np.ndarray], k: int) -> None:
        """Set the inputs of a sample, in every column."""
        row = np.array([given[name][k] for name in self._names])
        arguments[self._inputs] = row.reshape(-1, *(1,) * (arguments.ndim - 1))
        arguments[self._tally] += LOST * (0 < k == self.lost)

    def outputs(self, given: Mapping[str, np.ndarray], count: int) -> np.ndarray:
        """Return the outputs of every sample."""
        arguments = self.start.copy()
        found = np.empty((count, self._outputs))
        for k in range(count):
            self.enter(arguments, given, k)
            results = self._evaluator(arguments)
            found[k], arguments[self._states] = results[: self._outputs], results[self._outputs :]
        return found


@dataclass(frozen=True)
class Samples:
    """Samples of a run."""

    run: Run  # the run
    given: Mapping[str, np.ndarray]  # inputs by name, as the type of the export holds them
    expected: np.ndarray  # outputs in double
    allowed: np.ndarray  # largest difference of an output from its expected value
    doubtful: tuple[int, ...] = ()  # samples, counted from 1, in which rounding makes a decision that matters

    def first(self, count: int) -> Samples:
        """Return the first samples."""
        given = {name: column[:count] for name, column in self.given.items()}
        doubtful = tuple(k for k in self.doubtful if k <= count)
        return Samples(self.run, given, self.expected[:count], self.allowed[:count], doubtful)


class Faults:
    """The faults that samples can show: another value of a parameter, a wrong operation, a state that stays 0."""

    def __init__(self, export: Export, rounding: Rounding) -> None:
        self._rounding = rounding
        labels = [variable for variable in export.law.given for _ in variable.starts]
        self.parameters = export.law.select(*PARAMETERS)
        self._places = [[i for i, v in enumerate(labels) if v is parameter] for parameter in self.parameters]
        wrong = [i for i, node in enumerate(rounding.nodes) if node.operation in _WRONG]
        self._wrong = {node: len(self.parameters) + i for i, node in enumerate(wrong)}
        states = [i for i, v in enumerate(labels) if v.kind in STATES and not v.tally]
        self._states = {place: len(self.parameters) + len(wrong) + i for i, place in enumerate(states)}
        self.all = np.arange(len(self.parameters) + len(wrong) + len(states))

    def shown(self, trials: Sequence[Samples], faults: np.ndarray) -> np.ndarray:
        """Return the first sample of each run that shows each of these faults; the number of samples if none does."""
        columns = max(_CELLS // len(self._rounding.nodes), 2)
        most = max(columns // (faults.size + 1), 1)
        parts = [faults[i : i + columns] for i in range(0, faults.size, columns)]
        rows = [[self._shown(trials[k : k + most], part) for part in parts] for k in range(0, len(trials), most)]
        return np.block(rows)

    def _shown(self, trials: Sequence[Samples], faults: np.ndarray) -> np.ndarray:
        columns = np.append(-1, faults)
        each = np.tile(columns, len(trials))
        arguments = np.repeat(np.transpose([trial.run.start for trial in trials]), columns.size, axis=1)
        for number, (variable, places) in enumerate(zip(self.parameters, self._places, strict=True)):
            own = [variable.name not in trial.run.settings for trial in trials]  # the test does not set it
            mine = np.ix_(np.array(places), np.flatnonzero((each == number) & np.repeat(own, columns.size)))
            values = arguments[mine]
            near = np.where(values == 0.0, _CHANGE, values * (1.0 + _CHANGE))
            arguments[mine] = 1.0 - values if variable.kind in BOOLEANS else near
        wrong = {node: each == fault for node, fault in self._wrong.items() if fault in faults}
        kept = [(place, each == fault) for place, fault in self._states.items() if fault in faults]
        allowed = np.stack([trial.allowed for trial in trials])
        count = allowed.shape[1]
        first = np.full((len(trials), columns.size), count)
        for k in range(count):
            for i, trial in enumerate(trials):
                trial.run.enter(arguments[:, i * columns.size : (i + 1) * columns.size], trial.given, k)
            results = self._rounding.exact(arguments, wrong, _mistaken)
            outputs = results[: allowed.shape[2]].reshape(-1, *first.shape)
            right = np.abs(outputs - outputs[:, :, :1]) <= allowed[:, k].T[:, :, np.newaxis]
            first[~right.all(axis=0) & (first == count)] = k
            arguments = self._rounding.after(arguments, results)
            for place, mine in kept:
                arguments[place, mine] = 0.0
        return first[:, 1:]


def _mistaken(node: Node, values: np.ndarray, _: int) -> Any:
    return _WRONG[node.operation](*(values[argument] for argument in node.arguments))


def held(export: Export, variable: LawVariable, values: np.ndarray) -> np.ndarray:
    """Return values as the export holds them: in double, in float, or in a pair of floats."""
    if export.real is DOUBLE or variable.kind in BOOLEANS:
        return values
    high = values.astype(np.float32).astype(float)
    return high + (values - high).astype(np.float32) if variable.name in export.pairs else high


RUNS = 17  # number of runs; the first one is exact

Other = Callable[["Node", np.ndarray, int], Any]
_DECISION_MARGIN = 4.0  # of a decision over the largest deviation of its sides
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
        self.nodes, self._results = graph(export.law.function)
        self._outputs = len(export.law.select(Kind.OUTPUT))
        labels = [variable for variable in export.law.given for _ in variable.starts]
        self._states = [i for i, variable in enumerate(labels) if variable.kind in STATES]
        self._random = np.random.default_rng(0)
        self._functions = [
            _FUNCTIONS.get(node.operation) or getattr(np, node.operation.lower(), None) for node in self.nodes
        ]
        unit = 2.0**-53 if export.real is DOUBLE else 2.0**-24
        self._units = [
            (2.0**-46 if wide else 2.0 * unit if node.operation in CALLS else unit) * _is_rounded(node, export)
            for node, wide in zip(self.nodes, export.wide_nodes, strict=True)
        ]

    def sample(self, given: np.ndarray) -> tuple[np.ndarray, bool]:
        """Return the results of a sample, and whether rounding makes a decision that matters."""
        values = self._values(given, {}, self._units, _opposite)
        found = values[self._results]
        near = [i for i, node in enumerate(self.nodes) if node.operation in _JUMPS and self._is_near(node, values)]
        if not near:
            return found, False
        each = dict(zip(near, np.eye(len(near), dtype=bool), strict=True))
        others = self.exact(np.repeat(given[:, :1], len(near), axis=1), each, _opposite)
        size = np.abs(others) + np.abs(found[:, :1])
        alike = (values[near] == values[near][:, :1]).all(axis=0)  # runs with the decisions of the exact one
        spread = np.max(np.abs(found - found[:, :1])[:, alike], axis=1, keepdims=True)
        matters = ~(np.abs(others - found[:, :1]) <= _SAME * size + _DECISION_MARGIN * spread).all(axis=0)
        decided = {number: np.arange(RUNS) % 2 == 1 for number, counts in zip(near, matters, strict=True) if counts}
        return (
            (self._values(given, decided, self._units, _opposite)[self._results], True) if decided else (found, False)
        )

    def exact(self, given: np.ndarray, flipped: Mapping[int, np.ndarray], other: Other) -> np.ndarray:
        """Return the results without rounding, with another result of the operations that are flipped."""
        return self._values(given, flipped, [0.0] * len(self.nodes), other)[self._results]

    def after(self, given: np.ndarray, results: np.ndarray) -> np.ndarray:
        """Return the arguments of the next sample, with the same inputs."""
        following = given.copy()
        following[self._states] = results[self._outputs :]
        return following

    def _values(
        self, given: np.ndarray, flipped: Mapping[int, np.ndarray], units: Sequence[float], other: Other
    ) -> np.ndarray:
        """Return the values of all operations, with the other result where it is flipped."""
        values = np.empty((len(self.nodes), given.shape[1]))
        rows = list(values)
        with np.errstate(all="ignore"):
            for i, (row, node, function) in enumerate(zip(rows, self.nodes, self._functions, strict=True)):
                if isinstance(function, np.ufunc):
                    function(*[rows[argument] for argument in node.arguments], out=row)
                elif function:
                    row[:] = function(*[rows[argument] for argument in node.arguments])
                else:
                    row[:] = given[int(node.value)] if node.operation == "INPUT" else node.value
                if i in flipped:
                    np.copyto(row, other(node, values, i), where=flipped[i])
                if units[i]:
                    noise = units[i] * self._random.uniform(-1.0, 1.0, given.shape[1] - 1)
                    # integers such as counts have no rounding errors
                    row[1:] *= 1.0 + np.where(row[1:] == np.round(row[1:]), 0.0, noise)
        return values

    def _is_near(self, node: Node, values: np.ndarray) -> bool:
        """Return whether the sides of a decision are as close as rounding."""
        first = values[node.arguments[0]]
        if node.operation in COMPARE:
            gap = first - values[node.arguments[1]]
        else:
            gap = first if node.operation == "SIGN" else first - np.round(first)
        spread = np.max(np.abs(gap - gap[0]))
        return bool(spread > 0.0 and abs(gap[0]) <= _DECISION_MARGIN * spread)


def _is_rounded(node: Node, export: Export) -> bool:
    if node.operation == "CONST":
        return export.real is not DOUBLE and float(np.float32(node.value)) != node.value
    return node.operation not in _EXACT


def _opposite(node: Node, values: np.ndarray, number: int) -> np.ndarray:
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

N: Final = sum(count for _, count, _ in SEGMENTS)  # number of samples
_ORIGIN: Final = 0.3  # m; far enough from zero to need the lower part of a pair
_REACH: Final = (1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6)  # factors of the inputs on the way to a limit
_FACTORS: Final = (1.0, 0.9, 1.1, 0.7, 1.3, 0.5, 0.0)  # of the change of inputs, for another decision
_MARGIN: Final = 4.0  # of the tolerance over the largest deviation of runs with random rounding
# by unit; a length is near the difference of two positions, so that a dead-band of this size has an effect
_OTHER: Final = {"m": 5e-5, "rad": 5e-5, "m/s": 1e-3, "rad/s": 1e-3, "kg": 1.0}  # by unit
_MOST: Final = 64.0  # largest count
_LIMITS: Final = {"u_min": -1e30, "u_max": 1e30}  # as good as none
_RUNS: Final = 4
_SCREENED: Final = 64  # faults
_TRIALS: Final = 24  # of which the next runs are chosen
_TRIES: Final = 4  # of a parameter that conditions constrain
_SWITCHED: Final = (0.0, 0.03, 0.1, 0.2)  # part of the samples
_LOST: Final = 6
_OFF: Final = 0.1  # part of the runs in which a parameter is 0
_OTHERS: Final = (0.6, 0.8)  # part of the runs in which a parameter that is 0, or is not, is another one
_SLOW: Final = (1.0, 1.0, 1.0, 1.0, 1e-5)


@dataclass(frozen=True)
class Vectors:
    """Samples of runs from the start on, the first one with the start values of the export."""

    runs: tuple[Samples, ...]  # the samples
    relative: float  # smallest tolerance relative to an output; 0 if outputs must equal the expected values
    limited: bool  # whether outputs reach ``u_min`` and ``u_max``
    untested: tuple[str, ...]  # parameters whose change by 1 % no output shows
    repeated: tuple[int, ...]  # samples of run 1 with the inputs before, as an output is not finite; from 1

    @property
    def exact(self) -> bool:
        """Whether outputs must be equal to the expected values."""
        return self.relative == 0.0


def parts() -> list[tuple[int, int, str]]:
    """Return the first and the last sample of each part of the motion, counted from 1, and its text."""
    ends = accumulate((count for _, count, _ in SEGMENTS), initial=0)
    return [(a + 1, b, text) for (a, b), (text, _, _) in zip(pairwise(ends), SEGMENTS, strict=True)]


def inputs(export: Export) -> dict[str, np.ndarray]:
    """Return the inputs of the first run of the test vectors of an export."""
    run = Run(export)
    given = _finite(export, run, _inputs(export, _reach(export, run)[0]))[0]
    return _decided(export, run, Rounding(export), given)[0]


def vectors(export: Export) -> Vectors:
    """Return the test vectors of an export."""
    # The first run has the start values. The others are chosen of runs with random inputs and parameters, each for the
    # number of faults that it shows and no run before, and end when it has shown them.
    functions = {name.removesuffix(export.real.suffix) for name in export.kernel.functions}
    relative = 3e-5 if export.real is not DOUBLE else 0.0 if functions <= EXACT else 1e-12
    rounding, run = Rounding(export), Run(export)
    faults = Faults(export, rounding)
    reach, limited = _reach(export, run)
    given, repeated = _finite(export, run, _inputs(export, reach))
    runs = [_samples(export, run, rounding, given, relative)]
    left = faults.all[faults.shown(runs, faults.all)[0] == N]
    random = np.random.default_rng(3)
    trials = list(_drawn(export, random, relative)) if left.size else []
    while trials and left.size and len(runs) < _RUNS:
        shown = np.count_nonzero(faults.shown(trials, random.permutation(left)[:_SCREENED]) < N, axis=1)
        trial = trials.pop(int(np.argmax(shown)))
        if not shown.any():
            break
        samples = _samples(export, trial.run, rounding, trial.given, relative)
        first = faults.shown([samples], left)[0]
        if (first < N).any():
            runs.append(samples.first(int(first[first < N].max()) + 1))
            left = left[first == N]
    limited |= all(
        any(np.isclose(r.expected, r.run.settings.get(name, np.nan), rtol=1e-6).any() for r in runs) for name in _LIMITS
    )
    untested = tuple(v.name for number, v in enumerate(faults.parameters) if number in left)
    return Vectors(tuple(runs), relative, limited, untested, repeated)


def _drawn(export: Export, random: np.random.Generator, relative: float) -> Iterator[Samples]:
    """Draw parameters and inputs for other runs, whose outputs are finite; the tolerance is the smallest one."""
    moved = _inputs(export, 1.0)
    lost = _LOST if any(v.kind not in BOOLEANS for v in export.law.select(*INPUTS)) else 0
    names = [v.name for v in export.law.select(Kind.OUTPUT)]
    for _ in range(_TRIALS):
        settings = _parameters(export, random)
        given = _scaled(export, moved, random)
        found = Run(export, settings, lost).outputs(given, N)
        if _LIMITS.keys() <= settings.keys():
            force = np.median(np.abs(found[:, names.index("u")]))
            for name, limit in _LIMITS.items():
                settings[name] = (_rounded(np.sign(limit) * force * 10.0 ** random.uniform(-0.3, 1.0)),)
        run = Run(export, settings, lost)
        found = run.outputs(given, N)
        if np.isfinite(found).all() and (np.abs(found) <= export.real.largest).all():
            yield Samples(run, given, found, _allowed(export, found, relative))


def _parameters(export: Export, random: np.random.Generator) -> dict[str, tuple[float, ...]]:
    """Draw parameters that the law accepts; those that equal the start values are omitted."""
    found: dict[str, tuple[float, ...]] = {}
    parameters = export.law.select(*PARAMETERS)
    for variable in parameters:
        start = export.start[variable.name]
        for _ in range(_TRIES if random.random() < _OTHERS[any(start)] else 0):
            values = tuple(_other(variable, value, random) for value in start)
            other = {**export.start, **found, variable.name: values}
            plain = {v.name: other[v.name] if v.kind in VECTORS else other[v.name][0] for v in parameters}
            if not export.law.conditions.violated(plain):
                found |= {variable.name: values} if values != start else {}
                break
    return found


def _scaled(export: Export, moved: Mapping[str, np.ndarray], random: np.random.Generator) -> dict[str, np.ndarray]:
    """Draw the size of each input, samples at rest and other commands."""
    found = {}
    switched = random.choice(_SWITCHED)
    rests = random.random(N) < switched
    for variable in export.law.select(*INPUTS):
        column = moved[variable.name]
        if variable.kind in BOOLEANS:
            other = (random.random(N) < switched) & (np.arange(N) != _LOST - 1)
            found[variable.name] = np.where(other, 1.0 - variable.starts[0], variable.starts[0])
        else:
            factor = round(10.0 ** random.uniform(-1.0, 0.5), 2) * random.choice(_SLOW)
            moves = np.where(rests, 0.0, factor * (column - column[0]))
            found[variable.name] = held(export, variable, np.round(column[0] + moves, 12))
    return found


def _other(variable: LawVariable, start: float, random: np.random.Generator) -> float:
    """Return another value of a parameter."""
    if variable.kind in BOOLEANS:
        return float(random.random() < 0.5)
    if variable.kind is Kind.SAMPLE_TIME:
        return start
    if variable.name in _LIMITS:
        return _LIMITS[variable.name]
    unit = unit_text(variable)
    if unit == "" and 1.0 < variable.max <= _MOST and start.is_integer() and variable.min >= 0.0:
        least = int(np.ceil(variable.min))
        value = float(random.choice((int(variable.max), int(random.integers(least, int(variable.max) + 1)))))  # a count
    elif start == 0.0 and unit in ("m", "rad") and variable.min == -np.inf:  # a position
        return round(_ORIGIN + 1e-3 * random.uniform(-1.0, 1.0), 5)
    elif start != 0.0 and variable.min <= 0.0 <= variable.max and random.random() < _OFF:
        value = 0.0
    elif start == 0.0:
        value = random.choice((-1.0, 1.0)) * _OTHER.get(unit, 0.5) * 10.0 ** random.uniform(-0.3, 0.8)
    else:
        value = start * 10.0 ** (random.choice((0.3, 1.0)) * random.uniform(-1.0, 1.0))
    return min(max(_rounded(value), variable.min), variable.max)


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")


def _allowed(export: Export, expected: np.ndarray, relative: float) -> np.ndarray:
    """Return the smallest tolerances of outputs."""
    outputs = export.law.select(Kind.OUTPUT)
    # a pair holds a position; its resolution is the resolution of the motion about the first one
    offsets = np.array([row if v.name in export.pairs else 0.0 for v, row in zip(outputs, expected[0], strict=True)])
    values = np.abs(expected - offsets)
    size = np.array([np.median(column[column != 0.0]) if column.any() else 0.0 for column in values.T])
    allowed: np.ndarray = relative * np.maximum(values, size)
    return allowed


def _samples(
    export: Export, run: Run, rounding: Rounding, inputs: Mapping[str, np.ndarray], relative: float
) -> Samples:
    given, deviation, doubtful = _decided(export, run, rounding, inputs)
    expected = run.outputs(given, N)
    allowed = _allowed(export, expected, relative)
    if relative:
        allowed = np.maximum(allowed, _MARGIN * deviation)
    return Samples(run, given, expected, allowed, doubtful)


def _decided(
    export: Export, run: Run, rounding: Rounding, given: Mapping[str, np.ndarray]
) -> tuple[dict[str, np.ndarray], np.ndarray, tuple[int, ...]]:
    """Return inputs with which rounding makes no decision that matters, as far as possible."""
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
                found[variable.name][k] = column[k] if factor == 1.0 else held(export, variable, moved)[0]
            entered = arguments.copy()
            run.enter(entered, found, k)
            results, decides = rounding.sample(entered)
            if not (decides and k):
                break
        else:
            doubtful.append(k + 1)
        deviation[k] = np.max(np.abs(results[: deviation.shape[1]] - results[: deviation.shape[1], :1]), axis=1)
        arguments = rounding.after(arguments, results)
    return found, deviation, tuple(doubtful)


def _reach(export: Export, run: Run) -> tuple[float, bool]:
    """Return the smallest factor of the inputs with which an output reaches both of its limits; 1 if none does."""
    limits = [held(export, v, np.array(export.start[v.name])) for v in export.law.given if v.name in ("u_min", "u_max")]
    if len(limits) < 2:
        return 1.0, False
    first = min(first for first, _, text in parts() if text.endswith("limit"))
    for factor in _REACH:
        found = run.outputs(_inputs(export, factor), N)[first - 1 :]
        if np.isfinite(found).all() and all((found == limit).any() for limit in limits):
            return factor, True
    return 1.0, False


def _finite(export: Export, run: Run, given: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], tuple[int, ...]]:
    """Return the inputs with repeated samples in place of those with outputs that are not finite, and their numbers."""
    given = {name: column.copy() for name, column in given.items()}
    repeated: list[int] = []
    while True:
        found = run.outputs(given, N)
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
        found[variable.name] = held(export, variable, values)
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
