"""Rules of modelDescription.xml of FMI 2.0.5: its head (2.2.1 to 2.2.6), ModelVariables, and ModelStructure."""

import math
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from posixpath import normpath
from typing import Final

from lxml import etree

from friction_fmus.check.archive_rules import Contents, read_member
from friction_fmus.check.description import (
    SECTIONS,
    VARIABILITIES,
    ListedUnknown,
    Model,
    Variable2,
    initials,
    integer,
    line_of,
    name_of,
    parse,
    real,
    violations,
    wrong_encoding,
)
from friction_fmus.check.findings import Fault, Finding, at, declare, for_each, rule
from friction_fmus.check.fmi3_rules import FLOATS, Model3, Variable3
from harness.units import BASE_SYMBOLS, BaseUnit, parse_unit
from harness.values import STRUCTURED

# ---- the head: identity, units, types, log categories

AnyModel = Model | Model3
REALS: Final = ("Real", *FLOATS)
_METADATA = ("description", "author", "version", "license", "generationTool", "generationDateAndTime")
_C_KEYWORDS = re.compile(
    "auto|break|case|char|const|continue|default|do|double|else|enum|extern|float|for|goto|if|inline|int|long|"
    "register|restrict|return|short|signed|sizeof|static|struct|switch|typedef|union|unsigned|void|volatile|while"
)


def _repeated(elements: Iterable[etree._Element], what: str) -> Iterator[Fault]:
    """Yield a fault for each element with a repeated name."""
    seen: dict[str, int] = {}
    for element in elements:
        name = element.get("name", "")
        if name in seen:
            message = f"{what} {name!r} is already defined in line {seen[name]}; remove or rename one"
            yield Fault(message, line_of(element))
        seen.setdefault(name, line_of(element))


# ---- identity


@rule("model-identifier", "error", "2.2.1", "The modelIdentifier is not a C identifier.", "both")
def _identifier(model: AnyModel) -> Iterator[Fault]:
    for element in model.interfaces:
        name = element.get("modelIdentifier", "")
        if not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII) or _C_KEYWORDS.fullmatch(name):
            message = f"modelIdentifier {name!r} is not a C identifier; use only letters, digits and _, a letter first"
            yield Fault(message, line_of(element))


@rule("guid-empty", "error", "2.2.1", "The guid, or the instantiationToken, is empty.", "both")
def _guid(model: AnyModel) -> Iterator[Fault]:
    name = "guid" if isinstance(model, Model) else "instantiationToken"
    if not model.root.get(name, "").strip():
        yield Fault(f"the {name} is empty; give a hash of the file's content", line_of(model.root))


@rule("generation-date", "warning", "2.2.1", "The time of generation is not in the form of the standard.", "both")
def _date(model: AnyModel) -> Iterator[Fault]:
    text = model.root.get("generationDateAndTime")
    if text is not None and not re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?Z", text, re.ASCII):
        yield Fault(f"generationDateAndTime is {text!r}; write it as 2026-12-31T23:59:59Z, in UTC", line_of(model.root))


@rule("metadata-missing", "note", "2.2.1", "Metadata such as author or version are missing.", "both")
def _metadata(model: AnyModel) -> Iterator[Fault]:
    missing = [name for name in _METADATA if not model.root.get(name)]
    if missing:
        yield Fault(f"{', '.join(missing)} missing; add the known ones", line_of(model.root))


@rule("needs-tool", "note", "4.3.1", "The FMU runs only where the tool that exported it is installed.", "both")
def _tool(model: AnyModel) -> Iterator[Fault]:
    if model.flag("needsExecutionTool"):
        yield Fault("needsExecutionTool is true; install the tool to run the FMU", line_of(model.interfaces[0]))


@rule("serialize-without-state", "error", "4.3.1", "A capability is declared without one that it requires.")
def _serialize(model: Model) -> Iterator[Fault]:
    for element in (*model.all("CoSimulation"), *model.all("ModelExchange")):
        flags = {name: element.get(name) in ("true", "1") for name in ("canSerializeFMUstate", "canGetAndSetFMUstate")}
        if flags["canSerializeFMUstate"] and not flags["canGetAndSetFMUstate"]:
            message = "canSerializeFMUstate requires canGetAndSetFMUstate; declare both or neither"
            yield Fault(message, line_of(element))


