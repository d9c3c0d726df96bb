"""The equations in the documentation of a law, and the operations that compute their left-hand sides."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from friction_fmus.lawkit.emit.graph import CONDITIONS, Node
from friction_fmus.lawkit.emit.names import Named

NONE: Mapping[int, str] = MappingProxyType({})

_INDENT = "    "  # marks the equations
_START = re.compile(r"(?:[\w ]+:\s+)?([A-Za-z]\w*?)_?(?:\([^)]*\)|\[[^\]]*\])?'*\s+(?:=|becomes)\s")


@dataclass(frozen=True)
class Equation:
    """An equation."""

    number: int
    """Its number, counted from 1."""
    name: str
    """The variable on its left-hand side."""
    lines: tuple[str, ...]
    """Its text."""
    last: int
    """Index of its last line in the documentation."""
    prefix: str = ""
    """Prefix of the variable in the code."""

    @property
    def text(self) -> str:
        """The equation in one line, with its number."""
        return f"({self.number}) {re.sub(r' +', ' ', ' '.join(self.lines)).rstrip(',')}"


def equations_of(documentation: str, prefixes: Mapping[int, str] = NONE) -> tuple[Equation, ...]:
    """Return the equations of a documentation page; an indented line with ``name =`` or ``name becomes`` begins one."""
    prefix = ""
    found: list[Equation] = []
    inside = False
    for index, line in enumerate(documentation.splitlines()):
        prefix = prefixes.get(index, prefix)
        inside = inside and bool(line.strip())
        if not line.startswith(_INDENT):
            continue
        text = line.strip()
        start = _START.match(text)
        if start:
            found.append(Equation(len(found) + 1, start[1], (text,), index, prefix))
            inside = True
        elif inside:
            last = found.pop()
            found.append(Equation(last.number, last.name, (*last.lines, text), index, prefix))
    return tuple(found)


def numbered(documentation: str) -> str:
    """Return the documentation with the number of each equation at its end."""
    lines = documentation.splitlines()
    for equation in equations_of(documentation):
        lines[equation.last] += f"   ({equation.number})"
    return "\n".join(lines)


def placed(
    equations: tuple[Equation, ...],
    nodes: Sequence[Node],
    named: Sequence[Named],
    results: Mapping[str, int],
    commands: Collection[int],
) -> tuple[dict[int, list[str]], list[str]]:
    """Return the comments for operations.

    An equation whose left-hand side is no variable of the law is added to one that contains this side: to the next
    equation, or else to one before it.
    """
    own = [_node(equation.prefix + equation.name, nodes, named, results, commands) for equation in equations]
    places = range(len(equations))
    for place in (*reversed(places), *places):  # in both directions, as an equation may belong to one of the same kind
        for other in (place + 1, *range(place - 1, -1, -1)):
            if own[place] is None and other in places and _belongs(equations[place], equations[other]):
                own[place] = own[other]
    comments: dict[int, list[str]] = {}
    for node, equation in zip(own, equations, strict=True):
        if node is not None:
            comments.setdefault(node, []).append(equation.text)
    return comments, [equation.text for node, equation in zip(own, equations, strict=True) if node is None]


def _belongs(equation: Equation, other: Equation) -> bool:
    """Return whether another equation of the same law contains the left-hand side."""
    return equation.prefix == other.prefix and re.search(rf"\b{equation.name}\b", other.text) is not None


def _node(
    name: str, nodes: Sequence[Node], named: Sequence[Named], results: Mapping[str, int], commands: Collection[int]
) -> int | None:
    """Return the operation that computes a variable, before a disabled law replaces it by zero."""
    own = [entry.node for entry in named if entry.name == name and not entry.depth]
    node = results.get(name, own[0] if own else -1)
    while node >= 0 and nodes[node].operation in ("SELECT", "IF_ELSE_ZERO") and _commanded(nodes, node, commands):
        node = nodes[node].arguments[1]
    if node < 0 or nodes[node].operation in ("CONST", "INPUT", *CONDITIONS):
        return None
    return node


def _commanded(nodes: Sequence[Node], select: int, commands: Collection[int]) -> bool:
    condition = nodes[nodes[select].arguments[0]]
    return condition.operation == "INPUT" and int(condition.value) in commands
