"""Plain C from casadi expressions, in casadi's order of evaluation, for bit-identical results.

`kernel` translates a function for use in any C file.
"""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from casadi import Function

from friction_fmus.lawkit.emit.branches import DECIDES, Block, CountedLoop, Decision, Weight, plan, split
from friction_fmus.lawkit.emit.chains import INDEX, Rolled, roll
from friction_fmus.lawkit.emit.names import Named, Names, place_name
from friction_fmus.lawkit.emit.operations import COMPARE, CONDITIONS, INFIX, LIBM, LOGIC, Node, Zeros, graph
from friction_fmus.lawkit.emit.syntax import DOUBLE, FLOAT, PRIMARY, PRODUCT, SUM, UNARY, Real, Text, in_brackets, plain

__all__ = ["DOUBLE", "FLOAT", "Kernel", "Lows", "Real", "kernel"]


COMPARISON = 5
BOTH = 4
EITHER = 3
CHOICE = 2

TRUE, FALSE = (plain(text) for text in ("true", "false"))
_TRUTHS = ("true", "false")

TERNARY = {"SELECT", "IF_ELSE_ZERO", "SIGN", "FMIN", "FMAX"}
REPEATS = {"SQ": 2, "SIGN": 3, "FMIN": 2, "FMAX": 2}
"""Largest number of times that an expression contains an argument; 1 for other operations."""

_MIRRORED = {"LT": ">", "LE": ">=", "EQ": "==", "NE": "!="}


def literal(value: float, real: Real) -> Text:
    """Return a number."""
    text = real.literal(value)
    return Text(text, UNARY if text.startswith("-") else PRIMARY, frozenset())


def joined(first: Text, operator: str, second: Text, rank: int, least: tuple[int, int]) -> Text:
    """Return both expressions with an operator between them; ``a + -b`` becomes ``a - b``, which has the same bits."""
    if operator in "+-" and second.text.startswith("-") and second.rank >= PRODUCT:
        operator, second = "-" if operator == "+" else "+", second._replace(text=second.text[1:])
    text = f"{in_brackets(first, least[0])} {operator} {in_brackets(second, least[1])}"
    return Text(text, rank, first.reads | second.reads)


def choice(condition: Text, first: Text, second: Text, real: Real) -> Text:
    """Return the conditional expression."""
    text, sides = real.choice(condition, first, second), (condition, first, second)
    return Text(text, CHOICE, condition.reads | first.reads | second.reads, sides)


def either(condition: Text, first: Text, second: Text, real: Real) -> Text:
    """Return one of two truth values, depending on a condition."""
    if FALSE in (first, second) or TRUE in (first, second):
        if second.text in _TRUTHS:
            condition, first, second = negation(condition), second, first
        if second.text in _TRUTHS:
            return condition if first == TRUE else negation(condition)
        if first == TRUE:
            return joined(condition, "||", second, EITHER, (UNARY, UNARY))
        return joined(negation(condition), "&&", second, BOTH, (UNARY, UNARY))
    return choice(condition, first, second, real)


def negation(condition: Text) -> Text:
    """Return whether a truth value is false."""
    if condition.rank == UNARY and condition.text.startswith("!"):
        return Text(condition.text[1:], PRIMARY, condition.reads)
    return Text(f"!{in_brackets(condition, PRIMARY)}", UNARY, condition.reads)


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
        arguments = ", ".join(text.text for text in given)
        return Text(f"{real.called(operation)}({arguments})", PRIMARY, reads)
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
        positive = choice(less(given[0], zero, ">"), one, given[0], real)
        return choice(less(given[0], zero, "<"), minus_one, positive, real)
    # the first of equal arguments, like fmin; a NaN in the first argument stays, unlike fmin
    other = less(given[1], given[0], "<" if operation == "FMIN" else ">")
    return choice(other, given[1], given[0], real)


RESULT, SIDE, IF = -1, -2, -3  # users of a value that are not nodes


