"""Measures: numbers that summarise a run."""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from harness.errors import SweepError, UnknownNameError, nearest
from harness.parts.part import Part, Values
from harness.result import Result
from harness.system.graph import recorded_names

Measure: TypeAlias = Callable[[Result], Mapping[str, float]]

KINDS: Final[Mapping[str, Callable[[Values], float]]] = {
    "final": lambda y: y[-1],
    "min": np.min,
    "max": np.max,
    "max_abs": lambda y: np.max(np.abs(y)),
    "mean": np.mean,
    "rms": lambda y: np.sqrt(np.mean(np.square(y))),
}
"""Built-in measures over all recorded rows of a variable."""

_PATTERN = re.compile(r"\s*(?P<kind>\w+)\((?P<name>.+)\)\s*")


@dataclass(frozen=True)
class Builtin:
    """A built-in measure of one variable, for example ``rms(pid.u)``."""

    kind: str  # key of `KINDS`
    name: str  # ``part.port``

    def __str__(self) -> str:
        return f"{self.kind}({self.name})"

    def __call__(self, result: Result) -> Mapping[str, float]:
        """Return the number under its heading."""
        return {str(self): self.of(result[self.name].to_numpy().astype(np.float64))}

    def of(self, values: Values) -> float:
        """Return the number for recorded values of the variable."""
        return KINDS[self.kind](values)


def find_measures(measure: str | Measure | Iterable[str | Measure], parts: Mapping[str, Part]) -> tuple[Measure, ...]:
    """Return the requested measures."""
    wanted = [measure] if isinstance(measure, str) or callable(measure) else list(measure)
    found: dict[Measure, None] = {}
    for one in wanted:
        if not isinstance(one, str):
            found[one] = None
            continue
        match = _PATTERN.fullmatch(one)
        if not match:
            raise SweepError(f"'{one}' is not a measure: write, for example, rms(part.port), or give a function")
        if match["kind"] not in KINDS:
            raise UnknownNameError(f"there is no measure '{match['kind']}': {nearest(match['kind'], KINDS)}")
        found.update({Builtin(match["kind"], name): None for name in recorded_names(parts, [match["name"]])})
    if not found:
        raise SweepError("the sweep measures nothing: give a measure such as final(part.port)")
    return tuple(found)


def label(measure: object) -> str:
    """Return the name of a measure or another function for messages and for the description of a sweep."""
    if isinstance(measure, Builtin):
        return str(measure)
    named = measure if hasattr(measure, "__qualname__") else type(measure)
    return f"{named.__module__}.{named.__qualname__}"
