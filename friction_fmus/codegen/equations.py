"""The equations in the documentation of a law, and the operations that compute their left-hand sides."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from friction_fmus.lawkit.emit.graph import CONDITIONS, Node
from friction_fmus.lawkit.emit.names import Named

_INDENT = "    "  # marks the equations
_START = re.compile(r"(?:[\w ]+:\s+)?([A-Za-z]\w*?)_?(?:\([^)]*\)|\[[^\]]*\])?'*\s+(?:=|becomes)\s")


@dataclass(frozen=True)
class Equation:
    """An equation.

    Attributes
    ----------
    number : int
        Its number, counted from 1.
    name : str
        The variable on its left-hand side.
    lines : tuple of str
        Its text.
    last : int
        Index of its last line in the documentation.
    """

    number: int
    name: str
    lines: tuple[str, ...]
    last: int

    @property
    def text(self) -> str:
        """The equation in one line, with its number."""
        return f"({self.number}) {re.sub(r' +', ' ', ' '.join(self.lines)).rstrip(',')}"


def equations_of(documentation: str) -> tuple[Equation, ...]:
    """Return the equations of a documentation page: each indented line with ``name =`` or ``name becomes`` begins one.

    Parameters
    ----------
    documentation : str
        Plain text, in which the equations are indented by four spaces.
    """
    found: list[Equation] = []
    inside = False
    for index, line in enumerate(documentation.splitlines()):
        inside = inside and bool(line.strip())
        if not line.startswith(_INDENT):
            continue
        text = line.strip()
        start = _START.match(text)
        if start:
            found.append(Equation(len(found) + 1, start[1], (text,), index))
            inside = True
        elif inside:
            last = found.pop()
            found.append(Equation(last.number, last.name, (*last.lines, text), index))
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
) -> dict[int, list[str]]:
    """Return the comments for operations.

    An equation whose left-hand side is no variable of the law is added to one that contains this side: to the next
    equation, or else to one before it; if none does, to the previous equation.

    Parameters
    ----------
    equations : tuple of Equation
        The equations of a law.
    nodes : sequence of Node
        Its operations.
    named : sequence of Named
        Names of its intermediate results.
    results : mapping of str to int
        Node of each result, of vectors the first element.
    commands : collection of int
        Indices of the arguments that enable and reset the law.

    Returns
    -------
    dict of int to list of str
        The texts of equations by node.
    """
    own = {equation.number: _node(equation.name, nodes, named, results, commands) for equation in equations}
    for place in (*range(len(equations) - 1, -1, -1), *range(len(equations))):  # chains of such equations in both ways
        equation = equations[place]
        for other in equations[place + 1 : place + 2] + equations[place - 1 :: -1] if place else equations[1:2]:
            if own[equation.number] is None and re.search(rf"\b{equation.name}\b", other.text):
                own[equation.number] = own[other.number]
    found: dict[int, list[str]] = {}
    node = next(filter(None, own.values()), None)
    for equation in equations:
        node = node if own[equation.number] is None else own[equation.number]
        if node is not None:
            found.setdefault(node, []).append(equation.text)
    return found


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
