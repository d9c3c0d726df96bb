"""The functions of FMI 2.0 over those of FMI 3.0, and the structs of fmi3.h."""

from __future__ import annotations

import ctypes
import math
import struct
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final

from harness.engine.library import library, mirrors
from harness.errors import PartError
from harness.parts.flat import TYPES, Flat

_POINTER, _INT, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
_NEXT = struct.Struct("<dq")

ADAPTED: Final[Mapping[str, str]] = MappingProxyType(
    {
        **{f"{verb}Real": f"fmi3_{verb}_real".lower() for verb in ("Set", "Get")},
        **{f"{verb}{kind}": f"fmi3_{verb}_whole".lower() for verb in ("Set", "Get") for kind in ("Integer", "Boolean")},
        **{f"{verb}FMUstate": f"fmi3_{verb}_state".lower() for verb in ("Get", "Set", "Free")},
    }
)
"""Functions of the adapter by the names of FMI 2.0."""


@mirrors("Variable3")
class Variable(ctypes.Structure):
    """``Variable3`` of fmi3.h."""

    _fields_ = (("reference", ctypes.c_uint32), ("type", ctypes.c_int32), ("first", _INT), ("count", _INT))


@mirrors("Clock3")
class Clock(ctypes.Structure):
    """``Clock3`` of fmi3.h."""

    _fields_ = (("reference", ctypes.c_uint32), ("interval", _REAL), ("shift", _REAL))


@mirrors("Fmi3")
class Adapter(ctypes.Structure):
    """``Fmi3`` of fmi3.h."""

    _fields_ = (
        ("instance", _POINTER),
        *((name, _POINTER * len(TYPES)) for name in ("set", "get")),
        *((name, _POINTER) for name in ("do_step", "enter_event_mode", "enter_step_mode", "set_clock", "update")),
        *((name, _POINTER) for name in ("get_state", "set_state", "free_state", "set_slopes")),
        *((name, _POINTER) for name in ("variables", "variable_of", "values", "numbers", "packed", "places")),
        ("references", _POINTER),
        ("elements", _INT),
        ("clocks", _POINTER),
        *((name, _INT) for name in ("clock_count", "uses_events")),
        *((name, _REAL) for name in ("start", "next", "ended")),
        *((name, _INT) for name in ("pending", "failure", "failed")),
    )


class _State(ctypes.Structure):
    """``State3`` of fmi3.h."""

    _fields_ = (("state", _POINTER), ("next", _REAL), ("pending", _INT))


