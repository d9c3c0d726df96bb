"""FMI 3.0.2: modelDescription.xml with its defaults, and the rules of variables, structure and interfaces."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from typing import ClassVar, Final

from lxml import etree

from friction_fmus.check.description import (
    PARAMETERS,
    VARIABILITIES,
    DescribedModel,
    DescribedVariable,
    initials,
    integer,
    line_of,
    name_of,
    real,
)
from friction_fmus.check.findings import Fault, at, for_each, rule

FLOATS: Final = ("Float64", "Float32")
INTEGERS: Final = ("Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")
TYPES: Final = (*FLOATS, *INTEGERS, "Boolean", "String", "Binary", "Enumeration", "Clock")


@dataclass(frozen=True)
class Variable3(DescribedVariable):
    """A variable, with the defaults of the standard and of its declared type."""

    declared: etree._Element | None  # the type that it names, if there is one of its kind

    @property
    def type(self) -> str:
        """Float64, Int32, Clock, ..."""
        return name_of(self.element)

    @property
    def typed(self) -> etree._Element:
        """The element with the attributes of the type, as in FMI 2.0."""
        return self.element

    @property
    def reference(self) -> int | None:
        """Value reference; None if it is not a number."""
        return integer(self.element.get("valueReference"))

    @property
    def variability(self) -> str:
        """Variability, with its default by causality and type."""
        default = "fixed" if self.causality in PARAMETERS else "continuous" if self.type in FLOATS else "discrete"
        return self.element.get("variability", default)

    @property
    def initial(self) -> str | None:
        """The attribute initial, with its default."""
        default: str | None = "calculated"
        if self.causality in ("parameter", "structuralParameter", "input") or self.variability == "constant":
            default = "exact"
        if self.causality == "independent":
            default = None
        return self.element.get("initial", default)

    def get(self, attribute: str) -> str | None:
        """Return an attribute of the variable, or else of its declared type."""
        value = self.element.get(attribute)
        return value if value is not None or self.declared is None else self.declared.get(attribute)

    @cached_property
    def starts(self) -> tuple[str, ...] | None:
        """Start values; None if there are none."""
        if self.type in ("String", "Binary"):
            return tuple(str(e.get("value", "")) for e in self.element.iterfind("Start")) or None
        text = self.element.get("start")
        return None if text is None else tuple(text.split())

    @cached_property
    def dimensions(self) -> tuple[tuple[int | None, int | None], ...]:
        """Size, or else value reference of the size, of each dimension."""
        found = self.element.iterfind("Dimension")
        return tuple((integer(e.get("start")), integer(e.get("valueReference"))) for e in found)

    @property
    def clocks(self) -> list[str]:
        """Value references of its clocks."""
        return self.element.get("clocks", "").split()


@dataclass
class Model3(DescribedModel):
    """The content of modelDescription.xml."""

    kinds: ClassVar[tuple[str, ...]] = ("ModelExchange", "CoSimulation", "ScheduledExecution")

    @cached_property
    def variables(self) -> list[Variable3]:
        """All variables."""
        types = {(name_of(e), e.get("name")): e for e in self.root.iterfind("TypeDefinitions/*")}
        found = [e for e in self.root.iterfind("ModelVariables/*") if name_of(e) in TYPES]
        return [Variable3(e, types.get((f"{name_of(e)}Type", e.get("declaredType")))) for e in found]

    @cached_property
    def by_reference(self) -> dict[int, Variable3]:
        """Variables by value reference."""
        return {v.reference: v for v in self.variables if v.reference is not None}

    def numbered(self, text: str | None) -> Variable3 | None:
        """Return the variable with a value reference in the file."""
        reference = integer(text)
        return None if reference is None else self.by_reference.get(reference)

    def listed(self, section: str) -> set[int | None]:
        """Return the value references in ModelStructure of a kind, such as Output."""
        return {integer(element.get("valueReference")) for element in self.all(f"ModelStructure/{section}")}

    def elements(self, v: Variable3) -> int | None:
        """Return the number of elements of a variable at the start; None if it cannot be told."""
        sizes = []
        for start, reference in v.dimensions:
            named = None if start is not None or reference is None else self.by_reference.get(reference)
            sizes.append(integer(named.starts[0]) if named is not None and named.starts else start)
        return None if None in sizes else math.prod(size for size in sizes if size is not None)


# ---- ModelVariables (section 2.4.7)

_LIMITS = {
    **{f"Int{bits}": (-(2.0 ** (bits - 1)), 2.0 ** (bits - 1) - 1.0) for bits in (8, 16, 32, 64)},
    **{f"UInt{bits}": (0.0, 2.0**bits - 1.0) for bits in (8, 16, 32, 64)},
}


@rule("fmi3-duplicate", "error", "2.4.7", "Two variables have the same name or value reference.", "fmi3")
def _duplicate(model: Model3) -> Iterator[Fault]:
    for what in ("name", "reference"):
        seen: dict[object, Variable3] = {}
        for v in model.variables:
            key = getattr(v, what)
            if key in seen:
                shown = f"the name {key!r}" if what == "name" else f"the value reference {key}"
                yield at(v, f"{v.name} has {shown} of line {seen[key].line}; give each variable its own")
            seen.setdefault(key, v)


@for_each("fmi3-variability", "error", "2.4.7.4", "Causality, variability, initial or type are incompatible.", "fmi3")
def _variability(_model: Model3, v: Variable3) -> Iterator[str]:
    allowed = VARIABILITIES.get(v.causality, {v.variability})
    starts = initials(v.causality, v.variability, "exact")
    if v.variability not in allowed:
        yield f"{v.name} is {v.causality} and {v.variability}; make it {' or '.join(sorted(allowed))}"
    elif v.variability == "continuous" and v.type not in FLOATS:
        yield f"{v.name} is {v.type} and continuous; write variability='discrete'"
    elif v.initial not in starts and v.type != "Clock":
        one = " or ".join(sorted(text or "nothing" for text in starts))
        yield f"{v.name} ({v.causality}, {v.variability}) has initial={v.initial!r}; write {one}"


@for_each("fmi3-start", "error", "2.4.7.5", "Start values are missing, forbidden, or not as many as elements.", "fmi3")
def _start(model: Model3, v: Variable3) -> Iterator[str]:
    if v.type == "Clock":
        return
    needs = v.initial in ("exact", "approx")
    if needs and v.starts is None:
        yield f"{v.name} has no start value; give the one of the binary"
    if not needs and v.starts is not None:
        yield f"{v.name} is computed but has a start value; remove it or set initial='exact'"
    count = model.elements(v)
    if v.starts is not None and count is not None and len(v.starts) not in (1, count):
        yield f"{v.name} has {count} elements and {len(v.starts)} start values; give one or {count}"


@rule("fmi3-limits", "error", "2.4.7.5", "A start value is outside min and max, the type, or its enumeration.", "fmi3")
def _limits(model: Model3) -> Iterator[Fault]:
    items = cache(lambda declared: {real(item.get("value")) for item in declared.iterfind("Item")})
    for v in model.variables:
        if v.type not in (*FLOATS, *INTEGERS, "Enumeration"):
            continue
        of_type = _LIMITS.get(v.type, (None, None))
        low, high = (
            real(v.get(name)) if v.get(name) is not None else bound
            for name, bound in zip(("min", "max"), of_type, strict=True)
        )
        for text in v.starts or ():
            start = real(text)
            if start is None or (v.type in INTEGERS and start != int(start)):
                yield at(v, f"{v.name} starts at {text!r}, which is no {v.type}; write a number of this type")
            elif (low is not None and start < low) or (high is not None and start > high):
                yield at(
                    v,
                    f"{v.name} starts at {text}, outside {low:g} to {high:g}; correct one of them"
                    if low is not None and high is not None
                    else f"{v.name} starts at {text}, outside its limit; correct one of them",
                )
            elif v.type == "Enumeration" and v.declared is not None and start not in items(v.declared):
                yield at(v, f"{v.name} starts at {text}, which is no item of its enumeration; correct one of them")


@for_each("fmi3-intermediate", "error", "2.4.7.4", "A parameter or clock is marked with intermediateUpdate.", "fmi3")
def _intermediate(_model: Model3, v: Variable3) -> Iterator[str]:
    if v.element.get("intermediateUpdate") in ("true", "1") and (v.causality in PARAMETERS or v.type == "Clock"):
        what = "clock" if v.type == "Clock" else "parameter"
        yield f"{v.name} is a {what}, which no intermediate update accesses; remove intermediateUpdate"


@rule("fmi3-reinit", "error", "2.4.7.5", "A variable that is no continuous state has the attribute reinit.", "fmi3")
def _reinit(model: Model3) -> Iterator[Fault]:
    states = {v.element.get("derivative") for v in model.variables}
    for v in model.variables:
        if v.element.get("reinit") in ("true", "1") and str(v.reference) not in states:
            yield at(v, f"{v.name} has reinit but is no continuous state; remove reinit")


@for_each(
    "fmi3-dimension", "error", "2.4.7.5", "A dimension has no size, or one that is no structural parameter.", "fmi3"
)
def _dimension(model: Model3, v: Variable3) -> Iterator[str]:
    if v.dimensions and v.causality == "structuralParameter":
        yield f"the structural parameter {v.name} has a dimension; remove it"
    for start, reference in v.dimensions:
        if (start is None) == (reference is None):
            yield f"a dimension of {v.name} needs either start or valueReference"
        if reference is None:
            continue
        size = model.by_reference.get(reference)
        if (
            size is None
            or size.type != "UInt64"
            or not (size.causality == "structuralParameter" or size.variability == "constant")
        ):
            yield f"a dimension of {v.name} names {reference}, no structural parameter or constant of type UInt64"


@rule("fmi3-type", "error", "2.4.5", "A declared type does not exist.", "fmi3")
def _type(model: Model3) -> Iterator[Fault]:
    for v in model.variables:
        name = v.element.get("declaredType")
        if name is not None and v.declared is None:
            yield at(v, f"{v.name} has the type {name!r}, but TypeDefinitions has no {v.type}Type of this name")
        if v.type == "Enumeration" and name is None:
            yield at(v, f"{v.name} is an Enumeration without declaredType; name its type")


@rule("fmi3-independent", "error", "2.4.7.4", "There is no or more than one independent variable.", "fmi3")
def _independent(model: Model3) -> Iterator[Fault]:
    found = [v for v in model.variables if v.causality == "independent"]
    if len(found) != 1:
        line = line_of(model.root) if not found else found[1].line
        yield Fault(f"there are {len(found)} independent variables; declare exactly one, the time", line)


@for_each("fmi3-derivative", "error", "2.4.7.5", "The attribute derivative names no continuous variable.", "fmi3")
def _derivative(model: Model3, v: Variable3) -> Iterator[str]:
    if v.element.get("derivative") is None:
        return
    state = model.numbered(v.element.get("derivative"))
    if state is None or state.type not in FLOATS or state.variability != "continuous":
        yield f"{v.name} is the derivative of {v.element.get('derivative')}, which is no continuous variable"
    elif v.type not in FLOATS or v.variability != "continuous":
        yield f"{v.name} is the derivative of {state.name}, but a {v.variability} {v.type}; make it a continuous Float"
    elif model.elements(state) != model.elements(v):
        yield f"{v.name} and its state {state.name} have different dimensions; make them equal"


@for_each("fmi3-clock", "error", "2.2.8", "A clock has no interval, or a wrong one.", "fmi3")
def _clock(model: Model3, v: Variable3) -> Iterator[str]:
    if v.type != "Clock":
        return
    variability, decimal = v.get("intervalVariability"), v.get("intervalDecimal")
    counter, resolution = real(v.get("intervalCounter")), real(v.get("resolution"))
    if variability == "constant" and decimal is None and counter is None:
        yield f"the clock {v.name} has a constant interval but states none; give intervalDecimal"
    if decimal is not None and not (real(decimal) or 0.0) > 0.0:
        yield f"the clock {v.name} has the interval {decimal}; give a positive one"
    if counter is not None and not ((resolution or 0.0) > 0.0 and counter > 0.0):
        yield f"the clock {v.name} has an interval of {counter:g} counts of 1/{resolution}; give positive ones"
    if variability == "triggered" and (decimal is not None or counter is not None):
        yield f"the clock {v.name} is triggered but states an interval; remove it"
    if v.get("priority") is not None and model.root.find("ScheduledExecution") is None:
        yield f"the clock {v.name} has a priority, which is for scheduled execution only; remove it"
    if v.causality == "output" and variability != "triggered":
        yield f"the output clock {v.name} is {variability}; only triggered clocks can be outputs"


@rule("fmi3-clocked", "error", "2.4.7.5", "The attribute clocks or previous names an unsuitable variable.", "fmi3")
def _clocked(model: Model3) -> Iterator[Fault]:
    owners: dict[int | None, str] = {}
    for v in model.variables:
        for reference in v.clocks:
            clock = model.numbered(reference)
            if clock is None or clock.type != "Clock":
                yield at(v, f"{v.name} names the clock {reference}, but no Clock has this value reference")
        if v.clocks and v.variability not in ("discrete", "tunable"):
            yield at(v, f"{v.name} is clocked and {v.variability}; a clocked variable is discrete or tunable")
        previous = v.element.get("previous")
        if previous is None:
            continue
        value = model.numbered(previous)
        if not v.clocks:
            yield at(v, f"{v.name} has a previous value but no clock; name its clock in the attribute clocks")
        if value is None:
            yield at(v, f"{v.name} names the previous value {previous}, which does not exist")
        elif value is v or value.type != v.type or value.variability != "discrete" or value.causality == "input":
            yield at(
                v, f"{v.name} names {value.name} as its previous value; name another discrete {v.type} that is no input"
            )
        elif owner := owners.get(value.reference):
            yield at(v, f"{v.name} and {owner} have the same previous value {value.name}; give each its own")
        else:
            owners[value.reference] = v.name


@rule("fmi3-no-event-mode", "error", "4.1.1", "There are input clocks, but no event mode to tick them in.", "fmi3")
def _event_mode(model: Model3) -> Iterator[Fault]:
    element = model.root.find("CoSimulation")
    ticking = [v for v in model.variables if v.type == "Clock" and v.causality == "input"]
    if element is not None and ticking and element.get("hasEventMode") not in ("true", "1"):
        message = f"the clock {ticking[0].name} is an input, but CoSimulation has no event mode; set hasEventMode"
        yield Fault(message, ticking[0].line, ticking[0].name)


# ---- ModelStructure and interfaces (sections 2.4.8 and 2.4.2)

DERIVATIVE: Final = "ContinuousStateDerivative"  # an entry for the derivative of a state
_SECTIONS = ("Output", DERIVATIVE, "ClockedState", "InitialUnknown", "EventIndicator")


@rule("fmi3-structure", "error", "2.4.8", "An entry of ModelStructure names a variable that does not exist.", "fmi3")
def _references(model: Model3) -> Iterator[Fault]:
    for section in _SECTIONS:
        seen = set()
        for element in model.all(f"ModelStructure/{section}"):
            line, reference = line_of(element), integer(element.get("valueReference"))
            if reference not in model.by_reference:
                yield Fault(f"{section} names value reference {reference}, which no variable has", line)
            if reference in seen:
                yield Fault(f"{section} names value reference {reference} twice; remove one", line)
            seen.add(reference)
            known = element.get("dependencies")
            kinds = element.get("dependenciesKind")
            for word in () if known is None else known.split():
                if integer(word) not in model.by_reference:
                    yield Fault(f"{section} {reference} depends on {word}, which no variable has", line)
            if kinds is not None and len(kinds.split()) != len((known or "").split()):
                yield Fault(f"{section} {reference} has not as many dependenciesKind as dependencies", line)


@rule("fmi3-outputs", "error", "2.4.8", "ModelStructure does not list all outputs, or lists other variables.", "fmi3")
def _outputs(model: Model3) -> Iterator[Fault]:
    listed = model.listed("Output")
    for v in model.variables:
        if v.causality == "output" and v.reference not in listed:
            yield at(v, f"{v.name} is an output, but ModelStructure does not list it")
        if v.causality != "output" and v.reference in listed:
            yield at(v, f"{v.name} is listed as an output, but has causality {v.causality}")


@rule("fmi3-states", "error", "2.4.8", "ModelStructure lists other states than the variables declare.", "fmi3")
def _states(model: Model3) -> Iterator[Fault]:
    listed, clocked = model.listed(DERIVATIVE), model.listed("ClockedState")
    for v in model.variables:
        declared = v.element.get("derivative") is not None
        if v.reference in listed and not declared:
            yield at(v, f"{v.name} is listed as a derivative, but names no state in the attribute derivative")
        if declared and v.reference not in listed and model.root.find("ModelExchange") is not None:
            yield at(v, f"{v.name} is the derivative of a state, but ModelStructure does not list it")
    for v in model.variables:
        if (v.element.get("previous") is not None) != (v.reference in clocked):
            what = "ModelStructure lists it as" if v.reference in clocked else "its attribute previous makes it"
            yield at(v, f"{v.name} is a clocked state in one place only: {what} one; declare both or none")
    for element in model.all("ModelStructure/EventIndicator"):
        indicator = model.numbered(element.get("valueReference"))
        if indicator is not None and (indicator.type not in FLOATS or indicator.variability != "continuous"):
            yield at(indicator, f"{indicator.name} is an event indicator, but no continuous Float variable")


@rule(
    "fmi3-initial-unknowns",
    "error",
    "2.4.8",
    "InitialUnknown does not list a variable that it must, or depends on a computed one.",
    "fmi3",
)
def _initial_unknowns(model: Model3) -> Iterator[Fault]:
    listed, derivatives = model.listed("InitialUnknown"), model.listed(DERIVATIVE)
    states = {integer(v.element.get("derivative")) for v in model.variables if v.element.get("derivative")}
    for v in model.variables:
        computed = v.initial in ("calculated", "approx") and not v.clocks and v.type != "Clock"
        asked = v.causality in ("output", "calculatedParameter") or v.reference in derivatives | states
        if computed and asked and v.reference not in listed:
            yield at(v, f"{v.name} is computed at the start, but InitialUnknown does not list it")
    for element in model.all("ModelStructure/InitialUnknown"):
        for word in element.get("dependencies", "").split():
            known = model.numbered(word)
            if known is not None and known.causality not in ("input", "independent") and known.initial != "exact":
                message = f"an InitialUnknown depends on {known.name}, which is computed"
                yield Fault(f"{message}; name inputs, the time and what is exact", line_of(element), known.name)


@rule("fmi3-flags", "error", "2.4.2", "There is no interface, or a capability lacks what it needs.", "fmi3")
def _flags(model: Model3) -> Iterator[Fault]:
    for element in model.interfaces:
        for flag, needed in (
            ("canSerializeFMUState", "canGetAndSetFMUState"),
            ("canReturnEarlyAfterIntermediateUpdate", "providesIntermediateUpdate"),
        ):
            if element.get(flag) in ("true", "1") and element.get(needed) not in ("true", "1"):
                yield Fault(f"{element.tag} declares {flag} without {needed}; declare both", line_of(element))
        if (size := real(element.get("fixedInternalStepSize"))) is not None and not size > 0.0:
            yield Fault(f"fixedInternalStepSize is {size:g}; give a positive number or remove it", line_of(element))
    if not model.interfaces:
        yield Fault(
            "there is no ModelExchange, CoSimulation or ScheduledExecution; export it again", line_of(model.root)
        )
