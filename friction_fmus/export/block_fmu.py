"""Blocks by name or file, with their sources, written as FMUs or for another target."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal
from zipfile import ZipFile

from friction_fmus.blocks.catalogue import (
    PACKAGE,
    Block,
    drawn,
    find,
    icon_files,
    licence_text,
    listing,
    read_c,
    source_folder,
    with_room,
)
from friction_fmus.blocks.customise import Start, identified, renamed, rotational, with_start_values
from friction_fmus.blocks.probe import (
    FIXED,
    INPUT,
    PARAMETER,
    STATE,
    BlockVariables,
    Description,
    describe,
    read_variables,
)
from friction_fmus.errors import BuildError
from friction_fmus.export.targets import Compiling, SourceFmu, choose_target, write_file
from friction_fmus.version import VERSION, build_time
from harness.compiling import toolchain
from harness.compiling.platforms import NATIVE, compiled, native_library, select
from harness.storage.files import ScratchFolder, cached, hash_of
from harness.storage.zip_file import find_outside, zipped
from harness.units import in_unit

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


SHIPPED = PACKAGE / "fmus"  # folder of the FMUs for all platforms in an installed package; a checkout has none

SHARED_FOLDERS = ("", "numerics", "friction")
"""Folders of ``fmu_src`` with headers for all blocks; in an FMU, all sources are in one folder."""

TWIN = "In this rotational twin, forces but Fn are torques, lengths are angles, and masses are moments of inertia."
FMI_HEADER = "fmi2Functions.h"  # the header of the FMI standard, which importers provide


def build(
    model: str | Path,
    out_dir: str | Path,
    start: Start | None = None,
    name: str | None = None,
    files: Mapping[str, str] | None = None,
    *,
    domain: Literal["translational", "rotational"] = "translational",
    platforms: Sequence[str] = ("native",),
    fmi: Literal[2, 3] = 2,
    target: str | None = None,
    compiling: Compiling | None = None,
    **options: Any,
) -> Path:
    """Build one FMU.

    Parameters
    ----------
    model : str or Path
        Name of a block (`friction-fmus list`), or path of a block's ``.c`` or a law's ``.py`` file.
    out_dir : path-like
        Folder for ``NAME.fmu``, or for the folder ``NAME-wasm``; it is created if needed.
    start : mapping of str to number, optional
        New default start values, in the units of the block, or with a unit: ``{"Fc": "0.002 kN"}``. The normal force
        Fn begins with that of the parameters, Fn0, unless it is given.
    name : str, optional
        Model identifier and file name, if different from the model's name.
    files : mapping of str to str, optional
        Additional or replaced headers of the block, such as ``series.h`` of `Record`.
    domain : {"translational", "rotational"}
        The rotational twin uses N.m, rad and kg.m2 in place of N, m and kg, and has the suffix ``Rotational``.
    platforms : sequence of str
        Platforms of the binaries: ``"native"``, ``"all"`` or names such as ``"win64"``, see `PLATFORMS`. ``"wasm32"``
        alone writes a WebAssembly module with a JavaScript class in place of an FMU.
    fmi : {2, 3}
        Version of FMI: 2.0, or 3.0 with intermediate update and adjoint derivatives. The numbers are the same.
    target : str, optional
        What is written, in place of an FMU of version ``fmi``: the name of a module of `friction_fmus.export.targets`.
    compiling : callable, optional
        Called before each platform is compiled, with its name and the number of completed platforms, for a progress
        bar. It is not called for an FMU in the cache.
    **options
        Options of the target. An FMI 3.0 FMU has a clock for its samples with ``clocks=True``, and arrays for its
        vectors with ``arrays=True``; many importers know neither.

    Returns
    -------
    Path
        The FMU or the folder, which is written completely or not at all.

    Raises
    ------
    UnknownNameError, BuildError
        If the model is unknown; if it cannot be built.
    """
    chosen, given = choose_target("fmu", target or f"fmi{fmi}", options, platforms)
    selected = select(tuple(platforms))
    source = replace(block_source(model, start, name, files, domain, compiling), platforms=selected)
    path = Path(out_dir) / f"{source.identifier}{chosen.ending}"
    chosen.write(source, path, **given)
    return path


def block_source(
    model: str | Path,
    start: Start | None = None,
    name: str | None = None,
    files: Mapping[str, str] | None = None,
    domain: str = "translational",
    compiling: Compiling | None = None,
) -> SourceFmu:
    """Return a block, of which targets make what they write, from the cache or a new build; see `build`."""
    twin = domain == "rotational"
    if not (start or name or files or twin) and (shipped := _shipped(model)):
        return SourceFmu(shipped.stem, shipped.read_bytes(), (), compiling, ((NATIVE,), select(("all",))))
    block = find(model)
    block = replace(block, summary=block.rotary_summary, notes=f"{block.notes}\n\n{TWIN}") if twin else block
    identifier = name or block.name + ("Rotational" if twin else "")
    start = _in_units(replace(block, code=rotational(block.code)) if twin else block, start or {})
    code = with_start_values(with_room(block, start).code, start)
    code = rotational(code) if twin else code
    code = renamed(code, identifier) if name else code
    block = replace(block, name=identifier, code=code)
    sources = identified(_sources(block, files or {}), identifier)

    def make() -> bytes:
        if compiling:
            compiling(NATIVE.folder, 0)
        return assemble(block, sources)

    path = toolchain.cache_folder() / f"{identifier}-{_key(sources, block)}.fmu"
    return SourceFmu(identifier, cached(path, make), (), compiling, ((NATIVE,),))


def _in_units(block: Block, start: Mapping[str, Any]) -> Start:
    """Return start values with each text such as ``0.002 kN`` as a number in the unit of its variable."""
    if not any(isinstance(value, str) for value in start.values()):
        return start
    units = {variable.name: variable.unit for variable in describe_block(block).variables}
    return {name: in_unit(value, units.get(name), None, name) for name, value in start.items()}


def _shipped(model: str | Path) -> Path | None:
    """Return the FMU in the installed package, if the model is one of its blocks."""
    path = SHIPPED / f"{model}.fmu"
    return path if path.is_file() and str(model) in listing() else None


def fmu(
    name: str | Path,
    domain: Literal["translational", "rotational"] = "translational",
    files: Mapping[str, str] | None = None,
    **start: float | bool | str,
) -> Path:
    """Return the path of the FMU of a block, with default or other start values.

    An installed package contains the FMUs of its blocks for all platforms. For a user's file, or in a checkout, the FMU
    is built for this machine and cached.

    Parameters
    ----------
    name : str or Path
        Name or file of the block, see `build`.
    domain : {"translational", "rotational"}
        See `build`.
    files : mapping of str to str, optional
        See `build`.
    **start
        Other default start values, such as ``Fc=2.0`` or ``Fc="0.002 kN"``.

    Returns
    -------
    Path
        The FMU. Copy it before you change it.

    Raises
    ------
    UnknownNameError, BuildError
        If the model is unknown; if it cannot be built.
    """
    if domain == "translational" and not files and not start and (shipped := _shipped(name)):
        return shipped
    source = block_source(name, start, None, files, domain)
    # one folder per content, as another version of this package may use the same cache
    folder = toolchain.cache_folder() / "models" / hashlib.sha256(source.content).hexdigest()[:16]
    path = folder / f"{source.identifier}.fmu"
    write_file(source.content, path)
    return path


def describe_block(block: Block) -> BlockVariables:
    """Read the variables of a block from its library, which is compiled if it is not in the installed package."""
    shipped = _shipped(block.name)
    if shipped is None or find(block.name) is not block:
        return read_variables(native_library(identified(_sources(block, {}), block.name), block.name))
    with ScratchFolder() as folder, ZipFile(shipped) as archive:
        member = f"binaries/{NATIVE.folder}/{block.name}{NATIVE.suffix}"
        return read_variables(Path(archive.extract(member, folder)))


def build_record(
    times: ArrayLike,
    r: ArrayLike,
    rd: ArrayLike,
    rdd: ArrayLike,
    out_dir: str | Path,
    name: str = "Record",
    *,
    domain: Literal["translational", "rotational"] = "translational",
) -> Path:
    """Build a `Record` FMU that plays back a measured or computed reference.

    Parameters
    ----------
    times, r, rd, rdd : array_like, shape (n,)
        Strictly increasing times [s], and position [m], velocity [m/s] and acceleration [m/s2] at these times.
    out_dir : path-like
        Folder for the FMU.
    name : str
        Model identifier.
    domain : {"translational", "rotational"}
        The rotational twin uses rad in place of m.

    Returns
    -------
    Path
        The FMU.

    Raises
    ------
    BuildError
        If lengths differ, values are not finite or times do not increase.
    """
    import numpy as np

    columns = [np.asarray(column, dtype=float) for column in (times, r, rd, rdd)]
    if len({column.shape for column in columns}) != 1 or columns[0].ndim != 1 or columns[0].size < 2:
        raise BuildError("A record needs times, r, rd and rdd as vectors of the same length, at least 2")
    table = np.column_stack(columns)
    if not np.isfinite(table).all() or not (np.diff(columns[0]) > 0.0).all():
        raise BuildError(
            "A record needs finite values at strictly increasing times; sort the samples and remove missing values"
        )
    rows = "".join("    {" + ", ".join(repr(float(value)) for value in row) + "},\n" for row in table)
    text = f"/* t, r, rd, rdd in SI units */\nstatic const double series[][4] = {{\n{rows}}};\n"
    return build("Record", out_dir, name=name, files={"series.h": text}, domain=domain)


def _sources(block: Block, files: Mapping[str, str]) -> dict[str, str]:
    """Return the text of each source file: the block and all headers that it includes, directly or indirectly."""
    sources = {f"{block.name}.c": block.code}
    places = (block.path.parent, *(source_folder() / folder for folder in SHARED_FOLDERS))
    pending = [(block.path, block.code)]
    while pending:
        includer, text = pending.pop()
        for header in re.findall(r'^[ \t]*#[ \t]*include\s+"([^"]+)"', text, re.M):
            if header in sources or header == FMI_HEADER:
                continue
            if find_outside([header]) is not None:  # it would be written to this path
                raise BuildError(f"{includer} includes {header!r}: copy this file into the same folder")
            given = header in files
            found = None if given else next((p / header for p in places if (p / header).is_file()), None)
            if found is None and not given:
                raise BuildError(f"{includer} includes {header!r}, which is neither in the same folder nor in fmu_src")
            sources[header] = files[header] if found is None else read_c(found, BuildError)
            pending.append((Path(header), sources[header]))
    return sources


def _key(sources: Mapping[str, str], block: Block) -> str:
    """Return a hash of everything that determines the bytes of the FMU."""
    texts = [
        _generator(),
        build_time(),
        toolchain.identity(),
        *(block.kind, block.summary, block.source, block.notes),
        *(part for item in sorted(sources.items()) for part in item),
        *(file.read_bytes().hex() for file in icon_files(block)),
    ]
    return hash_of(texts)[:24]


@cache
def _generator() -> str:
    """Return a hash of what generates FMUs: this package and fmpy."""
    from importlib.metadata import version

    modules = (path.read_text(encoding="utf-8") for path in sorted(PACKAGE.rglob("*.py")))
    return hash_of((VERSION, version("fmpy"), *modules))


def assemble(block: Block, sources: Mapping[str, str]) -> bytes:
    """Return the FMU for this machine: library, model description, documentation and terminals."""
    from friction_fmus.fmi.documentation import index_page  # not needed for an FMU in the cache
    from friction_fmus.fmi.model_description import model_description, terminals, terminals_and_icons

    place = f"binaries/{NATIVE.folder}/{block.name}{NATIVE.suffix}"
    members = {f"sources/{name}": text.encode() for name, text in sources.items()}
    members[place] = compiled(NATIVE, sources, block.name)
    with ScratchFolder() as folder:
        native = Path(folder) / f"{block.name}{NATIVE.suffix}"
        native.write_bytes(members[place])
        description = describe(native, computed(block))
    _check_start_values(block, description)
    connected = terminals(description, block.kind)
    icons = {"icon": icon_files(block), **{each.shape: drawn(each.shape) for each in connected}}
    for name, files in icons.items():
        members |= {f"terminalsAndIcons/{name}{file.suffix}": file.read_bytes() for file in files}
    members |= {
        "modelDescription.xml": model_description(block, description, block.name),
        "model.png": members["terminalsAndIcons/icon.png"],
        "terminalsAndIcons/terminalsAndIcons.xml": terminals_and_icons(connected),
        "documentation/licenses/license.txt": licence_text().encode(),
        "documentation/index.html": index_page(block, description).encode(),
    }
    return zipped(members, build_time())


def _check_start_values(block: Block, description: Description) -> None:
    for v in description.variables:
        if v.role in (INPUT, PARAMETER, FIXED, STATE) and not v.min <= v.start <= v.max:
            raise BuildError(
                f"The start value {v.name} = {v.start:g} of {block.name} lies outside "
                f"[{v.min:g}, {v.max:g}]; choose a value inside"
            )
    if description.violated:
        raise BuildError(f"The start values of {block.name} violate {description.violated}; choose others")


def computed(block: Block) -> dict[str, tuple[str, ...]]:
    """Return the dependencies of a law's outputs as casadi finds them; empty for other blocks."""
    if not block.is_law:
        return {}
    from friction_fmus.lawkit.law import Kind, discover_laws

    (law,) = discover_laws(block.path)
    return {variable.name: law.dependencies(variable.name) for variable in law.select(Kind.OUTPUT)}
