"""Friction blocks as seen by the identification.

Names, units, ranges and default values of the parameters come from the FMU; which of them are identified, from which
start values, and the motion that determines each of them come from the block's file (`CONTACT` and `IDENTIFIED`).
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from friction_fmus.blocks.arithmetic import evaluate, names_in
from friction_fmus.blocks.axis_units import AxisUnits, domain_of
from friction_fmus.blocks.catalogue import find, listing
from friction_fmus.blocks.contact import NOT_IDENTIFIED, Fitted, Identified
from friction_fmus.errors import FitError, IdentificationError
from friction_fmus.export.block_fmu import fmu
from harness import FmuPart, open_archive
from harness.parts.part import StartValue


@dataclass(frozen=True)
class DataTraits:
    """Rough properties of the friction, estimated from the data."""

    level: float
    peak: float
    """Typical and largest force in sliding [force]."""
    viscous: float  # increase of the force with speed [force / velocity]
    stiffness: float
    damping: float
    """Stiffness and damping of the contact in small motions [force / position], [force / velocity]."""
    speed: float  # largest speed [velocity]

    @property
    def distance(self) -> float:
        """Distance from rest to sliding [position]."""
        return self.level / self.stiffness

    def value(self, expression: str) -> float:
        """Return the value of an expression of these numbers, see `Fitted.start`."""
        return float(evaluate(expression, {name: getattr(self, name) for name in names_in(expression)}))


@dataclass(frozen=True)
class ModelParameter:
    """Parameter of a block, read from its FMU."""

    name: str
    unit: str
    start: float
    lower: float
    upper: float
    text: str
    kind: str

    @property
    def real(self) -> bool:
        """Whether the parameter has the type Real."""
        return self.kind == "Real"

    def typed(self, value: float) -> float | int | bool:
        """Return a value converted to the type of the parameter."""
        return value if self.real else bool(value) if self.kind == "Boolean" else int(value)


@dataclass(frozen=True)
class ContactModel:
    """Friction block with the properties needed for its identification."""

    name: str  # name of the block
    block: str  # its name or file, as given
    path: Path  # FMU of the block
    parameters: Mapping[str, ModelParameter]  # all parameters, by name
    states: Mapping[str, str]  # units of the states, by name
    loaded: bool  # whether the block has the normal force as input
    rate_dependent: bool  # whether the force depends on the velocity, not only on the path
    identified_by: Identified  # identification of the block, as stated in its file
    transmits: bool = False  # whether the block has the transmitted force as input, which is the drive force
    lacks_viscous: bool = False  # whether the block has no viscous friction
    viscous: bool = False  # whether a viscous friction with the coefficient Fv acts beside the block

    @property
    def static(self) -> bool:
        """Whether the force is a function of the present velocity."""
        return not self.states

    @property
    def initial_state(self) -> str | None:
        """State whose initial value is identified; None if there is none."""
        return self.identified_by.state or None

    def level(self, values: Mapping[str, float]) -> float:
        """Return the Coulomb friction, as the file of the block states it [force]."""
        friction = find(self.block).about.friction
        given = {**{name: parameter.start for name, parameter in self.parameters.items()}, **values}
        return max(friction.level(given).Fc if friction else values.get("Fc", 1.0), 1e-12)

    def identified(self, named: set[str], fixed: Mapping[str, float]) -> list[str]:
        """Return the scalar parameters to identify; `named` are the keys of the user's start values and bounds."""
        chosen = []
        for name, parameter in self.parameters.items():
            mirrored = name.endswith("_neg") and not fixed.get("asymmetric", 0.0)
            if name in fixed or not parameter.real or "[" in name or mirrored:
                continue
            fit = self.fit_of(name)
            if name in named or (fit is not None and not fit.held):
                chosen.append(name)
            elif fit is None and not (name == "Fn0" and self.loaded):
                raise FitError(
                    f"The file of {self.name} does not state how {name} is identified; add a row FIT({name}, start, "
                    f"experiment) or HELD({name}, start, experiment) to IDENTIFIED there, or fix {name}."
                )
        return chosen

    def fit_of(self, name: str) -> Fitted | None:
        """Return start value and required motion of a parameter, a vector element or a parameter for v < 0."""
        return self.identified_by.fits.get(name.split("[")[0].removesuffix("_neg"))


