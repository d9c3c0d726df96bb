"""Rules of ModelStructure and of the interfaces (FMI 3.0.2, sections 2.4.8 and 2.4.2)."""

from __future__ import annotations

from collections.abc import Iterator

from friction_fmus.check.description import integer, line_of
from friction_fmus.check.findings import Fault, rule
from friction_fmus.check.fmi3.description import FLOATS, Model3
from friction_fmus.check.fmi3.variables import at

_SECTIONS = ("Output", "ContinuousStateDerivative", "ClockedState", "InitialUnknown", "EventIndicator")


@rule("fmi3-structure", "error", "2.4.8", "An entry of ModelStructure names a variable that does not exist.", "fmi3")
def _references(model: Model3) -> Iterator[Fault]:
    for section in _SECTIONS:
        seen = set()
        for element in model.structure(section):
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
    listed = {integer(element.get("valueReference")) for element in model.structure("Output")}
    for v in model.variables:
        if v.causality == "output" and v.reference not in listed:
            yield at(v, f"{v.name} is an output, but ModelStructure does not list it")
        if v.causality != "output" and v.reference in listed:
            yield at(v, f"{v.name} is listed as an output, but has causality {v.causality}")


@rule("fmi3-states", "error", "2.4.8", "ModelStructure lists other states than the variables declare.", "fmi3")
def _states(model: Model3) -> Iterator[Fault]:
    listed = {integer(element.get("valueReference")) for element in model.structure("ContinuousStateDerivative")}
    for v in model.variables:
        declared = v.element.get("derivative") is not None
        if v.reference in listed and not declared:
            yield at(v, f"{v.name} is listed as a derivative, but names no state in the attribute derivative")
        if declared and v.reference not in listed and model.root.find("ModelExchange") is not None:
            yield at(v, f"{v.name} is the derivative of a state, but ModelStructure does not list it")
    clocked = {integer(element.get("valueReference")) for element in model.structure("ClockedState")}
    for v in model.variables:
        if (v.element.get("previous") is not None) != (v.reference in clocked):
            what = "ModelStructure lists it as" if v.reference in clocked else "its attribute previous makes it"
            yield at(v, f"{v.name} is a clocked state in one place only: {what} one; declare both or none")
    for element in model.structure("EventIndicator"):
        indicator = model.by_reference.get(integer(element.get("valueReference")) or 0)
        if indicator is not None and (indicator.type not in FLOATS or indicator.variability != "continuous"):
            yield at(indicator, f"{indicator.name} is an event indicator, but no continuous Float variable")


@rule("fmi3-initial-unknowns", "error", "2.4.8", "InitialUnknown does not list a variable that it must.", "fmi3")
def _initial_unknowns(model: Model3) -> Iterator[Fault]:
    listed = {integer(element.get("valueReference")) for element in model.structure("InitialUnknown")}
    derivatives = {integer(element.get("valueReference")) for element in model.structure("ContinuousStateDerivative")}
    states = {integer(v.element.get("derivative")) for v in model.variables if v.element.get("derivative")}
    for v in model.variables:
        computed = v.initial in ("calculated", "approx") and not v.clocks and v.type != "Clock"
        asked = v.causality in ("output", "calculatedParameter") or v.reference in derivatives | states
        if computed and asked and v.reference not in listed:
            yield at(v, f"{v.name} is computed at the start, but InitialUnknown does not list it")


@rule("fmi3-flags", "error", "2.4.2", "A capability is declared without another that it needs.", "fmi3")
def _flags(model: Model3) -> Iterator[Fault]:
    for element in model.interfaces:
        for flag, needed in (
            ("canSerializeFMUState", "canGetAndSetFMUState"),
            ("canReturnEarlyAfterIntermediateUpdate", "providesIntermediateUpdate"),
        ):
            if element.get(flag) in ("true", "1") and element.get(needed) not in ("true", "1"):
                yield Fault(f"{element.tag} declares {flag} without {needed}; declare both", line_of(element))
