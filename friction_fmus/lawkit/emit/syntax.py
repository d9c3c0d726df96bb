"""Floating-point types, with the syntax of the language in which statements are generated."""

import math
import re
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.emit.operations import LIBM


class Text(NamedTuple):
    """An expression with the operators of C."""

    text: str  # the expression
    rank: int  # precedence of its outermost operator; `PRIMARY` for names, numbers and calls
    reads: frozenset[int] = frozenset()  # indices of the arguments of the function that it reads
    sides: tuple["Text", ...] = ()  # of a conditional expression: the condition, and the values if true and if false


PRIMARY = 9
UNARY = 8
PRODUCT = 7
SUM = 6


def plain(text: str) -> Text:
    """Return a name, a number or a condition in brackets as an expression."""
    return Text(text, PRIMARY)


def in_brackets(text: Text, least: int) -> str:
    """Return the expression, in brackets if its precedence is below `least`."""
    return text.text if text.rank >= least else f"({text.text})"


def wrapped(text: str, indent: str = "", width: int = 120) -> str:
    """Return a text in lines, of which all but the first are indented; words are not divided."""
    return textwrap.fill(text, width, subsequent_indent=indent, break_on_hyphens=False, break_long_words=False)


_LINE = 100  # longest line of a statement
_BREAKS = re.compile(r" (\+|-|\*|/|&&|\|\||\?|:) ")
_ORDER = ("?", ":", "||", "&&", "+", "-", "*", "/")  # of operators at which a line is divided


def statement(text: str) -> list[str]:
    """Return a statement in lines, divided at its outermost operators if it is long."""
    if len(text) <= _LINE:
        return [text]
    start = text.find(" = ") + 3

    def depth(end: int) -> int:  # number of open brackets
        return text.count("(", start, end) - text.count(")", start, end)

    found = [
        (depth(match.start()), _ORDER.index(match[1]) // 2, -match.start())
        for match in _BREAKS.finditer(text, start + 12, _LINE)
    ]
    if not found:
        return [text]
    place = -min(found)[2]
    return [text[:place], *indented(statement(text[place + 1 :]))]


def indented(lines: Iterable[str]) -> list[str]:
    """Return the lines of an inner block."""
    return [f"    {line}" for line in lines]


_WIDTH = 96


@dataclass(frozen=True)
class Real:
    """A floating-point type of C, and the syntax of C."""

    name: str  # keyword
    suffix: str  # suffix of literals and of the functions in <math.h>
    infinity: str  # expression for infinity
    largest: float  # largest finite number
    smallest: float
    """Smallest magnitude of a constant other than zero: a guard against division by zero must not become zero."""
    bound: float = 0.0
    """Largest magnitude of an input, so that its square does not overflow; 0 if each finite number is accepted."""
    flag: str = "bool"  # type of a truth value
    converted: str = "({}){}"  # type and index of a loop: the index as a number
    finite: str = "isfinite({})"  # the condition that a value is finite
    no_case: bool = False  # whether identifiers that differ in case only are equal

    def literal(self, value: float) -> str:
        """Return the shortest literal that reads back as this number."""
        if math.isnan(value):
            return "NAN"
        if math.isinf(value):
            return f"-{self.infinity}" if value < 0.0 else self.infinity
        if abs(value) > self.largest:
            raise FrictionError(f"The constant {value!r} is too large for the type {self.name}")
        if 0.0 < abs(value) < self.smallest:
            value = math.copysign(self.smallest, value)
        return repr(float(value)) + self.suffix

    def called(self, operation: str) -> str:
        """Return the name of the function for an operation."""
        return LIBM[operation] + self.suffix

    def choice(self, condition: Text, first: Text, second: Text) -> str:
        """Return a conditional expression."""
        return f"{in_brackets(condition, UNARY)} ? {in_brackets(first, PRODUCT)} : {in_brackets(second, PRODUCT)}"

    def assignment(self, place: str, value: Text, operator: str = "=") -> list[str]:
        """Return the assignment of a value, or with ``+=`` its addition to a sum."""
        return statement(f"{place} {operator} {value.text};")

    def declared(self, kind: str, name: str, value: Text | None = None, size: int = 0) -> list[str]:
        """Return the declaration of a constant, or of a variable; its type begins with ``const`` for a constant."""
        return statement(f"{kind} {name}{f'[{size}]' if size else ''}{f' = {value.text}' if value else ''};")

    def decision(self, condition: Text, first: Sequence[str], second: Sequence[str]) -> list[str]:
        """Return an ``if`` with both sides."""
        lines = [f"if ({condition.text}) {{", *indented(first or ["/* nothing changes */"])]
        outer = [line for line in second if not line.startswith(" ")]
        if outer and outer[0].startswith("if (") and all(line.startswith("}") for line in outer[1:]):
            return [*lines, f"}} else {second[0]}", *second[1:]]
        return [*lines, "} else {", *indented(second or ["/* nothing changes */"]), "}"]

    def loop(self, index: str, count: int, body: Sequence[str]) -> list[str]:
        """Return a loop over the elements of a vector."""
        return [f"for (int32_t {index} = 0; {index} < {count}; {index}++) {{", *indented(body), "}"]

    def comment(self, text: str) -> str:
        """Return a comment, with further lines indented, in which no comment begins and no trigraph is."""
        text = text.replace("*/", "* /").replace("/*", "/ *").replace("//", "/ /").replace("??", "? ?")
        return f"/* {textwrap.indent(text, '   ').lstrip()} */"

    def comment_lines(self, texts: Iterable[str]) -> list[str]:
        """Return one comment for each text, divided into lines."""
        comments = [self.comment(text) for text in texts]
        return [line for text in comments for line in textwrap.wrap(text, _WIDTH, subsequent_indent="   ")]


DOUBLE = Real("double", "", "HUGE_VAL", math.inf, 0.0)
FLOAT = Real("float", "f", "HUGE_VALF", 3.4028234e38, 1.1754944e-38, 1e9)
comment = DOUBLE.comment