@rule("duplicate-source-file", "error", "2.2.1", "A source file is listed twice.")
def _source_files(model: Model) -> Iterator[Fault]:
    for kind in ("CoSimulation", "ModelExchange"):
        yield from _repeated(model.all(f"{kind}/SourceFiles/File"), "source file")


@rule("duplicate-category", "error", "2.2.4", "Two log categories have the same name.", "both")
def _categories(model: AnyModel) -> Iterator[Fault]:
    yield from _repeated(model.all("LogCategories/Category"), "log category")


@rule("duplicate-annotation", "error", "2.2.6", "Two annotations belong to the same tool.")
def _annotations(model: Model) -> Iterator[Fault]:
    yield from _repeated(model.all("VendorAnnotations/Tool"), "annotation of tool")
    for v in model.variables:
        yield from _repeated(v.element.iterfind("Annotations/Tool"), "annotation of tool")


@rule("experiment", "error", "2.2.5", "The default experiment is invalid.", "both")
def _experiment(model: AnyModel) -> Iterator[Fault]:
    for element in model.all("DefaultExperiment"):
        start, stop, step, tolerance = (
            real(element.get(name)) for name in ("startTime", "stopTime", "stepSize", "tolerance")
        )
        values = [value for value in (start, stop, step, tolerance) if value is not None]
        first = start or 0.0
        if not all(map(math.isfinite, values)):
            yield Fault("a value of the default experiment is not finite; give finite numbers", line_of(element))
        elif stop is not None and stop <= first:
            yield Fault(f"stopTime {stop:g} is not after startTime {first:g}; correct them", line_of(element))
        elif any(value is not None and value <= 0.0 for value in (step, tolerance)):
            yield Fault("stepSize and tolerance must be positive; correct them", line_of(element))
        elif stop is not None and step is not None and step > (stop - first) * (1.0 + 1e-9):
            yield Fault(f"stepSize {step:g} is longer than the experiment; shorten it", line_of(element))


# ---- units


@rule("duplicate-unit", "error", "2.2.2", "Two units, or two display units of a unit, have the same name.", "both")
def _units(model: AnyModel) -> Iterator[Fault]:
    yield from _repeated(model.all("UnitDefinitions/Unit"), "unit")
    for unit in model.all("UnitDefinitions/Unit"):
        yield from _repeated(unit.iterfind("DisplayUnit"), f"display unit of {unit.get('name')}")


def _unit_of_elements(model: AnyModel) -> Iterator[tuple[etree._Element, str, str | None, str | None]]:
    """Yield element, name of its owner, unit and display unit, for variables and types."""
    for v in model.variables:
        if v.typed is not None:
            for element in (v.typed, *v.element.iterfind("Alias")):
                yield element, element.get("name", v.name), v.get("unit"), element.get("displayUnit")
    for name, element in model.types:
        yield element, name, element.get("unit"), element.get("displayUnit")


@rule("unit-undefined", "error", "2.2.2", "A unit is used but not defined.", "both")
def _undefined(model: AnyModel) -> Iterator[Fault]:
    defined = {unit.get("name") for unit in model.all("UnitDefinitions/Unit")}
    for element, owner, unit, _ in _unit_of_elements(model):
        if unit is not None and unit not in defined:
            remedy = "define it in UnitDefinitions" if unit else "omit the attribute for a dimensionless variable"
            yield Fault(f"{owner} has the unit {unit!r}, which is not defined; {remedy}", line_of(element), owner)


@rule("display-unit-undefined", "error", "2.2.2", "A display unit is not defined for its unit.", "both")
def _display_undefined(model: AnyModel) -> Iterator[Fault]:
    shown = {
        unit.get("name"): {display.get("name") for display in unit.iterfind("DisplayUnit")}
        for unit in model.all("UnitDefinitions/Unit")
    }
    for element, owner, unit, display in _unit_of_elements(model):
        if display is not None and display != unit and display not in shown.get(unit, ()):
            yield Fault(f"{owner}: {display!r} is not a display unit of {unit!r}; define it", line_of(element), owner)


def _stated(base: etree._Element) -> BaseUnit | None:
    exponents = [integer(base.get(symbol, "0")) for symbol in BASE_SYMBOLS]
    factor, offset = real(base.get("factor", "1")), real(base.get("offset", "0"))
    if None in exponents or factor is None or offset is None:
        return None
    return BaseUnit(tuple(power or 0 for power in exponents), factor, offset)