def state_sizes(model: ContactModel, values: Mapping[str, float]) -> dict[str, float]:
    """Return the magnitude of each state in steady sliding: the deflection, or the force of each element."""
    values = {**{name: parameter.start for name, parameter in model.parameters.items()}, **values}
    if model.initial_state is not None:
        return {model.initial_state: float(evaluate(model.identified_by.size, values))}
    if model.identified_by.method != "hysteresis":
        return {}
    elements = range(1, int(values["N"]) + 1)
    if "alpha[1]" not in values:
        return {f"Fi[{i}]": values[f"W[{i}]"] for i in elements}
    shares = {i: values[f"alpha[{i}]"] for i in elements}
    level = max(values["Fs"], values["Fc"]) / (sum(shares.values()) or 1.0)
    return {f"Fi[{i}]": level * share for i, share in shares.items()}


def identifiable() -> tuple[str, ...]:
    """Return the names of the blocks of the catalogue that `identify` accepts.

    They are friction models with the velocity as input and the force as output, without random behaviour.

    Returns
    -------
    tuple of str
        Names in the order of the catalogue.
    """
    return tuple(
        block.name
        for block in (find(entry.name) for entry in listing().values() if entry.kind == "friction")
        if re.search(r"\bINPUT\s*\(v,", block.code)
        and not {"random", "mass inside"} & set(block.features)
        and block.about.identified.method != NOT_IDENTIFIED
    )


def contact_model(model: str | Path, units: AxisUnits) -> ContactModel:
    """Build a block and read its parameters; the result is cached for blocks of the catalogue."""
    if str(model) in listing():
        return _known(str(model), units)
    return _read(model, units)


@cache
def _known(model: str, units: AxisUnits) -> ContactModel:
    return _read(model, units)


def _read(model: str | Path, units: AxisUnits) -> ContactModel:
    block = find(model)
    if str(model) in listing() and block.name not in identifiable():
        raise IdentificationError(
            f"{block.name} cannot be identified from a record of motion and force; use one of "
            f"{', '.join(identifiable())}."
        )
    path = fmu(model, domain_of(units.rotary))
    part = FmuPart(block.name, path)
    names = {port.name for port in part.inputs}
    if "v" not in names or "F" not in {port.name for port in part.outputs}:
        raise IdentificationError(f"{block.name} has no input v or no output F; use a friction block with both.")
    variables = open_archive(path).variables
    parameters = {}
    for port in part.parameters:
        v = variables[port.name]
        if v.causality != "parameter":
            continue
        parameters[port.name] = ModelParameter(
            port.name,
            units.own(v.unit or "1"),
            float(v.start if v.type != "Boolean" else v.start in ("true", "1", True)),
            -math.inf if v.min is None else float(v.min),
            math.inf if v.max is None else float(v.max),
            v.description or "",
            v.type,
        )
    states = {
        p.name: units.own(variables[p.name].unit or "1")
        for p in part.parameters
        if variables[p.name].causality == "local" and p.type == "Real"
    }
    if taken := sorted({"M", "OF"} & parameters.keys()):
        raise FitError(
            f"{block.name} has a parameter {taken[0]}, the name of a result beside the model (mass M, offset OF of the "
            "drive); rename the parameter."
        )
    friction, fits = block.about.friction, block.about.identified.fits.values()
    return ContactModel(
        block.name,
        str(model),
        path,
        parameters,
        states,
        "Fn" in names,
        "rate dependent" in block.features or not states,
        block.about.identified,
        transmits="F_t" in names,
        lacks_viscous=(friction is None or friction.viscous == "0") and all(fit.start != "viscous" for fit in fits),
    )


def axis_start(
    model: ContactModel, values: Mapping[str, float], direction: float, load: str = "axis.F_load"
) -> dict[str, StartValue]:
    """Return the start values of an axis with this friction: mass, force offset, parameters, and states in sliding."""
    start: dict[str, StartValue] = {"axis.m": values["M"], load: -values.get("OF", 0.0)}
    if "Fv" not in model.parameters:
        start["axis.d"] = values.get("Fv", 0.0)
    own = {name: model.parameters[name].typed(value) for name, value in values.items() if name in model.parameters}
    friction = {**own, **{name: direction * size for name, size in state_sizes(model, values).items()}}
    return start | {f"friction.{name}": value for name, value in friction.items()}
