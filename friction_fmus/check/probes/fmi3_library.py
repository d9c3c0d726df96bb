"""The functions of FMI 2.0, which the probes call, by those of an FMI 3.0 library."""

import ctypes
import mmap
import os
import re
from collections.abc import Callable
from ctypes import CFUNCTYPE, byref, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint64, c_void_p
from typing import Any, Final

from .fmi2_library import ERROR, MissingError, RawLibrary

LOGGER: Final = CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
UPDATE: Final = CFUNCTYPE(
    None, c_void_p, c_double, c_bool, c_bool, c_bool, c_bool, ctypes.POINTER(c_bool), ctypes.POINTER(c_double)
)

_RENAMED: Final = {
    **{f"{verb}Real": f"{verb}Float64" for verb in ("Get", "Set")},
    **{f"{verb}Integer": f"{verb}Int32" for verb in ("Get", "Set")},
    **{f"{verb}FMUstate": f"{verb}FMUState" for verb in ("Get", "Set", "Free", "Serialize")},
    "SerializedFMUstateSize": "SerializedFMUStateSize",
    "DeSerializeFMUstate": "DeserializeFMUState",
    "GetDerivatives": "GetContinuousStateDerivatives",
    "GetRealOutputDerivatives": "GetOutputDerivatives",
    "NewDiscreteStates": "UpdateDiscreteStates",
    "SetupExperiment": "EnterInitializationMode",
}
_VALUES: Final = ("Float32", "Float64", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")
_VALUE_FUNCTIONS: Final = tuple(
    f"{verb}{kind}" for verb in ("Get", "Set") for kind in (*_VALUES, "Boolean", "String", "Binary", "Clock")
)
_COMMON: Final = (
    *("GetVersion", "SetDebugLogging", "FreeInstance", "EnterInitializationMode", "ExitInitializationMode"),
    *("EnterEventMode", "Terminate", "Reset", *_VALUE_FUNCTIONS, "GetNumberOfVariableDependencies"),
    *("GetVariableDependencies", "GetFMUState", "SetFMUState", "FreeFMUState", "SerializedFMUStateSize"),
    *("SerializeFMUState", "DeserializeFMUState", "GetDirectionalDerivative", "GetAdjointDerivative"),
    *("EnterConfigurationMode", "ExitConfigurationMode", "EvaluateDiscreteStates", "UpdateDiscreteStates"),
    *(
        f"{verb}{what}{how}"
        for verb in ("Get", "Set")
        for what in ("Interval", "Shift")
        for how in ("Decimal", "Fraction")
    ),
)
_EXCHANGE: Final = (
    *("InstantiateModelExchange", "EnterContinuousTimeMode", "CompletedIntegratorStep", "SetTime"),
    *("SetContinuousStates", "GetContinuousStateDerivatives", "GetEventIndicators", "GetContinuousStates"),
    *("GetNominalsOfContinuousStates", "GetNumberOfEventIndicators", "GetNumberOfContinuousStates"),
)
_CO_SIMULATION: Final = ("InstantiateCoSimulation", "EnterStepMode", "GetOutputDerivatives", "DoStep")


class RawLibrary3(RawLibrary):
    """A loaded library of FMI 3.0; see `RawLibrary`."""

    version = b"3.0"
    token = "instantiation token"

    def __init__(self, job: dict[str, Any], trace: mmap.mmap) -> None:
        super().__init__(job, trace)
        self._special: dict[str, Callable[..., Any]] = {
            "GetVersion": lambda: bytes(self.raw("GetVersion", result=c_char_p)),
            "Instantiate": self._instantiate,
            "FreeInstance": lambda pointer: self.raw("FreeInstance", c_void_p(pointer), result=None),
            "SetupExperiment": self._setup_experiment,
            "EnterInitializationMode": self._enter_initialization_mode,
            "Reset": self._reset,
            "SetDebugLogging": lambda pointer, on, n, categories: int(
                self.raw("SetDebugLogging", c_void_p(pointer), c_bool(bool(on)), c_size_t(n), categories)
            ),
            "GetBoolean": self._get_boolean,
            "SetBoolean": self._set_boolean,
            "GetDirectionalDerivative": self._get_directional_derivative,
            "DoStep": self._do_step,
            "NewDiscreteStates": self._new_discrete_states,
            "CompletedIntegratorStep": self._completed_integrator_step,
        }
        self._logger3 = LOGGER(lambda _, status, category, message: self._log(None, b"", status, category, message))
        self._experiments: dict[int, tuple[Any, ...] | None] = {}

    def _bind(self) -> None:
        """Find the functions; ctypes converts the arguments of each call."""
        needed = _COMMON + (_EXCHANGE if self.exchange else _CO_SIMULATION)
        self.missing = [name for name in needed if not hasattr(self._handle, f"fmi3{name}")]

    def named(self, name: str) -> str:
        """Return the name in FMI 3.0 of what is called so in FMI 2.0."""
        return f"fmi3{_RENAMED.get(name, name)}"

    def raw(self, function: str, *arguments: object, result: Any = c_int) -> Any:
        """Call a function of FMI 3.0, given without its prefix."""
        self.mark(f"fmi3{function}")
        called = getattr(self._handle, f"fmi3{function}")
        called.restype = result
        return called(*arguments)

    def call(self, function: str, *arguments: object) -> Any:
        """Call what stands for a function of FMI 2.0, and return its result."""
        if function in self._special:
            return self._special[function](*arguments)
        name = _RENAMED.get(function, function)
        self._require(name)
        typed = [c_void_p(arguments[0]) if isinstance(arguments[0], int) else arguments[0], *map(_typed, arguments[1:])]
        if re.fullmatch(r"[GS]et(Float64|Int32|String|OutputDerivatives)", name):
            typed.append(c_size_t(int(typed[2].value)))  # as many values as variables: all are scalars
        return self.raw(name, *typed)

    def _require(self, name: str) -> None:
        if name in self.missing:
            raise MissingError(name)

    # ---- functions that differ

    def _instantiate(
        self, name: bytes, _kind: int, token: bytes, _folder: bytes, callbacks: int, _visible: int, _on: int
    ) -> int | None:
        logger = self._logger3 if c_void_p.from_address(callbacks).value else LOGGER()
        return self.new(name, token, logger)

    def new(
        self,
        name: bytes,
        token: bytes,
        logger: Any = None,
        *,
        events: bool = False,
        returns: bool = False,
        update: Any = None,
    ) -> int | None:
        """Return the address of a new instance, or None."""
        no, yes = c_bool(False), c_bool(True)
        logger = self._logger3 if logger is None else logger
        common = (c_char_p(name), c_char_p(token), c_char_p((self.job["resources"] + os.sep).encode()), no, yes)
        if self.exchange:
            self._require("InstantiateModelExchange")
            made = self.raw("InstantiateModelExchange", *common, None, logger, result=c_void_p)
        else:
            self._require("InstantiateCoSimulation")
            rest = (c_bool(events), c_bool(returns), None, c_size_t(0), None, logger, update or UPDATE())
            made = self.raw("InstantiateCoSimulation", *common, *rest, result=c_void_p)
        if made:
            self._experiments[made] = (0, 0.0, self.start_time, 0, 0.0)
        return int(made) if made else None

    def _setup_experiment(self, pointer: int, *experiment: Any) -> int:
        """Keep the experiment for fmi3EnterInitializationMode."""
        if self._experiments.get(pointer) is None:
            return ERROR
        self._experiments[pointer] = experiment
        return 0

    def _enter_initialization_mode(self, pointer: int) -> int:
        given = self._experiments.get(pointer) or (0, 0.0, self.start_time, 0, 0.0)
        flags = c_bool(bool(given[0])), c_bool(bool(given[3]))
        values = c_double(given[1]), c_double(given[2]), c_double(given[4])
        status = int(
            self.raw("EnterInitializationMode", c_void_p(pointer), flags[0], values[0], values[1], flags[1], values[2])
        )
        self._experiments[pointer] = None if status <= 1 else given
        return status

    def _reset(self, pointer: int) -> int:
        status = int(self.raw("Reset", c_void_p(pointer)))
        if status <= 1:
            self._experiments[pointer] = (0, 0.0, self.start_time, 0, 0.0)
        return status

    def _get_boolean(self, pointer: int, references: Any, n: int, values: Any) -> int:
        found = (c_bool * n)()
        status = int(self.raw("GetBoolean", c_void_p(pointer), references, c_size_t(n), found, c_size_t(n)))
        if status <= 1:
            values[:] = [int(value) for value in found]
        return status

    def _set_boolean(self, pointer: int, references: Any, n: int, values: Any) -> int:
        given = (c_bool * n)(*(bool(value) for value in values))
        return int(self.raw("SetBoolean", c_void_p(pointer), references, c_size_t(n), given, c_size_t(n)))

    def _get_directional_derivative(self, pointer: int, a: Any, n: Any, b: Any, m: Any, seed: Any, result: Any) -> int:
        above, below = c_size_t(getattr(n, "value", n)), c_size_t(getattr(m, "value", m))
        pair = (a, above, b, below, seed, below, result, above)
        return int(self.raw("GetDirectionalDerivative", c_void_p(pointer), *pair))

    def _do_step(self, pointer: int, t: float, h: float, keeps: int) -> int:
        flags, last = [c_bool() for _ in range(3)], c_double(t + h)
        given = (c_double(t), c_double(h), c_bool(bool(keeps)))
        return int(self.raw("DoStep", c_void_p(pointer), *given, *map(byref, flags), byref(last)))

    def _new_discrete_states(self, pointer: int, place: Any) -> int:
        info = place._obj
        flags, following = [c_bool() for _ in range(5)], c_double(info.next)
        status = int(self.raw("UpdateDiscreteStates", c_void_p(pointer), *map(byref, flags), byref(following)))
        if status <= 1:
            info.iterate, info.terminate, info.nominals, info.values, info.scheduled = (int(f.value) for f in flags)
            info.next = following.value
        return status

    def _completed_integrator_step(self, pointer: int, keeps: int, event: Any, ends: Any) -> int:
        flags = c_bool(), c_bool()
        status = int(self.raw("CompletedIntegratorStep", c_void_p(pointer), c_bool(bool(keeps)), *map(byref, flags)))
        if status <= 1:
            event._obj.value, ends._obj.value = (int(flag.value) for flag in flags)
        return status


def _typed(argument: object) -> Any:
    """Return a Python number as an argument in C: a float is a double, an integer a size."""
    if isinstance(argument, bool | int):
        return c_size_t(argument)
    return c_double(argument) if isinstance(argument, float) else argument


BUFFERS: Final[dict[str, Any]] = {
    **{"Float64": c_double, "Float32": ctypes.c_float, "Boolean": c_bool, "Enumeration": ctypes.c_int64},
    **{f"Int{bits}": getattr(ctypes, f"c_int{bits}") for bits in (8, 16, 32, 64)},
    **{f"UInt{bits}": getattr(ctypes, f"c_uint{bits}") for bits in (8, 16, 32)},
    "UInt64": c_uint64,
}
"""Type in C of the elements of each type."""
