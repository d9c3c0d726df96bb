"""The results of the equations of a law as scalar expressions."""

from __future__ import annotations

from typing import Any

from casadi import SX

from friction_fmus.errors import FrictionError
from friction_fmus.law_variables import Kind, Variable


def scalars(where: str, variable: Variable, value: Any) -> list[SX]:
    """Return what the equations give for a variable, element by element.

    Raises
    ------
    FrictionError
        If it is not an expression of the right size.
    """
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
        raise FrictionError(f"{where}: {name} has the shape {expression.shape}, a result is one number")
    return SX(0.0) + expression if expression.nnz() == 0 else expression