def _named_and_stated(model: AnyModel) -> Iterator[tuple[etree._Element, str, BaseUnit, BaseUnit]]:
    """Yield element, name, unit according to the name, and stated unit; angles count as dimensionless."""
    for unit in model.all("UnitDefinitions/Unit"):
        base = unit.find("BaseUnit")
        meant = parse_unit(unit.get("name", ""))
        stated = None if base is None else _stated(base)
        if base is not None and meant is not None and stated is not None:
            yield base, unit.get("name", ""), meant, stated


@rule("unit-inverse", "error", "2.4.4", "A display unit is inverse and has an offset.", "fmi3")
def _inverse(model: Model3) -> Iterator[Fault]:
    for element in model.all("UnitDefinitions/Unit/DisplayUnit[@inverse]"):
        if element.get("inverse") in ("true", "1") and real(element.get("offset", "0")) != 0.0:
            message = f"the display unit {element.get('name')!r} is inverse and has an offset; remove one of them"
            yield Fault(message, line_of(element))


@rule("unit-exponents", "error", "2.2.2", "The exponents of a BaseUnit disagree with the name of the unit.", "both")
def _exponents(model: AnyModel) -> Iterator[Fault]:
    for base, name, meant, stated in _named_and_stated(model):
        if meant.exponents[:-1] != stated.exponents[:-1]:  # rad is dimensionless in many tools
            yield Fault(f"the unit {name!r} means {meant} but has the BaseUnit {stated}; correct it", line_of(base))


@rule(
    "unit-factor", "error", "2.2.2", "The factor or offset of a BaseUnit disagrees with the name of the unit.", "both"
)
def _factor(model: AnyModel) -> Iterator[Fault]:
    for base, name, meant, stated in _named_and_stated(model):
        agrees = math.isclose(meant.factor, stated.factor, rel_tol=1e-6)
        if meant.exponents[:-1] == stated.exponents[:-1] and not (
            agrees and math.isclose(meant.offset, stated.offset, rel_tol=1e-6, abs_tol=1e-9)
        ):
            yield Fault(f"the unit {name!r} means {meant} but has the BaseUnit {stated}; correct it", line_of(base))


@rule(
    "unit-without-base", "note", "2.2.2", "A unit has no BaseUnit, so importers cannot compare or convert it.", "both"
)
def _without_base(model: AnyModel) -> Iterator[Fault]:
    for unit in model.all("UnitDefinitions/Unit"):
        if unit.find("BaseUnit") is None and unit.get("name") not in ("1", "-"):
            yield Fault(f"the unit {unit.get('name')!r} has no BaseUnit; add its exponents", line_of(unit))


# ---- types


@rule("duplicate-type", "error", "2.2.3", "Two types have the same name.", "both")
def _types(model: AnyModel) -> Iterator[Fault]:
    yield from _repeated(model.all("TypeDefinitions/*"), "type")


@rule("type-and-variable", "error", "2.2.3", "A type and a variable have the same name.", "both")
def _clash(model: AnyModel) -> Iterator[Fault]:
    names = {v.name for v in model.variables}
    for name, element in model.types:
        if name in names:
            yield Fault(f"the type {name!r} has the name of a variable; rename it", line_of(element))


@rule("type-unknown", "error", "2.2.7", "A declared type does not exist.")
def _type_unknown(model: Model) -> Iterator[Fault]:
    for v in model.variables:
        if v.typed is not None and v.typed.get("declaredType") is not None and v.declared is None:
            yield at(v, f"{v.name} is declared as {v.typed.get('declaredType')!r}, which is not defined; define it")


@rule("type-mismatch", "error", "2.2.7", "The base type of a declared type differs from the type of the variable.")
def _type_mismatch(model: Model) -> Iterator[Fault]:
    for v in model.variables:
        if v.declared is not None and v.typed is not None and name_of(v.declared) != v.type:
            declared = f"{v.typed.get('declaredType')!r}, a type of {name_of(v.declared)}"
            yield at(v, f"{v.name} is {v.type} but declared as {declared}; choose another")


@rule("enumeration-items", "error", "2.2.3", "Two items of an enumeration have the same name or value.", "both")
def _items(model: AnyModel) -> Iterator[Fault]:
    for name, enumeration in model.types:
        for attribute in ("name", "value"):
            seen: set[str] = set()
            for item in enumeration.iterfind("Item"):
                text = item.get(attribute, "")
                if text in seen:
                    yield Fault(f"two items of {name!r} have the {attribute} {text!r}; change one", line_of(item))
                seen.add(text)


