"""C expressions of the values of nodes."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

from friction_fmus.lawkit.emit.branches import DECIDES
from friction_fmus.lawkit.emit.expressions import (
    CHOICE,
    COMPARISON,
    FALSE,
    PRIMARY,
    PRODUCT,
    SUM,
    TRUE,
    UNARY,
    Text,
    called_function,
    choice,
    either,
    expression,
    joined,
    literal,
    negation,
)
from friction_fmus.lawkit.emit.graph import COMPARE, CONDITIONS, LIBM, LOGIC
from friction_fmus.lawkit.emit.loops import INDEX, Rolled
from friction_fmus.lawkit.emit.real import Real
from friction_fmus.lawkit.emit.signed_zeros import Zeros
from friction_fmus.lawkit.emit.statements import statement


class Values:
    """The expressions of all values at one place in the code."""

    def __init__(
        self, rolled: Rolled, real: Real, conditions: Collection[int], zeros: Zeros, flags: Collection[str]
    ) -> None:
        """Prepare the texts of arguments and constants."""
        self.functions: set[str] = set()
        self._nodes = rolled.nodes
        self._reads = rolled.reads
        self._real = real
        self._conditions = conditions
        self._zeros = zeros
        self._flags = flags
        self._places = {place for places in rolled.targets.values() for place in places}
        self._zero, self._one = literal(0.0, real), literal(1.0, real)
        self._texts: dict[int, Text] = {}
        self._open: set[int] = set()  # nodes whose text is an expression instead of a name
        self._users: dict[int, list[tuple[int, int]]] = {}  # users of each node, and the place among their arguments
        self._decided: dict[int, int] = {}  # side of each condition in the current block
        self._truths: set[int] = set()  # nodes that are truth values
        for number, node in enumerate(rolled.nodes):
            if self._is_truth(number):
                self._truths.add(number)
            if node.operation == "CONST":
                self._texts[number] = literal(node.value, real)
            elif node.operation == "INPUT":
                place = int(node.value)
                self._texts[number] = Text(rolled.reads[place], PRIMARY, frozenset([place]))
            elif node.operation == "INDEX":
                index = Text(f"({real.name}){INDEX}", UNARY, frozenset())
                first = literal(node.value, real)
                self._texts[number] = joined(index, "+", first, SUM, (SUM, PRODUCT)) if node.value else index
            elif node.brief:
                self._texts[number] = self._expression(number)

    def _choice(self, number: int) -> Text:
        """Return a select as an expression; on one side of a decision on the same condition, only this side is left."""
        condition = self._nodes[number].arguments[0]
        decided = self._decided.get(condition)
        value = self._true_side if self._is_condition(number) else self._side
        if decided and all(map(self._is_dispensable, self._others(number, decided))):
            return value(number, decided)
        opposite = self._opposite(condition)
        sides = value(number, 1), value(number, 2)
        if opposite >= 0:
            condition, sides = opposite, sides[::-1]
        return (either if self._is_condition(number) else choice)(self._truth(condition), *sides)

    def _others(self, number: int, side: int) -> list[int]:
        """Return the value of a select on the other side, unless it is 0."""
        return [value for i, value in enumerate(self._nodes[number].arguments) if i not in (0, side)]

    def _is_dispensable(self, number: int) -> bool:
        """Return whether a value is an argument, a number, or also used elsewhere."""
        return self._nodes[number].is_leaf or len(self._users[number]) > 1

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

    def _true_side(self, number: int, side: int) -> Text:
        """Return the truth value of a select on one side."""
        values = self._nodes[number].arguments[side : side + 1]
        return self._truth(values[0]) if values else FALSE

    def _number(self, node: int) -> Text:
        """Return the node as a number."""
        text = self._texts[node]
        if not self._is_condition(node):
            return text
        return choice(text, self._one, self._zero)

    def _truth(self, node: int) -> Text:
        """Return the node as a truth value."""
        text = self._texts[node]
        if self._nodes[node].operation == "CONST":
            return TRUE if self._nodes[node].value != 0.0 else FALSE
        if self._is_condition(node):
            return text
        return joined(text, "!=", self._zero, COMPARISON, (CHOICE + 1, PRIMARY))

    def _is_limit(self, first: int, second: int) -> bool:
        """Return whether a comparison reads better with the second value first."""
        leaf = self._nodes[first].is_leaf
        return leaf and (self._nodes[first].operation == "CONST" or not self._nodes[second].is_leaf)

    def _is_condition(self, number: int) -> bool:
        return number in self._truths

    def _is_bit(self, number: int) -> bool:
        """Return whether a node is the number 0 or 1."""
        node = self._nodes[number]
        return node.operation == "CONST" and self._texts[number].text in (self._zero.text, self._one.text)

    def _is_truth(self, number: int) -> bool:
        """Return whether a node, of which all arguments are known, is a truth value."""
        node = self._nodes[number]
        if node.operation == "INPUT":
            return int(node.value) in self._conditions
        if node.operation in DECIDES:
            return all(value in self._truths or self._is_bit(value) for value in node.arguments[1:])
        return node.operation in CONDITIONS

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

    def _kind(self, number: int) -> str:
        return "bool" if self._is_condition(number) else self._real.name

    def _element(self, number: int) -> str:
        return self._reads[int(self._nodes[number].value)]

    def _only_shown(self, number: int, places: Sequence[str]) -> bool:
        """Return whether a value is only assigned to places that are never read."""
        return len(self._users[number]) == len(places) and not any(place in self._reads for place in places)

    def _assignments(self, places: Iterable[str], number: int, side: int | None = None) -> list[str]:
        """Return the assignments of a node, or of a select on one side."""
        lines = []
        for place in places:
            text = self._assigned(number, side, self._holds_truth(place, number)).text
            lines += statement(f"{place} = {text};") if text != place else []
        return lines

    def _holds_truth(self, place: str, number: int) -> bool:
        """Return whether a place is a truth value: a flag, or the variable of a node that is one."""
        return place in self._flags or (place not in self._places and self._is_condition(number))

    def _assigned(self, number: int, side: int | None, is_truth: bool) -> Text:
        """Return what is assigned, as a truth value or as a number."""
        if side is None:
            return self._truth(number) if is_truth else self._number(number)
        if is_truth:
            return self._true_side(number, side)
        if self._is_condition(number):
            values = self._nodes[number].arguments[side : side + 1]
            return self._number(values[0]) if values else self._zero
        return self._side(number, side)
