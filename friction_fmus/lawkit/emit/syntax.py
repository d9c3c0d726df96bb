"""The syntax of generated statements: C, or Structured Text of IEC 61131-3."""

import re
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from friction_fmus.lawkit.emit.operations import LIBM


class Text(NamedTuple):
    """An expression, in C except for calls and nested choices."""

    text: str  # the expression
    rank: int  # precedence of its outermost operator; `PRIMARY` for names, numbers and calls
    reads: frozenset[int]  # indices of the arguments of the function that it reads
    sides: tuple["Text", ...] = ()  # for a conditional expression: the condition, its value if true, and if false


PRIMARY = 9
UNARY = 8
PRODUCT = 7
SUM = 6
COMPARISON = 5
BOTH = 4
EITHER = 3
CHOICE = 2


def in_brackets(text: Text, least: int) -> str:
    """Return the expression, in brackets if its precedence is below `least`."""
    return text.text if text.rank >= least else f"({text.text})"


_LINE = 100  # longest line of a statement
_BREAKS = re.compile(r" (\+|-|\*|/|&&|\|\||\?|:) ")
_ORDER = ("?", ":", "||", "&&", "+", "-", "*", "/")  # of operators at which a line is divided


def statement(text: str) -> list[str]:
    """Return a statement in lines, divided at its outermost operators if it is long."""
    if len(text) <= _LINE:
        return [text]
    start = text.find(" = ") + 3
    found = [
        (_depth(text, start, match.start()), _ORDER.index(match[1]) // 2, -match.start())
        for match in _BREAKS.finditer(text, start + 12, _LINE)
    ]
    if not found:
        return [text]
    place = -min(found)[2]
    return [text[:place], *(f"    {line}" for line in statement(text[place + 1 :]))]


def _depth(text: str, start: int, end: int) -> int:
    """Return the number of open brackets at a place."""
    return text.count("(", start, end) - text.count(")", start, end)


def indented(lines: Iterable[str]) -> list[str]:
    """Return lines of an inner block."""
    return [f"    {line}" for line in lines]


_WIDTH = 96


@dataclass(frozen=True)
class Syntax:
    """The syntax of C."""

    integer: ClassVar[str] = "int32_t"
    flag: ClassVar[str] = "bool"

    def key(self, name: str) -> str:
        """Return what two equal identifiers have in common."""
        return name

    def called(self, operation: str, suffix: str) -> str:
        """Return the name of the function for an operation."""
        return LIBM[operation] + suffix

    def converted(self, index: str, real: str) -> Text:
        """Return the index of a loop as a number."""
        return Text(f"({real}){index}", UNARY, frozenset())

    def choice(self, condition: Text, first: Text, second: Text) -> str:
        """Return a conditional expression."""
        return " ".join(
            [in_brackets(condition, UNARY), "?", in_brackets(first, PRODUCT), ":", in_brackets(second, PRODUCT)]
        )

    def assignment(self, place: str, value: Text) -> list[str]:
        """Return the assignment of a value."""
        return statement(f"{place} = {value.text};")

    def increase(self, name: str, term: Text) -> list[str]:
        """Return the addition to a sum."""
        return statement(f"{name} += {term.text};")

    def constant(self, kind: str, name: str, value: Text) -> list[str]:
        """Return the declaration of a constant, or the assignment if declarations are elsewhere."""
        return statement(f"const {kind} {name} = {value.text};")

    def variable(self, kind: str, name: str, value: Text | None = None, size: int = 0) -> list[str]:
        """Return the declaration of a variable; nothing, or the assignment, if declarations are elsewhere."""
        return [f"{kind} {name}{f'[{size}]' if size else ''}{f' = {value.text}' if value else ''};"]

    def decision(self, condition: Text, first: Sequence[str], second: Sequence[str]) -> list[str]:
        """Return an ``if`` with both sides."""
        lines = [f"if ({condition.text}) {{", *indented(first or ["/* nothing changes */"])]
        outer = [line for line in second if not line.startswith(" ")]
        if outer and outer[0].startswith("if (") and all(line.startswith("}") for line in outer[1:]):
            return [*lines, f"}} else {second[0]}", *second[1:]]
        return [*lines, "} else {", *indented(second or ["/* nothing changes */"]), "}"]

    def loop(self, index: str, count: int, body: Sequence[str]) -> list[str]:
        """Return a loop over the elements of a vector."""
        return [f"for ({self.integer} {index} = 0; {index} < {count}; {index}++) {{", *indented(body), "}"]

    def comment_text(self, text: str) -> str:
        """Return a text that neither ends a comment nor begins one, and contains no trigraph."""
        return text.replace("*/", "* /").replace("/*", "/ *").replace("//", "/ /").replace("??", "? ?")

    def comment(self, text: str) -> str:
        """Return a comment; further lines are indented."""
        return f"/* {textwrap.indent(self.comment_text(text), '   ').lstrip()} */"

    def comment_lines(self, texts: Iterable[str]) -> list[str]:
        """Return one comment for each text, divided into lines."""
        comments = [self.comment(text) for text in texts]
        return [line for text in comments for line in textwrap.wrap(text, _WIDTH, subsequent_indent="   ")]


C = Syntax()
comment = C.comment
