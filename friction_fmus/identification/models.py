"""Which parameters of a block are identified, where the search starts, and what determines each of them.

Names, units, ranges and start values come from the FMU. Here stands only what they do not say; the blocks of
this package use one name for one thing, so that one row serves all models.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from friction_fmus.catalogue import catalogue, find
from friction_fmus.package import fmu
from harness import FmuPart, open_archive

from .errors import IdentificationError
from .record import ROTARY, AxisUnits


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


@dataclass(frozen=True)
class Row:
    """A parameter name of the blocks: where to start, and what to measure if it is weakly determined."""

    guess: Callable[[Traits], float]
    measure: str


_SLOW = "slow constant velocities of both directions around it"
_FAST = "constant velocities up to the largest speed"
_SLIDING = "sliding at constant velocity in both directions"
_SMALL = "motions to and fro that are smaller than the presliding distance"
_SMALL_FAST = "small motions to and fro at a higher frequency"
_LOOPS = "reversals with many samples over the presliding distance"
_REST = "break-aways after rests of different length"

ROWS: Mapping[str, Row] = {
    "M": Row(lambda t: 1.0, "accelerations in both directions"),
    "OF": Row(lambda t: 0.0, "the same speeds in both directions"),
    "Fc": Row(lambda t: t.level, _SLIDING),
    "Fs": Row(lambda t: t.peak, _SLOW),
    "Fv": Row(lambda t: t.viscous, _FAST),
    "sigma2": Row(lambda t: t.viscous, _FAST),
    "vs": Row(lambda t: 0.1 * t.speed, _SLOW),
    "sigma0": Row(lambda t: t.stiffness, _SMALL),
    "sigma": Row(lambda t: t.stiffness, _SMALL),
    "kt": Row(lambda t: t.stiffness, _SMALL),
    "sigma1": Row(lambda t: t.damping, _SMALL_FAST),
    "beta": Row(lambda t: t.damping, _SMALL_FAST),
    "n": Row(lambda t: 1.0, _LOOPS),
    "z_ba": Row(lambda t: 0.5 * t.distance, _LOOPS),
    "z0": Row(lambda t: t.distance, _LOOPS),
    "a": Row(lambda t: 0.1, _SLOW),
    "f1": Row(lambda t: 1.5 * t.level, _LOOPS),
    "f2": Row(lambda t: 0.5 * t.level, _LOOPS),
    "eta": Row(lambda t: 0.3, _LOOPS),
    "eps": Row(lambda t: t.distance, _LOOPS),
    "A": Row(lambda t: 2.5 * t.peak, _LOOPS),
    "zc": Row(lambda t: 2.5 * t.distance, _LOOPS),
    "Fs_a": Row(lambda t: 0.2 * t.level, _REST),
    "Fs_inf": Row(lambda t: 0.2 * t.level, _REST),
    "gamma": Row(lambda t: 1.0, _REST),
    "tauL": Row(lambda t: 5e-3, "sliding with a velocity that swings about a mean one"),
    "T_dz": Row(lambda t: t.peak, _SLOW),
    "C": Row(lambda t: 100.0 * t.level, "sliding with a velocity that swings about a mean one"),
    "k": Row(lambda t: t.stiffness, _LOOPS),
    "W": Row(lambda t: t.level, _LOOPS),
    "alpha": Row(lambda t: 1.0, _LOOPS),
}
"""Parameters that are identified, by name; elements of vectors without their number, parameters of v < 0 without
``_neg``."""

HELD = ("delta", "v_d", "delta_v", "gamma", "Fs_a", "tauL", "dead_band", "DV", "offset", "Fn0", "sigma")
"""Parameters that keep their value unless `start` or `bounds` names them: shapes that trade with others, and effects
that most records do not show. The stiffness of `Dahl` is called sigma, too, and is no such parameter."""

HYSTERESIS = ("MaxwellSlip", "GMS")
"""Blocks with elements k[i] beside others: least squares on a grid of break-away distances finds them."""

STATE_SCALES: Mapping[str, Callable[[Mapping[str, float]], float]] = {
    "Dahl": lambda p: p["Fc"] / p["sigma"],
    "LuGre": lambda p: p["Fc"] / p["sigma0"],
    "ElastoPlastic": lambda p: p["Fc"] / p["sigma0"],
    "SevenParameter": lambda p: p["Fc"] / p["kt"],
    "ResetIntegrator": lambda p: p["z0"],
    "BlimanSorine": lambda p: p["f1"],
}
"""Blocks whose first state, the deflection or force of the contact at the beginning of the record, is identified as
well -> its size in steady sliding."""


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
    """

    name: str
    path: Path
    parameters: Mapping[str, Parameter]
    states: tuple[str, ...]
    loaded: bool
    rate_dependent: bool

    @property
    def static(self) -> bool:
        """Whether the force follows from the velocity at the same instant."""
        return not self.states

    @property
    def initial_state(self) -> str | None:
        """The state that is identified with the parameters, if there is one."""
        return self.states[0] if self.name in STATE_SCALES else None

    def identified(self, named: set[str], fixed: Mapping[str, float]) -> list[str]:
        """Names of the scalar parameters to identify; `named` are those that start or bounds name."""
        chosen = []
        for name, parameter in self.parameters.items():
            base = name.removesuffix("_neg")
            held = base in HELD and not (base == "sigma" and self.name == "Dahl")
            mirrored = name != base and not fixed.get("asymmetric", 0.0)
            if name in fixed or not parameter.real or "[" in name or mirrored:
                continue
            if name in named or (base in ROWS and not held):
                chosen.append(name)
        return chosen


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
        return {model.initial_state: STATE_SCALES[model.name](values)}
    if model.name not in HYSTERESIS:
        return {}
    elements = range(1, int(values["N"]) + 1)
    if "alpha[1]" not in values:
        return {f"Fi[{i}]": values[f"W[{i}]"] for i in elements}
    shares = {i: values[f"alpha[{i}]"] for i in elements}
    level = max(values["Fs"], values["Fc"]) / (sum(shares.values()) or 1.0)
    return {f"Fi[{i}]": level * share for i, share in shares.items()}


def row_of(name: str) -> Row | None:
    """The row of a parameter, of an element of a vector, or of a parameter for v < 0."""
    return ROWS.get(name.split("[")[0].removesuffix("_neg"))


_NOT = ("FrenkelKontorovaTomlinson", "PrandtlTomlinson", "RateAndState", "Karnopp", "ModifiedLeuven")
"""Blocks without units, with the mass of a tip, with parameters that only tests of their own kind tell apart, or with
a dead zone in the velocity that only the mass beside it fills."""


def identifiable() -> tuple[str, ...]:
    """Names of the blocks that `identify` takes: friction with the velocity in and the force out, nothing random."""
    return tuple(
        block.name
        for block in catalogue().values()
        if block.kind == "friction"
        and re.search(r"\bINPUT\s*\(v,", block.code)
        and not {"random", "mass inside"} & set(block.features)
        and block.name not in _NOT
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
    if str(model) in catalogue():
        return _known(str(model), units)
    return _read(model, units)


@cache
def _known(model: str, units: AxisUnits) -> ContactModel:
    return _read(model, units)


def _read(model: str | Path, units: AxisUnits) -> ContactModel:
    block = find(model)
    if str(model) in catalogue() and block.name not in identifiable():
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
        block.name, path, parameters, states, "Fn" in names, "rate dependent" in block.features or not states
    )
