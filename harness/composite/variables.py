"""The variables of a composite FMU; the value reference of each is its place in the list."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from harness.composite.exchange import inner_name, states
from harness.composite.interface import Interface
from harness.parts.fmu import FmuPart
from harness.parts.part import Part, Port, StartValue
from harness.system.assembly import Assembly


@dataclass(frozen=True)
class Variable:
    """A variable of a composite FMU."""

    name: str
    """"part.variable"."""
    part: str
    """The part; empty for the time."""
    port: Port
    """Type, unit and limits."""
    reference: int
    """Value reference in the part's FMU, or column of a recorded series."""
    causality: str
    variability: str
    """As in the model description."""
    initial: str | None = None
    """"exact" or "calculated"; None for an input and the time."""
    start: StartValue | None = None
    """Start value, if it has one."""
    early: bool = False
    """Whether it can be set before the first step only."""
    type_name: str | None = None
    quantity: str | None = None
    """The part's declared type of a Real, and its quantity."""
    state: str | None = None
    """The state of which this is the derivative."""

    @property
    def inner(self) -> str:
        """The name with that of the part in front: "part.der(x)"."""
        return f"{self.part}.{self.port.name}" if self.part else self.name


def composite_variables(system: Assembly, interface: Interface, *, exchanges: bool) -> list[Variable]:
    """Return the time, and the inputs, outputs, parameters and local variables of all parts."""
    found = [Variable("time", "", Port("time", "s", description="simulation time"), 0, "independent", "continuous")]
    wired = {wire.target for wire in system.wires}
    for name, part in system.parts.items():
        if isinstance(part, FmuPart):
            found += _of_fmu(name, part, system.start, interface, wired, exchanges)
        else:
            found += _of_series(name, part, interface)
    known = {variable.name for variable in found}
    for name, port in interface.inputs.items():  # outputs of sources that the FMU does not contain
        if name not in known:
            variability = "continuous" if port.type == "Real" else "discrete"
            found.append(Variable(name, "", port, 0, "input", variability, start=port.start or 0.0))
    inputs = [variable for variable in found if variable.causality == "input"]
    outputs = [variable for variable in found if variable.causality == "output"]
    rest = [variable for variable in found if variable.causality not in ("input", "output")]
    by_name = {variable.name: variable for variable in found}
    return [
        rest[0],
        *(by_name[name] for name in interface.inputs if by_name[name] in inputs),
        *(by_name[name] for name in interface.outputs if by_name[name] in outputs),
        *rest[1:],
    ]


def _of_series(name: str, part: Part, interface: Interface) -> Iterable[Variable]:
    for column, port in enumerate(part.outputs):
        causality = "output" if f"{name}.{port.name}" in interface.outputs else "local"
        variability = "discrete" if port.held else "continuous"
        yield Variable(f"{name}.{port.name}", name, port, column, causality, variability, "calculated")


def _of_fmu(
    name: str,
    part: FmuPart,
    start: Mapping[str, StartValue],
    interface: Interface,
    wired: set[str],
    exchanges: bool,
) -> Iterable[Variable]:
    derivatives = states(part) if exchanges else {}
    for own, variable in part.archive.variables.items():
        port, dotted = part.archive.ports[own], inner_name(name, own)
        if port.type == "String" or variable.causality == "independent" or variable.variability == "constant":
            continue
        if dotted in wired or (own.startswith("der(") and own not in derivatives):
            continue
        role = _role(variable, dotted, interface)
        if role is None:
            continue
        causality, variability, initial, early = role
        value = start.get(dotted, port.start) if initial == "exact" or causality == "input" else None
        yield Variable(
            dotted,
            name,
            port,
            int(variable.valueReference),
            causality,
            variability,
            initial,
            (0.0 if value is None else value) if initial == "exact" or causality == "input" else None,
            early,
            variable.declaredType.name if variable.declaredType is not None and port.type == "Real" else None,
            variable.quantity or getattr(variable.declaredType, "quantity", None),
            inner_name(name, derivatives[own]) if own in derivatives else None,
        )


def _role(variable: Any, dotted: str, interface: Interface) -> tuple[str, str, str | None, bool] | None:
    """Return causality, variability and initial, and whether it can be set before the first step only."""
    real = variable.type == "Real"
    variability = variable.variability or ("continuous" if real else "discrete")
    if variable.causality == "input":
        if dotted in interface.inputs:
            return "input", variability, None, False
        return "parameter", "tunable", "exact", False
    if variable.causality == "parameter":
        return "parameter", variability, "exact", variability == "fixed"
    shown = variable.causality == "output" and dotted in interface.outputs
    exact = variable.initial in ("exact", "approx")
    causality = "output" if shown else "local"
    return causality, variability, "exact" if exact else "calculated", exact
