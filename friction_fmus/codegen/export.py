"""Export of a law to a folder with C files and a README that states their cost."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from friction_fmus.blocks.catalogue import find
from friction_fmus.codegen.cost import Cost, measure
from friction_fmus.codegen.layout import Export
from friction_fmus.codegen.readme import readme
from friction_fmus.codegen.sources import example, header, implementation
from friction_fmus.codegen.target import COMPILER, CORES, missing
from friction_fmus.codegen.unit_test import unit_test
from friction_fmus.codegen.vectors import vectors
from friction_fmus.codegen.wrapper import wrapper
from friction_fmus.errors import FrictionError, UnknownNameError, nearest
from friction_fmus.lawkit.declarations import check_identifier
from friction_fmus.lawkit.emit.c_text import DOUBLE, FLOAT
from friction_fmus.lawkit.files import discover_laws
from friction_fmus.lawkit.law import BOOLEANS, VECTORS, Law
from harness.storage.atomic import atomic_path


def export_law(
    model: str | Path,
    out_dir: str | Path,
    *,
    real: Literal["float", "double"] = "double",
    start: Mapping[str, float | bool] | None = None,
    prefix: str = "law",
) -> tuple[Path, ...]:
    """Write a law as C.

    Parameters
    ----------
    model : str or Path
        Name of a law, or path of a law file.
    out_dir : path-like
        Folder for ``law.h``, ``law.c``, ``law_test.c``, ``law.hpp``, ``main.c`` and ``README.md``; it is created if
        needed.
    real : {"float", "double"}
        Type of all numbers.
    start : mapping of str to number, optional
        Other start values of parameters, states and inputs; elements of vectors are ``k[1]``.
    prefix : str
        Prefix of names of files, types and functions, for several laws in one program.

    Returns
    -------
    tuple of Path
        The files.

    Raises
    ------
    UnknownNameError, FrictionError
        If the model is unknown; if it is not a law or a start value is invalid.
    """
    export = make_export(model, real=real, start=start, prefix=prefix)
    costs: tuple[Cost, ...] = () if COMPILER in missing() else tuple(measure(export, core) for core in CORES)
    texts = {
        f"{prefix}.h": header(export),
        f"{prefix}.c": implementation(export),
        f"{prefix}_test.c": unit_test(export, vectors(export)),
        f"{prefix}.hpp": wrapper(export),
        "main.c": example(export),
        "README.md": readme(export, costs),
    }
    folder = Path(out_dir)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        with atomic_path(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8", newline="\n")
    return tuple(folder / name for name in texts)


def make_export(
    model: str | Path,
    *,
    real: Literal["float", "double"] = "double",
    start: Mapping[str, float | bool] | None = None,
    prefix: str = "law",
) -> Export:
    """Return the checked data of an export; arguments and errors are the same as for `export_law`."""
    law = _law(model).with_room(start or {})
    check_identifier("codegen", "prefix", prefix)
    if prefix == "main":
        raise FrictionError("The prefix main is the name of the example; choose another prefix")
    values = {variable.name: variable.starts for variable in law.given}
    for name, value in (start or {}).items():
        _set(law, values, name, value)
    if broken := law.conditions.violated(values):
        raise FrictionError(f"{law.name} requires {broken[0]}, which the given values violate")
    return Export(law, FLOAT if real == "float" else DOUBLE, prefix, values)


def _law(model: str | Path) -> Law:
    block = find(model)
    if block.kind != "law" and block.path.suffix != ".py":
        raise FrictionError(f"{block.name} is not a law but a C block; use its file {block.path.name}")
    return next(law for law in discover_laws(block.path) if law.name == block.name)


def _set(law: Law, values: dict[str, tuple[float, ...]], name: str, value: float | bool) -> None:
    element = re.fullmatch(r"(\w+)\[(\d+)\]", name)
    plain = element[1] if element else name
    variable = next((v for v in law.given if v.name == plain), None)
    if variable is None or (variable.kind in VECTORS) != bool(element):
        names = [v.name for v in law.given]
        raise UnknownNameError(f"{law.name} has no variable {name!r} with a start value{nearest(plain, names)}")
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
