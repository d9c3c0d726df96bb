"""Which parameters of a block are identified, where the search starts, and what determines each of them.

Names, units, ranges and start values come from the FMU. The blocks of this package use one name for one thing, so that
one row serves all models; the file of a block states exceptions and further parameters (`IDENTIFIED`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from friction_fmus.blocks.arithmetic import evaluate, names_in
from friction_fmus.blocks.catalogue import find, listing
from friction_fmus.blocks.identified import NOT_IDENTIFIED, Fitted, Identified
from friction_fmus.fmi.package import fmu
from friction_fmus.identification.data.record import ROTARY, AxisUnits
from friction_fmus.identification.errors import IdentificationError
from harness import FmuPart, open_archive


@dataclass(frozen=True)
class Traits:
    """What a look at the data tells of the friction.

    Attributes
    ----------
    level, peak : float
        Typical and largest force in sliding [force].
    viscous : float
        Its growth with speed [force / velocity].
    stiffness, damping : float
        Of the contact in small motions [force / position], [force / velocity].
    speed : float
        Largest speed [velocity].
    """

    level: float
    peak: float
    viscous: float
    stiffness: float
    damping: float
    speed: float

    @property
    def distance(self) -> float:
        """Path over which the contact goes from rest to sliding [position]."""
        return self.level / self.stiffness

    def value(self, expression: str) -> float:
        """Return the value of an expression of these numbers, as `Fitted.start` has it."""
        return float(evaluate(expression, {name: getattr(self, name) for name in names_in(expression)}))


ROWS: Mapping[str, Fitted] = {
    "M": Fitted("1", "accelerations"),
    "OF": Fitted("0", "directions"),
    "Fc": Fitted("level", "sliding"),
    "Fs": Fitted("peak", "slow"),
    "Fv": Fitted("viscous", "fast"),
    "sigma2": Fitted("viscous", "fast"),
    "vs": Fitted("0.1 * speed", "slow"),
    "sigma0": Fitted("stiffness", "small"),
    "sigma": Fitted("stiffness", "small"),
    "kt": Fitted("stiffness", "small"),
    "sigma1": Fitted("damping", "small_fast"),
    "beta": Fitted("damping", "small_fast"),
    "n": Fitted("1", "loops"),
    "z_ba": Fitted("0.5 * distance", "loops"),
    "z0": Fitted("distance", "loops"),
    "a": Fitted("0.1", "slow"),
    "f1": Fitted("1.5 * level", "loops"),
    "f2": Fitted("0.5 * level", "loops"),
    "eta": Fitted("0.3", "loops"),
    "eps": Fitted("distance", "loops"),
    "A": Fitted("2.5 * peak", "loops"),
    "zc": Fitted("2.5 * distance", "loops"),
    "Fs_a": Fitted("0.2 * level", "rest"),
    "Fs_inf": Fitted("0.2 * level", "rest"),
    "gamma": Fitted("1", "rest"),
    "tauL": Fitted("5e-3", "swinging"),
    "T_dz": Fitted("peak", "slow"),
    "C": Fitted("100 * level", "swinging"),
    "k": Fitted("stiffness", "loops"),
    "W": Fitted("level", "loops"),
    "alpha": Fitted("1", "loops"),
}
"""Parameters that are identified, by name; elements of vectors without their number, parameters of v < 0 without
``_neg``. A block whose parameter of that name is another thing says so in its file."""

HELD = ("delta", "v_d", "delta_v", "gamma", "Fs_a", "tauL", "dead_band", "DV", "offset", "Fn0", "sigma")
"""Parameters that keep their value unless `start` or `bounds` names them: shapes that trade with others, and effects
that most records do not show."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of a block, from its FMU."""

    name: str
    unit: str
    start: float
    lower: float
    upper: float
    text: str
    kind: str

    @property
    def real(self) -> bool:
        """Whether it is a Real."""
        return self.kind == "Real"

    def typed(self, value: float) -> float | int | bool:
        """A value in the type that the block takes."""
        return value if self.real else bool(value) if self.kind == "Boolean" else int(value)


