"""Rules of clocks (FMI 3.0.2, sections 2.2.8 and 2.4.7)."""

from __future__ import annotations

from collections.abc import Iterator

from friction_fmus.check.description import real
from friction_fmus.check.findings import Fault, rule
from friction_fmus.check.fmi3.description import Model3
from friction_fmus.check.fmi3.variables import at

_STATED = ("constant", "fixed", "tunable")


@rule("fmi3-clock", "error", "2.2.8", "A clock has no interval, or a wrong one.", "fmi3")
def _clock(model: Model3) -> Iterator[Fault]:
    for v in model.variables:
        if v.type != "Clock":
            continue
        variability, decimal = v.get("intervalVariability"), v.get("intervalDecimal")
        counter, resolution = real(v.get("intervalCounter")), real(v.get("resolution"))
        if variability in _STATED and decimal is None and counter is None:
            yield at(v, f"the clock {v.name} has a {variability} interval but states none; give intervalDecimal")
        if decimal is not None and not (real(decimal) or 0.0) > 0.0:
            yield at(v, f"the clock {v.name} has the interval {decimal}; give a positive one")
        if counter is not None and not ((resolution or 0.0) > 0.0 and counter > 0.0):
            yield at(
                v, f"the clock {v.name} has an interval of {counter:g} counts of 1/{resolution}; give positive ones"
            )
        if v.causality == "output" and variability != "triggered":
            yield at(v, f"the output clock {v.name} is {variability}; only triggered clocks can be outputs")


@rule("fmi3-clocked", "error", "2.4.7.5", "The attribute clocks names a variable that is no clock.", "fmi3")
def _clocked(model: Model3) -> Iterator[Fault]:
    for v in model.variables:
        for reference in v.clocks:
            clock = model.by_reference.get(-1 if reference is None else reference)
            if clock is None or clock.type != "Clock":
                yield at(v, f"{v.name} names the clock {reference}, but no Clock has this value reference")
        if v.clocks and v.variability != "discrete":
            yield at(v, f"{v.name} is clocked and {v.variability}; a clocked variable is discrete")
        previous = v.element.get("previous")
        if previous is not None and (not previous.isdigit() or int(previous) not in model.by_reference):
            yield at(v, f"{v.name} names the previous value {previous}, which does not exist")


@rule("fmi3-no-event-mode", "error", "4.1.1", "There are input clocks, but no event mode to tick them in.", "fmi3")
def _event_mode(model: Model3) -> Iterator[Fault]:
    element = model.root.find("CoSimulation")
    ticking = [v for v in model.variables if v.type == "Clock" and v.causality == "input"]
    if element is not None and ticking and element.get("hasEventMode") not in ("true", "1"):
        message = f"the clock {ticking[0].name} is an input, but CoSimulation has no event mode; set hasEventMode"
        yield Fault(message, ticking[0].line, ticking[0].name)
