"""FMI 3.0 FMUs behind the functions of FMI 2.0 that the rest of the harness calls; the C is in fmi3_adapter.h."""

import ctypes
import math
import os
import struct
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import fmpy
import fmpy.fmi3
import numpy as np

from harness.compiling.engine_library import library, mirror
from harness.errors import ENDED, PartError, StartValueError
from harness.parts.archive import Archive
from harness.parts.flat_description import TYPES, Flat
from harness.parts.fmi2 import Instance, Library
from harness.parts.integrator import address_of
from harness.parts.part import StartValue

_POINTER, _REAL = ctypes.c_void_p, ctypes.c_double
_NEXT = struct.Struct("<dq")

ADAPTED: Final[Mapping[str, str]] = MappingProxyType(
    {
        **{f"{verb}Real": f"fmi3_{verb}_real".lower() for verb in ("Set", "Get")},
        **{f"{verb}{kind}": f"fmi3_{verb}_whole".lower() for verb in ("Set", "Get") for kind in ("Integer", "Boolean")},
        **{f"{verb}FMUstate": f"fmi3_{verb}_state".lower() for verb in ("Get", "Set", "Free")},
    }
)
"""Functions of the adapter by the names of FMI 2.0."""

EngineVariable = mirror("Variable3")
Clock = mirror("Clock3")
Adapter = mirror("Fmi3")
_State = mirror("State3")


class Fmi2Functions:
    """The functions of FMI 2.0 by name, by those of FMI 3.0; each takes the address of the adapter first."""

    def __init__(self, raw: Any, adapter: ctypes.Structure, flat: Flat) -> None:
        """Take the loaded library, the adapter of the instance and the flat description."""
        self._raw, self._adapter, self._flat = raw, adapter, flat
        self._experiment: tuple[Any, ...] = ()
        self._texts = {array.first: array for array in flat.arrays if array.type == "String"}
        self._sizes = {array.first: array for array in flat.arrays if array.structural}
        engine = library()
        self.functions: dict[str, Callable[..., int]] = {
            "SetupExperiment": self._setup,
            "EnterInitializationMode": self._enter,
            "ExitInitializationMode": lambda _: self._call("ExitInitializationMode"),
            "Terminate": lambda _: self._call("Terminate"),
            "Reset": self._reset,
            "FreeInstance": lambda _: self._call("FreeInstance"),
            "SetDebugLogging": lambda _, on, count, categories: self._call(
                "SetDebugLogging", ctypes.c_bool(bool(on)), ctypes.c_size_t(count), categories
            ),
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
            places = ctypes.byref(value), ctypes.byref(qualifier)
            status = self._call("GetIntervalDecimal", ctypes.byref(reference), one, *places)
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

    def _reset(self, _: int) -> int:
        """Call fmi3Reset, and forget the values that were set."""
        starts = (_REAL * len(self._flat.starts))(*self._flat.starts)
        ctypes.memmove(self._adapter.values, starts, ctypes.sizeof(starts))
        return self._call("Reset")

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


_REASONS: Final[Mapping[int, str]] = MappingProxyType(
    {
        1: "the value of {name} is not a whole number in the range of {type}",
        2: "the value of {name} is too large for an exact number here",
        3: "its discrete states do not settle: after 100 calls it still asks for another",
        4: "it has more than 10000 events in one communication step: use a shorter step",
        103: ENDED,
        104: "it ended the step early, which was not allowed",
    }
)
"""Reasons for a failure of fmi3_adapter.h, and for a status of part.h."""

_OF_STEPS: Final = (103, 104)  # those of them that are the status of a step
_SLOPES: Final = "harness_SetInputDerivatives"  # function for time derivatives of inputs, which FMI 3.0 lacks

_NEEDED: Final = (
    *("InstantiateCoSimulation", "FreeInstance", "EnterInitializationMode", "ExitInitializationMode"),
    *("Terminate", "Reset", "DoStep"),
)
_EVENTS: Final = ("EnterEventMode", "EnterStepMode", "SetClock", "UpdateDiscreteStates")
_STATES: Final = ("GetFMUState", "SetFMUState", "FreeFMUState")
"""Functions that every FMU needs, those with clocks, and those that save their state."""

_NAMES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "fmi2SetReal": "fmi3SetFloat64",
        "fmi2GetReal": "fmi3GetFloat64",
        "fmi2SetupExperiment": "fmi3EnterInitializationMode",
        "fmi2GetFMUstate": "fmi3GetFMUState",
        "fmi2SetFMUstate": "fmi3SetFMUState",
        "fmi2SerializeFMUstate": "fmi3SerializeFMUState",
        "fmi2DeSerializeFMUstate": "fmi3DeserializeFMUState",
    }
)
"""Functions with another name in FMI 3.0 than in FMI 2.0."""


