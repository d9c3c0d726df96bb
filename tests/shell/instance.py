"""An FMU called function by function: every status, message and null pointer of FMI 2.0 stays visible."""

from __future__ import annotations

import ctypes
import math
import random
import struct
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from ctypes import CFUNCTYPE, POINTER, byref, c_char, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import fmpy
from fmpy.model_description import ScalarVariable

OK, WARNING, DISCARD, ERROR = range(4)
MODEL_EXCHANGE, CO_SIMULATION = range(2)
LAST_SUCCESSFUL_TIME, TERMINATED = 2, 3

_LOGGER = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)


class _Callbacks(ctypes.Structure):
    _fields_ = (
        ("logger", c_void_p),
        ("allocate", c_void_p),
        ("free", c_void_p),
        ("step_finished", c_void_p),
        ("environment", c_void_p),
    )


_references = POINTER(c_uint)
_reals, _integers, _strings = POINTER(c_double), POINTER(c_int), POINTER(c_char_p)
SIGNATURES: Mapping[str, tuple[type, ...]] = MappingProxyType(
    {
        "GetTypesPlatform": (),
        "GetVersion": (),
        "SetDebugLogging": (c_void_p, c_int, c_size_t, _strings),
        "Instantiate": (c_char_p, c_int, c_char_p, c_char_p, c_void_p, c_int, c_int),
        "FreeInstance": (c_void_p,),
        "SetupExperiment": (c_void_p, c_int, c_double, c_double, c_int, c_double),
        "EnterInitializationMode": (c_void_p,),
        "ExitInitializationMode": (c_void_p,),
        "Terminate": (c_void_p,),
        "Reset": (c_void_p,),
        "GetReal": (c_void_p, _references, c_size_t, _reals),
        "GetInteger": (c_void_p, _references, c_size_t, _integers),
        "GetBoolean": (c_void_p, _references, c_size_t, _integers),
        "GetString": (c_void_p, _references, c_size_t, _strings),
        "SetReal": (c_void_p, _references, c_size_t, _reals),
        "SetInteger": (c_void_p, _references, c_size_t, _integers),
        "SetBoolean": (c_void_p, _references, c_size_t, _integers),
        "SetString": (c_void_p, _references, c_size_t, _strings),
        "GetFMUstate": (c_void_p, POINTER(c_void_p)),
        "SetFMUstate": (c_void_p, c_void_p),
        "FreeFMUstate": (c_void_p, POINTER(c_void_p)),
        "SerializedFMUstateSize": (c_void_p, c_void_p, POINTER(c_size_t)),
        "SerializeFMUstate": (c_void_p, c_void_p, c_void_p, c_size_t),
        "DeSerializeFMUstate": (c_void_p, c_void_p, c_size_t, POINTER(c_void_p)),
        "GetDirectionalDerivative": (c_void_p, _references, c_size_t, _references, c_size_t, _reals, _reals),
        "SetRealInputDerivatives": (c_void_p, _references, c_size_t, _integers, _reals),
        "GetRealOutputDerivatives": (c_void_p, _references, c_size_t, _integers, _reals),
        "DoStep": (c_void_p, c_double, c_double, c_int),
        "CancelStep": (c_void_p,),
        "GetStatus": (c_void_p, c_int, _integers),
        "GetRealStatus": (c_void_p, c_int, _reals),
        "GetIntegerStatus": (c_void_p, c_int, _integers),
        "GetBooleanStatus": (c_void_p, c_int, _integers),
        "GetStringStatus": (c_void_p, c_int, _strings),
    }
)
"""The 34 functions of FMI 2.0 for co-simulation without their prefix, and the types of their arguments."""


class EventInfo(ctypes.Structure):
    """fmi2EventInfo."""

    _fields_ = (
        *((name, c_int) for name in ("again", "terminate", "nominals_changed", "states_changed", "defined")),
        ("next", c_double),
    )


EXCHANGE_SIGNATURES: Mapping[str, tuple[type, ...]] = MappingProxyType(
    {
        "EnterEventMode": (c_void_p,),
        "NewDiscreteStates": (c_void_p, POINTER(EventInfo)),
        "EnterContinuousTimeMode": (c_void_p,),
        "CompletedIntegratorStep": (c_void_p, c_int, _integers, _integers),
        "SetTime": (c_void_p, c_double),
        "SetContinuousStates": (c_void_p, _reals, c_size_t),
        "GetContinuousStates": (c_void_p, _reals, c_size_t),
        "GetNominalsOfContinuousStates": (c_void_p, _reals, c_size_t),
        "GetDerivatives": (c_void_p, _reals, c_size_t),
        "GetEventIndicators": (c_void_p, _reals, c_size_t),
    }
)
"""The functions of model exchange; an FMU for co-simulation only has none of them."""

