"""The equations of a law as one casadi function with scalar results."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from casadi import SX, Function, vertcat

from friction_fmus.errors import FrictionError, nearest
from friction_fmus.lawkit.declarations import Kind, Variable
from friction_fmus.lawkit.labels import Label, labelled

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
    where: str, equations: Equations, declared: tuple[Variable, ...], variables: tuple[Variable, ...]
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
    where: str, equations: Equations, declared: tuple[Variable, ...], variables: tuple[Variable, ...]
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
                f"{where} returns {key!r}, which is neither a declared output nor a state{nearest(str(key), results)}"
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


def scalars(where: str, variable: Variable, value: Any) -> list[SX]:
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
