"""Start values of a part as a parameter set."""

from __future__ import annotations

from collections.abc import Mapping

from harness.errors import SystemFileError
from harness.parts.flat import Array, element_names
from harness.parts.fmu import FmuPart
from harness.parts.part import Port, StartValue
from harness.ssp.parameter import Parameter
from harness.ssp.typed_values import is_single
from harness.ssp.units import known_unit


def start_parameters(
    part: FmuPart, start: Mapping[str, StartValue], arrays: Mapping[str, Array]
) -> tuple[dict[str, Parameter], dict[str, tuple[int, ...]]]:
    """Return the start values with type and unit of their variables, and the shapes of the arrays.

    An array is always given as a whole, as an importer sets it as a whole.
    """
    ports = {port.name: port for port in (*part.inputs, *part.parameters)}
    parameters: dict[str, Parameter] = {}
    shapes: dict[str, tuple[int, ...]] = {}
    for name in start:
        array = arrays.get(name)
        if name in parameters:  # part of an array
            continue
        names = [name] if array is None else list(element_names(array.name, array.shape))
        values = {each: start.get(each, ports[each].start) for each in names}
        missing = next((each for each, value in values.items() if value is None), None)
        if missing is not None:
            raise SystemFileError(f"{part.name}.{missing} has no start value: give one for each element of the array")
        if array is not None and array.shape:
            shapes[array.name] = array.shape
        kind = _stated_type(array, values)
        parameters |= {
            each: _parameter(part.name, ports[each], value, kind) for each, value in values.items() if value is not None
        }
    return parameters, shapes


def _stated_type(array: Array | None, values: Mapping[str, StartValue | None]) -> str:
    """Return the type of FMI 3.0 to state, if there is one."""
    if array is None or array.type in ("Boolean", "String", "Enumeration"):
        return ""
    if array.type == "Float32":
        exact = all(not isinstance(value, (int, float)) or is_single(value) for value in values.values())
        return "Float32" if exact else "Float64"  # the FMU rounds the value, the file keeps it
    return array.type


def _parameter(part: str, port: Port, value: StartValue, kind: str) -> Parameter:
    """Return a start value with the type and the unit of its variable."""
    where = f"start value {value!r} of {part}.{port.name}"
    try:
        if port.type == "String":
            return Parameter(str(value))
        if port.type == "Real" and "Int" not in kind:
            unit = port.unit if known_unit(port.unit, port.base) is not None else None
            return Parameter(float(value), unit, port.base, type=kind)
        number = int(value)
        if number != value:
            raise ValueError(value)
        if port.items:
            return Parameter({number: item for item, number in port.items}[number], item=True)
        return Parameter(bool(number) if port.type == "Boolean" else number, type=kind)
    except (KeyError, OverflowError, ValueError) as error:
        raise SystemFileError(f"{where} has the wrong type: give {_expected(port)}") from error


def _expected(port: Port) -> str:
    return f"one of {', '.join(str(number) for _, number in port.items)}" if port.items else f"a {port.type}"