ABSENT = ("CancelStep", "GetStatus", "GetRealStatus", "GetIntegerStatus", "GetBooleanStatus", "GetStringStatus")
"""Functions that FMI 3.0 does not have, see facade.c."""

_RESULTS = {"GetTypesPlatform": c_char_p, "GetVersion": c_char_p, "Instantiate": c_void_p, "FreeInstance": None}

# amplitude of the signals that drive a block, by unit of the input; where friction and control are neither
# saturated nor at rest
_AMPLITUDE = {"m": 1e-3, "m/s": 5e-3, "m/s2": 0.5, "rad": 1e-3, "rad/s": 5e-3}


class Library:
    """An unpacked FMU and its shared library."""

    def __init__(self, fmu: Path) -> None:
        self.fmu = fmu
        self.folder = fmu.with_suffix(".unpacked")
        if not self.folder.is_dir():  # the library may be in use: another process must not write it again
            fmpy.extract(str(fmu), str(self.folder))
        self.description = fmpy.read_model_description(str(fmu))
        self.identifier: str = self.description.coSimulation.modelIdentifier
        self.binary = self.folder / "binaries" / fmpy.platform / f"{self.identifier}{fmpy.sharedLibraryExtension}"
        self.handle = ctypes.CDLL(str(self.binary))
        self.exchanges = self.description.modelExchange is not None
        self.fmi = 2 if hasattr(self.handle, "fmi2GetStatus") else 3
        signatures = {**SIGNATURES, **(EXCHANGE_SIGNATURES if self.exchanges else {})}
        if self.fmi == 3:
            signatures = {name: each for name, each in signatures.items() if name not in ABSENT}
        for name, arguments in signatures.items():
            function = getattr(self.handle, f"fmi2{name}")
            function.argtypes = arguments
            function.restype = _RESULTS.get(name, c_int)
        self.variables: dict[str, ScalarVariable] = {v.name: v for v in self.description.modelVariables}
        self._by_type: dict[tuple[str, ...], Any] = {}

    def __repr__(self) -> str:
        return self.identifier

    def names(self, *causalities: str, type: str | None = None) -> list[str]:
        """Names of the variables with one of these causalities (none given: all) and that type."""
        return [
            v.name
            for v in self.variables.values()
            if (not causalities or v.causality in causalities) and type in (None, v.type)
        ]

    def by_type(self, names: tuple[str, ...]) -> Sequence[tuple[str, list[int], ctypes.Array[c_uint], type[Any]]]:
        """For each type of these variables: its name, their places, their references, and an array for their values."""
        if names not in self._by_type:
            places: dict[str, list[int]] = {}
            for place, name in enumerate(names):
                places.setdefault(self.variables[name].type, []).append(place)
            self._by_type[names] = [
                (
                    type,
                    chosen,
                    (c_uint * len(chosen))(*(int(self.variables[names[place]].valueReference) for place in chosen)),
                    (c_double if type == "Real" else c_int) * len(chosen),
                )
                for type, chosen in places.items()
            ]
        return self._by_type[names]

    def settable(self) -> list[str]:
        """Names of what may be set during a run: inputs and tunable parameters."""
        return [v.name for v in self.variables.values() if v.causality == "input" or v.variability == "tunable"]

    @property
    def sampled(self) -> bool:
        """Whether the block acts at sample times: its Real outputs are then discrete."""
        return any(v.variability == "discrete" for v in self.variables.values() if v.type == "Real")

    @property
    def states(self) -> int:
        """Number of continuous states."""
        return int(self.description.numberOfContinuousStates)

    @property
    def indicators(self) -> int:
        """Number of event indicators."""
        return int(self.description.numberOfEventIndicators)

    def start(self, name: str) -> float:
        """The start value in the XML as a number."""
        text = self.variables[name].start
        return float({"true": 1.0, "false": 0.0}.get(text, text))


@cache
def load(fmu: Path) -> Library:
    """The library of an FMU, unpacked beside it once."""
    return Library(fmu)


class RefusedError(AssertionError):
    """A call that had to succeed did not."""