# ---- ModelStructure (section 2.2.8), and other XML files

TERMINALS: Final = "terminalsAndIcons/terminalsAndIcons.xml"
BUILD: Final = "sources/buildDescription.xml"

_TERMINALS = declare("terminals", "error", "2.3", f"{TERMINALS} violates FMI 3.0.", "archive")
_VARIABLE = declare("terminals-variable", "error", "2.3", "A terminal names a variable that does not exist.", "archive")
_NAMES = declare("terminals-name", "error", "2.3", "Two terminals or two members have the same name.", "archive")
_ICON = declare("terminals-icon", "warning", "2.3", "A named icon is missing.", "archive")
_AREA = declare(
    "terminals-area",
    "error",
    "2.3",
    "A graphical representation has no area, is upside down or has no stroke.",
    "archive",
)
_BUILD = declare("build-description", "error", "2.3", f"{BUILD} is invalid or names missing files.", "archive")

_KINDS: Final = {"Terminal": "terminals", "TerminalMemberVariable": "members"}


def examine_side_files(contents: Contents, model: AnyModel) -> Iterator[Finding]:
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


def _terminals(contents: Contents, model: AnyModel, root: etree._Element) -> Iterator[Finding]:
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
    for element in root.iter("CoordinateSystem", "TerminalGraphicalRepresentation", "Icon"):
        x1, y1, x2, y2 = (real(element.get(name)) or 0.0 for name in ("x1", "y1", "x2", "y2"))
        reversed_ = name_of(element) == "CoordinateSystem" and (x1 > x2 or y1 > y2)
        stroke = real(element.get("defaultConnectionStrokeSize", "1")) or 0.0
        if x1 == x2 or y1 == y2 or reversed_ or stroke <= 0.0:
            message = (
                f"{name_of(element)} needs an area from bottom left to top right, and a positive stroke; correct it"
            )
            yield _AREA.finding(message, TERMINALS, line=line_of(element))


def _build(contents: Contents, model: AnyModel, root: etree._Element) -> Iterator[Finding]:
    for element in root.iter("SourceFile"):
        if f"sources/{element.get('name')}" not in contents.names:
            message = f"the source file {element.get('name')!r} is missing in sources; add it or remove the entry"
            yield _BUILD.finding(message, BUILD, line=line_of(element))
    identifiers = {element.get("modelIdentifier") for element in model.interfaces}
    for configuration in root.iterfind("BuildConfiguration"):
        if (name := configuration.get("modelIdentifier")) not in identifiers:
            message = f"no interface has the modelIdentifier {name!r} of a BuildConfiguration; correct it"
            yield _BUILD.finding(message, BUILD, line=line_of(configuration))
    for files in root.iter("SourceFileSet"):
        if files.get("compilerOptions") is not None and files.get("compiler") is None:
            message = "a SourceFileSet has compilerOptions but no compiler; name the compiler"
            yield _BUILD.finding(message, BUILD, line=line_of(files))
        for kind in ("SourceFile", "PreprocessorDefinition", "IncludeDirectory"):
            for fault in _repeated(files.iterfind(kind), kind):
                yield _BUILD.finding(fault.message, BUILD, line=fault.line)
        for directory in files.iterfind("IncludeDirectory"):
            path = normpath(f"sources/{directory.get('name')}")
            if not contents.below(path):
                message = f"the include directory {path!r} is missing; add it or remove the entry"
                yield _BUILD.finding(message, BUILD, line=line_of(directory))


def _entries(model: Model) -> Iterator[tuple[str, ListedUnknown]]:
    for section in SECTIONS:
        for unknown in model.unknowns[section]:
            yield section, unknown


def _line(model: Model, section: str) -> int:
    """Return the line of a section, or of its parent if the section is missing."""
    found = model.all(f"ModelStructure/{section}") or model.all("ModelStructure") or [model.root]
    return line_of(found[0])


def _named(variables: list[Variable2]) -> str:
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
        state = None if derivative is None else model.numbered(derivative.get("derivative"))
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


def _known(model: Model, section: str, v: Variable2) -> bool:
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


# ---- ModelVariables (sections 2.2.7 and 2.2.9)


