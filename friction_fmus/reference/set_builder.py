"""Build the reference set: for each case a folder with FMUs or an SSP, reference results and a page."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final
from zipfile import ZipFile

from jinja2 import Template
from lxml import etree

from friction_fmus.blocks.catalogue import licence_text, source_folder
from friction_fmus.export.block_fmu import build
from friction_fmus.export.targets import write_file
from friction_fmus.reference.case import BOUND, INPUTS, REFERENCE, CaseFmu, ReferenceCase
from friction_fmus.version import build_time
from harness import Experiment, FmuPart, System
from harness.compiling.platforms import compiled, select
from harness.ssp.package import write_package
from harness.storage.files import ScratchFolder, make_folder
from harness.storage.zip_file import zipped

RELATED: Final = "extra/org.fmi-standard.fmi-ls-ref"  # folder in an FMU of the draft of FMI-LS-REF


def build_case(case: ReferenceCase, folder: Path, platforms: Sequence[str] = ("native",)) -> Path:
    """Build a case of this package in a folder, and return the folder of the case."""
    target = folder / case.name
    make_folder(target)
    members: dict[str, bytes | Path] = {}  # of the SSP
    for file in sorted(case.folder.iterdir()):
        if file.suffix in (".ssd", ".ssv", ".ssm"):
            members[file.name] = file
        else:
            shutil.copyfile(file, target / file.name)
    with ScratchFolder() as scratch:
        for name, fmu in case.fmus.items():
            path = _fmu(case, name, fmu, Path(scratch), platforms)
            if case.kind == "ssp":
                members[f"resources/{name}.fmu"] = path
            else:
                shutil.copyfile(path, target / path.name)
        if case.kind == "ssp" and "SystemStructure.ssd" in members:
            write_package(target / case.file.name, members)
        elif case.kind == "ssp":
            parts = [FmuPart(name, Path(scratch) / f"{name}.fmu") for name in case.fmus]
            experiment = Experiment(**vars(case.experiment))
            with System(parts, case.connections, start=case.start, experiment=experiment) as system:
                system.to_ssp(target / case.file.name)
    write_file(_filled("case_page", case), target / "README.md")
    return target


def _fmu(case: ReferenceCase, name: str, fmu: CaseFmu, scratch: Path, platforms: Sequence[str]) -> Path:
    """Build an FMU with the interface that the case uses, and with the files of the case."""
    path = scratch / f"{name}.fmu"
    given: dict[str, Any] = {"platforms": platforms, "fmi": int(case.fmi[0]), **fmu.options}
    if fmu.block.endswith(".toml"):
        with System.from_toml(case.folder / fmu.block, open_inputs=True) as system:
            system.to_fmu(path, name=name, **given)
    elif (file := source_folder() / "reference" / f"{fmu.block}.c").is_file():
        path.write_bytes(_special(file, platforms))
    else:
        build(fmu.block, scratch, fmu.start, name, **given)
    with ZipFile(path) as archive:
        members = {each: archive.read(each) for each in archive.namelist()}
    for old, new in fmu.replaced.items():
        members["modelDescription.xml"] = members["modelDescription.xml"].replace(old.encode(), new.encode())
    root = etree.fromstring(members["modelDescription.xml"])
    offered = fmu.interface or ("me" if case.kind == "me" else "cs")
    for element in root.findall({"cs": "ModelExchange", "me": "CoSimulation", "both": "None"}[offered]):
        root.remove(element)
    if offered == "cs":
        etree.strip_attributes(root, "reinit")
    members["modelDescription.xml"] = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    if case.kind != "ssp":
        members[f"{RELATED}/fmi-ls-manifest.xml"] = _filled("fmi-ls-manifest", case).encode()
        files = ("case.toml", REFERENCE, BOUND, *([INPUTS] if case.inputs else ()))
        members |= {f"{RELATED}/{file}": (case.folder / file).read_bytes() for file in files}
    path.write_bytes(zipped(members, str(root.get("generationDateAndTime"))))
    return path


def _special(file: Path, platforms: Sequence[str]) -> bytes:
    """Return an FMU that is no block, of a C file with its modelDescription.xml beside it."""
    source = file.read_text(encoding="utf-8")
    places = {f"binaries/{each.folder}/{file.stem}{each.suffix}": each for each in select(tuple(platforms))}
    members = {place: compiled(platform, {file.name: source}, file.stem) for place, platform in places.items()}
    members |= {f"sources/{file.name}": source.encode(), "documentation/licenses/license.txt": licence_text().encode()}
    return zipped({**members, "modelDescription.xml": file.with_suffix(".xml").read_bytes()}, build_time())


def _filled(template: str, case: ReferenceCase) -> str:
    """Return a text of this package, filled for a case."""
    text = (Path(__file__).parent / f"{template}.template").read_text(encoding="utf-8")
    return str(Template(text, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True).render(case=case))
