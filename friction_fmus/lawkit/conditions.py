"""Relations between the parameters of a law, checked where values are given to them."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from casadi import SX, Function, vertcat

from friction_fmus.errors import FrictionError, nearest
from friction_fmus.lawkit.declarations import Kind, Variable, check_line

PARAMETERS = (Kind.PARAMETER, Kind.VECTOR, Kind.SWITCH, Kind.SAMPLE_TIME)
"""Kinds whose values a relation may use: those that are set before the first sample."""

Relation = Callable[..., Any]

LIMITS: Mapping[str, Relation] = MappingProxyType({"u_min <= u_max": lambda u_min, u_max: u_min <= u_max})
"""What every law with these two parameters needs, which are the limits of its output by convention."""


@dataclass(frozen=True, eq=False)
class Conditions:
    """What must hold between the parameters of a law, because the law is singular otherwise.

    Attributes
    ----------
    texts : tuple of str
        Each relation as it is told to the user, such as ``u_min <= u_max``.
    parameters : tuple of Variable
        All parameters of the law.
    function : casadi.Function
        Their scalars to one truth value for each relation.
    """

    texts: tuple[str, ...]
    parameters: tuple[Variable, ...]
    function: Function

    def violated(self, values: Mapping[str, float | tuple[float, ...]]) -> tuple[str, ...]:
        """The relations that do not hold.

        Parameters
        ----------
        values : mapping
            By parameter; what is missing has its start value.
        """
        arguments: list[float] = []
        for parameter in self.parameters:
            value = values.get(parameter.name, parameter.start)
            arguments += value if isinstance(value, tuple) else (value,)
        held = self.function.call(arguments)
        return tuple(text for text, holds in zip(self.texts, held, strict=True) if not float(holds))


def conditions_of(where: str, relations: Mapping[str, Relation], variables: tuple[Variable, ...]) -> Conditions:
    """The relations as a casadi function.

    Parameters
    ----------
    where : str
        Beginning of messages.
    relations : mapping of str to callable
        What it says -> function of SX parameters, chosen by the names of its arguments. `LIMITS` is added to a law
        with these parameters.
    variables : tuple of Variable
        Of the law.

    Raises
    ------
    FrictionError
        For an argument that is no parameter, a result that is no number, or start values that violate a relation.
    """
    parameters = tuple(variable for variable in variables if variable.kind in PARAMETERS)
    elements = {variable.name: [SX.sym(scalar) for scalar in variable.scalars] for variable in parameters}
    results = []
    relations = {**(LIMITS if {"u_min", "u_max"} <= elements.keys() else {}), **relations}
    for text, relation in relations.items():
        check_line(where, "text of a condition", text)
        names = list(inspect.signature(relation).parameters)
        for name in names:
            if name not in elements:
                raise FrictionError(
                    f"{where}: the condition {text!r} reads {name}, which is not a parameter{nearest(name, elements)}"
                )
        result = SX(relation(*(vertcat(*elements[name]) for name in names)))
        if result.shape != (1, 1):
            raise FrictionError(f"{where}: the condition {text!r} has the shape {result.shape}, it is one truth value")
        results.append(result)
    symbols = [symbol for variable in parameters for symbol in elements[variable.name]]
    found = Conditions(tuple(relations), parameters, Function("conditions", symbols, results))
    if broken := found.violated({}):
        raise FrictionError(f"{where}: its start values violate {broken[0]}")
    return found
