"""Names of the constants and variables in generated C."""

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.declarations import check_identifier
from friction_fmus.lawkit.emit.chains import INDEX
from friction_fmus.lawkit.emit.operations import COMPARE, LIBM, Node

_LIBRARY = {"abort", "atoi", "calloc", "exit", "free", "malloc", "printf", "puts", "rand", "realloc", "system"}
"""Functions of the C library with names that a law may use for its variables."""

_LONGEST = 26  # length of a name that is made from the names of operands

_PATTERNS = {
    **{"ADD": "{0}_plus_{1}", "SUB": "{0}_minus_{1}", "MUL": "{0}_{1}", "DIV": "{0}_per_{1}", "SQ": "{0}_squared"},
    **{"NEG": "minus_{0}", "TWICE": "two_{0}", "FABS": "abs_{0}", "SIGN": "sign_{0}", "INV": "one_per_{0}"},
    **{"LT": "{0}_below_{1}", "LE": "{0}_up_to_{1}", "EQ": "{0}_is_{1}", "NE": "{0}_is_not_{1}", "NOT": "not_{0}"},
    **{"AND": "{0}_and_{1}", "OR": "{0}_or_{1}", "SELECT": "{1}_or_{2}", "IF_ELSE_ZERO": "{1}_or_0"},
    "SUM": "sum_of_{0}",
}
"""Names of operations on operands with names."""

_MIRRORED = {"LT": "{1}_above_{0}", "LE": "{1}_from_{0}"}
_WITH_ZERO = {"LT": ("is_negative", "is_positive"), "LE": ("is_not_positive", "is_not_negative")}

_KINDS = {
    **{"ADD": "sum", "SUB": "difference", "MUL": "product", "DIV": "quotient", "SQ": "square", "NEG": "negative"},
    **{"SELECT": "choice", "IF_ELSE_ZERO": "choice", "AND": "both", "OR": "either", "NOT": "opposite"},
    **dict.fromkeys(COMPARE, "comparison"),
}
"""Names of operations on operands without names."""


class Named(NamedTuple):
    """A name that the source of a function gives to a node."""

    name: str  # the name, which several nodes may have
    node: int  # index of the node
    depth: int  # 0 for names in the law itself, more for names in functions that it calls
    assigned: bool
    """Whether it is the name of a variable. Its node always becomes a constant; other names are used if a node needs
    one."""


def place_name(place: str) -> str:
    """Return an identifier for a place such as ``states->Fi[3]``, for a vector such as ``states->Fi[i]`` its name."""
    words = re.findall(r"\w+", re.sub(rf"\[{INDEX}\b.*", "", place[place.rfind(">") + 1 :]))
    return "_".join(words)


class Names:
    """Unique identifiers, made from the names of nodes."""

    # A node without a name is named after its operation and its operands, or after its operation if they have no names.

    def __init__(
        self,
        nodes: Sequence[Node],
        named: Collection[Named],
        reads: Sequence[str],
        results: Mapping[int, str],
        taken: Iterable[str],
        *,
        no_case: bool,
        describes: bool,
    ) -> None:
        self._nodes = nodes
        self._key: Callable[[str], str] = str.upper if no_case else str
        self._taken = {*map(self._key, taken)}
        self._describes = describes
        self._reads = reads
        self._results = results
        self.assigned = {entry.node for entry in named if entry.assigned}
        best = sorted(enumerate(named), key=lambda pair: (not pair[1].assigned, pair[1].depth, pair[0]))
        chosen: dict[int, str] = {}
        for _, entry in best:
            if not entry.assigned and (entry.name == "value" or _valid(entry.name) != entry.name):
                continue  # such as `clip`, the name of a function
            chosen.setdefault(entry.node, _valid(entry.name))
        shared = {name for name in chosen.values() if list(chosen.values()).count(name) > 1}
        self._own: dict[int, str] = {}
        for node in filter(chosen.__contains__, dict.fromkeys(entry.node for entry in named)):
            self._own[node] = self._unique(chosen[node], numbered=chosen[node] in shared)
        self._fixed = dict(self._own)

    def of(self, node: int) -> str:
        """Return the identifier of a node that becomes a constant or a variable."""
        if node not in self._fixed:
            self._fixed[node] = self._described(node) if self._describes else self._unique("t", numbered=True, first=1)
        return self._fixed[node]

    def copy(self, place: str) -> str:
        """Return an identifier for the value of a place before it is overwritten."""
        return self._unique(f"{place_name(place)}_before", numbered=False)

    def _described(self, number: int) -> str:
        """Return an identifier for a value without a name: after its place, its operands, or its operation."""
        if number in self._results:
            place = self._results[number]
            name = place_name(place)
            if place in self._reads:
                name += "_next"
            return self._unique(f"{name}_out" if self._key(name) in self._taken else name, numbered=False)
        node = self._nodes[number]
        text = self._from_operands(node, depth=0)
        if text and len(text) <= _LONGEST and _valid(text) == text:
            return self._unique(text, numbered=False, first=2)
        kind = LIBM.get(node.operation, node.operation.lower())
        return self._unique(_KINDS.get(node.operation, f"{kind}_value"), numbered=True, first=1)

    def _from_operands(self, node: Node, depth: int) -> str:
        """Return a name made from the names of all operands; empty if one has none."""
        operation, operands = node.operation, [self._operand(argument, depth) for argument in node.arguments]
        if operation in _WITH_ZERO and "0" in operands and all(operands):
            place = operands.index("0")
            return f"{operands[1 - place]}_{_WITH_ZERO[operation][1 - place]}"
        pattern = _PATTERNS.get(operation, f"{LIBM[operation]}_{{0}}" if operation in LIBM else "")
        if operation in _MIRRORED and self._nodes[node.arguments[0]].operation == "INPUT":
            pattern = _MIRRORED[operation]
        if operation in ("SELECT", "IF_ELSE_ZERO"):
            operands[0] = operands[0] or "any"  # not part of the name
        return pattern.format(*operands) if all(operands) and operands.count("0") < 2 else ""

    def _operand(self, number: int, depth: int) -> str:
        """Return the name of an operand, or a name made from its own operands, which must have names."""
        node = self._nodes[number]
        if node.operation == "INPUT":
            return place_name(self._reads[int(node.value)])
        if node.operation == "CONST":
            return f"{node.value:g}" if node.value in (0.0, 1.0) else ""
        return self._own.get(number, "" if depth else self._from_operands(node, 1))

    def _unique(self, base: str, *, numbered: bool, first: int = 0) -> str:
        number, name = first, base
        joint = "" if base == "t" or base.endswith("_") else "_"
        while self._key(name) in self._taken or numbered:
            name, numbered = f"{base}{joint}{number}", False
            number += 1
        self._taken.add(self._key(name))
        return name


def _valid(name: str) -> str:
    """Return the name as a C identifier."""
    name = re.sub(r"_+", "_", name).lstrip("_") or "value"
    try:
        check_identifier("", "", name)
    except FrictionError:
        return f"{name}_value"
    return f"{name}_value" if name in _LIBRARY else name