class Store(NamedTuple):
    """Assignment to elements of vectors."""

    node: int  # a vector, or a select of vectors
    places: Sequence[str]  # places of an element
    side: int | None  # side of the select that is assigned; None for the value of the node

    def values(self, nodes: Sequence[Node]) -> tuple[int, ...]:
        """Return the node that is assigned; none for a zero."""
        if self.side is None:
            return (self.node,)
        return nodes[self.node].arguments[self.side : self.side + 1]

    @property
    def uses(self) -> int:
        """Number of uses of the node in the count of users."""
        return len(self.places) if self.side is None else 1


def numbers(item: int | Decision | CountedLoop) -> Iterator[int]:
    """Yield the nodes of an item."""
    if isinstance(item, int):
        yield item
    elif isinstance(item, CountedLoop):
        for inner in item.items:
            yield from numbers(inner)
    else:
        yield from item.selects
        for side in item.sides:
            for part in side:
                yield from numbers(part)


def computed(item: int | Decision | CountedLoop) -> tuple[int, ...]:
    """Return the nodes with the values of an item that is not a loop."""
    return item.selects if isinstance(item, Decision) else (item,) if isinstance(item, int) else ()


def is_in(user: int, place: int, inside: Collection[int]) -> bool:
    """Return whether a user of a value is among these nodes."""
    return (place if user in (SIDE, IF) else user) in inside


def last_values(nodes: Sequence[Node], block: Block, targets: Mapping[int, Sequence[str]]) -> Iterator[tuple[int, str]]:
    """Yield the values that are assigned after other results may have been, with their places."""
    yield from ((number, place) for number, places in targets.items() for place in places)
    last = block[-1] if block else None
    if isinstance(last, Decision):
        for side, inner in enumerate(last.sides, start=1):
            values: dict[int, list[str]] = {}
            for select in last.selects:
                for argument in nodes[select].arguments[side : side + 1]:
                    values.setdefault(argument, []).extend(targets.get(select, ()))
            yield from last_values(nodes, inner, values)


def count_users(nodes: Sequence[Node], block: Block, users: dict[int, list[tuple[int, int]]]) -> None:
    """Add the users of each node as they appear in the text, and the place among their arguments."""

    def add(argument: int, user: int, place: int, times: int = 1) -> None:
        users.setdefault(argument, []).extend([(user, place)] * times)

    def times(argument: int, user: int) -> int:
        return 2 if nodes[user].lanes and not nodes[argument].lanes else 1  # once for each element

    for item in block:
        if isinstance(item, CountedLoop):
            count_users(nodes, item.items, users)
        elif isinstance(item, Decision):
            add(item.condition, IF, item.selects[0])
            for select in item.selects:
                for argument in nodes[select].arguments[1:]:
                    add(argument, SIDE, select, times(argument, select))
            for side in item.sides:
                count_users(nodes, side, users)
        else:
            for place, argument in enumerate(nodes[item].arguments):
                add(argument, item, place, REPEATS.get(nodes[item].operation, 1) * times(argument, item))


class Values:
    """The expressions of all values at one place in the code."""

    def __init__(
        self, rolled: Rolled, real: Real, conditions: Collection[int], zeros: Zeros, flags: Collection[str]
    ) -> None:
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
                index = Text(real.converted.format(real.name, INDEX), UNARY)
                first = literal(node.value, real)
                self._texts[number] = joined(index, "+", first, SUM, (SUM, PRODUCT)) if node.value else index
            elif node.brief:
                self._texts[number] = self._expression(number)

    def _choice(self, number: int) -> Text:
        """Return a select as an expression; on one side of a decision on the same condition, only this side is left."""
        condition = self._nodes[number].arguments[0]
        decided = self._decided.get(condition)
        value = self._true_side if self._is_condition(number) else self._side
        others = [n for i, n in enumerate(self._nodes[number].arguments) if decided and i not in (0, decided)]
        # an argument, a number and what is also used elsewhere can be dispensed with
        if decided and all(self._nodes[n].is_leaf or len(self._users[n]) > 1 for n in others):
            return value(number, decided)
        opposite = self._opposite(condition)
        sides = value(number, 1), value(number, 2)
        if opposite >= 0:
            condition, sides = opposite, sides[::-1]
        return (either if self._is_condition(number) else choice)(self._truth(condition), *sides, self._real)

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
        return choice(text, self._one, self._zero, self._real)

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
            self.functions.add(self._real.called(operation))
        mirrored = operation in COMPARE and self._is_limit(*arguments)
        numbers = [self._number(argument) for argument in arguments]
        return expression(operation, numbers, self._real, number_first=mirrored)

    def _kind(self, number: int) -> str:
        return self._real.flag if self._is_condition(number) else self._real.name

    def _element(self, number: int) -> str:
        return self._reads[int(self._nodes[number].value)]

    def _only_shown(self, number: int, places: Sequence[str]) -> bool:
        """Return whether a value is only assigned to places that are never read."""
        return len(self._users[number]) == len(places) and not any(place in self._reads for place in places)

    def _assignments(self, places: Iterable[str], number: int, side: int | None = None) -> list[str]:
        """Return the assignments of a node, or of a select on one side."""
        lines = []
        for place in places:
            value = self._assigned(number, side, self._holds_truth(place, number))
            lines += self._real.assignment(place, value) if value.text != place else []
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


