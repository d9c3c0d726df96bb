"""Declarations of a law: variables with units, kinds, valid names, and conditions."""

import inspect
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import Any

from casadi import SX, Function, vertcat

from friction_fmus.errors import FrictionError, did_you_mean
from friction_fmus.lawkit.quantities import NO_UNIT, TIME, Unit, unit_of

# ---- variables ------------------------------------------------------------------------------------------------------


class Kind(Enum):
    """Kinds of variables; the value is the name of the row macro in block.h."""

    INPUT = "INPUT"
    OPTIONAL = "OPTIONAL"
    COMMAND = "COMMAND"
    OUTPUT = "OUTPUT"
    FLAG = "OUTPUT_FLAG"
    STATE = "STATE"
    STATES = "STATES"
    PARAMETER = "PARAMETER"
    VECTOR = "PARAMETERS"
    SWITCH = "SWITCH"
    SAMPLE_TIME = "FIXED"


VECTORS = (Kind.VECTOR, Kind.STATES)  # a tuple of numbers as value, in expressions ``k[0]``, ``k[1]``, ...
BOOLEANS = (Kind.COMMAND, Kind.SWITCH)  # kinds with a Boolean value, 1 or 0 in expressions


@dataclass(frozen=True)
class LawVariable:
    """One variable of a law."""

    kind: Kind  # kind of the variable
    unit: Unit  # SI unit
    start: float | tuple[float, ...]  # start value; a tuple for a vector, 0 or 1 for a Boolean
    text: str  # one-line description
    min: float = -math.inf
    max: float = math.inf
    nominal: float = 1.0
    """Limits of a parameter, nominal value of a state."""
    name: str = ""  # name in the law, the FMU and the equations
    flag: bool = False  # whether a state is 0 or 1; in generated C without FMI it is a ``bool``
    sums: bool = False  # whether a state is a sum of small increments, which is a pair of floats in single precision
    tally: bool = False
    """Whether a state counts the samples since the last one that were missed because of an invalid input."""

    @property
    def scalars(self) -> tuple[str, ...]:
        """Names of the scalars in the casadi function: ``("Kp",)``, for a vector ``("k_1", "k_2", ...)``."""
        if isinstance(self.start, tuple):
            return tuple(f"{self.name}_{i + 1}" for i in range(len(self.start)))
        return (self.name,)

    @property
    def starts(self) -> tuple[float, ...]:
        """Start values of the scalars."""
        return self.start if isinstance(self.start, tuple) else (self.start,)

    def places(self, name: str) -> list[str]:
        """Return the expressions of the scalars in C, for a variable or a vector of this name."""
        return [f"{name}[{i}]" for i in range(len(self.starts))] if self.kind in VECTORS else [name]


# the functions below are argument defaults of a law, where the argument is an SX; they therefore return Any


def Input(unit: Unit | str, start: float, text: str, *, optional: bool = False) -> Any:  # noqa: N802
    """Declare a Real input; an optional one may stay unconnected."""
    return LawVariable(Kind.OPTIONAL if optional else Kind.INPUT, unit_of(unit), float(start), text)


def Command(start: bool, text: str) -> Any:  # noqa: N802
    """Declare a Boolean input, 0 or 1 in expressions."""
    return LawVariable(Kind.COMMAND, NO_UNIT, float(start), text)


def State(  # noqa: N802
    unit: Unit | str,
    start: float | tuple[float, ...],
    text: str,
    *,
    nominal: float = 1.0,
    flag: bool = False,
    sums: bool = False,
) -> Any:
    """Declare a state: the law receives its value and returns the next value under the same name.

    With a tuple of start values it is a vector, written as ``z[0]``, ``z[1]``, ... and returned as a list. A state that
    is 0 or 1 has ``flag=True``, an integral ``sums=True``.
    """
    if isinstance(start, tuple):
        return LawVariable(
            Kind.STATES, unit_of(unit), tuple(map(float, start)), text, nominal=nominal, flag=flag, sums=sums
        )
    return LawVariable(Kind.STATE, unit_of(unit), float(start), text, nominal=nominal, flag=flag, sums=sums)


