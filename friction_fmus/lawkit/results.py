"""The equations of a law as one casadi function with scalar results, and their labels."""

import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import casadi
import numpy as np
from casadi import SX, Function, vertcat
from numpy.typing import ArrayLike, NDArray

from friction_fmus.errors import FrictionError, did_you_mean
from friction_fmus.lawkit.declarations import Kind, LawVariable

# Names of the intermediate results of a law: the local variables of its function and of the functions that it calls.
#
# The function is executed once more under a trace, so that a law needs no declarations for readable C code.

_CASADI = str(Path(casadi.__file__).parent)


@dataclass(frozen=True, eq=False)
class Label:
    """A name of an intermediate result."""

    name: str  # python identifier
    value: SX  # the scalar expression
    depth: int  # 0 for variables of the law's own function, 1 for functions that it calls, and so on
    assigned: bool  # false for arguments and returned values of called functions, and for elements of lists


def labelled(equations: Callable[..., Any], symbols: dict[str, SX]) -> tuple[Any, list[Label]]:
    """Call the function of a law and record its intermediate results."""
    recorder = _Recorder()
    earlier = sys.gettrace()
    sys.settrace(recorder.entered)
    try:
        return equations(**symbols), recorder.labels
    finally:
        sys.settrace(earlier)


class _Recorder:
    """Trace function that compares the local variables before and after each line."""

    def __init__(self) -> None:
        self.labels: list[Label] = []
        self._known: list[dict[str, tuple[Any, int]]] = []  # local variables of active functions with lengths of lists

    def entered(self, frame: FrameType, event: str, _: Any) -> Callable[[FrameType, str, Any], Any] | None:
        """Trace a function unless it belongs to casadi or has no name."""
        code = frame.f_code
        if event != "call" or code.co_filename.startswith(_CASADI) or code.co_name.startswith("<"):
            return None
        self._known.append({})
        self._record(frame, assigned=False)
        return self._went_on

    def _went_on(self, frame: FrameType, event: str, result: Any) -> Callable[[FrameType, str, Any], Any]:
        if event in ("line", "return"):
            self._record(frame, assigned=True)
        if event == "return":
            self._known.pop()
            if self._known:
                self._add(frame.f_code.co_name, result, assigned=False)
        return self._went_on

    def _record(self, frame: FrameType, *, assigned: bool) -> None:
        known = self._known[-1]
        for name, value in frame.f_locals.items():
            old, length = known.get(name, (None, 0))
            grown = len(value) if isinstance(value, list) else 0
            if old is not value:
                self._add(name, value, assigned=assigned)
            elif grown > length:
                for i in range(length, grown):
                    self._add(f"{name}_{i}", value[i], assigned=False)
            known[name] = value, grown

    def _add(self, name: str, value: Any, *, assigned: bool) -> None:
        depth = len(self._known) - 1
        for label, scalar in _scalars(name, value):
            self.labels.append(Label(label, scalar, depth, assigned and label == name))


def _scalars(name: str, value: Any) -> Iterator[tuple[str, SX]]:
    """Yield the scalar expressions in a value, with the index of each element."""
    if isinstance(value, SX):
        if value.is_scalar() and not (value.is_constant() or value.is_symbolic()):
            yield name, value
    elif isinstance(value, list | tuple):
        for i, element in enumerate(value):
            yield from _scalars(f"{name}_{i}", element)


Equations = Callable[..., Mapping[str, Any]]


@dataclass(frozen=True, eq=False)
class Results:
    """Symbols and expressions of a law."""

    arguments: tuple[SX, ...]
    expressions: tuple[SX, ...]
    """Scalars that a sample reads, and outputs followed by next states."""
    labels: tuple[str, ...]
    names: tuple[str, ...]
    """Names of both."""


def function_of(where: str, name: str, results: Results) -> Function:
    """Return one sample as a function."""
    # unused arguments stay; the tests of the FMU find variables without effect
    options = {"allow_free": True}
    function = Function(name, results.arguments, results.expressions, results.labels, results.names, options)
    if function.has_free():
        raise FrictionError(
            f"{where} uses the symbols {', '.join(function.get_free())}, which are not its variables; "
            "declare them as arguments"
        )
    return function