@dataclass(frozen=True)
class ContactModel:
    """A friction block as identification sees it.

    Attributes
    ----------
    name : str
        Name of the block.
    path : Path
        Its FMU.
    parameters : mapping of str to Parameter
        All of them.
    states : tuple of str
        Its states.
    loaded : bool
        Whether it takes the normal force.
    rate_dependent : bool
        Whether it depends on more than the path.
    told : Identified
        What its file says of its identification.
    """

    name: str
    path: Path
    parameters: Mapping[str, Parameter]
    states: tuple[str, ...]
    loaded: bool
    rate_dependent: bool
    told: Identified

    @property
    def static(self) -> bool:
        """Whether the force follows from the velocity at the same instant."""
        return not self.states

    @property
    def initial_state(self) -> str | None:
        """The state that is identified with the parameters, if there is one."""
        return self.told.state or None

    def identified(self, named: set[str], fixed: Mapping[str, float]) -> list[str]:
        """Names of the scalar parameters to identify; `named` are those that start or bounds name."""
        chosen = []
        for name, parameter in self.parameters.items():
            base = name.removesuffix("_neg")
            fitted = base in self.told.fits or (base in ROWS and base not in HELD)
            mirrored = name != base and not fixed.get("asymmetric", 0.0)
            if name in fixed or not parameter.real or "[" in name or mirrored:
                continue
            if name in named or fitted:
                chosen.append(name)
        return chosen

    def fit_of(self, name: str) -> Fitted | None:
        """Return how a parameter is identified, an element of a vector and a parameter for v < 0 included."""
        base = name.split("[")[0].removesuffix("_neg")
        return self.told.fits.get(base, ROWS.get(base))


def state_sizes(model: ContactModel, values: Mapping[str, float]) -> dict[str, float]:
    """States that a contact in steady sliding has -> their size: the deflection, or the force of each element.

    Parameters
    ----------
    model : ContactModel
        The block.
    values : mapping of str to float
        Its parameters; those that are missing have their start values.
    """
    values = {**{name: parameter.start for name, parameter in model.parameters.items()}, **values}
    if model.initial_state is not None:
        return {model.initial_state: float(evaluate(model.told.size, values))}
    if model.told.method != "hysteresis":
        return {}
    elements = range(1, int(values["N"]) + 1)
    if "alpha[1]" not in values:
        return {f"Fi[{i}]": values[f"W[{i}]"] for i in elements}
    shares = {i: values[f"alpha[{i}]"] for i in elements}
    level = max(values["Fs"], values["Fc"]) / (sum(shares.values()) or 1.0)
    return {f"Fi[{i}]": level * share for i, share in shares.items()}


def identifiable() -> tuple[str, ...]:
    """Names of the blocks that `identify` takes: friction with the velocity in and the force out, nothing random."""
    return tuple(
        block.name
        for block in (find(entry.name) for entry in listing().values() if entry.kind == "friction")
        if re.search(r"\bINPUT\s*\(v,", block.code)
        and not {"random", "mass inside"} & set(block.features)
        and block.about.identified.method != NOT_IDENTIFIED
    )


def contact_model(model: str | Path, units: AxisUnits) -> ContactModel:
    """Build the block and read its parameters; a block of the package only once.

    Parameters
    ----------
    model : str or Path
        As of `friction_fmus.build`.
    units : AxisUnits
        Units of the axis; a rotary one takes the rotational twin.

    Raises
    ------
    IdentificationError
        The block is not one that a record identifies.
    UnknownNameError, BuildError
        There is no such block, or it does not compile.
    """
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
            f"{block.name} cannot be identified from a record of motion and force; choose one of "
            f"{', '.join(identifiable())}."
        )
    path = fmu(model, "rotational" if units == ROTARY else "translational")
    part = FmuPart(block.name, path)
    names = {port.name for port in part.inputs}
    if "v" not in names or "F" not in {port.name for port in part.outputs}:
        raise IdentificationError(
            f"{block.name} has no input v or no output F; identification needs a friction block with both."
        )
    variables = open_archive(path).variables
    parameters = {}
    for port in part.parameters:
        v = variables[port.name]
        if v.causality != "parameter":
            continue
        parameters[port.name] = Parameter(
            port.name,
            v.unit or "1",
            float(v.start if v.type != "Boolean" else v.start in ("true", "1", True)),
            -math.inf if v.min is None else float(v.min),
            math.inf if v.max is None else float(v.max),
            v.description or "",
            v.type,
        )
    states = tuple(p.name for p in part.parameters if variables[p.name].causality == "local" and p.type == "Real")
    return ContactModel(
        block.name,
        path,
        parameters,
        states,
        "Fn" in names,
        "rate dependent" in block.features or not states,
        block.about.identified,
    )
