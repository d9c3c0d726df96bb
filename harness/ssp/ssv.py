"""Parameter sets: SSV files of SSP 1.0 and 2.0."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
from lxml import etree

from harness.errors import StartValueError, SystemFileError, UnitError, nearest
from harness.parts.flat_description import MOST_ELEMENTS, TYPES, element_names
from harness.parts.part import Port, StartValue
from harness.ssp.package import (
    SPACES,
    SSV,
    TOOL,
    check_element,
    converted,
    known_unit,
    parse_document,
    read_units,
    set_text,
    sub,
    to_bytes,
    write_units,
)
from harness.ssp.structure import Linear, Transformation, count, read_shape, shown
from harness.storage.files import LARGEST_DATA, atomic_path, read_regular
from harness.units import BaseUnit, needed_unit

_LOG = logging.getLogger("harness")


@dataclass(frozen=True)
class Parameter:
    """One value of a parameter set.

    Parameters
    ----------
    value : float, int, bool or str
        The value, in the given unit.
    unit : str or None
        Unit of a float; None stands for the unit of the variable that receives the value.
    base : BaseUnit or None
        The unit in base units; None derives it from the unit name.
    description : str
        One line of text.
    item : bool
        Whether the value is the name of an enumeration item.
    type : str
        Type of FMI 3.0, such as ``Int64``, which SSP 2.0 states; empty for the types of SSP 1.0.
    shape : tuple of int
        Sizes of the array of which the parameter is an element; () for a scalar.
    """

    value: StartValue
    unit: str | None = None
    base: BaseUnit | None = None
    description: str = ""
    item: bool = False
    type: str = ""
    shape: tuple[int, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        if self.unit is not None and type(self.value) is int:
            object.__setattr__(self, "value", float(self.value))

    def landed(
        self,
        base: BaseUnit | None,
        where: str,
        *,
        unit: str | None = None,
        suppress: bool = False,
        transformation: Transformation | None = None,
    ) -> Parameter:
        """Return the parameter at a connector or variable with this unit: first converted, then transformed.

        `where` names it in messages; `unit` is the name of its unit, which means the same as an equal name of the
        parameter's unit.
        """
        value, own = self.value, self.base
        if own is None and self.unit is not None and not suppress:
            own = base if self.unit == unit else needed_unit(self.unit, None, f"the value of {where}")
        if own is not None and not suppress and isinstance(value, float):
            base = base or needed_unit(unit, None, where)
            if base is not None:
                factor, offset = converted(own, base, where)
                value = factor * value + offset
        value = (transformation or Linear())(value, where)
        return replace(self, value=value, unit=None, base=base or own)

    def start_value(self, port: Port, where: str) -> StartValue:
        """Return this parameter as the start value of a variable, in its unit; `where` names it in messages."""
        landed = self.landed(known_unit(port.unit, port.base), where, unit=port.unit)
        value = landed.value
        if not port.unit and landed.base not in (None, BaseUnit()) and port.type == "Real":
            _LOG.warning("%s has no unit: the number %s is taken as it is, in [%s]", where, value, landed.base)
        if self.item:
            items = dict(port.items)
            if value not in items:
                raise StartValueError(f"{where} has no item '{value}': {nearest(str(value), items)}")
            return items[str(value)]
        if port.type == "Real" and isinstance(value, (int, float)) and not isinstance(value, bool):
            if isinstance(value, int) and int(float(value)) != value:
                raise StartValueError(f"{where} is {value}, which is not exact as a float: choose a smaller number")
            return float(value)
        if type(value) is {"Integer": int, "Boolean": bool, "String": str}.get(port.type):
            return value
        raise StartValueError(f"{where} is {value!r}, which is not of type {port.type}: give a value of this type")


_FLOATS: Final = ("Real", "Float64", "Float32")
_TEXTS: Final = ("String", "Enumeration")
#: Types that only SSP 2.0 has.
_NEW: Final = tuple(kind for kind in TYPES if kind != "Boolean")


def read_values(
    element: etree._Element, units: Mapping[str, BaseUnit], where: str
) -> tuple[tuple[int, ...], list[Parameter]]:
    """Return the shape of an element Parameter and its values in row-major order."""
    typed = element[0]
    kind, description = etree.QName(typed).localname, element.get("description", "")
    if kind == "Binary":
        raise SystemFileError(f"{where} is of type Binary, which no start value can have: remove it")
    shape = tuple(-1 if size is None else size for size in read_shape(element, where))
    if -1 in shape:
        raise SystemFileError(f"{where} has a Dimension without a size: state the size")
    texts = _texts(typed, kind, where)
    if len(texts) != count(shape) or len(texts) > MOST_ELEMENTS:
        raise SystemFileError(f"{where} is {shown(shape)}, but has {len(texts)} values: correct one of them")
    if kind in _TEXTS:
        items = kind == "Enumeration"
        return shape, [Parameter(text, description=description, item=items, shape=shape) for text in texts]
    if kind == "Boolean":
        return shape, [Parameter(text in {"true", "1"}, description=description, shape=shape) for text in texts]
    new = kind if kind in _NEW else ""
    if kind not in _FLOATS:
        return shape, [Parameter(int(text), description=description, type=new, shape=shape) for text in texts]
    unit = typed.get("unit")
    base = None if unit is None else units.get(unit)
    numbers = [_single(float(text), where) if kind == "Float32" else float(text) for text in texts]
    return shape, [Parameter(number, unit, base, description, type=new, shape=shape) for number in numbers]


def write_values(
    element: etree._Element, name: str, shape: Sequence[int], values: Sequence[Parameter], units: dict[str, BaseUnit]
) -> None:
    """Append the typed values and the dimensions, and add the unit to ``units``."""
    kinds = {(_kind(parameter), parameter.unit, known_unit(parameter.unit, parameter.base)) for parameter in values}
    if len(kinds) > 1:
        raise SystemFileError(f"the elements of the array '{name}' have several types or units: give all the same")
    ((kind, unit, base),) = kinds
    texts = [_text(name, parameter, kind) for parameter in values]
    if unit is not None:
        if base is None:
            raise SystemFileError(f"the unit '{unit}' of the parameter '{name}' is unknown: give its base unit as well")
        if not units.setdefault(unit, base).agrees(base):
            raise UnitError(f"the unit '{unit}' of the parameter '{name}' has two meanings: rename one")
    if shape and kind in _TEXTS:
        typed = sub(element, f"ssv:{kind}")
        for text in texts:
            sub(typed, "ssv:Value", value=text)
    else:
        sub(element, f"ssv:{kind}", value=" ".join(texts) if shape else texts[0], unit=unit)
    for size in shape:
        sub(element, "ssc:Dimension", size=str(size))


def is_single(value: float) -> bool:
    """Return whether a number is exact in single precision."""
    with np.errstate(over="ignore"):
        return float(np.float32(value)) == value


def _texts(typed: etree._Element, kind: str, where: str) -> list[str]:
    text, inner = typed.get("value"), [each.get("value", "") for each in typed.iterfind("ssv:Value", SPACES)]
    if text is not None and inner:
        raise SystemFileError(f"{where} has its value twice: remove the attribute or the elements Value")
    if text is None:
        return inner
    return [text] if kind in _TEXTS else text.split()


def _single(number: float, where: str) -> float:
    """Return the number in single precision, which the type Float32 has."""
    with np.errstate(over="ignore"):
        single = float(np.float32(number))
    if math.isinf(single) and math.isfinite(number):
        raise SystemFileError(f"{where} is {number}, which is too large for Float32: correct the value or the type")
    return single


def _kind(parameter: Parameter) -> str:
    if parameter.type:
        return parameter.type
    value = parameter.value
    if isinstance(value, str):
        return "Enumeration" if parameter.item else "String"
    return "Boolean" if isinstance(value, bool) else "Integer" if isinstance(value, int) else "Real"


def _text(name: str, parameter: Parameter, kind: str) -> str:
    """Return the value as a text of the type."""
    value = parameter.value
    if isinstance(value, str) and kind in _TEXTS:
        return value
    if isinstance(value, bool) and kind == "Boolean":
        return str(value).lower()
    if kind in _FLOATS and isinstance(value, (int, float)) and not isinstance(value, bool):
        if not math.isfinite(value):
            raise SystemFileError(f"the parameter '{name}' is {value}: a parameter set needs finite values")
        if kind != "Float32" or is_single(value):
            return repr(float(value))
    if kind in ("Integer", *_NEW) and kind not in _FLOATS and type(value) is int:
        bits = 32 if kind == "Integer" else int(kind.lstrip("UInt"))
        low, high = (0, 2**bits) if kind.startswith("U") else (-(2 ** (bits - 1)), 2 ** (bits - 1))
        if low <= value < high:
            return str(value)
    raise SystemFileError(f"the parameter '{name}' is {value!r}, which {kind} cannot state: correct the value or type")


#: Media type of such a file in an SSD.
MEDIA_TYPE = "application/x-ssp-parameter-set"


@dataclass(frozen=True)
class ParameterSet:
    """A named set of parameters.

    Parameters
    ----------
    name : str
        Name of the set.
    parameters : mapping of str to Parameter
        The parameters by name, such as ``friction.Fc``.
    description : str
        One line of text.
    arrays : mapping of str to tuple of int
        Sizes of the arrays of SSP 2.0; each element is a parameter, such as ``k[1,2]``.
    """

    name: str
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    description: str = ""
    arrays: Mapping[str, tuple[int, ...]] = field(default_factory=dict)

    def origins(self) -> dict[str, str]:
        """Return the name of the array for each of its elements."""
        return {element: name for name, shape in self.arrays.items() for element in element_names(name, shape)}


def read_ssv(path: str | Path) -> ParameterSet:
    """Read an SSV file.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    ParameterSet
        The parameters with their units.

    Raises
    ------
    SystemFileError
        If the file cannot be read, is invalid, or has binary values.
    """
    try:
        data = read_regular(Path(path), LARGEST_DATA)
    except OSError as error:
        raise SystemFileError(f"cannot read the parameters {path}: {error.strerror}; give an existing file") from error
    return parse_ssv(parse_document(data, SSV, str(path)), str(path))


def write_ssv(parameters: ParameterSet, path: str | Path) -> None:
    """Write an SSV file; the same set gives the same bytes.

    Parameters
    ----------
    parameters : ParameterSet
        The parameters to write.
    path : path-like
        The file.

    Raises
    ------
    SystemFileError
        If a value is not finite or does not have its type, an array is incomplete, or a unit is unknown and has no
        base unit.
    OutputError
        If the file cannot be written.
    """
    data = ssv_bytes(parameters)
    with atomic_path(Path(path)) as temporary:
        temporary.write_bytes(data)


def ssv_bytes(parameters: ParameterSet) -> bytes:
    """Return the content of an SSV file; see `write_ssv`."""
    return to_bytes(ssv_element(parameters))


def ssv_element(parameters: ParameterSet, parent: etree._Element | None = None) -> etree._Element:
    """Return the element ParameterSet, alone or appended to another element; see `write_ssv`."""
    if parent is None:
        root = etree.Element(f"{{{SSV}}}ParameterSet", nsmap={prefix: SPACES[prefix] for prefix in ("ssv", "ssc")})
    else:
        root = sub(parent, "ssv:ParameterSet")
    two = bool(parameters.arrays) or any(parameter.type for parameter in parameters.parameters.values())
    set_text(root, "version", "2.0" if two else "1.0")
    set_text(root, "name", parameters.name)
    if parameters.description:
        set_text(root, "description", parameters.description)
    if parent is None:
        set_text(root, "generationTool", TOOL)
    listed = sub(root, "ssv:Parameters")
    units: dict[str, BaseUnit] = {}
    for name, shape, elements in _grouped(parameters):
        element = sub(listed, "ssv:Parameter", name=name, description=elements[0].description or None)
        write_values(element, name, shape, elements, units)
    write_units(root, "ssv:Units", units)
    return root


def _grouped(parameters: ParameterSet) -> Iterator[tuple[str, tuple[int, ...], Sequence[Parameter]]]:
    """Return name, shape and values of each scalar, and of each array at its first element."""
    values, origins, written = parameters.parameters, parameters.origins(), set()
    for name, parameter in values.items():
        array = origins.get(name)
        if array is None:
            yield name, (), [parameter]
        elif array not in written:
            written.add(array)
            names = list(element_names(array, parameters.arrays[array]))
            missing = next((each for each in names if each not in values), None)
            if missing is not None:
                raise SystemFileError(f"the array '{array}' has no parameter '{missing}': give all elements")
            yield array, parameters.arrays[array], [values[each] for each in names]


def parse_ssv(root: etree._Element, where: str, units: Mapping[str, BaseUnit] = MappingProxyType({})) -> ParameterSet:
    """Return the parameter set of an element ParameterSet, with units of the SSD around it; see `read_ssv`."""
    check_element(root, SSV, where)
    units = {**units, **read_units(root, "ssv:Units")}
    parameters: dict[str, Parameter] = {}
    arrays: dict[str, tuple[int, ...]] = {}
    for element in root.iterfind("ssv:Parameters/ssv:Parameter", SPACES):
        name = element.get("name", "")
        shape, values = read_values(element, units, f"parameter '{name}' in {where}")
        if shape:
            arrays[name] = shape
        for each, parameter in zip(element_names(name, shape), values, strict=True):
            if each in parameters:
                raise SystemFileError(f"{where} has the parameter '{each}' twice: remove one")
            parameters[each] = parameter
    return ParameterSet(root.get("name", ""), parameters, root.get("description", ""), arrays)
