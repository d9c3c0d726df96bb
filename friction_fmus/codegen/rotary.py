"""Laws of a rotary axis: the same numbers, with torques, angles and inertias in texts and units."""

from __future__ import annotations

import re
from dataclasses import replace

from friction_fmus.codegen.sources import si_units
from friction_fmus.fmi.rotary import in_rotary_words
from friction_fmus.lawkit.declarations import ANGLE, LENGTH, Unit, Variable, c_string
from friction_fmus.lawkit.law import Law


def rotary_law(law: Law) -> Law:
    """Return a law with the units and words of a rotary axis."""
    units = si_units(rotary=True)

    def rotary(unit: Unit) -> Unit:
        if unit == LENGTH:
            return ANGLE  # a position of the axis, as before
        words = re.findall(r'"[^"]*"|\w+', unit.c)
        return Unit(" ".join(word if word.startswith('"') else c_string(units[word]) for word in words))

    def turned(variables: tuple[Variable, ...]) -> tuple[Variable, ...]:
        return tuple(replace(v, unit=rotary(v.unit), text=in_rotary_words(v.text)) for v in variables)

    return replace(
        law,
        variables=turned(law.variables),
        conditions=replace(law.conditions, parameters=turned(law.conditions.parameters)),
        documentation=in_rotary_words(law.documentation),
    )
