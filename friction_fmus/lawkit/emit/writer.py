"""Statements from operations: constants with names, and expressions where a value is used only once."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from friction_fmus.lawkit.emit.branches import DECIDES, Block, Decision, Loop
from friction_fmus.lawkit.emit.comments import comment_lines
from friction_fmus.lawkit.emit.expressions import (
    PRIMARY,
    TERNARY,
    UNARY,
    Text,
    literal,
)
from friction_fmus.lawkit.emit.loops import INDEX, Rolled
from friction_fmus.lawkit.emit.names import Names
from friction_fmus.lawkit.emit.real import Real
from friction_fmus.lawkit.emit.signed_zeros import Zeros
from friction_fmus.lawkit.emit.statements import is_if, statement
from friction_fmus.lawkit.emit.uses import RESULT, SIDE, Store, computed, count_users, is_in, last_values, numbers
from friction_fmus.lawkit.emit.values import Values

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
        """Prepare the texts of arguments and constants."""
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
        value = self._texts[number].text
        name = self._names.copy(self._reads[int(node.value)])
        self._texts[number] = Text(name, PRIMARY, frozenset())
        return [f"const {self._kind(number)} {name} = {value};"]

    def _block(self, block: Block, targets: Mapping[int, Sequence[str]], stores: Sequence[Store] = ()) -> list[str]:
        """Return statements, then assignments to the targets of nodes."""
        outer, self._lines = self._lines, []
        left = dict(targets)
        stores = [*stores]
        if not self._in_loop and not self._ends_with(block, [n for n in left if self._nodes[n].lanes]):
            stores += [Store(n, left.pop(n), None) for n in [*left] if self._nodes[n].lanes]
        for place, item in enumerate(block):
            stores = self._stored_early(item, block[place + 1 :], stores)
            if isinstance(item, Loop):
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

    def _stored_early(self, item: int | Decision | Loop, later: Block, stores: Sequence[Store]) -> list[Store]:
        """Choose the place of a result for elements that are used later, unless its old value is also used later."""
        inner = item.items if isinstance(item, Loop) else (item,)
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
                size = f"[{self._nodes[number].lanes}]" if array else ""
                self._lines.append(f"{self._kind(number)} {name}{size};")
            if array:
                names[number] = self._elements.get(number, f"{name}[{INDEX}]")
        self._lines += self._decision(item, {**final, **{number: [name] for number, name in names.items()}})
        self._texts.update((number, Text(name, PRIMARY, frozenset())) for number, name in names.items())

    def _loop(self, lanes: int, items: Sequence[int | Decision], stores: Sequence[Store]) -> None:
        """Write a loop with the operations on an element, the sums, and the assignments to elements."""
        sums = [item for item in items if isinstance(item, int) and self._nodes[item].operation == "SUM"]
        arrays = self._outside(items, stores)
        declared = [number for number in arrays if number not in self._elements]
        self._lines += [f"{self._kind(number)} {self._names.of(number)}[{lanes}];" for number in declared]
        for number in sums:
            self._lines += self._remark(number)
            self._lines.append(f"{self._real.name} {self._names.of(number)} = {self._start(number).text};")
        self._arrays.update(arrays)
        outer, self._lines, self._in_loop = self._lines, [], True
        for item in items:
            if isinstance(item, Decision):
                self._select(item, {})
            elif item not in sums:
                self._operation(item)
        for number in sums:
            term = self._number(self._nodes[number].arguments[0]).text
            self._lines += statement(f"{self._names.of(number)} += {term};")
        self._lines += self._stored(stores)
        body, self._lines, self._in_loop = self._lines, outer, False
        if not body:
            return
        self._lines += ["UNROLLED"] if self._unrolls else []
        self._lines.append(f"for (int32_t {INDEX} = 0; {INDEX} < {lanes}; {INDEX}++) {{")
        self._lines += [*(f"    {line}" for line in body), "}"]
        self._texts.update((number, Text(self._names.of(number), PRIMARY, frozenset())) for number in sums)

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
                    copies += statement(f"const {'bool' if is_truth else self._real.name} {name} = {value.text};")
                    value = Text(name, PRIMARY, frozenset())
                lines += statement(f"{place} = {value.text};") if value.text != place else []
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
            self._lines += statement(f"{name} = {self._texts[number].text};")
        else:
            self._lines += statement(f"const {self._kind(number)} {name} = {self._texts[number].text};")
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
            if side == order[1] and is_if(statements):
                lines += [f"}} else {statements[0]}", *statements[1:]]
            else:
                lines += ["} else {"] if side == order[1] else []
                lines += [f"    {line}" for line in statements or ["/* nothing changes */"]]
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

    def _remark(self, number: int) -> list[str]:
        """Return the comment of a node, once."""
        return comment_lines(self._remarks.pop(number, ()))
