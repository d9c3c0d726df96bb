"""Rules of ModelVariables (FMI 2.0.5, sections 2.2.7 and 2.2.9)."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterator
from functools import cache

from friction_fmus.check.description import Model, Variable, integer, line_of, real
from friction_fmus.check.findings import Fault, at, for_each, rule
from harness.values import STRUCTURED

# tables of causality and variability, and of initial (section 2.2.7)
_VARIABILITIES = {
    "parameter": {"fixed", "tunable"},
    "calculatedParameter": {"fixed", "tunable"},
    "input": {"discrete", "continuous"},
    "output": {"constant", "discrete", "continuous"},
    "local": {"constant", "fixed", "tunable", "discrete", "continuous"},
    "independent": {"continuous"},
}


def _initials(v: Variable) -> set[str | None]:
    if v.causality in ("input", "independent"):
        return {None}
    if v.causality == "parameter" or v.variability == "constant":
        return {"exact"}
    if v.causality == "calculatedParameter" or v.variability in ("fixed", "tunable"):
        return {"calculated", "approx"}
    return {"exact", "calculated", "approx"}


@rule("duplicate-variable", "error", "2.2.7", "Two variables have the same name.")
def _duplicate(model: Model) -> Iterator[Fault]:
    seen: dict[str, Variable] = {}
    for v in model.variables:
        if v.name in seen:
            yield at(v, f"{v.name!r} is already defined in line {seen[v.name].line}; rename one")
        seen.setdefault(v.name, v)


@rule("variable-name", "error", "2.2.9", "A name does not follow the declared naming convention.")
def _name(model: Model) -> Iterator[Fault]:
    structured = model.root.get("variableNamingConvention") == "structured"
    for v in model.variables:
        if structured and not STRUCTURED.fullmatch(v.name):
            yield at(v, f"{v.name!r} is not a structured name; rename it or declare the convention flat")
        if not structured and (not v.name or re.search("[\r\n\t]", v.name)):
            yield at(v, f"{v.name!r} is empty or contains a line break or a tab; rename it")


@for_each("variability", "error", "2.2.7", "Causality and variability, or type and variability, are incompatible.")
def _variability(_model: Model, v: Variable) -> Iterator[str]:
    allowed = _VARIABILITIES.get(v.causality, {v.variability})
    if v.variability not in allowed:
        one = " or ".join(sorted(allowed))
        yield f"{v.name} is {v.causality} and {v.variability}; make it {one}"
    elif v.variability == "continuous" and v.type not in ("Real", ""):
        default = "" if v.element.get("variability") else ", which is the default"
        yield f"{v.name} is {v.type} and continuous{default}; write variability='discrete' or another"


@for_each("initial", "error", "2.2.7", "The value of initial is incompatible with causality and variability.")
def _initial(_model: Model, v: Variable) -> Iterator[str]:
    if v.variability in _VARIABILITIES.get(v.causality, ()) and v.initial not in _initials(v):
        allowed = " or ".join(sorted(value or "nothing" for value in _initials(v)))
        yield f"{v.name} ({v.causality}, {v.variability}) has initial={v.initial!r}; write {allowed}"


@for_each("start-missing", "error", "2.2.7", "A variable that needs a start value has none.")
def _start_missing(_model: Model, v: Variable) -> Iterator[str]:
    needs = v.causality == "input" or (v.initial in ("exact", "approx") and v.causality != "independent")
    if needs and v.start is None and v.typed is not None:
        yield f"{v.name} has no start value; give the start value of the binary"


@for_each("start-forbidden", "error", "2.2.7", "A calculated or independent variable has a start value.")
def _start_forbidden(_model: Model, v: Variable) -> Iterator[str]:
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


@for_each("number-not-finite", "error", "2.2.7", "A start, min, max or nominal is NaN or infinite.")
def _not_finite(_model: Model, v: Variable) -> Iterator[str]:
    for element in (v.typed,) if v.typed is not None and v.type == "Real" else ():
        for attribute in ("start", "min", "max", "nominal"):
            value = real(element.get(attribute))
            if value is not None and not math.isfinite(value):
                yield f"{attribute}={element.get(attribute)!r} of {v.name} is not a finite number; give one"


@rule("limits-reversed", "error", "2.2.7", "A max is below its min.")
def _reversed(model: Model) -> Iterator[Fault]:
    elements = [(v.typed, v.name, v.get("min"), v.get("max")) for v in model.variables]
    elements += [(child, child.getparent(), child.get("min"), child.get("max"))  # type: ignore[misc]
                 for child in model.all("TypeDefinitions/SimpleType/*")]  # fmt: skip
    for element, owner, low_text, high_text in elements:
        low, high = real(low_text), real(high_text)
        if element is not None and low is not None and high is not None and high < low:
            name = owner if isinstance(owner, str) else owner.get("name", "")
            message = f"{name} has min {low_text} above max {high_text}; correct them"
            yield Fault(message, line_of(element), name)


@for_each("nominal", "error", "2.2.7", "A nominal value is not positive.")
def _nominal(_model: Model, v: Variable) -> Iterator[str]:
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
        settable = [v for v in group if v.settable]
        if len(settable) > 1:
            yield at(
                settable[1],
                f"{names} share value reference {reference}, and more than one can be set; use different value "
                "references",
            )
        elif len({v.variability == "constant" for v in group}) > 1:
            yield at(
                group[1],
                f"{names} share value reference {reference}, but only some are constant; use different value "
                "references",
            )
        elif len({v.get("unit") for v in group}) > 1:
            yield at(
                group[1], f"{names} share value reference {reference}, but not the unit; use different value references"
            )


@rule("independent", "error", "2.2.7", "There are several independent variables, or one that is not Real.")
def _independent(model: Model) -> Iterator[Fault]:
    found = [v for v in model.variables if v.causality == "independent"]
    for v in found:
        if v.type not in ("Real", ""):
            yield at(v, f"the independent variable {v.name} is {v.type}; make it Real")
    for v in found[1:]:
        yield at(v, f"{v.name} and {found[0].name} are both independent; keep one")


@for_each("time-name", "note", "2.2.7", "The independent variable is not called time or does not have the unit s.")
def _time(_model: Model, v: Variable) -> Iterator[str]:
    if v.causality == "independent" and (v.name != "time" or v.get("unit") not in (None, "s")):
        yield f"the independent variable is {v.name!r} in {v.get('unit')!r}; call it time, in s"


@for_each("derivative-of", "error", "2.2.7", "The attribute derivative does not name another continuous Real variable.")
def _derivative(model: Model, v: Variable) -> Iterator[str]:
    text = v.get("derivative") if v.type == "Real" else None
    state = model.variable(integer(text) or 0)
    if text is not None and (state is None or state is v or state.type != "Real"):
        yield f"{v.name} is the derivative of variable {text}, which is not another Real variable; correct it"


@for_each(
    "multiple-set", "error", "2.2.7", "canHandleMultipleSetPerTimeInstant is set for a variable that is not an input."
)
def _multiple_set(_model: Model, v: Variable) -> Iterator[str]:
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
