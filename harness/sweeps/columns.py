"""The table of a sweep: a row for each run, with its parameters, measures, time, error and warnings."""

from collections.abc import Mapping, Sequence
from typing import Any, Final, Protocol

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from harness.errors import SweepError
from harness.parts.part import PortType
from harness.result import DTYPES
from harness.sweeps.samples import Sample
from harness.sweeps.worker import Outcome

_OWN: Final = ("run", "wall_time", "error", "warnings")


class Storage(Protocol):
    """Where the outcomes of a sweep are put; ``done`` has the numbers of those that are there."""

    done: set[int]

    def add(self, outcomes: Sequence[Outcome], samples: Sequence[Sample]) -> None:
        """Store the outcomes of some runs of a sweep with these parameter sets."""

    def read(self) -> xr.Dataset:
        """Return what is there, see `read_sweep`."""


class Columns:
    """The columns of the table; the first run that is measured says which measures there are."""

    def __init__(self, parameters: Mapping[str, PortType], units: Mapping[str, str]) -> None:
        self.parameters = parameters
        self.units = {**units, "wall_time": "s"}
        self.measures: list[str] | None = None  # None before a run was measured

    def begin(self, outcomes: Sequence[Outcome]) -> bool:
        """Return whether the measures become known with these outcomes."""
        first = next((list(outcome.measures) for outcome in outcomes if outcome.measures), None)
        if self.measures is not None or first is None:
            return False
        for name in first:
            if name in _OWN or name in self.parameters:
                raise SweepError(f"a measure cannot be called '{name}', which is the name of another column: rename it")
        self.measures = first
        return True

    def values(
        self, outcomes: Sequence[Outcome], samples: Sequence[Sample]
    ) -> dict[str, tuple[PortType, list[int | float | bool | str | None]]]:
        """Return type and values of each column; a run with other measures than earlier ones gets an error."""
        for outcome in outcomes:
            if outcome.measures and outcome.measures.keys() != set(self.measures or ()):
                outcome.error = (
                    f"the measures are called {', '.join(outcome.measures)} but were {', '.join(self.measures or ())} "
                    "in an earlier run: return the same names in every run"
                )
                outcome.measures = {}
        return {
            "run": ("Integer", [outcome.run for outcome in outcomes]),
            **{
                parameter: (kind, [samples[outcome.run].get(parameter) for outcome in outcomes])
                for parameter, kind in self.parameters.items()
            },
            # a missing measure is None; a measured NaN stays NaN
            **{
                measure: ("Real", [outcome.measures.get(measure) for outcome in outcomes])
                for measure in self.measures or ()
            },
            "wall_time": ("Real", [outcome.wall_time for outcome in outcomes]),
            "error": ("String", [outcome.error for outcome in outcomes]),
            "warnings": ("String", [outcome.warnings for outcome in outcomes]),
        }


class Memory:
    """The outcomes of a sweep without a folder."""

    def __init__(self, columns: Columns) -> None:
        self.done: set[int] = set()
        self._columns = columns
        self._outcomes: list[Outcome] = []
        self._samples: Sequence[Sample] = ()

    def add(self, outcomes: Sequence[Outcome], samples: Sequence[Sample]) -> None:
        """Store the outcomes of some runs."""
        self._columns.begin(outcomes)
        self._outcomes += outcomes
        self._samples = samples
        self.done.update(outcome.run for outcome in outcomes)

    def read(self) -> xr.Dataset:
        """Return what is there, see `read_sweep`."""
        outcomes = sorted(self._outcomes, key=lambda outcome: outcome.run)
        units = self._columns.units
        columns = {
            name: ("run", _array(kind, values), {"units": units[name]} if name in units else {})
            for name, (kind, values) in self._columns.values(outcomes, self._samples).items()
        }
        coordinates = {name: columns.pop(name) for name in ("run", *self._columns.parameters)}
        return xr.Dataset(columns, coordinates)


def _array(kind: PortType, values: Sequence[int | float | bool | str | None]) -> NDArray[Any]:
    """A column as an array, as it comes out of a Parquet file."""
    if kind == "String":
        return np.array([value or "" for value in values], dtype=object)
    if None not in values:
        return np.array(values, dtype=DTYPES[kind])
    return np.array(values, dtype=object if kind == "Boolean" else np.float64)