def Parameter(  # noqa: N802
    unit: Unit | str, start: float | tuple[float, ...], text: str, *, min: float = -math.inf, max: float = math.inf
) -> Any:
    """Declare a tunable Real parameter; a tuple of start values declares a vector ``k[0]``, ``k[1]``, ..."""
    if isinstance(start, tuple):
        return LawVariable(Kind.VECTOR, unit_of(unit), tuple(map(float, start)), text, min, max)
    return LawVariable(Kind.PARAMETER, unit_of(unit), float(start), text, min, max)


def Switch(start: bool, text: str) -> Any:  # noqa: N802
    """Declare a tunable Boolean parameter, 0 or 1 in expressions."""
    return LawVariable(Kind.SWITCH, NO_UNIT, float(start), text)


def SampleTime() -> Any:  # noqa: N802
    """Declare that the equations use the sample time ``Ts``, a fixed parameter of every law."""
    return LawVariable(Kind.SAMPLE_TIME, TIME, math.nan, "sample time", min=1e-9)


def Output(unit: Unit | str, text: str) -> LawVariable:  # noqa: N802
    """Declare a Real output."""
    return LawVariable(Kind.OUTPUT, unit_of(unit), 0.0, text)


FAULT = LawVariable(
    Kind.FLAG,
    NO_UNIT,
    0.0,
    "true: an input is NaN or infinite; while enabled, outputs and states are held",
    name="fault",
)
"""Output that is added to every law."""

# ---- names ----------------------------------------------------------------------------------------------------------

# reserved names: C, <math.h>, headers of C runtimes, block.h
_RESERVED = {
    "C": "auto break case char const continue default do double else enum extern float for goto if inline int long "
    "register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while "
    "bool true false asm typeof and or not xor class new delete this template private public protected virtual "
    "operator namespace using try catch throw alignas alignof constexpr nullptr",
    "<math.h>": "acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1 fabs fdim "
    "floor fma fmax fmin fmod fpclassify frexp gamma hypot ilogb isfinite isinf isnan isnormal j0 j1 jn ldexp lgamma "
    "llrint llround log log10 log1p log2 logb lrint lround modf nan nearbyint nextafter nexttoward pow remainder "
    "remquo rint round scalbln scalbn signbit signgam sin sinh sqrt tan tanh tgamma trunc y0 y1 yn drem significand "
    "scalb finite exception matherr div abs index signal time clock remove rename",
    "Windows or compiler headers": "near far small hyper interface huge pascal cdecl min max linux unix i386 vax",
    "block.h": "time slope memory cache run given model rows states inputs nominals square sign clip value_of sample "
    "equations indicators advance evaluate relax fault violated relations holds is_flag is_direction is_count "
    "all_finite Model Memory Cache Run Row Instance INPUT COMMAND "
    "OUTPUT LOCAL FLAG OPTIONAL OUTPUT_FLAG LOCALS FLAGS TALLY STATES PARAMETER SWITCH "
    "FIXED COUNT PARAMETERS STATE STATE_OUTPUT "
    "SCALAR VECTOR DYNAMIC DYNAMICS GIVEN VARIABLES IDENTITY "
    "MODEL SUMMARY SOURCE SAMPLED GUARDED REQUIRES EVENTS INDICATORS DECIDES DECIDES_BY "
    "NO_EXCHANGE EXCHANGES REINITIALISES CACHE LINEAR_STATES "
    "MEMORY KEEPS_BY skip SKIPS_BY STEPS_BY VALID_BY WARNING INF COUNTS INPUTS STATES VALUES ROWS AT SLOPE UNWRAP "
    "LENGTH VELOCITY ACCELERATION JERK FORCE MASS STIFFNESS DAMPING TIME FREQUENCY ANGLE NO_UNIT "
    "FORCE_NOUN MASS_NOUN MOVING_MASS "
    "ROTATIONAL PASTE QUOTE ENTER REQUIRE MODE UNROLLED SET GET NAN NULL INFINITY HUGE_VAL EOF BUFSIZ RAND_MAX",
    "casadi": "null jac hess",
}
_TAKEN = {name: owner for owner, names in _RESERVED.items() for name in names.split()}


