"""MISRA C:2012: the rules that generated C deviates from, with reasons."""

from __future__ import annotations

from friction_fmus.codegen.layout import Export
from friction_fmus.codegen.sources import prototypes

CHECKED = {
    "12.1": "products in a sum have no brackets, as in the equations.",
    "12.3": "variables of one type are declared in one list; there is no comma operator.",
}
"""Reasons by rule, for rules that cppcheck's addon reports."""

_C89 = {"21.2": "for C89, the file declares the functions of `<math.h>` that came with C99; C99 skips these lines."}


def deviations(export: Export) -> dict[str, str]:
    """Return the rules that cppcheck's addon reports for the header and the implementation of a law, with reasons."""
    return CHECKED | (_C89 if prototypes(export) else {})
