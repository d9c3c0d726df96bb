"""Tables of a block's variables for readers: grouped, with one row per vector."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from itertools import groupby

from friction_fmus.blocks.probe import (
    BOOLEAN,
    DERIVATIVE,
    FIXED,
    INPUT,
    INTEGER,
    LOCAL,
    OUTPUT,
    PARAMETER,
    STATE,
    STATE_OUTPUT,
    BlockVariables,
    Variable,
)

GROUPS = {
    "Inputs": (INPUT,),
    "Outputs": (OUTPUT, STATE_OUTPUT),
    "Internal variables": (STATE, LOCAL, DERIVATIVE),
    "Parameters": (PARAMETER,),
    "Fixed parameters": (FIXED,),
}
"""Title of each group and the roles in it; fixed parameters cannot be changed during a run."""


@dataclass(frozen=True)
class Entry:
    """A variable, or the elements of a vector."""

    name: str
    unit: str
    text: str
    """Name (``k[1...10]`` for a vector), unit or type, and description."""
    starts: tuple[str, ...]
    """Start values; one if all are equal, none for computed variables."""
    limits: str
    """Range of accepted values; empty if there are no limits."""


def variable_groups(rows: BlockVariables) -> dict[str, tuple[Entry, ...]]:
    """Return the groups that are not empty, in the order of `GROUPS`."""
    groups = {}
    for title, roles in GROUPS.items():
        members = [v for role in roles for v in rows.variables if v.role == role]
        if entries := tuple(_entry(list(same)) for _, same in groupby(members, _vector)):
            groups[title] = entries
    return groups


def _vector(v: Variable) -> str:
    """Return the name without the index of the element."""
    return re.sub(r"\[\d+\]", "[]", v.name)


def _entry(elements: list[Variable]) -> Entry:
    first, last = elements[0], elements[-1]
    name = first.name
    if last is not first:
        name = re.sub(r"\[1\]", f"[1...{len(elements)}]", name)
    given = first.role in (INPUT, PARAMETER, FIXED, STATE)
    starts = tuple(_value(v.start, v.type) for v in elements) if given else ()
    low, high = (_value(limit, first.type) if math.isfinite(limit) else "" for limit in (first.min, first.max))
    limits = f"{low} to {high}" if low and high else f"at least {low}" if low else f"at most {high}" if high else ""
    return Entry(
        name,
        {INTEGER: "Integer", BOOLEAN: "Boolean"}.get(first.type, first.unit),
        first.text,
        starts[:1] if len(set(starts)) == 1 else starts,
        limits if given and first.type != BOOLEAN else "",
    )


def _value(value: float, type_: int) -> str:
    if type_ == BOOLEAN:
        return "true" if value else "false"
    return str(int(value)) if type_ == INTEGER else f"{value:g}"