class Calls:
    """The functions of FMI 2.0 by name, over those of FMI 3.0; each takes the address of the adapter first."""

    def __init__(self, raw: Any, adapter: Adapter, flat: Flat) -> None:
        """Take the loaded library, the adapter of the instance and the flat description."""
        self._raw, self._adapter, self._flat = raw, adapter, flat
        self._experiment: tuple[Any, ...] = ()
        self._texts = {array.first: array for array in flat.arrays if array.type == "String"}
        self._sizes = {array.first: array for array in flat.arrays if array.structural}
        engine = library()
        self.functions: dict[str, Callable[..., int]] = {
            "SetupExperiment": self._setup,
            "EnterInitializationMode": self._enter,
            "ExitInitializationMode": self._exit,
            "Terminate": self._terminate,
            "Reset": self._reset,
            "FreeInstance": self._release,
            "SetDebugLogging": self._set_logging,
            "SetString": self._set_text,
            "SerializedFMUstateSize": self._serialised_size,
            "SerializeFMUstate": self._serialise,
            "DeSerializeFMUstate": self._deserialise,
        }
        for name in ADAPTED:
            function = getattr(engine, ADAPTED[name])
            states = name.endswith("FMUstate")
            function.argtypes = (_POINTER, _POINTER) if states else (_POINTER, _POINTER, ctypes.c_size_t, _POINTER)
            self.functions[name] = self._setter(function) if name.startswith("Set") and not states else function

    def _call(self, name: str, *arguments: object) -> int:
        function = getattr(self._raw, f"fmi3{name}")
        function.argtypes = None
        return int(function(_POINTER(self._adapter.instance), *arguments) or 0)  # fmi3FreeInstance returns nothing

    def _setter(self, function: Callable[..., int]) -> Callable[..., int]:
        """Return a function that sets structural parameters in configuration mode."""

        def call(component: int, references: Any, count: int, values: Any) -> int:
            if count != 1 or references[0] not in self._sizes:
                return function(component, references, count, values)
            status = self._call("EnterConfigurationMode")
            status = status if status > 1 else function(component, references, count, values)
            return status if status > 1 else self._call("ExitConfigurationMode")

        return call

    def read_clocks(self, clocks: Any) -> None:
        """Read interval and shift of each clock, in initialisation mode; an FMU may state them in its XML only."""
        for place, clock in zip(clocks, self._flat.clocks, strict=False):
            reference, value, qualifier = ctypes.c_uint32(clock.valueReference), _REAL(), ctypes.c_int()
            one = ctypes.c_size_t(1)
            status = self._call(
                "GetIntervalDecimal",
                ctypes.byref(reference),
                one,
                ctypes.byref(value),
                ctypes.byref(qualifier),
            )
            stated = float(clock.intervalDecimal or 0.0)
            if clock.intervalCounter is not None and clock.resolution:
                stated = float(clock.intervalCounter) / float(clock.resolution)
            place.interval = value.value if status <= 1 and value.value > 0.0 else stated
            status = self._call("GetShiftDecimal", ctypes.byref(reference), one, ctypes.byref(value))
            place.shift = value.value if status <= 1 else float(clock.shiftDecimal or 0.0)
            if not (place.interval > 0.0 and math.isfinite(place.interval) and math.isfinite(place.shift)):
                raise PartError(
                    clock.name, "fmi3GetIntervalDecimal", f"the clock {clock.name} has no interval: export it again"
                )

    def _setup(self, _: int, *values: Any) -> int:
        """Keep the experiment for fmi3EnterInitializationMode."""
        self._experiment = values
        self._adapter.start = float(values[2])
        self._adapter.next, self._adapter.pending = math.inf, 0
        return 0

    def _enter(self, _: int) -> int:
        """Call fmi3EnterInitializationMode."""
        given, tolerance, start, stop_given, stop = self._experiment
        flags = ctypes.c_bool(bool(given)), ctypes.c_bool(bool(stop_given))
        return self._call("EnterInitializationMode", flags[0], _REAL(tolerance), _REAL(start), flags[1], _REAL(stop))

    def _exit(self, _: int) -> int:
        """Call fmi3ExitInitializationMode."""
        return self._call("ExitInitializationMode")

    def _terminate(self, _: int) -> int:
        """Call fmi3Terminate."""
        return self._call("Terminate")

    def _reset(self, _: int) -> int:
        """Call fmi3Reset, and forget the values that were set."""
        starts = (_REAL * len(self._flat.starts))(*self._flat.starts)
        ctypes.memmove(self._adapter.values, starts, ctypes.sizeof(starts))
        return self._call("Reset")

    def _release(self, _: int) -> int:
        """Call fmi3FreeInstance, which returns nothing."""
        self._call("FreeInstance")
        return 0

    def _set_logging(self, _: int, on: int, count: int, categories: Any) -> int:
        """Call fmi3SetDebugLogging."""
        return self._call("SetDebugLogging", ctypes.c_bool(bool(on)), ctypes.c_size_t(count), categories)

    def _set_text(self, _: int, references: Any, count: int, values: Any) -> int:
        """Call fmi3SetString for a scalar."""
        array = self._texts.get(references[0])
        if count != 1 or array is None or array.count != 1:
            return 3
        reference = ctypes.c_uint32(array.reference)
        return self._call("SetString", ctypes.byref(reference), ctypes.c_size_t(1), values, ctypes.c_size_t(1))

    def _serialised_size(self, _: int, state: Any, size: Any) -> int:
        """Call fmi3SerializedFMUStateSize; the time of the next event is stored before the state."""
        inside = _State.from_address(state.value)
        status = self._call("SerializedFMUStateSize", _POINTER(inside.state), size)
        size._obj.value += _NEXT.size
        return status

    def _serialise(self, _: int, state: Any, data: Any, size: Any) -> int:
        """Call fmi3SerializeFMUState."""
        inside = _State.from_address(state.value)
        ctypes.memmove(data, _NEXT.pack(inside.next, inside.pending), _NEXT.size)
        place = ctypes.c_void_p(ctypes.addressof(data) + _NEXT.size)
        return self._call("SerializeFMUState", _POINTER(inside.state), place, ctypes.c_size_t(size.value - _NEXT.size))

    def _deserialise(self, component: int, data: bytes, size: Any, state: Any) -> int:
        """Call fmi3DeserializeFMUState."""
        if size.value < _NEXT.size:
            return 3
        status: int = self.functions["GetFMUstate"](component, state)
        if status > 1:
            return status
        inside = _State.from_address(state._obj.value)
        made = _POINTER()
        status = self._call(
            "DeserializeFMUState", data[_NEXT.size :], ctypes.c_size_t(size.value - _NEXT.size), ctypes.byref(made)
        )
        if status > 1:
            return status
        old = _POINTER(inside.state)
        self._call("FreeFMUState", ctypes.byref(old))
        inside.state = made
        inside.next, inside.pending = _NEXT.unpack(data[: _NEXT.size])
        return status
