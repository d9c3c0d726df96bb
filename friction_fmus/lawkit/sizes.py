"""Laws with vectors whose length is chosen when the FMU is built or the C code is generated."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.declarations import Variable


@dataclass(frozen=True)
class Size:
    """A parameter that counts elements of vectors.

    Values up to its maximum fit into the declared vectors. A larger start value lengthens the vectors, and the
    parameter is then fixed to this value.

    Attributes
    ----------
    vectors : tuple of str
        The states and vectors of parameters whose length follows the parameter.
    most : int
        The largest start value.
    """

    vectors: tuple[str, ...]
    most: int


def wanted_sizes(
    name: str, sizes: Mapping[str, Size], maxima: Mapping[str, float], start: Mapping[str, float]
) -> dict[str, int]:
    """Return the sizes that start values need."""
    found = {}
    for parameter, size in sizes.items():
        value = float(start.get(parameter, 0.0))
        if math.isfinite(value) and value > maxima[parameter]:
            if value > size.most or value != int(value):
                rule = f"above {maxima[parameter]:g}, give an integer up to {size.most}"
                raise FrictionError(f"{name} cannot have {parameter} = {value:g}: {rule}")
            found[parameter] = int(value)
    return found


def resized(
    variables: tuple[Variable, ...], sizes: Mapping[str, Size], wanted: Mapping[str, int]
) -> tuple[Variable, ...]:
    """Return the variables with parameters fixed to these sizes and vectors of matching length."""
    by_name = {variable.name: variable for variable in variables}
    for parameter, size in wanted.items():
        added, value = size - int(by_name[parameter].max), float(size)
        by_name[parameter] = replace(by_name[parameter], start=value, min=value, max=value)
        for name in sizes[parameter].vectors:
            starts = by_name[name].starts
            by_name[name] = replace(by_name[name], start=starts + starts[-1:] * added)
    return tuple(by_name.values())
