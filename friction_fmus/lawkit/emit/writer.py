"""Statements from operations: constants with names, and expressions where a value is used only once."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

from friction_fmus.lawkit.emit.branches import DECIDES, Block, Decision
from friction_fmus.lawkit.emit.comments import comment_lines
from friction_fmus.lawkit.emit.expressions import (
    CHOICE,
    COMPARISON,
    PRIMARY,
    REPEATS,
    SUM,
    TERNARY,
    UNARY,
    Text,
    called_function,
    choice,
    expression,
    joined,
    literal,
    negation,
)
from friction_fmus.lawkit.emit.graph import COMPARE, CONDITIONS, LIBM, LOGIC, Node
from friction_fmus.lawkit.emit.names import Names
from friction_fmus.lawkit.emit.real import Real
from friction_fmus.lawkit.emit.signed_zeros import Zeros

_WIDTH = 150  # longest expression that is not divided into several

_LINE = 100  # longest line of a statement

_LEAVES = ("CONST", "INPUT")

_RESULT, _SIDE, _IF = -1, -2, -3  # users of a value that are not nodes


class Writer:
    """Writer of the statements of a function.

    Parameters
    ----------
    nodes : sequence of Node
        All operations, arguments before their users.
    reads : sequence of str
        C expression of each argument.
    real : Real
        Type of all numbers.
    conditions : collection of int
        Indices of the arguments that are truth values.
    zeros : Zeros
        Where -0.0 must become 0.0.
    names : Names
        Identifiers.
    overwritten : collection of str
        C expressions to which results are assigned.
    remarks : mapping of int to sequence of str
        Comments for nodes, which then become constants or variables.
    flags : collection of str
        C expressions in `overwritten` that are truth values.
    """

    def __init__(
        self,
        nodes: Sequence[Node],
        reads: Sequence[str],
        real: Real,
        conditions: Collection[int],
        zeros: Zeros,
        names: Names,
        overwritten: Collection[str],
        remarks: Mapping[int, Sequence[str]],
        *,
        flags: Collection[str] = (),
    ) -> None:
        """Prepare the texts of arguments and constants."""
        self.functions: set[str] = set()
        self._nodes = nodes
        self._real = real
        self._conditions = conditions
        self._zeros = zeros
        self._names = names
        self._kept = names.assigned | remarks.keys()
        self._remarks = {node: list(texts) for node, texts in remarks.items()}
        self._overwritten = frozenset(i for i, place in enumerate(reads) if place in overwritten)
        self._reads = reads
        self._flags = flags
        self._zero = literal(0.0, real)
        self._texts: dict[int, Text] = {}
        self._open: set[int] = set()  # nodes whose text is an expression instead of a name
        self._users: dict[int, list[tuple[int, int]]] = {}  # users of each node, and the place among their arguments
        self._last_moment: set[int] = set()  # nodes that are read while results are assigned
        self._decided: dict[int, int] = {}  # side of each condition in the current block
        self._lines: list[str] = []
        for number, node in enumerate(nodes):
            if node.operation == "CONST":
                self._texts[number] = literal(node.value, real)
            elif node.operation == "INPUT":
                place = int(node.value)
                self._texts[number] = Text(reads[place], PRIMARY, frozenset([place]))

    def statements(self, block: Block, targets: Mapping[int, Sequence[str]]) -> list[str]:
        """Return the statements of a function.

        Parameters
        ----------
        block : Block
            The operations.
        targets : mapping of int to sequence of str
            Places to which each result is assigned.
        """
        self._last_moment = {*targets, *self._last_values(block)}
        self._count(block)
        for number, places in targets.items():
            for _ in places:
                self._users.setdefault(number, []).append((_RESULT, 0))
        copies = [line for number in sorted(self._last_moment) for line in self._copy(number)]
        return [*copies, *self._block(block, targets)]

    def _last_values(self, block: Block) -> Iterator[int]:
        """Yield the values between which the last decision of a block selects, and those of its sides."""
        last = block[-1] if block else None
        if isinstance(last, Decision):
            for select in last.selects:
                yield from self._nodes[select].arguments[1:]
            for side in last.sides:
                yield from self._last_values(side)

    def _count(self, block: Block) -> None:
        """Find the users of each node as they appear in the text."""
        for item in block:
            if isinstance(item, Decision):
                self._users.setdefault(item.condition, []).append((_IF, 0))
                for select in item.selects:
                    for argument in self._nodes[select].arguments[1:]:
                        self._users.setdefault(argument, []).append((_SIDE, select))
                for side in item.sides:
                    self._count(side)
            else:
                node = self._nodes[item]
                for place, argument in enumerate(node.arguments):
                    self._users.setdefault(argument, []).extend([(item, place)] * REPEATS.get(node.operation, 1))

    def _copy(self, number: int) -> list[str]:
        """Copy an argument that is also a result if another result overwrites it."""
        node = self._nodes[number]
        if node.operation != "INPUT" or int(node.value) not in self._overwritten:
            return []
        value = self._number(number).text
        name = self._names.copy(self._reads[int(node.value)])
        self._texts[number] = Text(name, PRIMARY, frozenset())
        return [f"const {self._real.name} {name} = {value};"]

    def _block(self, block: Block, targets: Mapping[int, Sequence[str]] | None = None) -> list[str]:
        """Return statements, then assignments to the targets of nodes."""
        outer, self._lines = self._lines, []
        left = dict(targets or {})
        for item in block:
            if isinstance(item, Decision):
                # nothing is computed after the last decision, and nothing reads an output: results need no names there
                ends = [n for n in item.selects if n in left and (item is block[-1] or self._only_shown(n, left[n]))]
                final = {number: left.pop(number) for number in ends}
                names = {number: self._names.of(number) for number in item.selects if number not in final}
                for number in item.selects:
                    self._lines += self._remark(number)
                self._lines += [f"{self._real.name} {name};" for name in names.values()]
                self._lines += self._decision(item, {**final, **{number: [name] for number, name in names.items()}})
                self._texts.update((number, Text(name, PRIMARY, frozenset())) for number, name in names.items())
            else:
                self._operation(item)
        for number, places in left.items():
            self._lines += self._remark(number)
            self._lines += self._assignments(places, self._number(number), number)
        lines, self._lines = self._lines, outer
        return lines

    def _only_shown(self, number: int, places: Sequence[str]) -> bool:
        """Return whether a value is only assigned to places that are never read."""
        return len(self._users[number]) == len(places) and not any(place in self._reads for place in places)

    def _assignments(self, places: Iterable[str], value: Text, node: int) -> list[str]:
        """Return the assignments of a value, of a node that may be a truth value."""
        lines = []
        for place in places:
            lines += statement(f"{place} = {(self._truth(node) if place in self._flags else value).text};")
        return lines

    def _operation(self, number: int) -> None:
        """Compute a node now, or keep its expression for its only user."""
        while True:
            text = self._expression(number)
            arguments = self._nodes[number].arguments
            inner = [argument for argument in arguments if argument in self._open and not self._is_brief(argument)]
            if len(text.text) <= _WIDTH or not inner:
                break
            self._name(max(inner, key=lambda argument: len(self._texts[argument].text)))
        self._texts[number] = text
        self._open.add(number)
        if not self._stays_open(number):
            self._name(number)

    def _stays_open(self, number: int) -> bool:
        node, text, users = self._nodes[number], self._texts[number], self._users[number]
        if self._is_brief(number):
            return number not in self._kept
        if len(users) > 1 or (number in self._last_moment and text.reads & self._overwritten):
            return False
        ((user, place),) = users
        if user == _RESULT or (user == _SIDE and number not in self._names.assigned):
            return True
        if number in self._kept:
            return False
        if node.operation in TERNARY:
            return user >= 0 and self._nodes[user].operation == "SELECT" and place == 2
        return True

    def _is_brief(self, number: int) -> bool:
        """Return whether an expression may be repeated: a negated name, or a value without an operation."""
        node, text = self._nodes[number], self._texts[number]
        if node.operation == "NOT":
            return text.rank == UNARY and node.arguments[0] not in self._open
        return node.operation in DECIDES and text.rank == PRIMARY and not text.reads & self._overwritten

    def _name(self, number: int) -> None:
        """Declare a constant with the value of a node."""
        kind = "bool" if self._is_condition(number) else self._real.name
        name = self._names.of(number)
        self._lines += self._remark(number)
        self._lines += statement(f"const {kind} {name} = {self._texts[number].text};")
        self._texts[number] = Text(name, PRIMARY, frozenset())
        self._open.discard(number)

    def _decision(self, decision: Decision, targets: Mapping[int, Sequence[str]]) -> list[str]:
        """Return both sides, each with the operations that only it needs."""
        opposite = self._opposite(decision.condition)
        condition, order = (decision.condition, (1, 2)) if opposite < 0 else (opposite, (2, 1))
        lines = [f"if ({self._truth(condition).text}) {{"]
        outer = self._decided
        for side in order:
            self._decided = {**outer, decision.condition: side}
            inner = decision.sides[side - 1]
            assigned = self._assigned_inside(inner, side, targets)
            statements = self._block(inner, {self._nodes[n].arguments[side]: targets[n] for n in assigned})
            for number, names in targets.items():
                for argument in self._nodes[number].arguments[side : side + 1]:
                    statements += self._remark(argument)
                if number not in assigned:
                    statements += self._assignments(names, self._side(number, side), number)
            if side == order[1] and _is_if(statements):
                lines += [f"}} else {statements[0]}", *statements[1:]]
            else:
                lines += ["} else {"] if side == order[1] else []
                lines += [f"    {line}" for line in statements]
                lines += ["}"] if side == order[1] else []
        self._decided = outer
        return lines

    def _assigned_inside(self, block: Block, side: int, targets: Mapping[int, Sequence[str]]) -> list[int]:
        """Return the selects whose value on one side is a select of the last decision there, and is used only once."""
        last = block[-1] if block else None
        inside = last.selects if isinstance(last, Decision) else ()
        found = []
        for number in targets:
            value = self._nodes[number].arguments[side : side + 1]
            once = value and value[0] in inside and len(self._users[value[0]]) == 1
            if once and not self._zeros.becomes_plus(number, side):
                found.append(number)
        return found

    def _choice(self, number: int) -> Text:
        """Return a select as an expression; on one side of a decision on the same condition, only this side is left."""
        condition = self._nodes[number].arguments[0]
        decided = self._decided.get(condition)
        if decided and all(map(self._is_dispensable, self._others(number, decided))):
            return self._side(number, decided)
        sides = self._side(number, 1), self._side(number, 2)
        opposite = self._opposite(condition)
        return choice(self._truth(condition), *sides) if opposite < 0 else choice(self._truth(opposite), *sides[::-1])

    def _others(self, number: int, side: int) -> list[int]:
        """Return the value of a select on the other side, unless it is 0."""
        return [value for i, value in enumerate(self._nodes[number].arguments) if i not in (0, side)]

    def _is_dispensable(self, number: int) -> bool:
        """Return whether a value is an argument, a number, or also used elsewhere."""
        return self._nodes[number].operation in _LEAVES or len(self._users[number]) > 1

    def _opposite(self, condition: int) -> int:
        """Return the node that a condition negates, or -1 if it is not a negation or has a name."""
        node = self._nodes[condition]
        negated = node.operation == "NOT" and condition in self._open and self._is_condition(node.arguments[0])
        return node.arguments[0] if negated else -1

    def _side(self, number: int, side: int) -> Text:
        """Return the value of a select on one side; casadi's sum of both sides turns -0.0 into 0.0."""
        node = self._nodes[number]
        if side == len(node.arguments):
            return self._zero
        value = self._number(node.arguments[side])
        return joined(value, "+", self._zero, SUM, (SUM, PRIMARY)) if self._zeros.becomes_plus(number, side) else value

    def _number(self, node: int) -> Text:
        """Return the node as a number."""
        text = self._texts[node]
        if not self._is_condition(node):
            return text
        return choice(text, literal(1.0, self._real), self._zero)

    def _truth(self, node: int) -> Text:
        """Return the node as a truth value."""
        text = self._texts[node]
        if self._is_condition(node):
            return text
        return joined(text, "!=", self._zero, COMPARISON, (CHOICE + 1, PRIMARY))

    def _remark(self, number: int) -> list[str]:
        """Return the comment of a node, once."""
        return comment_lines(self._remarks.pop(number, ()))

    def _is_limit(self, first: int, second: int) -> bool:
        """Return whether a comparison reads better with the second value first."""
        leaf = self._nodes[first].operation in _LEAVES
        return leaf and (self._nodes[first].operation == "CONST" or self._nodes[second].operation not in _LEAVES)

    def _is_condition(self, number: int) -> bool:
        node = self._nodes[number]
        return node.operation in CONDITIONS or (node.operation == "INPUT" and int(node.value) in self._conditions)

    def _expression(self, number: int) -> Text:
        node = self._nodes[number]
        operation, arguments = node.operation, node.arguments
        if operation in LOGIC:
            truths = [self._truth(argument) for argument in arguments]
            return expression(operation, truths, self._real, number_first=False)
        if operation == "NOT":
            text = self._texts[arguments[0]]
            if self._is_condition(arguments[0]):
                return negation(text)
            return joined(text, "==", self._zero, COMPARISON, (CHOICE + 1, PRIMARY))
        if operation in DECIDES:
            return self._choice(number)
        if operation in LIBM:
            self.functions.add(called_function(operation, self._real))
        mirrored = operation in COMPARE and self._is_limit(*arguments)
        numbers = [self._number(argument) for argument in arguments]
        return expression(operation, numbers, self._real, number_first=mirrored)


_BREAKS = re.compile(r" (\+|-|\*|/|&&|\|\||\?|:) ")
_ORDER = ("?", ":", "||", "&&", "+", "-", "*", "/")  # of operators at which a line is divided


def statement(text: str) -> list[str]:
    """Return a statement in lines, divided at its outermost operators if it is long."""
    if len(text) <= _LINE:
        return [text]
    start = text.find(" = ") + 3
    found = [
        (_depth(text, start, match.start()), _ORDER.index(match[1]) // 2, -match.start())
        for match in _BREAKS.finditer(text, start + 30, _LINE)
    ]
    if not found:
        return [text]
    place = -min(found)[2]
    return [text[:place], *(f"    {line}" for line in statement(text[place + 1 :]))]


def _is_if(lines: Sequence[str]) -> bool:
    """Return whether lines are a single ``if`` with its sides."""
    outer = [line for line in lines if not line.startswith(" ")]
    return bool(outer) and outer[0].startswith("if (") and all(line.startswith("}") for line in outer[1:])


def _depth(text: str, start: int, end: int) -> int:
    """Return the number of open brackets at a place."""
    return text.count("(", start, end) - text.count(")", start, end)
