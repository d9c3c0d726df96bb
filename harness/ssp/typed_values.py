"""Typed values of parameter sets as XML, scalars and arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from lxml import etree

from harness.errors import SystemFileError, UnitError
from harness.parts.flat import MOST_ELEMENTS, TYPES
from harness.ssp.arrays import count, shown
from harness.ssp.document import SPACES, sub
from harness.ssp.parameter import Parameter
from harness.ssp.structure import read_shape
from harness.ssp.units import known_unit
from harness.units import BaseUnit

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
