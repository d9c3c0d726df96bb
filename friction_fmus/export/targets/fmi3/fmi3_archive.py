"""The archive of an FMU in FMI 3.0."""

import re
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Final

from lxml import etree

from friction_fmus.export.targets import SourceFmu
from harness.compiling import toolchain
from harness.compiling.platforms import Platform, linked
from harness.compiling.toolchain import guid_of, included, source_folder
from harness.storage.files import cached, hash_of
from harness.storage.zip_file import zipped

TYPES: Final[Mapping[str, str]] = {"Real": "Float64", "Integer": "Int32", "Enumeration": "Int32", "Boolean": "Boolean"}
"""Type in FMI 3.0 of each type of FMI 2.0."""

SIZE: Final = "N"  # name of the number of elements. Arrays with as many elements as its largest value are sized by it

_ELEMENT: Final = re.compile(r"(?P<name>.*)\[(?P<index>\d+)\](?P<end>\)?)")


@dataclass(frozen=True)
class Fmi3Variable:
    """A variable of FMI 3.0."""

    name: str  # name; that of an array has no index
    inner: int  # value reference in FMI 2.0 of the only or the first element
    type: str  # name of its element in the XML
    elements: tuple[etree._Element, ...]  # ScalarVariable in FMI 2.0 of each element; the largest number of them
    is_array: bool = False  # whether it is an array, perhaps of one element
    is_sized: bool = False  # whether the structural parameter, which is the first variable, is the length of the array
    reference: int = 0
    """Value reference: the position among the variables from 1, as OMSimulator reads dependencies as positions."""

    @property
    def is_intermediate(self) -> bool:
        """Whether an importer may read it in an intermediate update: a result that is continuous in time."""
        causality, variability = self.elements[0].get("causality"), self.elements[0].get("variability")
        return self.type == "Float64" and causality in (None, "local", "output") and variability in (None, "continuous")

    @property
    def typed(self) -> etree._Element:
        """The element of the first one in FMI 2.0 that holds type, start value and limits."""
        return self.elements[0][0]


def grouped(scalars: Sequence[etree._Element], *, arrays: bool, resizable: bool) -> tuple[Fmi3Variable, ...]:
    """Return the variables, the structural parameter first, as fmusim 0.0.39 needs it before its arrays."""
    found = _sized(tuple(_arrays(scalars)), resizable) if arrays else tuple(map(_scalar, scalars))
    return tuple(replace(v, reference=k) for k, v in enumerate(found, start=1))


def _sized(found: tuple[Fmi3Variable, ...], resizable: bool) -> tuple[Fmi3Variable, ...]:
    """Return the variables with the number of elements as structural parameter, if it sizes all arrays."""
    sizes = [v for v in found if v.name == SIZE and v.type == "Int32" and _get(v, "variability") == "fixed"]
    if not resizable or not sizes:
        return found
    (size,) = sizes
    most = int(size.typed.get("max") or 0)
    arrays = [v for v in found if v.is_array]
    if not arrays or any(len(v.elements) != most for v in arrays):
        return found
    return (replace(size, type="UInt64"), *(replace(v, is_sized=v.is_array) for v in found if v is not size))


def _scalar(scalar: etree._Element) -> Fmi3Variable:
    return Fmi3Variable(str(scalar.get("name")), int(str(scalar.get("valueReference"))), TYPES[_tag(scalar)], (scalar,))


def _arrays(scalars: Sequence[etree._Element]) -> Iterator[Fmi3Variable]:
    for (name, is_element), run in groupby(scalars, key=_base):
        elements = tuple(run)
        reference = int(str(elements[0].get("valueReference")))
        if is_element and _is_array(elements, reference):
            yield Fmi3Variable(name, reference, TYPES[_tag(elements[0])], elements, is_array=True)
        else:
            yield from map(_scalar, elements)


def _base(scalar: etree._Element) -> tuple[str, bool]:
    """Return the name of the array, and whether the variable is one of its elements."""
    name = str(scalar.get("name"))
    match = _ELEMENT.fullmatch(name)
    return (f"{match['name']}{match['end']}", True) if match else (name, False)


