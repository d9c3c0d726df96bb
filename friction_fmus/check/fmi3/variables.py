"""Rules of ModelVariables (FMI 3.0.2, section 2.4.7)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

from friction_fmus.check.description import integer, line_of, real
from friction_fmus.check.findings import Fault, rule
from friction_fmus.check.fmi3.description import FLOATS, INTEGERS, PARAMETERS, Model3, Variable3

_VARIABILITIES = {
    **{causality: {"fixed", "tunable"} for causality in PARAMETERS},
    "input": {"discrete", "continuous"},
    "output": {"constant", "discrete", "continuous"},
    "local": {"constant", "fixed", "tunable", "discrete", "continuous"},
    "independent": {"continuous"},
}
_LIMITS = {
    **{f"Int{bits}": (-(2.0 ** (bits - 1)), 2.0 ** (bits - 1) - 1.0) for bits in (8, 16, 32, 64)},
    **{f"UInt{bits}": (0.0, 2.0**bits - 1.0) for bits in (8, 16, 32, 64)},
}


def at(v: Variable3, message: str) -> Fault:
    """Return a fault of a variable."""
    return Fault(message, v.line, v.name)


def _initials(v: Variable3) -> set[str | None]:
    if v.causality == "independent":
        return {None}
    if v.causality in ("parameter", "structuralParameter", "input") or v.variability == "constant":
        return {"exact"}
    if v.causality == "calculatedParameter" or v.variability in ("fixed", "tunable"):
        return {"calculated", "approx"}
    return {"exact", "calculated", "approx"}


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


@rule("fmi3-variability", "error", "2.4.7.4", "Causality, variability, initial or type are incompatible.", "fmi3")
def _variability(model: Model3) -> Iterator[Fault]:
    for v in model.variables:
        allowed = _VARIABILITIES.get(v.causality, {v.variability})
        if v.variability not in allowed:
            yield at(v, f"{v.name} is {v.causality} and {v.variability}; make it {' or '.join(sorted(allowed))}")
        elif v.variability == "continuous" and v.type not in FLOATS:
            yield at(v, f"{v.name} is {v.type} and continuous; write variability='discrete'")
        elif v.initial not in _initials(v) and v.type != "Clock":
            one = " or ".join(sorted(text or "nothing" for text in _initials(v)))
            yield at(v, f"{v.name} ({v.causality}, {v.variability}) has initial={v.initial!r}; write {one}")


@rule("fmi3-start", "error", "2.4.7.5", "Start values are missing, forbidden, or not as many as elements.", "fmi3")
def _start(model: Model3) -> Iterator[Fault]:
    for v in model.variables:
        if v.type == "Clock":
            continue
        needs = v.initial in ("exact", "approx")
        if needs and v.starts is None:
            yield at(v, f"{v.name} has no start value; give the one of the binary")
        if not needs and v.starts is not None:
            yield at(v, f"{v.name} is computed but has a start value; remove it or set initial='exact'")
        count = model.elements(v)
        if v.starts is not None and count is not None and len(v.starts) not in (1, count):
            yield at(v, f"{v.name} has {count} elements and {len(v.starts)} start values; give one or {count}")


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


@rule("fmi3-intermediate", "error", "2.4.7.4", "A parameter or clock is marked with intermediateUpdate.", "fmi3")
def _intermediate(model: Model3) -> Iterator[Fault]:
    for v in model.variables:
        if v.element.get("intermediateUpdate") in ("true", "1") and (v.causality in PARAMETERS or v.type == "Clock"):
            what = "clock" if v.type == "Clock" else "parameter"
            yield at(v, f"{v.name} is a {what}, which no intermediate update accesses; remove intermediateUpdate")


@rule("fmi3-reinit", "error", "2.4.7.5", "A variable that is no continuous state has the attribute reinit.", "fmi3")
def _reinit(model: Model3) -> Iterator[Fault]:
    states = {v.element.get("derivative") for v in model.variables}
    for v in model.variables:
        if v.element.get("reinit") in ("true", "1") and str(v.reference) not in states:
            yield at(v, f"{v.name} has reinit but is no continuous state; remove reinit")


@rule("fmi3-dimension", "error", "2.4.7.5", "A dimension has no size, or one that is no structural parameter.", "fmi3")
def _dimension(model: Model3) -> Iterator[Fault]:
    for v in model.variables:
        for start, reference in v.dimensions:
            if (start is None) == (reference is None):
                yield at(v, f"a dimension of {v.name} needs either start or valueReference")
            if reference is None:
                continue
            size = model.by_reference.get(reference)
            if (
                size is None
                or size.type != "UInt64"
                or not (size.causality == "structuralParameter" or size.variability == "constant")
            ):
                yield at(
                    v,
                    f"a dimension of {v.name} names {reference}, no structural parameter or constant of type UInt64",
                )


@rule("fmi3-type", "error", "2.4.5", "A declared type or unit does not exist.", "fmi3")
def _type(model: Model3) -> Iterator[Fault]:
    units = {element.get("name") for element in model.root.iterfind("UnitDefinitions/Unit")}
    for v in model.variables:
        name, unit = v.element.get("declaredType"), v.get("unit")
        if name is not None and v.declared is None:
            yield at(v, f"{v.name} has the type {name!r}, but TypeDefinitions has no {v.type}Type of this name")
        if v.type == "Enumeration" and name is None:
            yield at(v, f"{v.name} is an Enumeration without declaredType; name its type")
        if unit is not None and unit not in units:
            yield at(v, f"{v.name} has the unit {unit!r}, which UnitDefinitions does not define")
        if v.type in FLOATS and unit is None and v.get("displayUnit") is not None:
            yield at(v, f"{v.name} has a displayUnit but no unit; give its unit")


@rule("fmi3-independent", "error", "2.4.7.4", "There is no or more than one independent variable.", "fmi3")
def _independent(model: Model3) -> Iterator[Fault]:
    found = [v for v in model.variables if v.causality == "independent"]
    if len(found) != 1:
        line = line_of(model.root) if not found else found[1].line
        yield Fault(f"there are {len(found)} independent variables; declare exactly one, the time", line)


@rule("fmi3-derivative", "error", "2.4.7.5", "The attribute derivative names no continuous variable.", "fmi3")
def _derivative(model: Model3) -> Iterator[Fault]:
    for v in model.variables:
        if v.element.get("derivative") is None:
            continue
        state = model.by_reference.get(int(v.element.get("derivative", "-1")))
        if state is None or state.type not in FLOATS or state.variability != "continuous":
            yield at(
                v,
                f"{v.name} is the derivative of {v.element.get('derivative')}, which is no continuous variable",
            )
        elif model.elements(state) != model.elements(v):
            yield at(v, f"{v.name} and its state {state.name} have different dimensions; make them equal")


@rule("fmi3-clock", "error", "2.2.8", "A clock has no interval, or a wrong one.", "fmi3")
def _clock(model: Model3) -> Iterator[Fault]:
    for v in model.variables:
        if v.type != "Clock":
            continue
        variability, decimal = v.get("intervalVariability"), v.get("intervalDecimal")
        counter, resolution = real(v.get("intervalCounter")), real(v.get("resolution"))
        if variability == "constant" and decimal is None and counter is None:
            yield at(v, f"the clock {v.name} has a constant interval but states none; give intervalDecimal")
        if decimal is not None and not (real(decimal) or 0.0) > 0.0:
            yield at(v, f"the clock {v.name} has the interval {decimal}; give a positive one")
        if counter is not None and not ((resolution or 0.0) > 0.0 and counter > 0.0):
            yield at(
                v, f"the clock {v.name} has an interval of {counter:g} counts of 1/{resolution}; give positive ones"
            )
        if variability == "triggered" and (decimal is not None or counter is not None):
            yield at(v, f"the clock {v.name} is triggered but states an interval; remove it")
        if v.causality == "output" and variability != "triggered":
            yield at(v, f"the output clock {v.name} is {variability}; only triggered clocks can be outputs")


@rule("fmi3-clocked", "error", "2.4.7.5", "The attribute clocks or previous names an unsuitable variable.", "fmi3")
def _clocked(model: Model3) -> Iterator[Fault]:
    owners: dict[int, str] = {}
    for v in model.variables:
        for reference in v.clocks:
            clock = model.by_reference.get(-1 if reference is None else reference)
            if clock is None or clock.type != "Clock":
                yield at(v, f"{v.name} names the clock {reference}, but no Clock has this value reference")
        if v.clocks and v.variability not in ("discrete", "tunable"):
            yield at(v, f"{v.name} is clocked and {v.variability}; a clocked variable is discrete or tunable")
        previous = v.element.get("previous")
        if previous is None:
            continue
        reference = integer(previous)
        value = model.by_reference.get(-1 if reference is None else reference)
        if not v.clocks:
            yield at(v, f"{v.name} has a previous value but no clock; name its clock in the attribute clocks")
        if value is None:
            yield at(v, f"{v.name} names the previous value {previous}, which does not exist")
        elif value is v or value.type != v.type or value.variability != "discrete" or value.causality == "input":
            yield at(
                v,
                f"{v.name} names {value.name} as its previous value; name another discrete {v.type} that is no input",
            )
        elif owner := owners.get(reference or 0):
            yield at(v, f"{v.name} and {owner} have the same previous value {value.name}; give each its own")
        else:
            owners[reference or 0] = v.name


@rule("fmi3-no-event-mode", "error", "4.1.1", "There are input clocks, but no event mode to tick them in.", "fmi3")
def _event_mode(model: Model3) -> Iterator[Fault]:
    element = model.root.find("CoSimulation")
    ticking = [v for v in model.variables if v.type == "Clock" and v.causality == "input"]
    if element is not None and ticking and element.get("hasEventMode") not in ("true", "1"):
        message = f"the clock {ticking[0].name} is an input, but CoSimulation has no event mode; set hasEventMode"
        yield Fault(message, ticking[0].line, ticking[0].name)
