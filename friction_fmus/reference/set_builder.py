"""Build the reference set: for each case a folder with FMUs or an SSP, reference results and a page."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final, Literal
from zipfile import ZipFile

from lxml import etree

from friction_fmus.blocks.catalogue import source_folder
from friction_fmus.export.block_fmu import build as build_fmu
from friction_fmus.reference.case import BOUND, REFERENCE, CaseFmu, ReferenceCase
from harness import Experiment, FmuPart, System
from harness.ssp.package import write_package
from harness.storage.files import ScratchFolder, atomic_path, make_folder
from harness.storage.zip_file import zipped

_MANIFEST: Final = "extra/org.fmi-standard.fmi-ls-ref/"
_ROLES: Final = {"case.toml": "testcase", "inputs.csv": "other", REFERENCE: "result", BOUND: "result"}
_MEMBERS: Final = {".ssd", ".ssv", ".ssm"}  # files of a case that belong into its SSP


def build_case(case: ReferenceCase, folder: Path, platforms: Sequence[str] = ("native",)) -> Path:
    """Build one case in a folder of its name.

    Parameters
    ----------
    case : ReferenceCase
        A case of `CASES`.
    folder : Path
        Folder of the set.
    platforms : sequence of str
        Platforms of the binaries, see `friction_fmus.build`.

    Returns
    -------
    Path
        The folder of the case.
    """
    target = folder / case.name
    make_folder(target)
    members: dict[str, bytes | Path] = {}
    for file in sorted(case.folder.iterdir()):
        if file.suffix in _MEMBERS:
            members[file.name] = file
        elif file.is_file():
            shutil.copyfile(file, target / file.name)
    with ScratchFolder() as scratch:
        made = {name: _fmu(case, name, fmu, Path(scratch), platforms) for name, fmu in case.fmus.items()}
        if case.kind != "ssp":
            for name, path in made.items():
                shutil.copyfile(path, target / f"{name}.fmu")
        elif members:
            resources = {f"resources/{name}.fmu": path for name, path in made.items()}
            write_package(target / f"{case.name}.ssp", {**members, **resources})
        else:
            _write_ssp(case, made, target / f"{case.name}.ssp")
    with atomic_path(target / "README.md") as temporary:
        temporary.write_text(page(case), encoding="utf-8")
    return target


def _fmu(case: ReferenceCase, name: str, fmu: CaseFmu, scratch: Path, platforms: Sequence[str]) -> Path:
    """Return an FMU of the case with the interface that the case uses, and with the files of the case."""
    fmi: Literal[2, 3] = 3 if case.fmi == "3.0" else 2
    if fmu.block.endswith(".toml"):
        path = scratch / f"{name}.fmu"
        with System.from_toml(case.folder / fmu.block, open_inputs=True) as system:
            system.to_fmu(path, name=name, platforms=platforms, fmi=fmi, **fmu.options)
    else:
        special = source_folder() / "reference" / f"{fmu.block}.c"
        model = special if special.is_file() else fmu.block
        given = {"domain": fmu.domain, "platforms": platforms, "fmi": fmi, **fmu.options}
        path = build_fmu(model, scratch, fmu.start, name, **given)
    with ZipFile(path) as archive:
        members = {each: archive.read(each) for each in archive.namelist()}
    root = etree.fromstring(members["modelDescription.xml"])
    dropped = {"cs": "ModelExchange", "me": "CoSimulation", "both": ""}[fmu.interface or _interface(case)]
    for element in root.findall(dropped) if dropped else ():
        root.remove(element)
    if root.find("ModelExchange") is None:
        for element in root.iterfind("ModelVariables//*[@reinit]"):
            del element.attrib["reinit"]
    made = str(root.get("generationDateAndTime"))
    members["modelDescription.xml"] = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    if case.kind != "ssp":
        members |= {f"{_MANIFEST}{file}": content for file, content in _related(case)}
    path.write_bytes(zipped(members, made))
    return path


def _interface(case: ReferenceCase) -> str:
    return "me" if case.kind == "me" else "cs"


def _related(case: ReferenceCase) -> Iterator[tuple[str, bytes]]:
    """Yield the files of the case as the draft of FMI-LS-REF places them, and their manifest."""
    space = "http://fmi-standard.org/fmi-ls-manifest"
    root = etree.Element("fmiReferences", nsmap={"fmi-ls": space})
    root.set(f"{{{space}}}fmi-ls-name", "org.fmi-standard.fmi-ls-ref")
    root.set(f"{{{space}}}fmi-ls-version", "1.0.0-alpha.1")
    text = "Layered Standard providing information on related files included in an FMU."
    root.set(f"{{{space}}}fmi-ls-description", text)
    for name, role in _ROLES.items():
        if (file := case.folder / name).is_file():
            kind = "text/csv" if file.suffix == ".csv" else "application/toml"
            etree.SubElement(root, "Related", type=kind, source=name, role=role, description=case.title)
            yield name, file.read_bytes()
    yield "fmi-ls-manifest.xml", etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


def _write_ssp(case: ReferenceCase, made: dict[str, Path], path: Path) -> None:
    """Write the system of the case as SSP."""
    times = case.experiment
    experiment = Experiment(start=times.start, stop=times.stop, step=times.step, tolerance=times.tolerance)
    parts = [FmuPart(name, file) for name, file in made.items()]
    with System(parts, case.connections, start=case.start, experiment=experiment) as system:
        system.to_ssp(path)


def page(case: ReferenceCase) -> str:
    """Return the page of a case in Markdown."""
    times = case.experiment
    run = f"from {times.start:g} s to {times.stop:g} s, step {times.step:g} s, tolerance {times.tolerance:g}"
    lines = {
        "The standard": "; ".join(case.standard),
        "Run": f"{_KINDS[case.kind]}, FMI {case.fmi}, {run}; `{case.file.name}`",
        "Set before the start": ", ".join(f"`{name}` = {value}" for name, value in case.start.items()),
        "Inputs": "`inputs.csv`" * case.inputs,
        "Connections": ", ".join(f"`{each}`" for each in case.connections),
        "Calls": ", ".join(f"`{each['do']}`" for each in case.call),
        "Results": f"{', '.join(f'`{name}`' for name in case.outputs)}, with bounds in `{BOUND}`",
        "Needs": ", ".join(sorted(case.all_needs)),
        "Finds the faults": ", ".join(case.faults),
    }
    table = "\n".join(f"* {name}: {text}." for name, text in lines.items() if text)
    return f"# {case.title}\n\n{case.tests}\n\n{table}\n\n## Reference values and bounds\n\n{case.bound}\n"


_KINDS: Final = {"cs": "Co-simulation", "me": "Model exchange", "ssp": "System"}


def build_set(
    cases: Sequence[ReferenceCase],
    folder: Path,
    platforms: Sequence[str] = ("native",),
    done: Callable[[Path], None] = lambda path: None,
) -> None:
    """Build cases in a folder, and call ``done`` with the folder of each."""
    for case in cases:
        done(build_case(case, folder, platforms))
