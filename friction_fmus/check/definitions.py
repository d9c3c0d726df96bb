"""Rules of the head of modelDescription.xml: identity, units, types, log categories (FMI 2.0.5, 2.2.1 to 2.2.6)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator

from lxml import etree

from friction_fmus.check.description import Model, child_of, integer, line_of, name_of, real
from friction_fmus.check.findings import Fault, at, rule
from harness.units import BASE_SYMBOLS, BaseUnit, parse_unit

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


@rule("model-identifier", "error", "2.2.1", "The modelIdentifier is not a C identifier.")
def _identifier(model: Model) -> Iterator[Fault]:
    for element in (*model.all("CoSimulation"), *model.all("ModelExchange")):
        name = element.get("modelIdentifier", "")
        if not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII) or _C_KEYWORDS.fullmatch(name):
            message = f"modelIdentifier {name!r} is not a C identifier; use only letters, digits and _, a letter first"
            yield Fault(message, line_of(element))


@rule("guid-empty", "error", "2.2.1", "The guid is empty.")
def _guid(model: Model) -> Iterator[Fault]:
    if not model.root.get("guid", "").strip():
        yield Fault("the guid is empty; give a hash of the file's content", line_of(model.root))


@rule("metadata-missing", "note", "2.2.1", "Metadata such as author or version are missing.")
def _metadata(model: Model) -> Iterator[Fault]:
    missing = [name for name in _METADATA if not model.root.get(name)]
    if missing:
        yield Fault(f"{', '.join(missing)} missing; add the known ones", line_of(model.root))


@rule("needs-tool", "note", "4.3.1", "The FMU runs only where the tool that exported it is installed.")
def _tool(model: Model) -> Iterator[Fault]:
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


@rule("duplicate-category", "error", "2.2.4", "Two log categories have the same name.")
def _categories(model: Model) -> Iterator[Fault]:
    yield from _repeated(model.all("LogCategories/Category"), "log category")


@rule("duplicate-annotation", "error", "2.2.6", "Two annotations belong to the same tool.")
def _annotations(model: Model) -> Iterator[Fault]:
    yield from _repeated(model.all("VendorAnnotations/Tool"), "annotation of tool")
    for v in model.variables:
        yield from _repeated(v.element.iterfind("Annotations/Tool"), "annotation of tool")


@rule("experiment", "error", "2.2.5", "The default experiment is invalid.")
def _experiment(model: Model) -> Iterator[Fault]:
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


@rule("duplicate-unit", "error", "2.2.2", "Two units, or two display units of a unit, have the same name.")
def _units(model: Model) -> Iterator[Fault]:
    yield from _repeated(model.all("UnitDefinitions/Unit"), "unit")
    for unit in model.all("UnitDefinitions/Unit"):
        yield from _repeated(unit.iterfind("DisplayUnit"), f"display unit of {unit.get('name')}")


def _unit_of_elements(model: Model) -> Iterator[tuple[etree._Element, str, str | None, str | None]]:
    """Yield element, name of its owner, unit and display unit, for variables and types."""
    for v in model.variables:
        if v.typed is not None:
            yield v.typed, v.name, v.get("unit"), v.typed.get("displayUnit")
    for simple in model.all("TypeDefinitions/SimpleType"):
        child = child_of(simple)
        if child is not None:
            yield child, simple.get("name", ""), child.get("unit"), child.get("displayUnit")


@rule("unit-undefined", "error", "2.2.2", "A unit is used but not defined.")
def _undefined(model: Model) -> Iterator[Fault]:
    defined = {unit.get("name") for unit in model.all("UnitDefinitions/Unit")}
    for element, owner, unit, _ in _unit_of_elements(model):
        if unit is not None and unit not in defined:
            remedy = "define it in UnitDefinitions" if unit else "omit the attribute for a dimensionless variable"
            yield Fault(f"{owner} has the unit {unit!r}, which is not defined; {remedy}", line_of(element), owner)


@rule("display-unit-undefined", "error", "2.2.2", "A display unit is not defined for its unit.")
def _display_undefined(model: Model) -> Iterator[Fault]:
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


def _named_and_stated(model: Model) -> Iterator[tuple[etree._Element, str, BaseUnit, BaseUnit]]:
    """Yield element, name, unit according to the name, and stated unit; angles count as dimensionless."""
    for unit in model.all("UnitDefinitions/Unit"):
        base = unit.find("BaseUnit")
        meant = parse_unit(unit.get("name", ""))
        stated = None if base is None else _stated(base)
        if base is not None and meant is not None and stated is not None:
            yield base, unit.get("name", ""), meant, stated


@rule("unit-exponents", "error", "2.2.2", "The exponents of a BaseUnit disagree with the name of the unit.")
def _exponents(model: Model) -> Iterator[Fault]:
    for base, name, meant, stated in _named_and_stated(model):
        if meant.exponents[:-1] != stated.exponents[:-1]:  # rad is dimensionless in many tools
            yield Fault(f"the unit {name!r} means {meant} but has the BaseUnit {stated}; correct it", line_of(base))


@rule("unit-factor", "error", "2.2.2", "The factor or offset of a BaseUnit disagrees with the name of the unit.")
def _factor(model: Model) -> Iterator[Fault]:
    for base, name, meant, stated in _named_and_stated(model):
        agrees = math.isclose(meant.factor, stated.factor, rel_tol=1e-6)
        if meant.exponents[:-1] == stated.exponents[:-1] and not (
            agrees and math.isclose(meant.offset, stated.offset, rel_tol=1e-6, abs_tol=1e-9)
        ):
            yield Fault(f"the unit {name!r} means {meant} but has the BaseUnit {stated}; correct it", line_of(base))


@rule("unit-without-base", "note", "2.2.2", "A unit has no BaseUnit, so importers cannot compare or convert it.")
def _without_base(model: Model) -> Iterator[Fault]:
    for unit in model.all("UnitDefinitions/Unit"):
        if unit.find("BaseUnit") is None and unit.get("name") not in ("1", "-"):
            yield Fault(f"the unit {unit.get('name')!r} has no BaseUnit; add its exponents", line_of(unit))


# ---- types


@rule("duplicate-type", "error", "2.2.3", "Two types have the same name.")
def _types(model: Model) -> Iterator[Fault]:
    yield from _repeated(model.all("TypeDefinitions/SimpleType"), "type")


@rule("type-and-variable", "error", "2.2.3", "A type and a variable have the same name.")
def _clash(model: Model) -> Iterator[Fault]:
    names = {v.name for v in model.variables}
    for element in model.all("TypeDefinitions/SimpleType"):
        if element.get("name") in names:
            yield Fault(f"the type {element.get('name')!r} has the name of a variable; rename it", line_of(element))


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


@rule("enumeration-items", "error", "2.2.3", "Two items of an enumeration have the same name or value.")
def _items(model: Model) -> Iterator[Fault]:
    for simple in model.all("TypeDefinitions/SimpleType"):
        for enumeration in simple.iterfind("Enumeration"):
            for attribute in ("name", "value"):
                seen: set[str] = set()
                for item in enumeration.iterfind("Item"):
                    text = item.get(attribute, "")
                    if text in seen:
                        message = f"two items of {simple.get('name')!r} have the {attribute} {text!r}; change one"
                        yield Fault(message, line_of(item))
                    seen.add(text)
