"""From a block to an FMU: compile, describe, document, zip."""

from __future__ import annotations

import hashlib
import io
import re
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Literal

import fmpy
import matplotlib as mpl
import numpy as np
from numpy.typing import ArrayLike

from friction_fmus.catalogue import Block, find, package_text, source_folder, with_room
from friction_fmus.customise import Start, identified, renamed, rotational, with_start_values
from friction_fmus.describe import FIXED, INPUT, PARAMETER, STATE, Description, describe
from friction_fmus.documentation import index_page
from friction_fmus.errors import BuildError
from friction_fmus.law import Kind
from friction_fmus.law_files import discover_laws
from friction_fmus.model_description import build_time, model_description
from friction_fmus.portrait import portray, terminal_icon
from friction_fmus.terminals import terminals, terminals_and_icons
from friction_fmus.version import VERSION
from harness import toolchain
from harness.atomic import atomic_path
from harness.cache import cached
from harness.files import read_source, reason
from harness.platforms import NATIVE, Platform, compiled, native_library, select
from harness.scratch import ScratchFolder

SHIPPED = Path(__file__).parent / "fmus"
"""FMUs for all platforms in an installed package; a checkout has none."""

SHARED_FOLDERS = ("", "numerics", "friction")
"""Folders of ``fmu_src`` whose headers any block may include; in an FMU all sources are in one folder."""

FMI_HEADER = "fmi2Functions.h"
"""The header of the standard, which importers have and FMUs do not carry."""


def build(
    model: str | Path,
    out_dir: str | Path,
    start: Start | None = None,
    name: str | None = None,
    files: Mapping[str, str] | None = None,
    *,
    domain: Literal["translational", "rotational"] = "translational",
    platforms: Sequence[str] = ("native",),
) -> Path:
    """Builds one FMU.

    Parameters
    ----------
    model : str or Path
        Name of a block (`friction-fmus list`), or path of a block's ``.c`` or a law's ``.py`` file.
    out_dir : path-like
        Folder for ``NAME.fmu``; made if needed.
    start : mapping of str to number, optional
        Start values to burn in, in the units of the block.
    name : str, optional
        Other model identifier and file name.
    files : mapping of str to str, optional
        Further or replaced headers of the block, such as ``series.h`` of `Record`.
    domain : {"translational", "rotational"}
        The rotational twin has N.m, rad and kg.m2 for N, m and kg, and the suffix ``Rotational``.
    platforms : sequence of str
        Which binaries it gets: ``"native"``, ``"all"`` or names such as ``"win64"``, see `PLATFORMS`.

    Returns
    -------
    Path
        The FMU, complete or not there at all.

    Raises
    ------
    UnknownNameError, BuildError
        See their messages.
    """
    file, content = _built(model, start, name, files, domain, platforms)
    return _write(content, Path(out_dir) / file)


def _built(
    model: str | Path,
    start: Start | None,
    name: str | None,
    files: Mapping[str, str] | None,
    domain: str,
    platforms: Sequence[str],
) -> tuple[str, bytes]:
    """Return the file name of an FMU and its content, from the cache or built."""
    block = find(model)
    chosen = select(tuple(platforms))
    twin = domain == "rotational"
    plain = not (start or name or files or twin) and tuple(platforms) in (("native",), ("all",))
    if plain and (shipped := _shipped(model, block)):
        return shipped.name, shipped.read_bytes()
    code = with_start_values(with_room(block, start or {}).code, start or {})
    code = rotational(code) if twin else code
    identifier = name or block.name + ("Rotational" if twin else "")
    code = renamed(code, identifier) if name else code
    block = replace(block, name=identifier, code=code)
    sources = identified(_sources(block, files or {}), identifier)
    path = toolchain.cache_folder() / f"{identifier}-{_key(sources, block, chosen)}.fmu"
    return f"{identifier}.fmu", cached(path, lambda: _make(block, sources, chosen))


def _shipped(model: str | Path, block: Block) -> Path | None:
    """The FMU of the installed package, if it is one of its blocks that is asked for."""
    path = SHIPPED / f"{block.name}.fmu"
    return path if str(model) == block.name and path.is_file() else None