class Instance:
    """One instance, with raw calls (`call`) and checked ones (all others)."""

    def __init__(
        self,
        library: Library,
        name: bytes | None = b"instance",
        *,
        kind: int = CO_SIMULATION,
        guid: bytes | None = None,
        logging: bool = True,
        logger: bool = True,
        callbacks: bool = True,
        resources: bytes | None = None,
        visible: bool = False,
    ) -> None:
        self.library = library
        self.messages: list[tuple[str, int, str, bytes]] = []
        self._logger = _LOGGER(self._log)
        self._callbacks = _Callbacks(ctypes.cast(self._logger, c_void_p) if logger else None)
        self.pointer = library.handle.fmi2Instantiate(
            name,
            kind,
            library.description.guid.encode() if guid is None else guid,
            library.folder.joinpath("resources").as_uri().encode() if resources is None else resources,
            ctypes.addressof(self._callbacks) if callbacks else None,
            int(visible),
            int(logging),
        )

    def _log(self, _environment: object, name: bytes, status: int, category: bytes, message: bytes) -> None:
        self.messages.append((name.decode(), status, category.decode(), message))

    def __enter__(self) -> Instance:
        assert self.pointer
        return self

    def __exit__(self, *_: object) -> None:
        self.free()

    def free(self) -> None:
        """Free the instance; once more does nothing."""
        pointer, self.pointer = self.pointer, None
        self.library.handle.fmi2FreeInstance(pointer)

    def call(self, function: str, *arguments: object) -> int:
        """The status of a function without its prefix."""
        return int(getattr(self.library.handle, f"fmi2{function}")(self.pointer, *arguments))

    def must(self, function: str, *arguments: object) -> None:
        """Call and insist on fmi2OK."""
        status = self.call(function, *arguments)
        if status != OK:
            raise RefusedError(f"fmi2{function} returned {status}; log: {self.messages}")

    # ---- life

    def setup(self, start: float = 0.0, tolerance: float | None = None, stop: float | None = None) -> None:
        """fmi2SetupExperiment."""
        self.must("SetupExperiment", tolerance is not None, tolerance or 0.0, start, stop is not None, stop or 0.0)

    def initialise(
        self, start: float = 0.0, tolerance: float | None = None, stop: float | None = None, **values: float
    ) -> Instance:
        """From instantiated to step mode, `values` set in initialization mode."""
        self.setup(start, tolerance, stop)
        self.must("EnterInitializationMode")
        self.set(values)
        self.must("ExitInitializationMode")
        return self

    def step(self, t: float, h: float) -> None:
        """fmi2DoStep; a warning that the block gives is no failure."""
        status = self.call("DoStep", t, h, 1)
        if status not in (OK, WARNING):
            raise RefusedError(f"fmi2DoStep({t}, {h}) returned {status}; log: {self.messages}")

    # ---- model exchange

    def event(self) -> EventInfo:
        """fmi2NewDiscreteStates; a warning that the block gives is no failure."""
        info = EventInfo()
        status = self.call("NewDiscreteStates", byref(info))
        if status not in (OK, WARNING):
            raise RefusedError(f"fmi2NewDiscreteStates returned {status}; log: {self.messages}")
        return info

    def exchange(self, start: float = 0.0, **values: float) -> Instance:
        """From instantiated to continuous-time mode, `values` set in initialization mode."""
        self.initialise(start, **values)
        self.event()
        self.must("EnterContinuousTimeMode")
        return self

    def vector(self, function: str, n: int) -> list[float]:
        """The n values of a function such as GetDerivatives."""
        values = (c_double * n)()
        self.must(function, values, n)
        return list(values)

    # ---- values

    def reference(self, name: str) -> int:
        """Value reference of a variable."""
        return int(self.library.variables[name].valueReference)

    def try_set(self, values: Mapping[str, float]) -> list[int]:
        """Set all values, one call for each type; the statuses."""
        given = list(values.values())
        return [
            self.call(
                f"Set{type}",
                references,
                len(places),
                kind(*(given[place] if type == "Real" else int(given[place]) for place in places)),
            )
            for type, places, references, kind in self.library.by_type(tuple(values))
        ]

    def call_values(self, function: str, references: Sequence[int], values: Sequence[float]) -> int:
        """A call of the form (references, n, values) with the given values."""
        kind = c_double if function.endswith("Real") else c_int
        n = len(references)
        return self.call(function, (c_uint * n)(*references), n, (kind * n)(*values))

    def set(self, values: Mapping[str, float]) -> None:
        """Set all values."""
        for status in self.try_set(values):
            if status != OK:
                raise RefusedError(f"set {dict(values)} returned {status}; log: {self.messages}")

    def get(self, *names: str) -> list[float]:
        """Values of the variables, in order."""
        result = [math.nan] * len(names)
        for type, places, references, kind in self.library.by_type(names):
            buffer = kind()
            self.must(f"Get{type}", references, len(places), buffer)
            for place, value in zip(places, buffer, strict=True):
                result[place] = float(value)
        return result

    def get1(self, name: str) -> float:
        """Value of one variable."""
        return self.get(name)[0]

    def everything(self) -> bytes:
        """The bits of all declared variables."""
        values = self.get(*self.library.variables)
        return struct.pack(f"{len(values)}d", *values)

    # ---- derivatives

    def input_derivatives(self, slopes: Mapping[str, float], order: int = 1) -> int:
        """fmi2SetRealInputDerivatives; the status."""
        n = len(slopes)
        references = (c_uint * n)(*map(self.reference, slopes))
        return self.call(
            "SetRealInputDerivatives", references, n, (c_int * n)(*[order] * n), (c_double * n)(*slopes.values())
        )

    def output_derivatives(self, *names: str) -> list[float]:
        """fmi2GetRealOutputDerivatives of order 1."""
        n, result = len(names), (c_double * len(names))()
        self.must(
            "GetRealOutputDerivatives", (c_uint * n)(*map(self.reference, names)), n, (c_int * n)(*[1] * n), result
        )
        return list(result)

    def directional(self, unknowns: Sequence[str], seed: Mapping[str, float]) -> list[float]:
        """fmi2GetDirectionalDerivative."""
        result = (c_double * len(unknowns))()
        self.must(
            "GetDirectionalDerivative",
            (c_uint * len(unknowns))(*map(self.reference, unknowns)),
            len(unknowns),
            (c_uint * len(seed))(*map(self.reference, seed)),
            len(seed),
            (c_double * len(seed))(*seed.values()),
            result,
        )
        return list(result)

    # ---- states

    @contextmanager
    def saved(self) -> Iterator[c_void_p]:
        """The state of now as a pointer, freed at the end."""
        state = c_void_p()
        self.must("GetFMUstate", byref(state))
        yield state
        self.must("FreeFMUstate", byref(state))
        assert not state.value

    def serialised(self) -> bytes:
        """The bytes of the state of now."""
        with self.saved() as state:
            size = c_size_t()
            self.must("SerializedFMUstateSize", state, byref(size))
            buffer = (c_char * size.value)()
            self.must("SerializeFMUstate", state, buffer, size.value)
            return bytes(buffer)

    def try_restore(self, data: bytes) -> int:
        """Deserialise and set a state; the first status that is not fmi2OK."""
        state = c_void_p()
        status = self.call("DeSerializeFMUstate", data, len(data), byref(state))
        if status == OK:
            status = self.call("SetFMUstate", state)
            self.must("FreeFMUstate", byref(state))
        else:
            assert not state.value, "a refused state must not be handed out"
        return status

    def restore(self, data: bytes) -> None:
        """Deserialise and set a state."""
        if (status := self.try_restore(data)) != OK:
            raise RefusedError(f"the state was refused with {status}; log: {self.messages}")


