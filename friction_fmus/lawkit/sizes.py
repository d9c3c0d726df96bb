"""Laws with a vector of states whose length is chosen when the FMU is built or the C is written."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.declarations import Variable


@dataclass(frozen=True)
class Size:
    """A parameter that counts elements of vectors of states.

    Up to its maximum it fits the vectors as they are declared. A start value above that makes them longer, and the
    parameter keeps that value.

    Attributes
    ----------
    vectors : tuple of str
        The states that grow with it, element by element.
    most : int
        The largest start value.
    """

    vectors: tuple[str, ...]
    most: int


def wanted_sizes(
    name: str, sizes: Mapping[str, Size], maxima: Mapping[str, float], start: Mapping[str, float]
) -> dict[str, int]:
    """The sizes that start values need.

    Parameters
    ----------
    name : str
        Of the law.
    sizes : mapping of str to Size
        By parameter.
    maxima : mapping of str to float
        Maxima of the parameters, for which there is room.
    start : mapping of str to number
        Wanted start values of any variables.

    Returns
    -------
    dict of str to int
        Value by parameter, of those for which the declared vectors are too short.

    Raises
    ------
    FrictionError
        A start value is above the largest size, or not a whole number.
    """
    found = {}
    for parameter, size in sizes.items():
        value = float(start.get(parameter, 0.0))
        if math.isfinite(value) and value > maxima[parameter]:
            if value > size.most or value != int(value):
                rule = f"above {maxima[parameter]:g} it is a whole number up to {size.most}"
                raise FrictionError(f"{name} cannot have {parameter} = {value:g}: {rule}")
            found[parameter] = int(value)
    return found


def resized(
    variables: tuple[Variable, ...], sizes: Mapping[str, Size], wanted: Mapping[str, int]
) -> tuple[Variable, ...]:
    """Return the variables with parameters that are fixed to these sizes, and with the vectors that go with them."""
    by_name = {variable.name: variable for variable in variables}
    for parameter, size in wanted.items():
        added, value = size - int(by_name[parameter].max), float(size)
        by_name[parameter] = replace(by_name[parameter], start=value, min=value, max=value)
        for name in sizes[parameter].vectors:
            starts = by_name[name].starts
            by_name[name] = replace(by_name[name], start=starts + starts[-1:] * added)
    return tuple(by_name.values())
