"""Parameter sets: SSV files of SSP 1.0 and 2.0."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from lxml import etree

from harness.errors import SystemFileError
from harness.parts.flat import element_names
from harness.ssp.document import SPACES, SSV, TOOL, check_element, parse_document, set_text, sub, to_bytes
from harness.ssp.parameter import Parameter
from harness.ssp.typed_values import read_values, write_values
from harness.ssp.units import read_units, write_units
from harness.storage.atomic import atomic_path
from harness.storage.files import LARGEST_DATA, read_regular
from harness.units import BaseUnit

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
