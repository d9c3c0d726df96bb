"""The description of an FMI 3.0 FMU as the harness sees it: each element of an array is a variable of its own."""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any, Final

from harness.errors import FmuError, StartValueError
from harness.parts.part import StartValue
from harness.values import shown

TYPES: Final = (
    *("Float64", "Float32"),
    *(f"{sign}Int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U")),
    "Boolean",
)
"""Types of FMI 3.0 in the order of ``Type3`` of fmi3_numbers.h; an Enumeration is an Int64."""

_PORT: Final[Mapping[str, str]] = MappingProxyType(
    {
        **dict.fromkeys(("Float64", "Float32", "UInt32", "Int64", "UInt64"), "Real"),
        **dict.fromkeys(("Int8", "UInt8", "Int16", "UInt16", "Int32"), "Integer"),
        **{"Boolean": "Boolean", "String": "String", "Enumeration": "Enumeration"},
    }
)
"""Type of a port; integers that need more than 32 bits are Real, as which they are exact up to 2^53."""

_PERIODIC: Final = ("constant", "fixed", "tunable")
MOST_ELEMENTS: Final = 1_000_000


@dataclass(frozen=True)
class Array:
    """A variable of FMI 3.0 with its elements."""

    name: str  # its name
    type: str  # its type
    reference: int  # value reference
    first: int  # number of its first element; strings have elements too
    count: int  # number of elements
    structural: bool  # whether it is a structural parameter
    shape: tuple[int, ...]  # sizes of its dimensions; () for a scalar


@dataclass(frozen=True)
class Flat:
    """What the adapter needs to know."""

    arrays: tuple[Array, ...]  # all variables but clocks and binaries
    elements: int  # number of elements
    clocks: tuple[Any, ...]  # the periodic clocks that the harness ticks
    starts: tuple[float, ...]  # start value of each element, or 0; NaN if the array was resized and states none
    elements_of: Mapping[str, tuple[str, ...]]  # names of the elements of each variable
    others: Mapping[str, str]  # types of the variables that are no ports, clocks and binaries
    exchange: bool  # whether the FMU offers model exchange as well

    @property
    def structural(self) -> dict[str, Array]:
        """The structural parameters by name."""
        return {array.name: array for array in self.arrays if array.structural}


def flatten(path: Path, description: Any, sizes: Mapping[str, int], *, ticks: bool) -> tuple[Any, Flat]:
    """Return the description in terms of FMI 2.0; without ticks, the FMU takes its samples in its steps."""
    if description.coSimulation is None:
        raise FmuError(
            f"{path} is an FMI 3.0 FMU without co-simulation: export it for co-simulation, or as FMI 2.0 for model "
            "exchange"
        )
    known = {
        v.valueReference: sizes.get(v.name, v.start)
        for v in description.modelVariables
        if v.causality == "structuralParameter"
    }
    arrays: list[Array] = []
    scalars: list[Any] = []
    starts: list[float] = []
    of_name: dict[str, list[Any]] = {}
    for variable in description.modelVariables:
        if variable.type not in _PORT:
            continue
        shape = _shape(path, variable, known)
        own = list(_elements(path, variable, shape, sizes, len(scalars)))
        structural = variable.causality == "structuralParameter"
        arrays.append(
            Array(variable.name, variable.type, variable.valueReference, len(scalars), len(own), structural, shape)
        )
        scalars += own
        starts += [math.nan if each.start is None and variable.start else _number(each.start) for each in own]
        of_name[variable.name] = own
        if len(scalars) > MOST_ELEMENTS:
            raise FmuError(f"{path} has more than {MOST_ELEMENTS} elements of variables: choose smaller arrays")
    names = {name: tuple(str(each.name) for each in own) for name, own in of_name.items()}
    others = {v.name: v.type for v in description.modelVariables if v.type not in _PORT}
    clocks, exchange = _clocks(path, description) if ticks else (), description.modelExchange is not None
    flat = Flat(tuple(arrays), len(scalars), clocks, tuple(starts), names, others, exchange)
    return _description(description, scalars, of_name), flat


def stated_sizes(flat: Flat | None, part: str, start: Mapping[str, StartValue]) -> dict[str, int]:
    """Return the values of structural parameters among the start values of a part."""
    sizes = {}
    for name in start.keys() & (flat.structural if flat is not None else {}).keys():
        value = start[name]
        if isinstance(value, str) or not math.isfinite(value) or value != int(value):
            raise StartValueError(f"start value {shown(value)} of {part}.{name} is not a whole number: give a size")
        sizes[name] = int(value)
    return sizes