def check_identifier(where: str, what: str, name: str) -> None:
    """Raise a FrictionError unless the name is a valid C identifier that does not conflict with math.h and block.h."""
    if not re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*_?", name):
        raise FrictionError(
            f"{where}: the {what} {name!r} must consist of letters, digits and single underscores, and begin with a "
            "letter"
        )
    if name in _TAKEN:
        raise FrictionError(f"{where}: the {what} {name} is reserved by {_TAKEN[name]}; choose another name")
    if re.match(r"(fmi2|starts_of_|INPUT_|ROLE_|TYPE_|GIVEN_|LOG_|MAY_|FMI2_)", name):
        raise FrictionError(f"{where}: the {what} {name} has a prefix reserved by block.h; choose another name")


def check_line(where: str, what: str, text: str) -> None:
    """Raise a FrictionError unless the text is one printable line."""
    if not text.strip() or not text.isprintable():
        raise FrictionError(f"{where}: the {what} must be one line of text, not {text!r}")


PARAMETERS = (Kind.PARAMETER, Kind.VECTOR, Kind.SWITCH, Kind.SAMPLE_TIME)
"""Kinds of variables that a relation may use: those that are set before the first sample."""

Relation = Callable[..., Any]

LIMITS: Mapping[str, Relation] = MappingProxyType({"u_min <= u_max": lambda u_min, u_max: u_min <= u_max})
"""Relation for every law with these two parameters, which by convention are the limits of its output."""


@dataclass(frozen=True, eq=False)
class Conditions:
    """Relations between the parameters of a law without which the law is singular."""

    texts: tuple[str, ...]  # each relation as shown to the user, such as ``u_min <= u_max``
    parameters: tuple[LawVariable, ...]  # all parameters of the law
    function: Function  # maps the scalars of the parameters to one truth value per relation

    def violated(self, values: Mapping[str, float | tuple[float, ...]]) -> tuple[str, ...]:
        """Return the violated relations."""
        arguments: list[float] = []
        for parameter in self.parameters:
            value = values.get(parameter.name, parameter.start)
            arguments += value if isinstance(value, tuple) else (value,)
        held = self.function.call(arguments)
        return tuple(text for text, holds in zip(self.texts, held, strict=True) if not float(holds))


def conditions_of(where: str, relations: Mapping[str, Relation], variables: tuple[LawVariable, ...]) -> Conditions:
    """Return the relations as a casadi function."""
    parameters = tuple(variable for variable in variables if variable.kind in PARAMETERS)
    elements = {variable.name: [SX.sym(scalar) for scalar in variable.scalars] for variable in parameters}
    results = []
    relations = {**(LIMITS if {"u_min", "u_max"} <= elements.keys() else {}), **relations}
    for text, relation in relations.items():
        check_line(where, "text of a condition", text)
        names = list(inspect.signature(relation).parameters)
        for name in names:
            if name not in elements:
                raise FrictionError(
                    f"{where}: the condition {text!r} reads {name}, which is not a parameter"
                    f"{did_you_mean(name, elements)}"
                )
        result = SX(relation(*(vertcat(*elements[name]) for name in names)))
        if result.shape != (1, 1):
            raise FrictionError(f"{where}: the condition {text!r} has the shape {result.shape}; return one truth value")
        results.append(result)
    symbols = [symbol for variable in parameters for symbol in elements[variable.name]]
    found = Conditions(tuple(relations), parameters, Function("conditions", symbols, results))
    if broken := found.violated({}):
        raise FrictionError(f"{where}: its start values violate the condition {broken[0]}")
    return found