class _Slave:
    """A loaded library. ``FMU3Slave`` of fmpy wants all functions of FMI 3.0, also those of model exchange."""

    def __init__(self, archive: Archive, name: str, folder: Path) -> None:
        """Load the library in its folder, in which some libraries look for others."""
        self._name, self._token, self._folder = name, str(archive.description.guid), folder
        identifier = archive.interface.modelIdentifier
        path = folder / "binaries" / fmpy.platform_tuple / f"{identifier}{fmpy.sharedLibraryExtension}"
        os.chdir(path.parent)
        self.dll: Any = ctypes.CDLL(str(path))

    def instantiate(self, log: Callable[..., None], events: bool) -> int:
        """Return the address of a new instance, or 0."""
        self.log = fmpy.fmi3.fmi3LogMessageCallback(log)
        function = self.dll.fmi3InstantiateCoSimulation
        function.restype = _POINTER
        resources = str(self._folder / "resources") + os.sep
        no, yes = ctypes.c_bool(False), ctypes.c_bool(True)
        made = function(
            *(text.encode() for text in (self._name, self._token, resources)),
            *(no, yes, ctypes.c_bool(events), no),
            *(None, ctypes.c_size_t(0), None, self.log, None),
        )
        return int(made or 0)


class Library3(Library):
    """An unpacked FMI 3.0 FMU with its loaded library; its functions are those of the adapter."""

    def _load(self, archive: Archive, name: str, folder: str) -> None:
        self.slave: Any = _Slave(archive, name, Path(folder))
        assert archive.flat is not None
        needed = [f"{verb}{_stored(array.type)}" for array in archive.flat.arrays for verb in ("Set", "Get")]
        needed += [
            *_NEEDED,
            *(_EVENTS if archive.flat.clocks else ()),
            *(_STATES if archive.interface.canGetAndSetFMUstate else ()),
        ]
        for function in needed:
            if not hasattr(self.slave.dll, f"fmi3{function}"):
                raise ValueError(f"its library has no function fmi3{function}")
        exported = {**ADAPTED, "DoStep": "fmi3_do_step", "SetRealInputDerivatives": "fmi3_set_slopes"}
        self.addresses = {name: _address(library(), function) for name, function in exported.items()}


def _address(dll: Any, function: str) -> int:
    """Return the address of a function; 0 if the library does not have it, as it is not called then."""
    return address_of(dll, function) if hasattr(dll, function) else 0


