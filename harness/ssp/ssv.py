"""Parameter sets: SSV files of SSP 1.0."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from lxml import etree

from harness.errors import StartValueError, SystemFileError, UnitError, nearest
from harness.parts.part import Port, StartValue
from harness.ssp.document import SPACES, SSV, TOOL, check_element, parse_document, set_text, sub, to_bytes
from harness.ssp.transformation import Linear, Transformation
from harness.ssp.units import converted, known_unit, read_units, write_units
from harness.storage.atomic import atomic_path
from harness.storage.files import LARGEST_DATA, read_regular
from harness.units import BaseUnit

#: Media type of such a file in an SSD.
MEDIA_TYPE = "application/x-ssp-parameter-set"


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
    """

    value: StartValue
    unit: str | None = None
    base: BaseUnit | None = None
    description: str = ""
    item: bool = False

    def __post_init__(self) -> None:
        """Convert a number with a unit to a float."""
        if self.unit is not None and type(self.value) is int:
            object.__setattr__(self, "value", float(self.value))

    def landed(
        self, base: BaseUnit | None, where: str, *, suppress: bool = False, transformation: Transformation | None = None
    ) -> Parameter:
        """Return the parameter at a connector or variable with this unit: first converted, then transformed.

        Parameters
        ----------
        base : BaseUnit or None
            Unit of the connector or variable.
        where : str
            Its name, for messages.
        suppress : bool
            Whether unit conversion is suppressed.
        transformation : Linear, Table or None
            Transformation of the converted value.

        Returns
        -------
        Parameter
            The parameter in the new unit.

        Raises
        ------
        UnitError
            If the units measure different quantities.
        StartValueError
            If the value cannot be transformed.
        """
        value, own = self.value, known_unit(self.unit, self.base)
        if own is not None and base is not None and not suppress and isinstance(value, float):
            factor, offset = converted(own, base, where)
            value = factor * value + offset
        value = (transformation or Linear())(value, where)
        return replace(self, value=value, unit=None, base=base or own)

    def start_value(self, port: Port, where: str) -> StartValue:
        """Return this parameter as the start value of a variable, in the unit of the variable.

        Parameters
        ----------
        port : Port
            The variable.
        where : str
            Its name, for messages.

        Returns
        -------
        float, int, bool or str
            The start value.

        Raises
        ------
        UnitError
            If the units measure different quantities.
        StartValueError
            If the value does not have the type of the variable.
        """
        value = self.landed(known_unit(port.unit, port.base), where).value
        if self.item:
            items = dict(port.items)
            if value not in items:
                raise StartValueError(f"{where} has no item '{value}': {nearest(str(value), items)}")
            return items[str(value)]
        if port.type == "Real" and isinstance(value, (int, float)) and not isinstance(value, bool):
            return float(value)
        if type(value) is {"Integer": int, "Boolean": bool, "String": str}.get(port.type):
            return value
        raise StartValueError(f"{where} is {value!r}, which is not of type {port.type}: give a value of this type")


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
    """

    name: str
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    description: str = ""


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
        If a value is not finite, or a unit is unknown and has no base unit.
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
    set_text(root, "version", "1.0")
    set_text(root, "name", parameters.name)
    if parameters.description:
        set_text(root, "description", parameters.description)
    if parent is None:
        set_text(root, "generationTool", TOOL)
    listed = sub(root, "ssv:Parameters")
    units: dict[str, BaseUnit] = {}
    for name, parameter in parameters.parameters.items():
        element = sub(listed, "ssv:Parameter", name=name, description=parameter.description or None)
        _write_value(element, name, parameter, units)
    write_units(root, "ssv:Units", units)
    return root


def parse_ssv(root: etree._Element, where: str) -> ParameterSet:
    """Return the parameter set of an element ParameterSet; see `read_ssv`."""
    check_element(root, SSV, where)
    units = read_units(root, "ssv:Units")
    parameters: dict[str, Parameter] = {}
    for element in root.iterfind("ssv:Parameters/ssv:Parameter", SPACES):
        name = element.get("name", "")
        if name in parameters:
            raise SystemFileError(f"{where} has the parameter '{name}' twice: remove one")
        parameters[name] = _read_value(element, units, f"parameter '{name}' in {where}")
    return ParameterSet(root.get("name", ""), parameters, root.get("description", ""))


def _read_value(element: etree._Element, units: Mapping[str, BaseUnit], where: str) -> Parameter:
    typed, text = element[0], element[0].get("value", "")
    kind, description = etree.QName(typed).localname, element.get("description", "")
    if kind == "Real":
        unit = typed.get("unit")
        return Parameter(float(text), unit, None if unit is None else units.get(unit), description)
    if kind == "Integer":
        return Parameter(int(text), description=description)
    if kind == "Boolean":
        return Parameter(text.strip() in {"true", "1"}, description=description)
    if kind in {"String", "Enumeration"}:
        return Parameter(text, description=description, item=kind == "Enumeration")
    raise SystemFileError(f"{where} is of type {kind}, which FMI 2.0 does not have: remove it")


def _write_value(element: etree._Element, name: str, parameter: Parameter, units: dict[str, BaseUnit]) -> None:
    """Append the typed value, and add its unit to ``units``."""
    value = parameter.value
    if isinstance(value, str):
        sub(element, "ssv:Enumeration" if parameter.item else "ssv:String", value=value)
    elif isinstance(value, bool):
        sub(element, "ssv:Boolean", value=str(value).lower())
    elif isinstance(value, int):
        sub(element, "ssv:Integer", value=str(value))
    else:
        if not math.isfinite(value):
            raise SystemFileError(f"the parameter '{name}' is {value}: a parameter set needs finite values")
        if parameter.unit is not None:
            base = known_unit(parameter.unit, parameter.base)
            if base is None:
                raise SystemFileError(
                    f"the unit '{parameter.unit}' of the parameter '{name}' is unknown: give its base unit as well"
                )
            if not units.setdefault(parameter.unit, base).agrees(base):
                raise UnitError(f"the unit '{parameter.unit}' of the parameter '{name}' has two meanings: rename one")
        sub(element, "ssv:Real", value=repr(float(value)), unit=parameter.unit)
