"""MISRA C:2012: the rules that generated C deviates from, with reasons."""

from __future__ import annotations

DEVIATIONS = {
    "12.1": "products in a sum have no brackets, as in the equations.",
}
"""Reasons by rule, for rules that cppcheck's addon reports in the header and the implementation of a law."""
