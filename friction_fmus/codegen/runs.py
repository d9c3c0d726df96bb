"""Runs of an exported law in double, with the right operations or with a wrong one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from friction_fmus.codegen.layout import INPUTS, STATES, Export, Values
from friction_fmus.codegen.rounding import Rounding
from friction_fmus.lawkit.declarations import PARAMETERS
from friction_fmus.lawkit.emit.c_text import DOUBLE
from friction_fmus.lawkit.emit.operations import Node
from friction_fmus.lawkit.law import BOOLEANS, Kind, Law, LawVariable

LOST: Final = 2  # number of samples with an invalid input, one after the other
_CELLS: Final = 2**19  # of a table in memory
_CHANGE: Final = 0.01  # of a parameter
_WRONG: Final[Mapping[str, Callable[..., Any]]] = {
    **{"ADD": np.subtract, "SUB": np.add, "MUL": np.divide, "DIV": np.multiply, "TWICE": lambda a: 2.0 / a},
    **{"LT": np.greater, "LE": np.greater_equal, "AND": np.logical_or, "OR": np.logical_and},
}


class Run:
    """A run of a law, with the states fed back.

    It begins with the start values of the export, but for `settings`. Before the sample `lost`, if it is not 0, there
    are `LOST` samples with an invalid input.
    """

    def __init__(self, export: Export, settings: Values = MappingProxyType({}), lost: int = 0) -> None:
        """Take the start values."""
        law, start = export.law, {**export.start, **settings}
        self.settings, self.lost = settings, lost
        labels = [variable for variable in law.given for _ in variable.starts]
        self.start = np.concatenate([held(export, v, np.array(start[v.name])) for v in law.given])
        self._names = [v.name for v in export.law.select(*INPUTS)]
        self._inputs = [i for i, v in enumerate(labels) if v.kind in INPUTS]
        self._states = [i for i, v in enumerate(labels) if v.kind in STATES]
        self._tally = [i for i, v in enumerate(labels) if v.tally]
        self._evaluator = _Evaluator(law)
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
        """Number them."""
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
            results = self._rounding.exact(arguments, wrong, _other)
            outputs = results[: allowed.shape[2]].reshape(-1, *first.shape)
            right = np.abs(outputs - outputs[:, :, :1]) <= allowed[:, k].T[:, :, np.newaxis]
            first[~right.all(axis=0) & (first == count)] = k
            arguments = self._rounding.after(arguments, results)
            for place, mine in kept:
                arguments[place, mine] = 0.0
        return first[:, 1:]


def _other(node: Node, values: np.ndarray, _: int) -> Any:
    return _WRONG[node.operation](*(values[argument] for argument in node.arguments))


def held(export: Export, variable: LawVariable, values: np.ndarray) -> np.ndarray:
    """Return values as the export holds them: in double, in float, or in a pair of floats."""
    if export.real is DOUBLE or variable.kind in BOOLEANS:
        return values
    high = values.astype(np.float32).astype(float)
    return high + (values - high).astype(np.float32) if variable.name in export.pairs else high


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