@rule("duplicate-variable", "error", "2.2.7", "Two variables have the same name.")
def _duplicate(model: Model) -> Iterator[Fault]:
    seen: dict[str, Variable2] = {}
    for v in model.variables:
        if v.name in seen:
            yield at(v, f"{v.name!r} is already defined in line {seen[v.name].line}; rename one")
        seen.setdefault(v.name, v)


@rule("variable-name", "error", "2.2.9", "A name does not follow the declared naming convention.", "both")
def _name(model: AnyModel) -> Iterator[Fault]:
    structured = model.root.get("variableNamingConvention") == "structured"
    for v in model.variables:
        for name in (v.name, *(each.get("name", "") for each in v.element.iterfind("Alias"))):
            if structured and not STRUCTURED.fullmatch(name):
                yield at(v, f"{name!r} is not a structured name; rename it or declare the convention flat")
            if structured and name.startswith("der(") and v.type not in REALS:
                yield at(v, f"{name!r} is the name of a derivative, but its type is {v.type}; rename it")
            if not structured and (not name or re.search("[\r\n\t]", name)):
                yield at(v, f"{name!r} is empty or contains a line break or a tab; rename it")


@for_each("variability", "error", "2.2.7", "Causality and variability, or type and variability, are incompatible.")
def _variability(_model: Model, v: Variable2) -> Iterator[str]:
    allowed = VARIABILITIES.get(v.causality, {v.variability})
    if v.variability not in allowed:
        one = " or ".join(sorted(allowed))
        yield f"{v.name} is {v.causality} and {v.variability}; make it {one}"
    elif v.variability == "continuous" and v.type not in ("Real", ""):
        default = "" if v.element.get("variability") else ", which is the default"
        yield f"{v.name} is {v.type} and continuous{default}; write variability='discrete' or another"


@for_each("initial", "error", "2.2.7", "The value of initial is incompatible with causality and variability.")
def _initial(_model: Model, v: Variable2) -> Iterator[str]:
    allowed = initials(v.causality, v.variability, None)
    if v.variability in VARIABILITIES.get(v.causality, ()) and v.initial not in allowed:
        one = " or ".join(sorted(value or "nothing" for value in allowed))
        yield f"{v.name} ({v.causality}, {v.variability}) has initial={v.initial!r}; write {one}"


@for_each("start-missing", "error", "2.2.7", "A variable that needs a start value has none.")
def _start_missing(_model: Model, v: Variable2) -> Iterator[str]:
    needs = v.causality == "input" or (v.initial in ("exact", "approx") and v.causality != "independent")
    if needs and v.start is None and v.typed is not None:
        yield f"{v.name} has no start value; give the start value of the binary"


@for_each("start-forbidden", "error", "2.2.7", "A calculated or independent variable has a start value.")
def _start_forbidden(_model: Model, v: Variable2) -> Iterator[str]:
    if v.start is not None and (v.initial == "calculated" or v.causality == "independent"):
        yield f"{v.name} is computed but has start={v.start!r}; remove it or set initial='exact'"


@rule(
    "start-outside-limits",
    "error",
    "2.2.7",
    "A start value is outside min and max, or is not an item of its enumeration.",
)
def _start_outside(model: Model) -> Iterator[Fault]:
    items_of = cache(lambda declared: {integer(item.get("value")) for item in declared.iterfind("Item")})
    for v in model.variables:
        start, low, high = real(v.start), real(v.get("min")), real(v.get("max"))
        if v.type in ("Boolean", "String") or start is None:
            continue
        if low is not None and start < low:
            yield at(v, f"{v.name} starts at {v.start}, below its min {v.get('min')}; choose a value inside the limits")
        if high is not None and start > high:
            yield at(v, f"{v.name} starts at {v.start}, above its max {v.get('max')}; choose a value inside the limits")
        if v.type == "Enumeration" and v.declared is not None:
            items = items_of(v.declared)
            if items and integer(v.start) not in items:
                yield at(v, f"{v.name} starts at {v.start}, which is not an item of its type; choose an item")


@for_each("number-not-finite", "error", "2.2.7", "A start, min, max or nominal is NaN or infinite.", "both")
def _not_finite(_model: AnyModel, v: Variable2 | Variable3) -> Iterator[str]:
    for element in (v.typed,) if v.typed is not None and v.type in REALS else ():
        for attribute in ("start", "min", "max", "nominal"):
            for text in element.get(attribute, "").split():
                value = real(text)
                if value is not None and not math.isfinite(value):
                    yield f"{attribute}={text!r} of {v.name} is not a finite number; give one"


