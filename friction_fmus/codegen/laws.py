"""Laws by name, and their start values, for code generation."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from friction_fmus.blocks.catalogue import find, listing
from friction_fmus.errors import FrictionError, UnknownNameError, did_you_mean
from friction_fmus.lawkit.law import BOOLEANS, VECTORS, Law
from friction_fmus.lawkit.law_files import discover_laws


def law_of(model: str | Path) -> Law:
    """Return a law."""
    block = find(model)
    if not block.is_law:
        laws = [entry.name for entry in listing().values() if entry.path.suffix == ".py"]
        near = [name for name in laws if name.startswith(block.name)]
        what = f"in C: copy {block.path}" if block.family else f"a {block.kind} block"
        hint = f"; did you mean {' or '.join(near)}?" if near else ""
        raise FrictionError(f"{block.name} is {what}, but codegen exports compensators written in Python{hint}")
    return next(law for law in discover_laws(block.path) if law.name == block.name)


def start_values(law: Law, start: Mapping[str, float | bool]) -> dict[str, tuple[float, ...]]:
    """Return the start values of a law by variable, with some changed."""
    values = {variable.name: variable.starts for variable in law.given}
    for name, value in start.items():
        _set(law, values, name, value)
    if broken := law.conditions.violated(values):
        raise FrictionError(f"{law.name} requires {broken[0]}, which the given values violate")
    return values


def _set(law: Law, values: dict[str, tuple[float, ...]], name: str, value: float | bool) -> None:
    element = re.fullmatch(r"(\w+)\[(\d+)\]", name)
    plain = element[1] if element else name
    variable = next((v for v in law.given if v.name == plain), None)
    if variable is None or (variable.kind in VECTORS) != bool(element):
        names = [v.name for v in law.given]
        raise UnknownNameError(f"{law.name} has no variable {name!r} with a start value{did_you_mean(plain, names)}")
    place = int(element[2]) - 1 if element else 0
    if not 0 <= place < len(variable.starts):
        raise UnknownNameError(
            f"There is no variable {name!r}; the elements of {plain} are 1 to {len(variable.starts)}"
        )
    if variable.kind in BOOLEANS and value not in (0.0, 1.0):
        raise FrictionError(f"{name} = {value:g} is not a Boolean; give true or false")
    if not (variable.min <= value <= variable.max and abs(value) < float("inf")):
        raise FrictionError(
            f"{name} = {value:g} lies outside [{variable.min:g}, {variable.max:g}]; choose a value inside"
        )
    changed = list(values[plain])
    changed[place] = float(value)
    values[plain] = tuple(changed)
