"""C expressions of single operations, with brackets only where C or a reader needs them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from friction_fmus.lawkit.emit.graph import COMPARE, INFIX, LIBM, LOGIC
from friction_fmus.lawkit.emit.real import Real


class Text(NamedTuple):
    """A C expression."""

    text: str
    """The expression."""
    rank: int
    """Precedence of its outermost operator; `PRIMARY` for names, numbers and calls."""
    reads: frozenset[int]
    """Indices of the arguments of the function that it reads."""


PRIMARY = 9
UNARY = 8
PRODUCT = 7
SUM = 6
COMPARISON = 5
BOTH = 4
EITHER = 3
CHOICE = 2

TRUE, FALSE = (Text(text, PRIMARY, frozenset()) for text in ("true", "false"))
_TRUTHS = ("true", "false")

TERNARY = {"SELECT", "IF_ELSE_ZERO", "SIGN", "FMIN", "FMAX"}
REPEATS = {"SQ": 2, "SIGN": 3, "FMIN": 2, "FMAX": 2}
"""Largest number of times that an expression contains an argument; 1 for other operations."""

_MIRRORED = {"LT": ">", "LE": ">=", "EQ": "==", "NE": "!="}


def literal(value: float, real: Real) -> Text:
    """Return a number."""
    text = real.literal(value)
    return Text(text, UNARY if text.startswith("-") else PRIMARY, frozenset())


def in_brackets(text: Text, least: int) -> str:
    """Return the expression, in brackets if its precedence is below `least`."""
    return text.text if text.rank >= least else f"({text.text})"


def joined(first: Text, operator: str, second: Text, rank: int, least: tuple[int, int]) -> Text:
    """Return both expressions with an operator between them; ``a + -b`` becomes ``a - b``, which has the same bits."""
    if operator in "+-" and second.text.startswith("-") and second.rank >= PRODUCT:
        operator, second = "-" if operator == "+" else "+", second._replace(text=second.text[1:])
    text = f"{in_brackets(first, least[0])} {operator} {in_brackets(second, least[1])}"
    return Text(text, rank, first.reads | second.reads)


def choice(condition: Text, first: Text, second: Text) -> Text:
    """Return the conditional expression."""
    text = f"{in_brackets(condition, UNARY)} ? {in_brackets(first, PRODUCT)} : {in_brackets(second, PRODUCT)}"
    return Text(text, CHOICE, condition.reads | first.reads | second.reads)


def either(condition: Text, first: Text, second: Text) -> Text:
    """Return one of two truth values, depending on a condition."""
    if FALSE in (first, second) or TRUE in (first, second):
        if second.text in _TRUTHS:
            condition, first, second = negation(condition), second, first
        if second.text in _TRUTHS:
            return condition if first == TRUE else negation(condition)
        if first == TRUE:
            return joined(condition, "||", second, EITHER, (UNARY, UNARY))
        return joined(negation(condition), "&&", second, BOTH, (UNARY, UNARY))
    return choice(condition, first, second)


def negation(condition: Text) -> Text:
    """Return whether a truth value is false."""
    if condition.rank == UNARY and condition.text.startswith("!"):
        return Text(condition.text[1:], PRIMARY, condition.reads)
    return Text(f"!{in_brackets(condition, PRIMARY)}", UNARY, condition.reads)


def called_function(operation: str, real: Real) -> str:
    """Return the function of the C library for an operation."""
    return LIBM[operation] + real.suffix


def expression(operation: str, given: Sequence[Text], real: Real, *, number_first: bool) -> Text:
    """Return an operation on numbers or, for AND and OR, on truth values."""
    if operation in LOGIC:
        return joined(given[0], LOGIC[operation], given[1], BOTH if operation == "AND" else EITHER, (UNARY, UNARY))
    if operation in INFIX:
        rank = SUM if operation in ("ADD", "SUB") else PRODUCT
        return joined(given[0], INFIX[operation], given[1], rank, (rank, PRIMARY if rank == PRODUCT else PRODUCT))
    if operation in COMPARE:
        if number_first:
            return joined(given[1], _MIRRORED[operation], given[0], COMPARISON, (PRODUCT, PRODUCT))
        return joined(given[0], COMPARE[operation], given[1], COMPARISON, (PRODUCT, PRODUCT))
    reads = frozenset[int]().union(*(text.reads for text in given))
    if operation in LIBM:
        return Text(f"{called_function(operation, real)}({', '.join(text.text for text in given)})", PRIMARY, reads)
    return _formula(operation, given, real)


def _formula(operation: str, given: Sequence[Text], real: Real) -> Text:
    one, two, zero, minus_one = (literal(value, real) for value in (1.0, 2.0, 0.0, -1.0))
    if operation == "NEG":
        return Text(f"-{in_brackets(given[0], PRIMARY)}", UNARY, given[0].reads)
    if operation in ("SQ", "TWICE"):
        return joined(given[0] if operation == "SQ" else two, "*", given[0], PRODUCT, (PRIMARY, PRIMARY))
    if operation == "INV":
        return joined(one, "/", given[0], PRODUCT, (PRODUCT, PRIMARY))

    def less(first: Text, second: Text, operator: str) -> Text:
        return joined(first, operator, second, COMPARISON, (PRODUCT, PRODUCT))

    if operation == "SIGN":
        positive = choice(less(given[0], zero, ">"), one, given[0])
        return choice(less(given[0], zero, "<"), minus_one, positive)
    # the first of equal arguments, like fmin; a NaN in the first argument stays, unlike fmin
    return choice(less(given[1], given[0], "<" if operation == "FMIN" else ">"), given[1], given[0])