def _is_array(elements: Sequence[etree._Element], first: int) -> bool:
    """Return whether elements are numbered from 1, follow each other in memory, and differ in start values only."""

    def kind(each: etree._Element) -> tuple[object, ...]:
        attributes = {key: value for key, value in each[0].attrib.items() if key not in ("start", "derivative")}
        rest = {key: value for key, value in each.attrib.items() if key not in ("name", "valueReference")}
        return _tag(each), attributes, rest, "start" in each[0].attrib

    for k, each in enumerate(elements):
        match = _ELEMENT.fullmatch(str(each.get("name")))
        if not match or int(match["index"]) != k + 1 or int(str(each.get("valueReference"))) != first + k:
            return False
    return all(kind(each) == kind(elements[0]) for each in elements)


def _get(variable: Fmi3Variable, attribute: str) -> str | None:
    value = variable.elements[0].get(attribute)
    return None if value is None else str(value)


def _tag(scalar: etree._Element) -> str:
    return str(scalar[0].tag)


_EXCHANGE: Final[Mapping[str, str]] = {
    "canGetAndSetFMUstate": "canGetAndSetFMUState",
    "canSerializeFMUstate": "canSerializeFMUState",
    "providesDirectionalDerivative": "providesDirectionalDerivatives",
}
_SIMULATION: Final[Mapping[str, str]] = {
    **_EXCHANGE,
    "canHandleVariableCommunicationStepSize": "canHandleVariableCommunicationStepSize",
    "maxOutputDerivativeOrder": "maxOutputDerivativeOrder",
}
"""Names in FMI 3.0 of the capabilities."""


@dataclass(frozen=True)
class Traits:
    """What FMI 3.0 adds."""

    token: str  # instantiation token
    sampled: bool  # whether the FMU takes its samples at the ticks of a clock
    references: int  # largest value reference of the variables. The event indicators and the clock have the next ones
    indicators: int  # number of event indicators


def description_3(old: etree._Element, variables: Sequence[Fmi3Variable], traits: Traits) -> bytes:
    """Return the XML file."""
    dropped = ("guid", "numberOfEventIndicators")
    kept = {str(key): str(value) for key, value in old.attrib.items() if key not in dropped}
    root = etree.Element("fmiModelDescription", {**kept, "fmiVersion": "3.0", "instantiationToken": traits.token})
    _kinds(root, old, traits)
    _copied(root, old)
    listed = etree.SubElement(root, "ModelVariables")
    place = {int(str(each.get("valueReference"))): v for v in variables for each in v.elements}  # by FMI 2.0
    by_index = [place[int(str(each.get("valueReference")))] for each in old.iterfind("ModelVariables/ScalarVariable")]
    for v in variables:
        _variable(listed, v, by_index, variables[0])
    names = {v.name for v in variables}
    if traits.indicators:
        _indicators(listed, traits, names)
    if traits.sampled:
        _clock(listed, traits, names)
    structure = etree.SubElement(root, "ModelStructure")
    for group, name in (
        ("Outputs", "Output"),
        ("Derivatives", "ContinuousStateDerivative"),
        ("InitialUnknowns", "InitialUnknown"),
    ):
        _unknowns(structure, name, old.findall(f"ModelStructure/{group}/Unknown"), by_index)
    for k in range(traits.indicators):
        etree.SubElement(structure, "EventIndicator", valueReference=str(traits.references + 1 + k))
    annotations = etree.SubElement(root, "Annotations")
    for tool in old.iterfind("VendorAnnotations/Tool"):
        etree.SubElement(annotations, "Annotation", type=str(tool.get("name"))).extend(deepcopy(list(tool)))
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _kinds(root: etree._Element, old: etree._Element, traits: Traits) -> None:
    exchange, simulation = old.find("ModelExchange"), old.find("CoSimulation")
    assert simulation is not None, "FMUs of this project are for co-simulation"
    identifier = str(simulation.get("modelIdentifier"))
    if exchange is not None:
        flags = _flags(exchange, _EXCHANGE)
        if exchange.get("completedIntegratorStepNotNeeded") != "true":
            flags["needsCompletedIntegratorStep"] = "true"
        etree.SubElement(root, "ModelExchange", {"modelIdentifier": identifier, **flags})
    flags = _flags(simulation, _SIMULATION)
    flags |= {"providesIntermediateUpdate": "true", "canReturnEarlyAfterIntermediateUpdate": "true"}
    if traits.sampled:
        flags |= {"hasEventMode": "true", "mightReturnEarlyFromDoStep": "true"}
    etree.SubElement(root, "CoSimulation", {"modelIdentifier": identifier, **flags})


