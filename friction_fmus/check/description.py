"""modelDescription.xml for the rules: everything as written, with the defaults of the standard."""

import math
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any, ClassVar, Final

import fmpy
from lxml import etree

from friction_fmus.check.findings import DESCRIPTION, Finding, declare

_INITIAL: Final = {"parameter": "exact", "calculatedParameter": "calculated", "input": None, "independent": None}
"""Default of `initial` by causality; for outputs and locals it depends on the variability (section 2.2.7)."""

PARAMETERS: Final = ("parameter", "structuralParameter", "calculatedParameter")
VARIABILITIES: Final = {  # that are allowed, by causality (section 2.2.7, in FMI 3.0 2.4.7.4)
    **{causality: {"fixed", "tunable"} for causality in PARAMETERS},
    "input": {"discrete", "continuous"},
    "output": {"constant", "discrete", "continuous"},
    "local": {"constant", "fixed", "tunable", "discrete", "continuous"},
    "independent": {"continuous"},
}
SECTIONS: Final = ("Outputs", "Derivatives", "InitialUnknowns")  # sections of ModelStructure

MALFORMED = declare("xml-malformed", "error", "2.2", "modelDescription.xml cannot be read.", "description")
ENTITIES = declare(
    "xml-entities", "error", "2.2", "An XML file has a DOCTYPE, which can define entities.", "description"
)
ENCODING = declare("xml-encoding", "error", "2.2", "An XML file is not encoded as UTF-8.", "description")
SCHEMA = declare("schema", "error", "2.2", "modelDescription.xml violates the schema of FMI 2.0.", "description")
VERSION = declare("fmi-version", "error", "2.2.1", "The FMU is not an FMI 2.0 FMU.", "description")
NO_INTERFACE = declare(
    "no-interface", "error", "2.2.1", "The FMU offers neither co-simulation nor model exchange.", "description"
)


def initials(causality: str, variability: str, of_input: str | None) -> set[str | None]:
    """Return the allowed values of the attribute initial (section 2.2.7, in FMI 3.0 2.4.7.5)."""
    if causality in ("input", "independent"):
        return {of_input if causality == "input" else None}
    if causality in ("parameter", "structuralParameter") or variability == "constant":
        return {"exact"}
    if causality == "calculatedParameter" or variability in ("fixed", "tunable"):
        return {"calculated", "approx"}
    return {"exact", "calculated", "approx"}


@dataclass(frozen=True)
class ListedUnknown:
    """An entry of ModelStructure."""

    line: int  # line in the XML
    index: int  # index of the variable, from 1
    dependencies: tuple[int, ...] | None  # indices; None if the attribute is missing: it depends on all knowns
    kinds: tuple[str, ...] | None  # the attribute dependenciesKind


@dataclass(frozen=True)
class DescribedVariable:
    """What variables of both versions of FMI have."""

    element: etree._Element  # ScalarVariable, or in FMI 3.0 such as Float64

    @property
    def name(self) -> str:
        """The name."""
        return self.element.get("name", "")

    @property
    def line(self) -> int:
        """Line in the XML."""
        return line_of(self.element)

    @property
    def causality(self) -> str:
        """Causality, with its default."""
        return self.element.get("causality", "local")


@dataclass(frozen=True)
class Variable2(DescribedVariable):
    """A ScalarVariable with the defaults of the standard and of its declared type."""

    typed: etree._Element | None  # Real, Integer, Boolean, String or Enumeration
    declared: etree._Element | None  # the corresponding element of its SimpleType
    index: int  # index from 1, as in ModelStructure

    @property
    def type(self) -> str:
        """Real, Integer, Boolean, String or Enumeration."""
        return "" if self.typed is None else name_of(self.typed)

    @property
    def reference(self) -> str:
        """Value reference as written."""
        return self.element.get("valueReference", "")

    @property
    def variability(self) -> str:
        """Variability; the default is continuous even where that is not allowed."""
        return self.element.get("variability", "continuous")

    @cached_property
    def initial(self) -> str | None:
        """The attribute initial, with its default."""
        written = self.element.get("initial")
        if written is not None:
            return written
        if self.causality in _INITIAL:
            return _INITIAL[self.causality]
        return "exact" if self.variability == "constant" else "calculated"

    def get(self, attribute: str) -> str | None:
        """Return an attribute of the variable's type, or else of its declared type."""
        for element in (self.typed, self.declared):
            if element is not None and element.get(attribute) is not None:
                return element.get(attribute)
        return None

    @property
    def start(self) -> str | None:
        """Start value as written."""
        return None if self.typed is None else self.typed.get("start")

    @property
    def settable(self) -> bool:
        """Whether importers may set the variable before initialisation, including `approx`."""
        return self.variability != "constant" and (
            self.causality in ("parameter", "input") or self.initial in ("exact", "approx")
        )


@dataclass
class DescribedModel:
    """What modelDescription.xml has in both versions of FMI."""

    kinds: ClassVar[tuple[str, ...]] = ("CoSimulation", "ModelExchange")
    root: etree._Element  # the element fmiModelDescription

    @cached_property
    def interfaces(self) -> list[etree._Element]:
        """The elements of `kinds`, as far as they exist."""
        found = (self.root.find(kind) for kind in self.kinds)
        return [element for element in found if element is not None]

    @property
    def identifier(self) -> str:
        """Model identifier of the first interface."""
        return self.interfaces[0].get("modelIdentifier", "") if self.interfaces else ""

    @property
    def identifiers(self) -> tuple[str, ...]:
        """Model identifiers of all interfaces, each once."""
        return tuple(dict.fromkeys(element.get("modelIdentifier", "") for element in self.interfaces))

    @property
    def types(self) -> list[tuple[str, etree._Element]]:
        """Name and element of each declared type."""
        found = [(e.get("name", ""), e) for e in self.all("TypeDefinitions/*")]
        return [
            (name, child) for name, e in found if (child := child_of(e) if e.tag == "SimpleType" else e) is not None
        ]

    def all(self, path: str) -> list[etree._Element]:
        """Return elements by their path."""
        return list(self.root.iterfind(path))

    def flag(self, name: str) -> bool:
        """Return whether an interface has a capability flag."""
        return any(element.get(name) in ("true", "1") for element in self.interfaces)