_WIDTH = 150  # longest expression that is not divided into several


class Writer(Values):
    """Writer of the statements of a function."""

    def __init__(
        self,
        rolled: Rolled,
        real: Real,
        conditions: Collection[int],
        zeros: Zeros,
        names: Names,
        remarks: Mapping[int, Sequence[str]],
        *,
        flags: Collection[str] = (),
        unrolls: bool = False,
    ) -> None:
        super().__init__(rolled, real, conditions, zeros, flags)
        self._names = names
        self._kept = names.assigned | remarks.keys()
        self._remarks = {node: list(texts) for node, texts in remarks.items()}
        self._overwritten = frozenset(i for i, place in enumerate(rolled.reads) if place in self._places)
        self._unrolls = unrolls
        self._last_moment: dict[int, set[str]] = {}  # nodes that are read while results are assigned, and their places
        self._elements: dict[int, str] = {}  # places of elements that are stored before the end
        self._lines: list[str] = []
        self._arrays: set[int] = set()  # elements that are used outside their loop
        self._in_loop = False

    def statements(self, block: Block, targets: Mapping[int, Sequence[str]]) -> list[str]:
        """Return the statements of a function."""
        for number, place in last_values(self._nodes, block, targets):
            self._last_moment.setdefault(number, set()).add(place)
        count_users(self._nodes, block, self._users)
        for number, places in targets.items():
            self._users.setdefault(number, []).extend([(RESULT, 0)] * len(places))
        copies = [line for number in sorted(self._last_moment) for line in self._copy(number)]
        return [*copies, *self._block(block, targets)]

    def _copy(self, number: int) -> list[str]:
        """Copy an argument that is also a result if another result overwrites it."""
        node = self._nodes[number]
        if node.operation != "INPUT" or int(node.value) not in self._overwritten or node.lanes:
            return []
        if self._last_moment[number] == {self._reads[int(node.value)]}:
            return []  # it is its own next value
        value = self._texts[number]
        name = self._names.copy(self._reads[int(node.value)])
        self._texts[number] = plain(name)
        return self._real.declared(f"const {self._kind(number)}", name, value)

    def _block(self, block: Block, targets: Mapping[int, Sequence[str]], stores: Sequence[Store] = ()) -> list[str]:
        """Return statements, then assignments to the targets of nodes."""
        outer, self._lines = self._lines, []
        left = dict(targets)
        stores = [*stores]
        if not self._in_loop and not self._ends_with(block, [n for n in left if self._nodes[n].lanes]):
            stores += [Store(n, left.pop(n), None) for n in [*left] if self._nodes[n].lanes]
        for place, item in enumerate(block):
            stores = self._stored_early(item, block[place + 1 :], stores)
            if isinstance(item, CountedLoop):
                inside = stores if item is block[-1] else []
                self._loop(item.lanes, item.items, [store for store in inside if self._lanes(store) == item.lanes])
                stores = [store for store in stores if store not in inside or self._lanes(store) != item.lanes]
            elif isinstance(item, Decision):
                # nothing is computed after the last decision, and nothing reads an output: results need no names there
                ends = [n for n in item.selects if n in left and (item is block[-1] or self._only_shown(n, left[n]))]
                final = {number: left.pop(number) for number in ends}
                self._select(item, final)
            else:
                self._operation(item)
        for lanes in sorted({self._lanes(store) for store in stores}):
            self._loop(lanes, (), [store for store in stores if self._lanes(store) == lanes])
        for number, places in left.items():
            self._lines += self._remark(number)
            self._lines += self._assignments(places, number)
        lines, self._lines = self._lines, outer
        return lines

    def _stored_early(self, item: int | Decision | CountedLoop, later: Block, stores: Sequence[Store]) -> list[Store]:
        """Choose the place of a result for elements that are used later, unless its old value is also used later."""
        inner = item.items if isinstance(item, CountedLoop) else (item,)
        left = []
        for store in stores if later else ():
            values = store.values(self._nodes)
            found = [place for place, part in enumerate(inner) if {*computed(part)} & {*values}]
            after = [*inner[found[0] + 1 :], *later] if found else []
            read = {argument for part in after for n in numbers(part) for argument in self._nodes[n].arguments}
            read |= {value for other in stores if other is not store for value in other.values(self._nodes)}
            old = any(self._nodes[n].operation == "INPUT" and self._element(n) == store.places[0] for n in read)
            exact = store.side is None or not self._zeros.becomes_plus(store.node, store.side)
            exact = exact and bool(values) and self._fits(values[0], store.places[0])
            if found and exact and not old and values[0] not in self._elements and len(store.places) == 1:
                self._elements[values[0]] = store.places[0]
                if store.places[0] not in self._flags:
                    self._truths.discard(values[0])
            else:
                left.append(store)
        return left if later else [*stores]

    def _fits(self, number: int, place: str) -> bool:
        """Return whether a place has the type of a value, or the value is a select, which can also be a number."""
        select = self._nodes[number].operation in DECIDES
        return (place in self._flags) == self._is_condition(number) or (select and place not in self._flags)

    def _ends_with(self, block: Block, vectors: Sequence[int]) -> bool:
        """Return whether the last decision of a block assigns all these vectors."""
        last = block[-1] if block else None
        return isinstance(last, Decision) and {*vectors} <= {*last.selects}

    def _lanes(self, store: Store) -> int:
        return self._nodes[store.node].lanes

    def _select(self, item: Decision, final: Mapping[int, Sequence[str]]) -> None:
        """Write a decision; selects that are not assigned to final places become variables."""
        names = {number: self._names.of(number) for number in item.selects if number not in final}
        for number in item.selects:
            self._lines += self._remark(number)
        for number, name in names.items():
            array = number in self._arrays or (self._nodes[number].lanes and not self._in_loop)
            if number not in self._arrays and number not in self._elements:
                size = self._nodes[number].lanes if array else 0
                self._lines += self._real.declared(self._kind(number), name, size=size)
            if array:
                names[number] = self._elements.get(number, f"{name}[{INDEX}]")
        self._lines += self._decision(item, {**final, **{number: [name] for number, name in names.items()}})
        self._texts.update((number, plain(name)) for number, name in names.items())

    def _loop(self, lanes: int, items: Sequence[int | Decision], stores: Sequence[Store]) -> None:
        """Write a loop with the operations on an element, the sums, and the assignments to elements."""
        sums = [item for item in items if isinstance(item, int) and self._nodes[item].operation == "SUM"]
        arrays = self._outside(items, stores)
        declared = [number for number in arrays if number not in self._elements]
        for number in declared:
            self._lines += self._real.declared(self._kind(number), self._names.of(number), size=lanes)
        for number in sums:
            self._lines += self._remark(number)
            self._lines += self._real.declared(self._real.name, self._names.of(number), self._start(number))
        self._arrays.update(arrays)
        outer, self._lines, self._in_loop = self._lines, [], True
        for item in items:
            if isinstance(item, Decision):
                self._select(item, {})
            elif item not in sums:
                self._operation(item)
        for number in sums:
            term = self._number(self._nodes[number].arguments[0])
            self._lines += self._real.assignment(self._names.of(number), term, "+=")
        self._lines += self._stored(stores)
        body, self._lines, self._in_loop = self._lines, outer, False
        if not body:
            return
        self._lines += ["UNROLLED"] if self._unrolls else []
        self._lines += self._real.loop(INDEX, lanes, body)
        self._texts.update((number, plain(self._names.of(number))) for number in sums)

    def _start(self, number: int) -> Text:
        """Return the value before the first term of a sum; -0.0 keeps the sign of the sum of -0.0."""
        term, *first = self._nodes[number].arguments
        if first:
            return self._number(first[0])
        signed = self._zeros.matters(number) and not self._zeros.never_minus(term)
        return literal(-0.0 if signed else 0.0, self._real)

    def _outside(self, items: Sequence[int | Decision], stores: Sequence[Store]) -> list[int]:
        """Return the operations on elements that are used outside their loop."""
        inside = {number for item in items for number in numbers(item)}
        found = []
        for number in (n for item in items for n in computed(item)):
            stored = [store for store in stores if number in store.values(self._nodes)]
            users = [(user, place) for user, place in self._users.get(number, ()) if not is_in(user, place, inside)]
            if self._nodes[number].lanes and len(users) > sum(store.uses for store in stored):
                found.append(number)
        return found

    def _stored(self, stores: Sequence[Store]) -> list[str]:
        """Return assignments to elements; a value that an earlier assignment overwrites is copied before."""
        lines, copies = [], []
        written: set[str] = set()
        for store in stores:
            for argument in (store.node, *store.values(self._nodes)):
                lines += self._remark(argument)
            for place in store.places:
                is_truth = self._holds_truth(place, store.node)
                value = self._assigned(store.node, store.side, is_truth)
                if any(self._reads[i] in written for i in value.reads):
                    name = self._names.copy(self._reads[min(value.reads)])
                    kind = self._real.flag if is_truth else self._real.name
                    copies += self._real.declared(f"const {kind}", name, value)
                    value = plain(name)
                lines += self._real.assignment(place, value) if value.text != place else []
            written |= {*store.places}
        return [*copies, *lines]

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
        early = {place for place in self._elements.values() if self._in_loop}
        if number in self._arrays or any(self._reads[i] in early for i in text.reads):
            return False
        if self._is_brief(number):
            return number not in self._kept
        if len(users) > 1 or (number in self._last_moment and text.reads & self._overwritten):
            return False
        ((user, place),) = users
        if user == RESULT or (user == SIDE and number not in self._names.assigned):
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
        name = self._names.of(number)
        self._lines += self._remark(number)
        if number in self._arrays:
            name = self._elements.get(number, f"{name}[{INDEX}]")
            self._lines += self._real.assignment(name, self._texts[number])
        else:
            self._lines += self._real.declared(f"const {self._kind(number)}", name, self._texts[number])
        self._texts[number] = plain(name)
        self._open.discard(number)

    def _decision(self, decision: Decision, targets: Mapping[int, Sequence[str]]) -> list[str]:
        """Return both sides, each with the operations that only it needs."""
        opposite = self._opposite(decision.condition)
        condition, order = (decision.condition, (1, 2)) if opposite < 0 else (opposite, (2, 1))
        written: list[list[str]] = []
        tested, outer = self._truth(condition), self._decided
        for side in order:
            self._decided = {**outer, decision.condition: side}
            inner = decision.sides[side - 1]
            assigned = self._assigned_inside(inner, side, targets)
            stored = [n for n in targets if self._nodes[n].lanes and not self._in_loop and n not in assigned]
            statements = self._block(
                inner,
                {self._nodes[n].arguments[side]: targets[n] for n in assigned},
                [Store(n, targets[n], side) for n in stored],
            )
            for number, names in targets.items():
                if number in stored:
                    continue
                for argument in self._nodes[number].arguments[side : side + 1]:
                    statements += self._remark(argument)
                if number not in assigned:
                    statements += self._assignments(names, number, side)
            written.append(statements)
        self._decided = outer
        return self._real.decision(tested, *written)

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

    def _remark(self, number: int) -> list[str]:
        """Return the comment of a node, once."""
        return self._real.comment_lines(self._remarks.pop(number, ()))


