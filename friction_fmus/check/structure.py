"""Rules of ModelStructure (FMI 2.0.5, section 2.2.8)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Final

from lxml import etree

from friction_fmus.check.archive import Contents, read_member
from friction_fmus.check.description import (
    SECTIONS,
    Model,
    Unknown,
    Variable,
    integer,
    line_of,
    name_of,
    parse,
    violations,
    wrong_encoding,
)
from friction_fmus.check.findings import Fault, Finding, declare, rule
from friction_fmus.check.fmi3_rules import Model3

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
    for file, examined, schema, examine in (
        (TERMINALS, _TERMINALS, "fmi3TerminalsAndIcons.xsd", _terminals),
        (BUILD, _BUILD, "fmi3BuildDescription.xsd", _build),
    ):
        if file not in contents.names:
            continue
        data = read_member(contents, file)
        if isinstance(data, Finding):
            yield data
            continue
        root = parse(data, file)
        if isinstance(root, Finding):
            yield root
            continue
        yield from wrong_encoding(data, root, file)
        for message, line in violations(root, f"fmi3/{schema}"):
            yield examined.finding(message, file, line=line)
        if root.get("fmiVersion") != "3.0":
            text = f"fmiVersion is {root.get('fmiVersion')!r}; write 3.0, even in an FMI 2.0 FMU"
            yield examined.finding(text, file, line=line_of(root))
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


def _entries(model: Model) -> Iterator[tuple[str, Unknown]]:
    for section in SECTIONS:
        for unknown in model.unknowns[section]:
            yield section, unknown


def _line(model: Model, section: str) -> int:
    """Return the line of a section, or of its parent if the section is missing."""
    found = model.all(f"ModelStructure/{section}") or model.all("ModelStructure") or [model.root]
    return line_of(found[0])


def _named(variables: list[Variable]) -> str:
    shown = ", ".join(v.name for v in variables[:5])
    return shown + (f" and {len(variables) - 5} more" if len(variables) > 5 else "")


@rule("structure-index", "error", "2.2.8", "An index in ModelStructure is invalid or repeated.")
def _index(model: Model) -> Iterator[Fault]:
    seen = set()
    for section, unknown in _entries(model):
        if model.variable(unknown.index) is None:
            message = f"{section} names variable {unknown.index} of {len(model.variables)}; indices count from 1"
            yield Fault(message, unknown.line)
        if (section, unknown.index) in seen:
            yield Fault(f"{section} names variable {unknown.index} twice; remove one", unknown.line)
        seen.add((section, unknown.index))


@rule("outputs", "error", "2.2.8", "Outputs does not list all outputs, or lists other variables.")
def _outputs(model: Model) -> Iterator[Fault]:
    listed = {unknown.index: unknown for unknown in model.unknowns["Outputs"]}
    missing = [v for v in model.variables if v.causality == "output" and v.index not in listed]
    if missing:
        yield Fault(
            f"Outputs does not list {_named(missing)}; list every output", _line(model, "Outputs"), missing[0].name
        )
    for index, unknown in listed.items():
        v = model.variable(index)
        if v is not None and v.causality != "output":
            yield Fault(f"Outputs lists {v.name}, which is {v.causality}; remove it", unknown.line, v.name)


@rule("derivatives", "error", "2.2.8", "Derivatives lists a variable that is not a derivative.")
def _derivatives(model: Model) -> Iterator[Fault]:
    for unknown in model.unknowns["Derivatives"]:
        v = model.variable(unknown.index)
        if v is not None and (v.type != "Real" or integer(v.get("derivative")) is None):
            yield Fault(f"{v.name} in Derivatives has no attribute derivative; add or remove it", unknown.line, v.name)


@rule("derivatives-missing", "warning", "2.2.8", "Derivatives does not list a variable with the attribute derivative.")
def _derivatives_missing(model: Model) -> Iterator[Fault]:
    needed = model.root.find("ModelExchange") is not None or model.flag("providesDirectionalDerivative")
    listed = {unknown.index for unknown in model.unknowns["Derivatives"]}
    missing = [v for v in model.variables if v.type == "Real" and v.get("derivative") and v.index not in listed]
    if needed and missing:
        message = f"Derivatives does not list {_named(missing)}; list the derivatives of all states"
        yield Fault(message, _line(model, "Derivatives"), missing[0].name)


def _expected(model: Model) -> set[int]:
    """Return the indices of the variables that are unknown before initialisation."""
    computed = ("approx", "calculated")
    expected = {
        v.index
        for v in model.variables
        if (v.causality == "output" and v.initial in computed) or v.causality == "calculatedParameter"
    }
    for unknown in model.unknowns["Derivatives"]:
        derivative = model.variable(unknown.index)
        state = None if derivative is None else model.variable(integer(derivative.get("derivative")) or 0)
        expected |= {v.index for v in (derivative, state) if v is not None and v.initial in computed}
    return expected


@rule("initial-unknowns-missing", "error", "2.2.8", "InitialUnknowns does not list a required variable.")
def _initial_missing(model: Model) -> Iterator[Fault]:
    listed = {unknown.index for unknown in model.unknowns["InitialUnknowns"]}
    expected = _expected(model)
    missing = [v for v in model.variables if v.index in expected and v.index not in listed]
    if missing:
        message = f"InitialUnknowns does not list {_named(missing)}; list calculated outputs, states and derivatives"
        yield Fault(message, _line(model, "InitialUnknowns"), missing[0].name)


@rule("initial-unknowns-extra", "error", "2.2.8", "InitialUnknowns lists a variable that does not belong there.")
def _initial_extra(model: Model) -> Iterator[Fault]:
    expected = _expected(model)
    for unknown in model.unknowns["InitialUnknowns"]:
        v = model.variable(unknown.index)
        if v is not None and v.index not in expected:
            what = f"{v.causality}, initial {v.initial or 'not given'}"
            yield Fault(f"InitialUnknowns lists {v.name} ({what}); remove it", unknown.line, v.name)


@rule("initial-unknowns-order", "error", "2.2.8", "InitialUnknowns is not sorted by index.")
def _initial_order(model: Model) -> Iterator[Fault]:
    listed = [unknown.index for unknown in model.unknowns["InitialUnknowns"]]
    if listed != sorted(listed):
        yield Fault("InitialUnknowns is not sorted by index; sort it", _line(model, "InitialUnknowns"))


# ---- dependencies


@rule("dependencies-index", "error", "2.2.8", "A dependency is not a variable, or is repeated.")
def _dependency_index(model: Model) -> Iterator[Fault]:
    for section, unknown in _entries(model):
        dependencies = unknown.dependencies or ()
        wrong = [index for index in dependencies if model.variable(index) is None]
        if wrong:
            yield Fault(f"{section} depends on variable {wrong[0]}, which does not exist; correct it", unknown.line)
        if len(set(dependencies)) < len(dependencies):
            yield Fault(f"a dependency of variable {unknown.index} in {section} is repeated; remove one", unknown.line)


@rule("dependencies-order", "error", "2.2.8", "Dependencies are not in ascending order.")
def _dependency_order(model: Model) -> Iterator[Fault]:
    for section, unknown in _entries(model):
        dependencies = list(unknown.dependencies or ())
        if dependencies != sorted(dependencies):
            yield Fault(
                f"dependencies of variable {unknown.index} in {section} are not sorted; sort them", unknown.line
            )


def _known(model: Model, section: str, v: Variable) -> bool:
    """Return whether a variable is allowed as a dependency."""
    if v.causality in ("input", "independent"):
        return True
    if section == "InitialUnknowns":
        return v.initial == "exact"
    return v.index in model.states


@rule("dependencies-impossible", "warning", "2.2.8", "A dependency is not an input, a state or the time.")
def _impossible(model: Model) -> Iterator[Fault]:
    for section, unknown in _entries(model):
        for index in unknown.dependencies or ():
            v = model.variable(index)
            if v is not None and not _known(model, section, v):
                allowed = "initial='exact'" if section == "InitialUnknowns" else "states"
                message = f"in {section}, variable {unknown.index} depends on {v.name} ({v.causality})"
                yield Fault(f"{message}; name inputs, {allowed} and time only", unknown.line, v.name)


@rule("dependencies-kind", "error", "2.2.8", "dependenciesKind does not match dependencies or its section.")
def _kind(model: Model) -> Iterator[Fault]:
    for section, unknown in _entries(model):
        if unknown.kinds is None:
            continue
        where = f"of variable {unknown.index} in {section}"
        if unknown.dependencies is None or len(unknown.kinds) != len(unknown.dependencies):
            yield Fault(f"dependenciesKind {where} does not have one word per dependency; correct it", unknown.line)
        wrong = [kind for kind in unknown.kinds if kind not in ("dependent", "constant")]
        if section == "InitialUnknowns" and wrong:
            yield Fault(f"dependenciesKind {where} is {wrong[0]}; write dependent or constant", unknown.line)