def element_names(name: str, shape: Sequence[int]) -> Iterator[str]:
    """Return the names of the elements of an array, in row-major order; a scalar keeps its name."""
    for index in itertools.product(*(range(1, size + 1) for size in shape)):
        yield f"{name}[{','.join(map(str, index))}]" if shape else name


def _shape(path: Path, variable: Any, known: Mapping[int, Any]) -> tuple[int, ...]:
    shape = []
    for dimension in variable.dimensions:
        size = dimension.start if dimension.start is not None else known.get(dimension.valueReference)
        try:
            shape.append(int(str(size)))
        except ValueError as error:
            raise FmuError(
                f"variable '{variable.name}' of {path} has a dimension that is not a number: export it again"
            ) from error
    if any(size < 0 for size in shape) or math.prod(shape) > MOST_ELEMENTS:
        raise FmuError(f"variable '{variable.name}' of {path} has the size {shape}: choose smaller arrays")
    return tuple(shape)


def _elements(
    path: Path, variable: Any, shape: Sequence[int], sizes: Mapping[str, int], first: int
) -> Iterator[SimpleNamespace]:
    texts = variable.start if isinstance(variable.start, list) else str(variable.start or "").split()
    if variable.type == "String":
        texts = variable.start if isinstance(variable.start, list) else [variable.start] if variable.start else []
    if variable.name in sizes:
        texts = [str(sizes[variable.name])]
    count = math.prod(shape)
    if len(texts) > 1 and len(texts) < count and sizes and any(d.start is None for d in variable.dimensions):
        texts = [*texts, *[None] * (count - len(texts))]
    if len(texts) > 1 and len(texts) < count:
        raise FmuError(
            f"variable '{variable.name}' of {path} has {count} elements, but {len(texts)} start values: export it again"
        )
    for k, name in enumerate(element_names(variable.name, shape)):
        yield SimpleNamespace(
            name=name,
            valueReference=first + k,
            type=_PORT[variable.type],
            causality="parameter" if variable.causality == "structuralParameter" else variable.causality,
            variability=variable.variability,
            initial="exact" if variable.causality == "structuralParameter" else variable.initial,
            start=texts[min(k, len(texts) - 1)] if texts else None,
            **{key: getattr(variable, key) for key in ("unit", "declaredType", "min", "max", "nominal", "description")},
        )


def _number(text: str | None) -> float:
    try:
        return float({"true": "1", "false": "0"}.get(str(text), text or "0"))
    except ValueError:
        return 0.0


def _clocks(path: Path, description: Any) -> tuple[Any, ...]:
    """Return the clocks to tick."""
    inputs = [v for v in description.modelVariables if v.type == "Clock" and v.causality == "input"]
    for clock in inputs:
        if clock.intervalVariability not in _PERIODIC:
            raise FmuError(
                f"{path} has the clock '{clock.name}' with intervalVariability {clock.intervalVariability}, but only "
                "periodic clocks can be ticked: export the FMU without it"
            )
    if inputs and not description.coSimulation.hasEventMode:
        raise FmuError(f"{path} has the clock '{inputs[0].name}', but no event mode: export it again")
    return tuple(inputs)


def _description(description: Any, scalars: list[Any], of_name: Mapping[str, list[Any]]) -> SimpleNamespace:
    simulation = description.coSimulation
    outputs = [
        SimpleNamespace(
            variable=element,
            dependencies=None
            if unknown.dependencies is None
            else [each for known in unknown.dependencies for each in of_name.get(known.name, [])],
        )
        for unknown in description.outputs
        for element in of_name.get(unknown.variable.name, [])
    ]
    return SimpleNamespace(
        modelVariables=scalars,
        outputs=outputs,
        derivatives=description.derivatives,
        modelExchange=None,
        numberOfEventIndicators=0,
        coSimulation=SimpleNamespace(
            modelIdentifier=simulation.modelIdentifier,
            canGetAndSetFMUstate=simulation.canGetAndSetFMUstate,
            canSerializeFMUstate=simulation.canSerializeFMUstate,
            canHandleVariableCommunicationStepSize=simulation.canHandleVariableCommunicationStepSize,
            canInterpolateInputs=False,
            maxOutputDerivativeOrder=0,
            providesDirectionalDerivative=False,
        ),
        guid=description.instantiationToken,
        **{
            key: getattr(description, key)
            for key in (
                *("fmiVersion", "modelName", "description", "author", "copyright", "license", "generationTool"),
                *("generationDateAndTime", "logCategories", "unitDefinitions", "defaultExperiment", "version"),
            )
        },
    )