def _flags(element: etree._Element, names: Mapping[str, str]) -> dict[str, str]:
    """Return the capabilities. Whoever gives directional derivatives gives adjoint ones too, see fmi3.h."""
    flags = {new: str(element.get(old)) for old, new in names.items() if element.get(old) is not None}
    if flags.get("providesDirectionalDerivatives") == "true":
        flags["providesAdjointDerivatives"] = "true"
    return flags


def _texts(element: etree._Element) -> dict[str, str]:
    return {str(key): str(value) for key, value in element.attrib.items()}


def _copied(root: etree._Element, old: etree._Element) -> None:
    for name in ("UnitDefinitions", "TypeDefinitions", "LogCategories", "DefaultExperiment"):
        group = old.find(name)
        if group is None:
            continue
        copy = etree.SubElement(root, name, _texts(group))
        for each in group:
            if name != "TypeDefinitions":
                copy.append(etree.fromstring(etree.tostring(each)))
            elif each[0].tag == "Real":
                etree.SubElement(copy, "Float64Type", _texts(each) | _texts(each[0]))
        if name == "TypeDefinitions" and not len(copy):
            root.remove(copy)


def _variable(parent: etree._Element, v: Fmi3Variable, by_index: Sequence[Fmi3Variable], size: Fmi3Variable) -> None:
    scalar, typed = v.elements[0], v.typed
    given = {key: scalar.get(key) for key in ("description", "causality", "variability", "initial")}
    attributes = {key: str(value) for key, value in given.items() if value is not None}
    if v.type == "UInt64":
        attributes["causality"] = "structuralParameter"
    if v.is_intermediate:
        attributes["intermediateUpdate"] = "true"
    attributes |= _texts(typed)
    if v.type == "Int32":
        attributes.pop("declaredType", None)  # an enumeration, which is an integer here
    if "derivative" in attributes:
        attributes["derivative"] = str(by_index[int(attributes["derivative"]) - 1].reference)
    count = int(str(size.typed.get("start"))) if v.is_sized else len(v.elements)
    if "start" in attributes:
        attributes["start"] = " ".join(str(each[0].get("start")) for each in v.elements[:count])
    element = etree.SubElement(parent, v.type, {"name": v.name, "valueReference": str(v.reference), **attributes})
    if v.is_array:
        length = {"valueReference": str(size.reference)} if v.is_sized else {"start": str(count)}
        etree.SubElement(element, "Dimension", length)


def _free(name: str, names: set[str]) -> str:
    """Return the name, with an underscore for each variable that has it already."""
    while name in names:
        name += "_"
    return name


def _indicators(parent: etree._Element, traits: Traits, names: set[str]) -> None:
    """Add the event indicators, each as a scalar, which PyFMI needs."""
    name = _free("event_indicators", names)
    for k in range(traits.indicators):
        etree.SubElement(
            parent,
            "Float64",
            name=f"{name}[{k + 1}]",
            valueReference=str(traits.references + 1 + k),
            description="positive until what was decided at the last event ends; 1 in co-simulation",
            causality="local",
            variability="continuous",
            initial="calculated",
        )


def _clock(parent: etree._Element, traits: Traits, names: set[str]) -> None:
    """Add the clock. Importers ask for its interval: an attribute intervalDecimal would permit them to set it."""
    etree.SubElement(
        parent,
        "Clock",
        name=_free("samples", names),
        valueReference=str(traits.references + traits.indicators + 1),
        description="ticks at the samples, every Ts",
        causality="input",
        intervalVariability="fixed",
    )


def _unknowns(
    structure: etree._Element, name: str, unknowns: Sequence[etree._Element], by_index: Sequence[Fmi3Variable]
) -> None:
    """List each variable once, with the variables on which any of its elements depends."""
    listed: dict[int, set[int] | None] = {}
    for unknown in unknowns:
        reference = by_index[int(str(unknown.get("index"))) - 1].reference
        text = unknown.get("dependencies")
        known = None if text is None else {by_index[int(i) - 1].reference for i in str(text).split()}
        before = listed.get(reference, set())
        listed[reference] = None if known is None or before is None else before | known
    for reference, known in listed.items():
        attributes = {"valueReference": str(reference)}
        if known is not None:
            attributes["dependencies"] = " ".join(str(each) for each in sorted(known))
        etree.SubElement(structure, name, attributes)


