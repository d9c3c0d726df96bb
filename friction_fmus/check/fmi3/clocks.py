"""Rules of clocks (FMI 3.0.2, sections 2.2.8 and 2.4.7)."""

from __future__ import annotations

from collections.abc import Iterator

from friction_fmus.check.description import integer, real
from friction_fmus.check.findings import Fault, rule
from friction_fmus.check.fmi3.description import Model3
from friction_fmus.check.fmi3.variables import at


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