@dataclass(frozen=True)
class Kernel:
    """The C statements of a function."""

    lines: tuple[str, ...]
    """Declarations and statements, which end with the assignments of all results. Truth values have the type ``bool``.
    """
    functions: frozenset[str]  # called functions of <math.h>


@dataclass(frozen=True)
class Lows:
    """Lower parts of pairs, see `friction_fmus.lawkit.emit.branches`."""

    wide: Mapping[int, Weight]  # arguments that are pairs
    reads: Mapping[int, str]
    writes: Mapping[int, str]
    """C expressions of the lower parts, by index of the argument and of the result."""


def kernel(
    function: Function,
    reads: Sequence[str],
    writes: Sequence[str],
    *,
    real: Real = DOUBLE,
    conditions: Iterable[int] = (),
    positive: Iterable[int] | None = None,
    taken: Iterable[str] = (),
    lows: Lows | None = None,
    named: Collection[Named] | None = None,
    remarks: Mapping[int, Sequence[str]] | None = None,
    flags: Collection[str] = (),
    unrolls: bool = False,
) -> Kernel:
    """Translate a casadi function into C statements."""
    # All results are assigned after the last operation, so a result may overwrite an argument. Operations that only one
    # side of a decision needs are computed on that side if this saves enough to justify a branch.
    nodes, results = graph(function)
    describes, named = named is not None, named or ()
    if lows:
        low_of = {number: len(reads) + i for i, number in enumerate(lows.reads)}
        nodes, results, pairs = split(nodes, results, lows.wide, low_of, lows.writes)
        reads, writes = [*reads, *lows.reads.values()], [*writes, *lows.writes.values()]
        named = [
            entry._replace(node=node, name=f"{entry.name}{suffix}")
            for entry in named
            for node, suffix in zip(pairs[entry.node], ("", "_low"), strict=True)
            if node is not None
        ]
        remarks = {pairs[node][0]: texts for node, texts in (remarks or {}).items()}
    rolled = roll(nodes, results, reads, writes)
    truths = frozenset(conditions)
    truths |= {i for i, members in rolled.members.items() if truths >= {*members}}
    never_negative = truths | {*(positive or ())}
    never_negative |= {i for i, members in rolled.members.items() if never_negative >= {*members}}
    unsigned = truths if positive is None else range(len(rolled.reads))
    named = _moved(named, rolled)
    texts_of: dict[int, list[str]] = {}
    for node, texts in (remarks or {}).items():
        texts_of.setdefault(rolled.place[node], []).extend(texts)
    kept: dict[int, list[int]] = {}
    places = {place_name(place): i for i, place in enumerate(rolled.reads)}
    for number, targets in rolled.targets.items():
        for name in filter(places.__contains__, map(place_name, targets)):
            kept.setdefault(places[name], []).append(number)
    zeros = Zeros(rolled.nodes, kept, unsigned, never_negative)
    first = {number: targets[0] for number, targets in rolled.targets.items()}
    names = Names(rolled.nodes, named, rolled.reads, first, [INDEX, *taken], no_case=real.no_case, describes=describes)
    vectors = {place.rpartition("[")[0] for place in flags} - {""}
    written = {place for targets in rolled.targets.values() for place in targets}
    of_vectors = {place for place in written if place.rpartition("[")[0] in vectors}
    writer = Writer(rolled, real, truths, zeros, names, texts_of, flags={*flags, *of_vectors}, unrolls=unrolls)
    lines = writer.statements(plan(rolled.nodes, rolled.targets), rolled.targets)
    return Kernel(tuple(lines), frozenset(writer.functions))


def _moved(named: Collection[Named], rolled: Rolled) -> list[Named]:
    """Return the names of nodes in a graph with vectors, which have the names that most of their elements have."""
    nodes = rolled.nodes
    known = [entry for entry in named if entry.node in rolled.place]
    vectors = [entry._replace(node=rolled.place[entry.node], name=_INDEXED.sub("", entry.name)) for entry in known]
    counts = Counter(vectors)
    found: dict[Named, None] = {}
    for entry, vector in zip(known, vectors, strict=True):
        lanes = nodes[vector.node].lanes
        if not lanes:
            found[entry._replace(node=vector.node)] = None
        elif 2 * counts[vector] >= lanes:
            found[vector] = None
        elif entry.node in rolled.single:
            found[entry._replace(node=rolled.single[entry.node])] = None
    return [entry for entry in found if not nodes[entry.node].is_leaf]


_INDEXED = re.compile(r"_\d+$")