def forged(data: bytes, place: int, value: bytes) -> bytes:
    """Other bytes in the model of a serialised state, with the checksum of them: FNV-1a."""
    header = 64
    model = bytearray(data[header:])
    model[place : place + len(value)] = value
    checksum = 14695981039346656037
    for byte in model:
        checksum = (checksum ^ byte) * 1099511628211 % 2**64
    return data[: header - 8] + checksum.to_bytes(8, sys.byteorder) + bytes(model)


def signals(library: Library, seed: int, count: int) -> list[dict[str, float]]:
    """`count` values of all inputs from a seed: Real ones of either sign and zero, Boolean ones mostly their start."""
    draw = random.Random(f"{library.identifier} {seed}")

    def value(v: ScalarVariable) -> float:
        if v.type == "Boolean":
            start = library.start(v.name)
            return 1.0 - start if draw.random() < 0.1 else start
        return draw.choice((-1.0, 1.0, 1.0, 0.0)) * draw.uniform(0.1, 1.0) * _AMPLITUDE.get(v.unit, 1.0)

    inputs = [library.variables[name] for name in library.names("input")]
    return [{v.name: value(v) for v in inputs} for _ in range(count)]


def drive(instance: Instance, inputs: Iterable[Mapping[str, float]], t: float, h: float) -> list[bytes]:
    """Steps of size h from t with these inputs, set before each; the bits of all variables after each."""
    trajectory = []
    for values in inputs:
        instance.set(values)
        instance.step(t, h)
        t += h
        trajectory.append(instance.everything())
    return trajectory
