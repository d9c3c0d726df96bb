"""Relations between the parameters of a law, checked whenever values are assigned."""

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
"""Kinds of variables that a relation may use: those that are set before the first sample."""

Relation = Callable[..., Any]

LIMITS: Mapping[str, Relation] = MappingProxyType({"u_min <= u_max": lambda u_min, u_max: u_min <= u_max})
"""Relation for every law with these two parameters, which by convention are the limits of its output."""


@dataclass(frozen=True, eq=False)
class Conditions:
    """Relations between the parameters of a law without which the law is singular."""

    texts: tuple[str, ...]
    """Each relation as shown to the user, such as ``u_min <= u_max``."""
    parameters: tuple[Variable, ...]
    """All parameters of the law."""
    function: Function
    """Maps the scalars of the parameters to one truth value per relation."""

    def violated(self, values: Mapping[str, float | tuple[float, ...]]) -> tuple[str, ...]:
        """Return the violated relations."""
        arguments: list[float] = []
        for parameter in self.parameters:
            value = values.get(parameter.name, parameter.start)
            arguments += value if isinstance(value, tuple) else (value,)
        held = self.function.call(arguments)
        return tuple(text for text, holds in zip(self.texts, held, strict=True) if not float(holds))


def conditions_of(where: str, relations: Mapping[str, Relation], variables: tuple[Variable, ...]) -> Conditions:
    """Return the relations as a casadi function."""
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
            raise FrictionError(f"{where}: the condition {text!r} has the shape {result.shape}; return one truth value")
        results.append(result)
    symbols = [symbol for variable in parameters for symbol in elements[variable.name]]
    found = Conditions(tuple(relations), parameters, Function("conditions", symbols, results))
    if broken := found.violated({}):
        raise FrictionError(f"{where}: its start values violate the condition {broken[0]}")
    return found
