"""The content of an FMU: compile, describe, document, zip."""

from collections.abc import Mapping
from pathlib import Path

from friction_fmus.blocks.catalogue import Block, drawn, icon_files, licence_text
from friction_fmus.blocks.probe import FIXED, INPUT, PARAMETER, STATE, Description, describe
from friction_fmus.errors import BuildError
from friction_fmus.fmi.documentation import index_page
from friction_fmus.fmi.model_description import model_description, terminals, terminals_and_icons
from friction_fmus.version import build_time
from harness.compiling.platforms import NATIVE, compiled
from harness.storage.files import ScratchFolder
from harness.storage.zip_file import zipped


def assemble(block: Block, sources: Mapping[str, str]) -> bytes:
    """Return the FMU for this machine: library, model description, documentation and terminals."""
    place = f"binaries/{NATIVE.folder}/{block.name}{NATIVE.suffix}"
    members = {f"sources/{name}": text.encode() for name, text in sources.items()}
    members[place] = compiled(NATIVE, sources, block.name)
    with ScratchFolder() as folder:
        native = Path(folder) / f"{block.name}{NATIVE.suffix}"
        native.write_bytes(members[place])
        description = describe(native, computed(block))
    _check_start_values(block, description)
    connected = terminals(description)
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


def computed(block: Block) -> dict[str, tuple[str, ...]]:
    """Return the dependencies of a law's outputs as casadi finds them; empty for other blocks."""
    if not block.is_law:
        return {}
    from friction_fmus.lawkit.law import Kind
    from friction_fmus.lawkit.law_files import discover_laws

    (law,) = discover_laws(block.path)
    return {variable.name: law.dependencies(variable.name) for variable in law.select(Kind.OUTPUT)}