PAGE: Final = "documentation/index.html"

_FMI_2_HEADERS: Final = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")

_TUPLES: Final[Mapping[str, tuple[str, tuple[str | None, ...] | None]]] = {
    "linux64": ("x86_64-linux", None),
    "win64": ("x86_64-windows", None),
    "darwin64": ("x86_64-darwin", ("x86_64-macos",)),
}
"""Folder in FMI 3.0 of each platform that is named otherwise in FMI 2.0, and the targets if they differ."""

_SOURCE: Final = """\
/* {identifier} in FMI 3.0: the FMI 2.0 functions, the tables of variables, and the shell around them. */

#undef FMI2_OVERRIDE_FUNCTION_PREFIX
#include "{identifier}.c"

#include "fmi3_variable.h"

#define TOKEN       "{token}"
#define GUID_INSIDE "{guid}"

enum {{
    REFERENCES = {references},
    INDICATOR_COUNT = {indicators},
    INDICATORS_REFERENCE = {variable_count} + 1,
    CLOCK_REFERENCE = INDICATORS_REFERENCE + INDICATOR_COUNT,
    ALL_REFERENCES,
    STATE_VARIABLES = {state_count}
}};

static const Variable3 variables_3[ALL_REFERENCES] = {{
{variables}
}};

#define HAS_MODEL_EXCHANGE {exchange}
#define HAS_EVENT_MODE     {events}
{structural}
#if HAS_MODEL_EXCHANGE
static const uint32_t state_variables[STATE_VARIABLES + 1] = {{{states}}};
#endif

#include "fmi3.h"
"""


def fmi_3(source: SourceFmu, *, clocks: bool = False, arrays: bool = False) -> bytes:
    """Return the FMI 3.0 FMU, from the cache or compiled."""
    shell = {path.name: path.read_text("utf-8") for path in sorted((source_folder() / "fmi3").glob("*.h"))}
    modules = (path.read_text(encoding="utf-8") for path in sorted(Path(__file__).parent.glob("*.py")))
    parts = (part for item in sorted(shell.items()) for part in item)
    identities = (text for each in source.platforms for text in (each.folder, *map(toolchain.identity, each.targets)))
    digest = hash_of((f"{clocks} {arrays}", *modules, *parts, *identities), source.content)
    path = toolchain.cache_folder() / "fmi3" / f"{digest[:24]}.fmu"
    return cached(path, lambda: _assemble(source, shell, clocks, arrays))


def _assemble(fmu: SourceFmu, shell: Mapping[str, str], clocks: bool, arrays: bool) -> bytes:
    old, identifier, units = fmu.description, fmu.identifier, fmu.units
    files = {**fmu.files, **shell, **{name: _fmi_header(name) for name in _FMI_2_HEADERS}}
    main = f"fmi3_{identifier}.c"

    scalars = old.findall("ModelVariables/ScalarVariable")
    variables = grouped(scalars, arrays=arrays, resizable="block.h" in files)
    references = 1 + max(int(str(each.get("valueReference"))) for each in scalars)
    indicators = int(old.get("numberOfEventIndicators") or 0)
    sampled = clocks and re.search(r"^#define SAMPLED\b", files[f"{identifier}.c"], re.M) is not None

    def source(token: str) -> str:
        return _source(old, identifier, token, variables, references, indicators, sampled)

    traits = Traits("", sampled, len(variables), indicators)
    token = guid_of(files, source(""), description_3(old, variables, traits).decode())
    files[main] = source(token)
    traits = Traits(token, sampled, len(variables), indicators)
    made = {
        name: data
        for name, data in fmu.members.items()
        if name.startswith(("documentation/", "terminalsAndIcons/", "resources/"))
    }
    made["modelDescription.xml"] = description_3(old, variables, traits)
    if PAGE in made:
        made[PAGE] = made[PAGE].replace(b"<p>FMI 2.0 for co-simulation", b"<p>FMI 3.0 for co-simulation")
    compiled = (main, *(unit for unit in units if unit != f"{identifier}.c"))
    made |= {f"sources/{name}": text.encode() for name, text in files.items()}
    made["sources/buildDescription.xml"] = _build_description(identifier, compiled)
    sources = {
        unit: included(unit, files) | ({f"{identifier}.c": files[f"{identifier}.c"]} if unit == main else {})
        for unit in compiled
    }
    platforms = [_named(platform) for platform in fmu.platforms]
    made |= fmu.libraries(lambda platform: linked(platform, sources, identifier, fmu.quiet), platforms)
    return zipped(made, fmu.made)