def intermediate_results(
    where: str, equations: Equations, declared: tuple[LawVariable, ...], variables: tuple[LawVariable, ...]
) -> tuple[Function, tuple[Label, ...]]:
    """Return the intermediate results of a law."""
    labels: list[Label] = []

    def traced(**symbols: SX) -> Mapping[str, Any]:
        returned, found = labelled(equations, symbols)
        labels.extend(found)
        return returned  # type: ignore[no-any-return]

    results = results_of(where, traced, declared, variables)
    values = [label.value for label in labels]
    return Function("intermediate", results.arguments, [*results.expressions, *values]), tuple(labels)


def results_of(
    where: str, equations: Equations, declared: tuple[LawVariable, ...], variables: tuple[LawVariable, ...]
) -> Results:
    """Call the equations with symbols and check what they return."""
    given = [variable for variable in variables if variable.kind is not Kind.OUTPUT]
    elements = {variable.name: [SX.sym(scalar) for scalar in variable.scalars] for variable in given}
    symbols = {variable.name: vertcat(*elements[variable.name]) for variable in declared}
    try:
        returned = equations(**symbols)
    except FrictionError:
        raise
    except Exception as error:
        hint = "; write a decision as if_else(...)" if "truth value" in str(error) else ""
        reason = (str(error).strip().splitlines() or [""])[-1]
        raise FrictionError(f"{where}: its equations raise {type(error).__name__}: {reason}{hint}") from error
    if not isinstance(returned, Mapping):
        raise FrictionError(f"{where} returns a {type(returned).__name__}; return a dict of outputs and next states")

    results = {
        variable.name: variable for variable in variables if variable.kind in (Kind.OUTPUT, Kind.STATE, Kind.STATES)
    }
    for key in returned:
        if key not in results:
            raise FrictionError(
                f"{where} returns {key!r}, which is neither a declared output nor a state"
                f"{did_you_mean(str(key), results)}"
            )
    expressions, names = [], []
    for variable in sorted(results.values(), key=lambda v: v.kind is not Kind.OUTPUT):
        state = variable.kind is not Kind.OUTPUT
        if variable.name not in returned:
            what = f"a next value of the state {variable.name}" if state else f"the output {variable.name}"
            raise FrictionError(f"{where} does not return {what}")
        expressions += scalars(where, variable, returned[variable.name])
        names += [f"{scalar}_next" if state else scalar for scalar in variable.scalars]

    arguments = [symbol for variable in given for symbol in elements[variable.name]]
    labels = [scalar for variable in given for scalar in variable.scalars]
    return Results(tuple(arguments), tuple(expressions), tuple(labels), tuple(names))


def scalars(where: str, variable: LawVariable, value: Any) -> list[SX]:
    """Return the elements that the equations return for a variable."""
    if variable.kind is not Kind.STATES:
        return [_scalar(where, variable.name, value)]
    elements = list(value) if isinstance(value, list | tuple) else None
    if elements is None or len(elements) != len(variable.starts):
        raise FrictionError(f"{where}: return the next {variable.name} as a list of {len(variable.starts)} expressions")
    return [_scalar(where, scalar, element) for scalar, element in zip(variable.scalars, elements, strict=True)]


def _scalar(where: str, name: str, value: Any) -> SX:
    try:
        expression = SX(value)
    except Exception as error:
        raise FrictionError(f"{where}: {name} is a {type(value).__name__}, not an SX expression") from error
    if expression.shape != (1, 1):
        raise FrictionError(f"{where}: {name} has the shape {expression.shape}; return a scalar")
    return SX(0.0) + expression if expression.nnz() == 0 else expression


class Evaluator:
    """A function of scalars with numbers, much faster than `Function.call`; not for several threads at a time."""

    def __init__(self, function: Function) -> None:
        self._buffer, self._evaluate = function.buffer()
        self._given = np.zeros(function.n_in())
        self._found = np.zeros(function.n_out())
        for i in range(self._given.size):
            self._buffer.set_arg(i, memoryview(self._given[i : i + 1]))  # type: ignore[call-arg, arg-type]
        for i in range(self._found.size):
            self._buffer.set_res(i, memoryview(self._found[i : i + 1]))  # type: ignore[call-arg, arg-type]

    def __call__(self, arguments: ArrayLike) -> NDArray[np.float64]:
        """Return the results."""
        self._given[:] = arguments
        self._evaluate()
        return self._found.copy()
