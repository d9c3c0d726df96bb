"""Arithmetic in the files of blocks: ``Fc / sigma0``, ``max(Fc, Fs)``, ``sum(k)``; only arithmetic is evaluated."""

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from functools import cache
from typing import Final, TypeAlias

from friction_fmus.errors import FrictionError

Number: TypeAlias = float | int | bool
Numbers: TypeAlias = Mapping[str, Number]

FUNCTIONS: Final[Mapping[str, Callable[..., Number]]] = {
    "abs": abs,
    "exp": math.exp,
    "log": math.log,
    "max": max,
    "min": min,
    "round": round,
    "sqrt": math.sqrt,
}

OF_NAMES: Final = ("either", "sum")
"""Functions of names: the first argument with a value, and the sum of the used elements of a vector."""

_OPERATORS: Final[Mapping[type[ast.AST], Callable[..., Number]]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}


@cache
def names_in(text: str) -> frozenset[str]:
    """Return the names in an expression; for an element ``k[i]``, the name of the vector."""
    found = {node.id for node in ast.walk(_parsed(text)) if isinstance(node, ast.Name)}
    return frozenset(found - FUNCTIONS.keys() - {*OF_NAMES, "pi", "i"})


@cache
def vectors_in(text: str) -> frozenset[str]:
    """Return the vectors of which an expression reads the element ``[i]``."""
    nodes = [node for node in ast.walk(_parsed(text)) if isinstance(node, ast.Subscript)]
    return frozenset(node.value.id for node in nodes if isinstance(node.value, ast.Name))


def is_known(text: str, values: Numbers) -> bool:
    """Return whether all names in an expression, including vectors, have values."""
    return all(name in values or f"{name}[1]" in values for name in names_in(text))


def evaluate(text: str, values: Numbers) -> Number:
    """Return the value of an expression."""
    return _value(_parsed(text), text, values)


@cache
def _parsed(text: str) -> ast.expr:
    """Return the checked syntax tree of an expression."""
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError) as error:
        raise FrictionError(f"{text!r} is not an arithmetic expression") from error
    for node in ast.walk(tree):
        known = isinstance(node, ast.Name | ast.Load | ast.BinOp | ast.UnaryOp | ast.Compare | ast.Call | ast.Subscript)
        constant = isinstance(node, ast.Constant) and type(node.value) in (int, float)
        if not (known or constant or type(node) in _OPERATORS):
            raise FrictionError(f"{text!r} contains {type(node).__name__}, which is not arithmetic")
        if isinstance(node, ast.Call):
            name = node.func.id if isinstance(node.func, ast.Name) else ""
            if node.keywords or name not in {*FUNCTIONS, *OF_NAMES}:
                raise FrictionError(
                    f"{text!r} calls {name or 'an expression'}; known functions are {', '.join(FUNCTIONS)}"
                )
            if name == "sum" and not (len(node.args) == 1 and isinstance(node.args[0], ast.Name)):
                raise FrictionError(f"{text!r}: sum needs the name of one vector")
        if isinstance(node, ast.Subscript) and not (
            isinstance(node.value, ast.Name) and isinstance(node.slice, ast.Name) and node.slice.id == "i"
        ):
            raise FrictionError(f"{text!r}: write an element of a vector as k[i]")
    return tree


def _value(node: ast.expr, text: str, values: Numbers) -> Number:
    match node:
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.Name(id=name):
            return _known(name, text, values)
        case ast.Subscript(value=ast.Name(id=name)):
            return _known(f"{name}[{values['i']}]", text, values)
        case ast.BinOp(left=left, op=op, right=right):
            return _OPERATORS[type(op)](_value(left, text, values), _value(right, text, values))
        case ast.UnaryOp(op=op, operand=operand):
            return _OPERATORS[type(op)](_value(operand, text, values))
        case ast.Compare(left=left, ops=[op], comparators=[right]):
            return _OPERATORS[type(op)](_value(left, text, values), _value(right, text, values))
        case ast.Call(func=ast.Name(id="sum"), args=[ast.Name(id=name)]):
            return sum(_elements(name, values))
        case ast.Call(func=ast.Name(id="either"), args=arguments):
            known = [a for a in arguments if is_known(ast.unparse(a), values)]
            return _value((known or arguments)[0], text, values)
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return FUNCTIONS[name](*(_value(argument, text, values) for argument in arguments))
    raise FrictionError(f"{text!r} is not an arithmetic expression")


def _known(name: str, text: str, values: Numbers) -> Number:
    if name == "pi":
        return math.pi
    if name not in values:
        raise FrictionError(f"{text!r} reads {name}, which has no value")
    return values[name]


def _elements(name: str, values: Numbers) -> list[Number]:
    """Return the used elements of a vector: the first N, or all without N."""
    if "N" in values:
        return [values[f"{name}[{i}]"] for i in range(1, int(values["N"]) + 1)]
    return [value for key, value in values.items() if re.fullmatch(rf"{name}\[\d+\]", key)]
