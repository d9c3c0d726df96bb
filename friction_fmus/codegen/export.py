"""Export of a law to a folder with C files and a README that states their cost."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Literal

from friction_fmus.codegen.cost import Cost, measure
from friction_fmus.codegen.laws import law_of, start_values
from friction_fmus.codegen.layout import Export
from friction_fmus.codegen.loop import loop_law
from friction_fmus.codegen.loop_file import read_loop
from friction_fmus.codegen.readme import readme
from friction_fmus.codegen.rotary import rotary_law
from friction_fmus.codegen.sources import example, header, implementation
from friction_fmus.codegen.table import table_header, table_source
from friction_fmus.codegen.target import COMPILER, CORES, missing
from friction_fmus.codegen.unit_test import unit_test
from friction_fmus.codegen.vectors import vectors
from friction_fmus.codegen.wrapper import wrapper
from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.declarations import check_identifier
from friction_fmus.lawkit.emit.c_text import DOUBLE, FLOAT
from harness.storage.atomic import atomic_path, make_folder


def export_law(
    model: str | Path,
    out_dir: str | Path,
    *,
    real: Literal["float", "double"] = "double",
    start: Mapping[str, float | bool] | None = None,
    prefix: str = "",
) -> tuple[Path, ...]:
    """Write a law as C.

    Parameters
    ----------
    model : str or Path
        Name of a law, or path of a law file or of the file of a loop, see `friction_fmus.codegen.loop_file`.
    out_dir : path-like
        Folder for ``PREFIX.h``, ``PREFIX.c``, ``PREFIX_test.c``, ``PREFIX.hpp``, ``main.c``, ``README.md`` and, for a
        loop with a table over position, ``PREFIX_table.h`` and ``PREFIX_table.c``; it is created if needed.
    real : {"float", "double"}
        Type of all numbers.
    start : mapping of str to number, optional
        Other start values of parameters, states and inputs; elements of vectors are ``k[1]``.
    prefix : str
        Prefix of names of files, types and functions, for several laws in one program; by default ``law``, or ``loop``
        for a loop.

    Returns
    -------
    tuple of Path
        The files.

    Raises
    ------
    UnknownNameError, FrictionError
        If the model is unknown; if it is not a law or a start value is invalid.
    OutputError
        If a file cannot be written; then none is.
    """
    export = make_export(model, real=real, start=start, prefix=prefix)
    prefix = export.prefix
    costs: tuple[Cost, ...] = () if COMPILER in missing() else tuple(measure(export, core) for core in CORES)
    texts = {
        f"{prefix}.h": header(export),
        f"{prefix}.c": implementation(export),
        f"{prefix}_test.c": unit_test(export, vectors(export)),
        f"{prefix}.hpp": wrapper(export),
        "main.c": example(export),
        "README.md": readme(export, costs),
    }
    if export.table is not None:
        texts[f"{prefix}_table.h"] = table_header(export)
        texts[f"{prefix}_table.c"] = table_source(export, export.table)
    folder = Path(out_dir)
    new = not folder.exists()
    make_folder(folder)
    try:
        with ExitStack() as stack:  # no file replaces another one before all are written
            for name, text in texts.items():
                temporary = stack.enter_context(atomic_path(folder / name))
                temporary.write_text(text, encoding="utf-8", newline="\n")
    except BaseException:
        if new:
            folder.rmdir()
        raise
    return tuple(folder / name for name in texts)


def make_export(
    model: str | Path,
    *,
    real: Literal["float", "double"] = "double",
    start: Mapping[str, float | bool] | None = None,
    prefix: str = "",
) -> Export:
    """Return the checked data of an export; arguments and errors are the same as for `export_law`."""
    loop = read_loop(Path(model)) if Path(model).suffix == ".toml" else None
    law = loop_law(loop) if loop else law_of(model).with_room(start or {})
    law = rotary_law(law) if loop and loop.rotary else law
    prefix = prefix or ("loop" if loop else "law")
    check_identifier("codegen", "prefix", prefix)
    if prefix == "main":
        raise FrictionError("The prefix main is the name of the example; choose another prefix")
    export = Export(law, FLOAT if real == "float" else DOUBLE, prefix, start_values(law, start or {}))
    return replace(export, rotary=loop.rotary, table=loop.table) if loop else export
