"""Names of the constants and variables in generated C."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.declarations import check_identifier
from friction_fmus.lawkit.emit.graph import Node


class Named(NamedTuple):
    """A name that the source of a function gives to a node.

    Attributes
    ----------
    name : str
        The name, which several nodes may have.
    node : int
        Index of the node.
    depth : int
        0 for names in the law itself, more for names in functions that it calls.
    assigned : bool
        Whether it is the name of a variable. Its node always becomes a constant; other names are used if a node needs
        one.
    """

    name: str
    node: int
    depth: int
    assigned: bool


def place_name(place: str) -> str:
    """Return an identifier for a place such as ``states->Fi[3]``."""
    words = re.findall(r"\w+", place[place.rfind(">") + 1 :])
    return "_".join(words)


class Names:
    """Unique identifiers, made from the names of nodes.

    Parameters
    ----------
    nodes : sequence of Node
        All operations, arguments before their users.
    named : collection of Named
        Names in the order of assignment; without any, identifiers are t1, t2, ...
    results : mapping of int to str
        Name of each result by node.
    taken : iterable of str
        Identifiers that are already in use.
    """

    def __init__(
        self, nodes: Sequence[Node], named: Collection[Named], results: Mapping[int, str], taken: Iterable[str]
    ) -> None:
        """Choose a name for every node that has one."""
        self._taken = {*taken}
        self._owners: dict[int, list[str]] = {}
        self.assigned = {entry.node for entry in named if entry.assigned}
        best = sorted(enumerate(named), key=lambda pair: (not pair[1].assigned, pair[1].depth, pair[0]))
        chosen: dict[int, str] = {}
        for _, entry in best:
            if not entry.assigned and (entry.name == "value" or _valid(entry.name) != entry.name):
                continue  # such as `clip`, the name of a function
            chosen.setdefault(entry.node, _valid(entry.name))
        self._shared = {name for name in chosen.values() if list(chosen.values()).count(name) > 1}
        self._order = list(dict.fromkeys(entry.node for entry in named))
        self._fixed: dict[int, str] = {}
        for node in filter(chosen.__contains__, self._order):
            self._fixed[node] = self._unique(chosen[node], numbered=chosen[node] in self._shared)
        if named:
            self._owners = {node: [name] for node, name in results.items()}
            for number in range(len(nodes) - 1, -1, -1):
                owners = [self._fixed[number]] if number in self.assigned else self._owners.get(number, [])
                for argument in nodes[number].arguments:
                    self._owners.setdefault(argument, []).extend(owners)

    def of(self, node: int) -> str:
        """Return the identifier of a node that becomes a constant or a variable."""
        if node not in self._fixed:
            self._fixed[node] = self._derived(list(dict.fromkeys(self._owners.get(node, []))))
        return self._fixed[node]

    def _derived(self, owners: Sequence[str]) -> str:
        """Return an identifier for a value without a name, which these values with names need."""
        if not owners:
            return self._unique("t", numbered=True, first=1)
        family = re.sub(r"_\d+$", "", owners[0])
        if family not in self._shared:
            return self._unique(owners[0], numbered=True, first=1)
        # the numbers of a family are those of the elements of the law
        return self._unique(f"{owners[0] if len(owners) == 1 else family}_part", numbered=False, first=1)

    def copy(self, place: str) -> str:
        """Return an identifier for the value of a place before it is overwritten."""
        return self._unique(f"{place_name(place)}_before", numbered=False)

    def _unique(self, base: str, *, numbered: bool, first: int = 0) -> str:
        number, name = first, base
        joint = "" if base == "t" else "_"
        while name in self._taken or numbered:
            name, numbered = f"{base}{joint}{number}", False
            number += 1
        self._taken.add(name)
        return name


def _valid(name: str) -> str:
    """Return the name as a C identifier."""
    name = re.sub(r"_+", "_", name).lstrip("_") or "value"
    try:
        check_identifier("", "", name)
    except FrictionError:
        return f"{name}_value"
    return name