def fmu(name: str | Path, domain: Literal["translational", "rotational"] = "translational") -> Path:
    """Return the FMU of a block with its own start values: that of the installed package, for all platforms.

    Parameters
    ----------
    name : str or Path
        As of `build`. For a file, or in a checkout, the FMU is built, for this machine, and cached.
    domain : {"translational", "rotational"}
        As of `build`.

    Returns
    -------
    Path
        The FMU. Copy it before you change it.

    Raises
    ------
    UnknownNameError, BuildError
        See their messages.
    """
    if domain == "translational" and (shipped := _shipped(name, find(name))):
        return shipped
    file, content = _built(name, None, None, None, domain, ("native",))
    # a folder for each content: another version of this package may use the same cache
    return _write(content, toolchain.cache_folder() / "models" / hashlib.sha256(content).hexdigest()[:16] / file)


def describe_block(block: Block) -> Description:
    """Compiles a block and reads its variables.

    Raises
    ------
    BuildError
        If it does not compile.
    """
    library = native_library(identified(_sources(block, {}), block.name), block.name)
    return describe(library, _computed(block))


def _computed(block: Block) -> dict[str, tuple[str, ...]]:
    """The outputs of a law and what they are computed from, as casadi knows; nothing of other blocks."""
    if block.kind != "law":
        return {}
    (law,) = discover_laws(block.path)
    return {variable.name: law.dependencies(variable.name) for variable in law.select(Kind.OUTPUT)}


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
    """Builds a `Record` FMU that plays a measured or computed reference.

    Parameters
    ----------
    times, r, rd, rdd : array_like, shape (n,)
        Strictly increasing times [s], position [m], velocity [m/s], acceleration [m/s2].
    out_dir : path-like
        Folder for the FMU.
    name : str
        Model identifier.
    domain : {"translational", "rotational"}
        The rotational twin has rad for m.

    Raises
    ------
    BuildError
        If lengths differ, values are not finite or times do not increase.
    """
    columns = [np.asarray(column, dtype=float) for column in (times, r, rd, rdd)]
    if len({column.shape for column in columns}) != 1 or columns[0].ndim != 1 or columns[0].size < 2:
        raise BuildError("A record needs times, r, rd and rdd as vectors of one length, at least 2")
    table = np.column_stack(columns)
    if not np.isfinite(table).all() or not (np.diff(columns[0]) > 0.0).all():
        raise BuildError("A record needs finite values at strictly increasing times; sort it and drop the gaps")
    rows = "".join("    {" + ", ".join(repr(float(value)) for value in row) + "},\n" for row in table)
    text = f"/* t [s], r [m], rd [m/s], rdd [m/s2] */\nstatic const double series[][4] = {{\n{rows}}};\n"
    return build("Record", out_dir, name=name, files={"series.h": text}, domain=domain)


def _sources(block: Block, files: Mapping[str, str]) -> dict[str, str]:
    """Return file name -> text: the block and all headers that it includes, directly or through others."""
    sources = {f"{block.name}.c": block.code}
    places = (block.path.parent, *(source_folder() / folder for folder in SHARED_FOLDERS))
    pending = [(block.path, block.code)]
    while pending:
        includer, text = pending.pop()
        for header in re.findall(r'^#include\s+"([^"]+)"', text, re.M):
            if header in sources or header == FMI_HEADER:
                continue
            given = header in files
            found = None if given else next((p / header for p in places if (p / header).is_file()), None)
            if found is None and not given:
                raise BuildError(f"{includer} includes {header!r}, which is neither beside it nor in fmu_src")
            sources[header] = files[header] if found is None else _header(found)
            pending.append((Path(header), sources[header]))
    return sources


def _header(path: Path) -> str:
    try:
        return read_source(path)
    except (OSError, ValueError) as error:
        raise BuildError(f"{path} cannot be read as C ({reason(error)}); give a text in UTF-8") from error


