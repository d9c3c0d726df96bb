"""An instance of an FMU in the importer of the tests, with the faults that concern a single call."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from ctypes import byref, c_void_p
from typing import Any

import numpy as np
from reference_set.raw_fmu import DISCARD, FATAL, OK, WARNING, RawFmu, RawInstance, RefusedError, Variable

_FLOATING = {2: "Real", 3: "Float64"}


class FaultyInstance(RawInstance):
    """An instance that the importer uses; without faults it passes on what it is given."""

    def __init__(
        self, fmu: RawFmu, kind: str, name: str, faults: Collection[str] = (), *, events: bool = False
    ) -> None:
        """Instantiate it."""
        self.faults = frozenset(faults)
        self._saved: list[c_void_p] = []
        super().__init__(fmu, kind, name, events=events)

    # ---- status

    def call(self, name: str, *arguments: Any) -> int:
        """The status, or what a fault makes of it."""
        status = super().call(name, *arguments)
        if status == WARNING and "warning-as-error" in self.faults:
            raise RefusedError(name, status, self.log)
        if DISCARD <= status < FATAL and name != "DoStep" and "error-ignored" in self.faults:
            return OK
        return status

    # ---- life

    def start(
        self,
        values: Mapping[str, Any],
        inputs: Mapping[str, Any],
        start: float,
        stop: float | None = None,
        tolerance: float | None = None,
    ) -> None:
        """Set start values, initialise with the inputs of the start time."""
        structural = [name for name in values if self.fmu.variables[name].causality == "structuralParameter"]
        others = {name: value for name, value in values.items() if name not in structural}
        if structural and "structural-parameter-ignored" not in self.faults:
            self.must("EnterConfigurationMode")
            self.put({name: values[name] for name in structural})
            self.must("ExitConfigurationMode")
        if not self.faults & {"start-values-ignored", "start-values-after-initialisation"}:
            self.put(others)
        self.enter_initialization(start, stop, tolerance)
        self.put(inputs)
        self.must("ExitInitializationMode")
        if "start-values-after-initialisation" in self.faults:
            self.set(others)

    # ---- values

    def put(self, values: Mapping[str, Any]) -> None:
        """Set values; a refusal is an error."""
        status = self.set(values)
        if status > WARNING:
            raise RefusedError(f"setting {', '.join(values)}", status, self.log)

    def set(self, values: Mapping[str, Any]) -> int:
        """Set values; the status."""
        faulty = self.faults
        if not faulty:
            return super().set({name: self._in_rows(name, value) for name, value in values.items()})
        given: dict[str, Any] = {}
        booleans: list[Variable] = []
        for name, value in values.items():
            variable = self.fmu.variables[name]
            if variable.type == "Boolean" and "boolean-as-real" in faulty:
                booleans.append(variable)
            elif variable.type != "String" or "string-dropped" not in faulty:
                given[name] = self._faulty(variable, self._in_rows(name, value))
        status = super().set(given)
        if booleans:
            numbers = [float(bool(values[v.name])) for v in booleans]
            self.set_raw(_FLOATING[self.version], booleans, numbers)
        return status

    def _in_rows(self, name: str, value: Any) -> Any:
        """A list with its elements in the order of rows."""
        if not isinstance(value, (list, tuple)):
            return value
        variable = self.fmu.variables[name]
        array = np.array(value)
        if len(variable.sizes) == 2 and array.ndim == 1:
            first = variable.sizes[0]
            rows = first if isinstance(first, int) else int(self.get([self.fmu.by_reference[int(first)].name])[0])
            array = array.reshape(rows, -1)
        if "arrays-transposed" in self.faults:
            array = array.T
        flat = list(array.flatten().tolist())
        if "array-first-element-only" in self.faults:
            flat[1:] = self.get([name])[0][1:]
        return flat

    def _faulty(self, variable: Variable, value: Any) -> Any:
        if variable.type == "Enumeration" and "enumeration-off-by-one" in self.faults:
            return (self.fmu.items(variable.name)[value] if isinstance(value, str) else int(value)) - 1
        if "nt" in variable.type and "integer-through-float32" in self.faults and not isinstance(value, list):
            return int(np.float32(value))
        if variable.is_float and "nan-passed-through-as-zero" in self.faults and not isinstance(value, list):
            return 0.0 if math.isnan(float(value)) else value
        return value

    def get(self, names: Sequence[str]) -> list[Any]:
        """Values of variables."""
        if "wrong-value-reference-order" not in self.faults:
            return super().get(names)
        found: dict[str, Any] = {}
        for type in {self.fmu.variables[name].type for name in names}:
            chosen = [name for name in names if self.fmu.variables[name].type == type]
            in_order = sorted(chosen, key=lambda name: self.fmu.variables[name].reference)
            found |= zip(chosen, super().get(in_order), strict=True)
        return [found[name] for name in names]

    # ---- states

    def save(self) -> c_void_p:
        """A saved state."""
        if "state-shared" in self.faults and self._saved:
            super().must("GetFMUstate" if self.version == 2 else "GetFMUState", byref(self._saved[0]))
            return self._saved[0]
        self._saved.append(super().save())
        return self._saved[-1]

    def keep(self, state: c_void_p) -> None:
        """Free this state at the end."""
        self._saved.append(state)

    def restore(self, state: c_void_p) -> None:
        """Restore a saved state."""
        if "state-not-restored" not in self.faults:
            super().restore(state)

    def serialise(self, state: c_void_p) -> bytes:
        """The bytes of a saved state."""
        data = super().serialise(state)
        if "serialised-state-truncated" in self.faults:
            return data.partition(b"\0")[0].ljust(len(data), b"\0")
        return data

    def reset(self) -> None:
        """Reset the instance."""
        if "reset-keeps-state" not in self.faults:
            self.must("Reset")

    def free(self) -> None:
        """Free saved states and the instance."""
        while self.pointer and self._saved:
            self.free_state(self._saved.pop())
        super().free()

    # ---- derivatives

    def directional(self, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]) -> list[float]:
        """Directional derivatives."""
        sign = -1.0 if "directional-derivative-sign" in self.faults else 1.0
        return [sign * each for each in super().directional(unknowns, knowns, seed)]

    def adjoint(self, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]) -> list[float]:
        """Adjoint derivatives."""
        if "adjoint-not-transposed" not in self.faults:
            return super().adjoint(unknowns, knowns, seed)
        found = super().directional(unknowns, knowns, [*seed, *[0.0] * len(knowns)][: len(knowns)])
        return [*found, *[0.0] * len(knowns)][: len(knowns)]
