"""Rules of the other XML files: terminals and icons, and build descriptions (FMI 2.0.5, section 2.3)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Final

from lxml import etree

from friction_fmus.check.archive import Contents, read_member
from friction_fmus.check.description import Model, line_of, name_of, parse, violations, wrong_encoding
from friction_fmus.check.findings import Finding, declare
from friction_fmus.check.fmi3.description import Model3

TERMINALS: Final = "terminalsAndIcons/terminalsAndIcons.xml"
BUILD: Final = "sources/buildDescription.xml"

_TERMINALS = declare("terminals", "error", "2.3", f"{TERMINALS} violates FMI 3.0.", "archive")
_VARIABLE = declare("terminals-variable", "error", "2.3", "A terminal names a variable that does not exist.", "archive")
_NAMES = declare("terminals-name", "error", "2.3", "Two terminals or two members have the same name.", "archive")
_ICON = declare("terminals-icon", "warning", "2.3", "A named icon is missing.", "archive")
_BUILD = declare("build-description", "error", "2.3", f"{BUILD} is invalid or names missing files.", "archive")

_KINDS: Final = {"Terminal": "terminals", "TerminalMemberVariable": "members"}


def examine_side_files(contents: Contents, model: Model | Model3) -> Iterator[Finding]:
    """Yield the findings in these files, if they exist."""
    for file, rule, schema, examine in (
        (TERMINALS, _TERMINALS, "fmi3TerminalsAndIcons.xsd", _terminals),
        (BUILD, _BUILD, "fmi3BuildDescription.xsd", _build),
    ):
        if file not in contents.names:
            continue
        data = read_member(contents.path, file)
        if isinstance(data, Finding):
            yield data
            continue
        root = parse(data, file)
        if isinstance(root, Finding):
            yield root
            continue
        yield from wrong_encoding(data, root, file)
        for message, line in violations(root, f"fmi3/{schema}"):
            yield rule.finding(message, file, line=line)
        if root.get("fmiVersion") != "3.0":
            text = f"fmiVersion is {root.get('fmiVersion')!r}; write 3.0, even in an FMI 2.0 FMU"
            yield rule.finding(text, file, line=line_of(root))
        yield from examine(contents, model, root)


def _terminals(contents: Contents, model: Model | Model3, root: etree._Element) -> Iterator[Finding]:
    names = {v.name for v in model.variables}
    for element in root.iter("TerminalMemberVariable", "TerminalStreamMemberVariable"):
        for attribute in ("variableName", "inStreamVariableName", "outStreamVariableName"):
            name = element.get(attribute)
            if name is not None and name not in names:
                message = f"the terminal variable {name!r} is not in modelDescription.xml; correct the name"
                yield _VARIABLE.finding(message, TERMINALS, line=line_of(element), variable=name)
    for parent in root.iter("Terminals", "Terminal"):
        names_here = Counter((name_of(e), e.get("name") or e.get("memberName")) for e in parent)
        for (kind, name), count in names_here.items():
            if kind in ("Terminal", "TerminalMemberVariable") and name is not None and count > 1:
                where = f" in the terminal {parent.get('name')!r}" if parent.get("name") else ""
                message = f"{count} {_KINDS[kind]} have the name {name!r}{where}; rename all but one"
                yield _NAMES.finding(message, TERMINALS, line=line_of(parent))
    for element in root.iter("TerminalGraphicalRepresentation", "Icon"):
        base = element.get("iconBaseName", "") if name_of(element) != "Icon" else "icon"
        if f"terminalsAndIcons/{base}.png" not in contents.names:
            message = f"terminalsAndIcons/{base}.png is missing; add it, and optionally an .svg file"
            yield _ICON.finding(message, TERMINALS, line=line_of(element))


def _build(contents: Contents, _model: Model | Model3, root: etree._Element) -> Iterator[Finding]:
    for element in root.iter("SourceFile"):
        if f"sources/{element.get('name')}" not in contents.names:
            message = f"the source file {element.get('name')!r} is missing in sources; add it or remove the entry"
            yield _BUILD.finding(message, BUILD, line=line_of(element))
