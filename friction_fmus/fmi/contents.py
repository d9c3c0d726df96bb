"""The content of an FMU: compile, describe, document, zip."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from friction_fmus.blocks.catalogue import Block, package_text
from friction_fmus.blocks.probe import FIXED, INPUT, PARAMETER, STATE, Description, describe
from friction_fmus.errors import BuildError
from friction_fmus.fmi.documentation import index_page
from friction_fmus.fmi.model_description import model_description, terminals, terminals_and_icons
from friction_fmus.fmi.portrait import portray, terminal_icon
from friction_fmus.version import build_time
from harness.compiling.platforms import NATIVE, Platform, compiled
from harness.storage.files import ScratchFolder
from harness.storage.zip_file import zipped


def assemble(
    block: Block,
    sources: Mapping[str, str],
    platforms: Sequence[Platform],
    compiling: Callable[[str, int], None] | None,
) -> bytes:
    """Return an FMU as bytes: binaries, model description, documentation, terminals and figures."""
    with ScratchFolder("friction-fmus-") as folder:
        _stage(block, sources, Path(folder))
        for number, platform in enumerate(platforms):
            if compiling:
                compiling(platform.folder, number)
            _compile(platform, sources, block.name, Path(folder) / "fmu" / "binaries")
        return _zipped(Path(folder) / "fmu")


def _compile(platform: Platform, sources: Mapping[str, str], name: str, binaries: Path) -> Path:
    """Compile a block for a platform; return the path of the library."""
    library = binaries / platform.folder / f"{name}{platform.suffix}"
    library.parent.mkdir(parents=True)
    library.write_bytes(compiled(platform, sources, name))
    return library


def _stage(block: Block, sources: Mapping[str, str], folder: Path) -> None:
    """Write the unzipped FMU without binaries to the subfolder ``fmu``."""
    staged = folder / "fmu"
    (staged / "sources").mkdir(parents=True)
    for name, text in sources.items():
        (staged / "sources" / name).write_text(text, encoding="utf-8", newline="\n")
    native = _compile(NATIVE, sources, block.name, folder / "binaries")
    description = describe(native, computed(block))
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
                f"[{v.min:g}, {v.max:g}]; choose a value inside"
            )


def _zipped(folder: Path) -> bytes:
    """Return the FMU with the files of a folder."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return zipped({path.relative_to(folder).as_posix(): path.read_bytes() for path in files}, build_time())


def computed(block: Block) -> dict[str, tuple[str, ...]]:
    """Return the dependencies of a law's outputs as casadi finds them; empty for other blocks."""
    if block.kind != "law":
        return {}
    from friction_fmus.lawkit.files import discover_laws
    from friction_fmus.lawkit.law import Kind

    (law,) = discover_laws(block.path)
    return {variable.name: law.dependencies(variable.name) for variable in law.select(Kind.OUTPUT)}