class Instance3(Instance):
    """One instance of an FMI 3.0 FMU, called as in FMI 2.0."""

    def _instantiate(self, loaded: Library, archive: Archive) -> None:
        flat = archive.flat
        assert flat is not None
        self._flat: Flat = flat
        self._raw = loaded.slave.dll

        def log(_environment: object, status: int, category: bytes | None, message: bytes | None) -> None:
            self._logged(None, None, status, category, message)

        made = loaded.slave.instantiate(log, bool(flat.clocks))
        if not made:
            raise ValueError("no instance")
        self.inner = made
        self._adapter = self._adapt(made)
        self.component = ctypes.addressof(self._adapter)
        self._own = Fmi2Functions(self._raw, self._adapter, flat)

    def function(self, name: str) -> Callable[..., Any]:
        """Return the function that stands for the one of FMI 2.0."""
        return self._own.functions[name]

    def _adapt(self, instance: int) -> ctypes.Structure:
        flat, raw = self._flat, self._raw
        numeric = [array for array in flat.arrays if array.type != "String"]
        rows = [(a.reference, TYPES.index(_stored(a.type)), a.first, a.count) for a in numeric]
        of_element = np.zeros(max(flat.elements, 1), dtype=np.int64)
        for number, array in enumerate(numeric):
            of_element[array.first : array.first + array.count] = number
        size = max(flat.elements, 1)
        self._clocks = (Clock * max(len(flat.clocks), 1))()
        for place, clock in zip(self._clocks, flat.clocks, strict=False):
            place.reference = clock.valueReference
        self._rows = (EngineVariable * max(len(rows), 1))(*(EngineVariable(*row) for row in rows))
        self._kept: dict[str, np.ndarray[Any, Any]] = {
            "variable_of": of_element,
            "values": np.array(flat.starts or (0.0,)),
            "numbers": np.zeros(size),
            "packed": np.zeros(size),  # 8 bytes for each element
            "places": np.zeros(max(len(rows), 1), dtype=np.int64),
            "references": np.zeros(size, dtype=np.uint32),
        }
        adapter = Adapter(instance=instance, elements=flat.elements, clock_count=len(flat.clocks), next=math.inf)
        adapter.uses_events = bool(flat.clocks)
        adapter.clocks, adapter.variables = ctypes.addressof(self._clocks), ctypes.addressof(self._rows)
        for name, values in self._kept.items():
            setattr(adapter, name, values.ctypes.data)
        for verb in ("Set", "Get"):
            setattr(adapter, verb.lower(), (_POINTER * len(TYPES))(*(_address(raw, f"fmi3{verb}{t}") for t in TYPES)))
        for field, function in (
            *(("do_step", "DoStep"), ("enter_event_mode", "EnterEventMode"), ("enter_step_mode", "EnterStepMode")),
            *(("set_clock", "SetClock"), ("update", "UpdateDiscreteStates")),
            *(("get_state", "GetFMUState"), ("set_state", "SetFMUState"), ("free_state", "FreeFMUState")),
        ):
            setattr(adapter, field, _address(raw, f"fmi3{function}"))
        self.interpolates = hasattr(raw, _SLOPES)
        if self.interpolates:
            adapter.set_slopes = _address(raw, _SLOPES)
        return adapter

    def routes(
        self, inputs: Sequence[int], outputs: Sequence[int]
    ) -> tuple[Mapping[str, int], Sequence[int], Sequence[int]]:
        """Return direct functions and the references of the FMU where all values are scalars of type Float64."""
        functions = dict(self.functions)
        if not self._flat.clocks:
            names = ("DoStep", *_STATES)
            functions |= {f"fmi3{name}": _address(self._raw, f"fmi3{name}") for name in names}
            functions["fmi3SetInputDerivatives"] = _address(self._raw, _SLOPES)
        plain = {a.first: a.reference for a in self._flat.arrays if a.type == "Float64" and a.count == 1}
        chosen = []
        for verb, elements in (("Set", inputs), ("Get", outputs)):
            direct = all(element in plain for element in elements)
            if direct:
                functions[f"{verb}Real"] = _address(library(), f"fmi3_{verb.lower()}_plain")
                functions[f"fmi3{verb}Float64"] = _address(self._raw, f"fmi3{verb}Float64")
            elif verb == "Set":
                del functions["SetRealInputDerivatives"]
            chosen.append([plain[element] for element in elements] if direct else elements)
        return functions, chosen[0], chosen[1]

    def preload(self, values: Mapping[str, StartValue]) -> None:
        """Take over all start values before the first is set, as an array is set as a whole."""
        for array in self._flat.arrays:
            names = {name: k for k, name in enumerate(self._flat.elements_of[array.name]) if name in values}
            place = self._kept["values"][array.first : array.first + array.count]
            for name, k in names.items():
                value = values[name]
                if isinstance(value, int | float):
                    place[k] = value
            if names and np.isnan(place).any():
                raise StartValueError(
                    f"{self.name}.{array.name} has {array.count} elements now: give a start value for each of them"
                )

    def begin(self, time: float, tolerance: float | None) -> None:
        """Leave initialisation mode; an FMU with clocks is then in event mode and settles."""
        self._own.read_clocks(self._clocks)
        super().begin(time, tolerance)
        if self._adapter.uses_events:
            status = library().fmi3_settle(ctypes.byref(self._adapter))
            if status > 1:
                raise self.failure("fmi3UpdateDiscreteStates", status)

    def event(self, time: float) -> None:
        """Take the event at this time, as the next step does."""
        status = library().fmi3_event(ctypes.byref(self._adapter), ctypes.c_double(time))
        if status > 1:
            raise self.failure("fmi3UpdateDiscreteStates", status, time)

    def failure(self, function: str, status: int, time: float | None = None) -> PartError:
        """Return the error for a failed call, with the reason of the adapter or the last message of the FMU."""
        error = super().failure(_NAMES.get(function, function.replace("fmi2", "fmi3")), status, time)
        code, element = int(self._adapter.failure) or status, int(self._adapter.failed)
        if not self._adapter.failure and status not in _OF_STEPS:
            return error
        self._adapter.failure = 0
        array = next(a for a in self._flat.arrays if a.first <= element < a.first + max(a.count, 1))
        reason = _REASONS[code].format(name=array.name, type=array.type)
        found = PartError(self.name, error.function, reason, time)
        found.ended = float(self._adapter.ended)
        return found


def _stored(kind: str) -> str:
    return "Int64" if kind == "Enumeration" else kind