def _key(sources: Mapping[str, str], block: Block, platforms: Sequence[Platform]) -> str:
    """Hash of all that decides the bytes of the FMU."""
    digest = hashlib.sha256()
    texts = [
        VERSION,
        build_time(),
        *(toolchain.identity(target) for platform in (NATIVE, *platforms) for target in platform.targets),
        *(platform.folder for platform in platforms),
        *(module.__version__ for module in (fmpy, mpl)),
        package_text("CHANGELOG.md"),
        block.kind,
        block.summary,
        block.source,
    ]
    for text in (*texts, block.notes, *_package(), *(part for item in sorted(sources.items()) for part in item)):
        digest.update(text.encode() + b"\0")
    return digest.hexdigest()[:24]


@cache
def _package() -> tuple[str, ...]:
    """The texts of the modules that make the FMU, and of those that they quote."""
    return tuple(path.read_text(encoding="utf-8") for path in sorted(Path(__file__).parent.rglob("*.py")))


def _make(block: Block, sources: Mapping[str, str], platforms: Sequence[Platform]) -> bytes:
    """The FMU as bytes."""
    with ScratchFolder("friction-fmus-") as folder:
        _stage(block, sources, platforms, Path(folder))
        return _zipped(Path(folder) / "fmu")


def _stage(block: Block, sources: Mapping[str, str], platforms: Sequence[Platform], folder: Path) -> None:
    """Makes the unzipped FMU in the folder ``fmu`` of a temporary one."""
    staged = folder / "fmu"
    (staged / "sources").mkdir(parents=True)
    for name, text in sources.items():
        (staged / "sources" / name).write_text(text, encoding="utf-8", newline="\n")
    for place, platform in ((folder, NATIVE), *((staged, platform) for platform in platforms)):
        library = place / "binaries" / platform.folder / f"{block.name}{platform.suffix}"
        library.parent.mkdir(parents=True)
        library.write_bytes(compiled(platform, sources, block.name))
    native = folder / "binaries" / NATIVE.folder / f"{block.name}{NATIVE.suffix}"
    description = describe(native, _computed(block))
    _check_start_values(block, description)
    (staged / "modelDescription.xml").write_bytes(model_description(block, description, block.name))
    portrait = portray(block, description, folder)
    (staged / "model.png").write_bytes(portrait.icon.png)
    connected = terminals(description)
    icons = {"icon": portrait.icon, **{each.shape: terminal_icon(each.shape) for each in connected}}
    (staged / "terminalsAndIcons").mkdir()
    (staged / "terminalsAndIcons" / "terminalsAndIcons.xml").write_bytes(terminals_and_icons(connected))
    for name, image in icons.items():
        (staged / "terminalsAndIcons" / f"{name}.png").write_bytes(image.png)
        (staged / "terminalsAndIcons" / f"{name}.svg").write_bytes(image.svg)
    pages = staged / "documentation"
    (pages / "licenses").mkdir(parents=True)
    (pages / "licenses" / "license.txt").write_text(package_text("LICENSE"), encoding="utf-8")
    for number, figure in enumerate(portrait.figures, start=1):
        (pages / f"figure{number}.svg").write_bytes(figure.svg)
    page = index_page(block, description, portrait.figures, connected)
    (pages / "index.html").write_text(page, encoding="utf-8")


def _check_start_values(block: Block, description: Description) -> None:
    for v in description.variables:
        if v.role in (INPUT, PARAMETER, FIXED, STATE) and not v.min <= v.start <= v.max:
            raise BuildError(
                f"The start value {v.name} = {v.start:g} of {block.name} lies outside "
                f"[{v.min:g}, {v.max:g}]; choose one inside"
            )


def _zipped(folder: Path) -> bytes:
    """Sorted entries with one time and mode, so that equal contents are equal bytes."""
    stamp = build_time()
    moment = tuple(int(part) for part in re.findall(r"\d+", stamp))
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            entry = zipfile.ZipInfo(path.relative_to(folder).as_posix(), moment[:6])  # type: ignore[arg-type]
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            entry.external_attr = (0o755 if "binaries" in path.parts else 0o644) << 16
            archive.writestr(entry, path.read_bytes())
    return content.getvalue()


def _write(content: bytes, target: Path) -> Path:
    """Writes a file that is complete or absent; makes its folder."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(target) as temporary:
        temporary.write_bytes(content)
    return target
