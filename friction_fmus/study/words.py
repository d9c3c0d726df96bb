"""Words and units of a rotary axis in the result of a study."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, Final, TypeVar

from friction_fmus.fmi.rotary import in_rotary_words

TEXTS: Final = frozenset(
    (
        *(
            "change",
            "failure",
            "meaning",
            "next_steps",
            "no_compensation",
            "overview",
            "reason",
            "runner_up_reason",
            "summary",
        ),
        *("warnings", "weak", "what", "why", "wrong", "x_label", "y_label"),
    )
)
"""Attributes of results that are texts for people; names, units, paths and commands are not."""

T = TypeVar("T")


def result_in_rotary_words(result: T) -> T:
    """Return a result with the words and units of a rotary axis in all its texts."""
    return replace(result, **{f.name: _worded(getattr(result, f.name), f.name) for f in fields(result)})  # type: ignore[type-var, arg-type]


def _worded(value: Any, name: str) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return result_in_rotary_words(value)
    if isinstance(value, str):
        return in_rotary_words(value) if name in TEXTS else value
    if isinstance(value, tuple) and not (value and isinstance(value[0], float)):
        return tuple(_worded(item, name) for item in value)
    if isinstance(value, Mapping):
        return {key: _worded(item, name) for key, item in value.items()}
    return value