@rule("limits-reversed", "error", "2.2.7", "A max is below its min.", "both")
def _reversed(model: AnyModel) -> Iterator[Fault]:
    owners: list[tuple[str, etree._Element | None, Callable[[str], str | None]]]
    owners = [(v.name, v.typed, v.get) for v in model.variables]
    owners += [(name, element, element.get) for name, element in model.types]
    for name, element, get in owners:
        low, high = real(get("min")), real(get("max"))
        if element is not None and low is not None and high is not None and high < low:
            yield Fault(f"{name} has min {get('min')} above max {get('max')}; correct them", line_of(element), name)


@for_each("nominal", "error", "2.2.7", "A nominal value is not positive.", "both")
def _nominal(_model: AnyModel, v: Variable2 | Variable3) -> Iterator[str]:
    value = real(v.get("nominal"))
    if value is not None and value <= 0.0:
        yield f"{v.name} has nominal {v.get('nominal')}; give the typical magnitude of its values"


@rule("value-reference-shared", "error", "2.2.7", "Variables with the same value reference are not aliases.")
def _shared(model: Model) -> Iterator[Fault]:
    groups = defaultdict(list)
    for v in model.variables:
        base = "Integer" if v.type == "Enumeration" else v.type
        groups[base, v.reference].append(v)
    for (_, reference), group in groups.items():
        names = ", ".join(v.name for v in group)
        shared = f"{names} share value reference {reference}"
        settable = [v for v in group if v.settable]
        if len(settable) > 1:
            fault = settable[1], "and more than one can be set"
        elif len({v.variability == "constant" for v in group}) > 1:
            fault = group[1], "but only some are constant"
        elif len({v.get("unit") for v in group}) > 1:
            fault = group[1], "but not the unit"
        elif len({v.variability for v in group}) > 1:
            fault = group[1], "but not the variability"
        else:
            continue
        yield at(fault[0], f"{shared}, {fault[1]}; use different value references")


@rule("independent", "error", "2.2.7", "There are several independent variables, or one that is not Real.")
def _independent(model: Model) -> Iterator[Fault]:
    found = [v for v in model.variables if v.causality == "independent"]
    for v in found:
        if v.type not in ("Real", ""):
            yield at(v, f"the independent variable {v.name} is {v.type}; make it Real")
    for v in found[1:]:
        yield at(v, f"{v.name} and {found[0].name} are both independent; keep one")


@for_each(
    "time-name", "note", "2.2.7", "The independent variable is not called time or does not have the unit s.", "both"
)
def _time(_model: AnyModel, v: Variable2 | Variable3) -> Iterator[str]:
    if v.causality == "independent" and (v.name != "time" or v.get("unit") not in (None, "s")):
        yield f"the independent variable is {v.name!r} in {v.get('unit')!r}; call it time, in s"


@for_each("derivative-of", "error", "2.2.7", "The attribute derivative does not name another continuous Real variable.")
def _derivative(model: Model, v: Variable2) -> Iterator[str]:
    text = v.get("derivative") if v.type == "Real" else None
    state = model.numbered(text)
    if text is not None and (state is None or state is v or state.type != "Real"):
        yield f"{v.name} is the derivative of variable {text}, which is not another Real variable; correct it"


@for_each(
    "multiple-set",
    "error",
    "2.2.7",
    "canHandleMultipleSetPerTimeInstant is set for a variable that is not an input.",
    "both",
)
def _multiple_set(_model: AnyModel, v: Variable2 | Variable3) -> Iterator[str]:
    if v.element.get("canHandleMultipleSetPerTimeInstant") is not None and v.causality != "input":
        yield f"{v.name} is {v.causality}; remove canHandleMultipleSetPerTimeInstant, which is for inputs only"


@rule(
    "reinit",
    "warning",
    "2.2.7",
    "reinit is set in an FMU for co-simulation only, or for a variable that is not a state.",
)
def _reinit(model: Model) -> Iterator[Fault]:
    exchange = model.root.find("ModelExchange") is not None
    for v in model.variables:
        has = v.typed is not None and v.typed.get("reinit") is not None
        if has and not (exchange and v.index in model.states):
            yield at(v, f"{v.name} has reinit, which is for states in model exchange; remove it")