def _named(platform: Platform) -> Platform:
    """Return a platform as FMI 3.0 names it."""
    folder, targets = _TUPLES.get(platform.folder, (platform.folder, None))
    return platform._replace(folder=folder, targets=targets or platform.targets)


def _source(
    old: etree._Element,
    identifier: str,
    token: str,
    variables: Sequence[Fmi3Variable],
    references: int,
    indicators: int,
    sampled: bool,
) -> str:
    """Return the C file with the tables."""
    rows = [
        f"    [{v.reference}] = "
        + _row(
            v.type,
            v.type == "Float64" and len(v.elements) == 1,
            v.is_sized,
            v.is_intermediate,
            len(v.elements),
            v.inner,
        )
        for v in variables
    ]
    rows += [f"    [INDICATORS_REFERENCE + {k}] = {_row('Float64')}" for k in range(indicators)]
    rows += [f"    [CLOCK_REFERENCE] = {_row('Clock')}"] if sampled else []
    of_scalar = {int(str(each.get("valueReference"))): v for v in variables for each in v.elements}
    scalars = old.findall("ModelVariables/ScalarVariable")
    states: list[int] = []
    for unknown in old.iterfind("ModelStructure/Derivatives/Unknown"):
        derivative = scalars[int(str(unknown.get("index"))) - 1]
        state = scalars[int(str(derivative[0].get("derivative"))) - 1]
        states.append(of_scalar[int(str(state.get("valueReference")))].reference)
    distinct = list(dict.fromkeys(states))
    structural = next((f"#define STRUCTURAL         {v.inner}\n" for v in variables if v.type == "UInt64"), "")
    return _SOURCE.format(
        identifier=identifier,
        token=token,
        guid=old.get("guid"),
        references=references,
        indicators=indicators,
        variable_count=len(variables),
        state_count=len(distinct),
        variables="\n".join(rows),
        states=", ".join(map(str, distinct)) or "0",
        structural=structural,
        exchange=int(old.find("ModelExchange") is not None),
        events=int(sampled),
    )


def _row(
    kind: str, plain: bool = False, resized: bool = False, intermediate: bool = False, length: int = 1, inner: int = 0
) -> str:
    """Return a `Variable3` in C."""
    flags = ", ".join(str(flag).lower() for flag in (plain, resized, intermediate))
    return f"{{IS_{kind.upper()}, {flags}, {length}, {inner}}},"


def _build_description(identifier: str, compiled: Sequence[str]) -> bytes:
    root = etree.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = etree.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    files = etree.SubElement(configuration, "SourceFileSet", language="C99")
    for name in compiled:
        etree.SubElement(files, "SourceFile", name=name)
    etree.SubElement(
        files,
        "PreprocessorDefinition",
        name="FMI3_OVERRIDE_FUNCTION_PREFIX",
        value="",
        optional="true",
        description=f"for a shared library; in a static one, the functions have the prefix {identifier}_",
    )
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _fmi_header(name: str) -> str:
    """Return a header of FMI 2.0, which importers of FMI 3.0 need not have."""
    # As in the standard, and unlike in fmpy's copy, functions with a prefix are not exported.
    text = (toolchain.header_folder() / name).read_text(encoding="utf-8").replace("\r\n", "\n")
    return re.sub(r"#if defined _WIN32.*?#endif\n(?=\n)|#define fmi2FullName.*?\n", _prefixed, text, flags=re.S)


def _prefixed(found: re.Match[str]) -> str:
    hidden = "fmi2FullName(name) PASTE(FMI2_FUNCTION_PREFIX, name)" if "fmi2FullName" in found[0] else "FMI2_Export"
    return f"#ifdef FMI2_FUNCTION_PREFIX\n#define {hidden}\n#else\n{found[0]}#endif\n"