@dataclass
class Model(DescribedModel):
    """The content of modelDescription.xml."""

    variables: list[Variable2] = field(init=False)

    def __post_init__(self) -> None:
        types = {element.get("name"): child_of(element) for element in self.all("TypeDefinitions/SimpleType")}
        self.variables = []
        for index, element in enumerate(self.all("ModelVariables/ScalarVariable"), start=1):
            typed = child_of(element)
            declared = None if typed is None else types.get(typed.get("declaredType", ""))
            self.variables.append(Variable2(element, typed, declared, index))

    @property
    def source_files(self) -> tuple[str, ...]:
        """Source files of all interfaces, each once."""
        files = (file for element in self.interfaces for file in element.iterfind("SourceFiles/File"))
        return tuple(dict.fromkeys(file.get("name", "") for file in files))

    @cached_property
    def unknowns(self) -> dict[str, list[ListedUnknown]]:
        """Entries of ModelStructure by section: Outputs, Derivatives, InitialUnknowns."""
        return {section: [_unknown(e) for e in self.all(f"ModelStructure/{section}/Unknown")] for section in SECTIONS}

    def variable(self, index: int) -> Variable2 | None:
        """Return a variable by its index from 1."""
        return self.variables[index - 1] if 1 <= index <= len(self.variables) else None

    def numbered(self, text: str | None) -> Variable2 | None:
        """Return the variable with an index in the file."""
        return self.variable(integer(text) or 0)

    @cached_property
    def states(self) -> set[int]:
        """Indices of the continuous-time states, which the attributes derivative name."""
        derivatives = (variable.get("derivative") for variable in self.variables if variable.type == "Real")
        return {index for index in map(integer, derivatives) if index is not None}


def _unknown(element: etree._Element) -> ListedUnknown:
    kinds, listed = element.get("dependenciesKind"), element.get("dependencies")
    return ListedUnknown(
        line_of(element),
        integer(element.get("index")) or 0,
        None if listed is None else tuple(integer(word) or 0 for word in listed.split()),
        None if kinds is None else tuple(kinds.split()),
    )


def name_of(element: etree._Element) -> str:
    """Return the tag of an element, also of a comment."""
    return element.tag if isinstance(element.tag, str) else ""


def line_of(element: etree._Element) -> int:
    """Return the line of an element."""
    line = element.sourceline
    return line if isinstance(line, int) else 1


def child_of(element: etree._Element) -> etree._Element | None:
    """Return the first child that states a type."""
    types = ("Real", "Integer", "Boolean", "String", "Enumeration")
    return next((child for child in element if name_of(child) in types), None)


def integer(text: str | None) -> int | None:
    """Return an integer written in XML, or None if there is none."""
    try:
        return None if text is None or len(text) > 20 else int(text)
    except ValueError:
        return None


def real(text: str | None) -> float | None:
    """Return a number written in XML, including infinities and NaN, or None if there is none."""
    if text is None:
        return None
    special = {"INF": math.inf, "-INF": -math.inf, "NaN": math.nan}
    try:
        return special[text.strip()] if text.strip() in special else float(text)
    except ValueError:
        return None


def parse(data: bytes, file: str = DESCRIPTION) -> etree._Element | Finding:
    """Return the root of an XML file, without external entities, or a finding if it cannot be read."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        line = error.lineno or None
        return MALFORMED.finding(f"{file} is not well-formed: {error.msg}; export the FMU again", file, line=line)
    except ValueError as error:  # such as an unknown encoding
        return MALFORMED.finding(f"{file} cannot be read: {error}; export the FMU again", file)
    if root.getroottree().docinfo.internalDTD is not None:
        return ENTITIES.finding(f"{file} has a DOCTYPE, which the standard does not need; remove it", file, line=1)
    return root


def wrong_encoding(data: bytes, root: etree._Element, file: str = DESCRIPTION) -> list[Finding]:
    """Return a finding if a file is not encoded as UTF-8 or declares another encoding."""
    stated = root.getroottree().docinfo.encoding or "UTF-8"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        stated = "another encoding" if stated.upper() == "UTF-8" else stated
    if stated.upper() == "UTF-8":
        return []
    return [
        ENCODING.finding(f"{file} is encoded in {stated}; use UTF-8, as many importers read nothing else", file, line=1)
    ]


@cache
def _schema(name: str) -> etree.XMLSchema:
    return etree.XMLSchema(etree.parse(str(Path(fmpy.__file__).parent / "schema" / name)))


def violations(root: etree._Element, schema: str) -> list[tuple[str, int]]:
    """Return the violations of a schema, with their lines."""
    xsd = _schema(schema)
    xsd.validate(root.getroottree())
    log: Any = xsd.error_log  # the stubs do not declare that it is iterable
    return [(f"{entry.message.removesuffix('.')}; see {Path(schema).name}", entry.line) for entry in log]
