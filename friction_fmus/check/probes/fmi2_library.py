"""Direct calls of the functions in an FMU's library; instances of both interfaces, driven as FMI prescribes."""

import ctypes
import locale
import math
import mmap
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from ctypes import CFUNCTYPE, POINTER, byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Self

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)
STATUS: Final = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
TRACE_SIZE: Final = 128

_refs, _reals, _ints, _strings = POINTER(c_uint), POINTER(c_double), POINTER(c_int), POINTER(c_char_p)
_state = c_void_p
_VALUES: Final = (("Real", _reals), ("Integer", _ints), ("Boolean", _ints), ("String", _strings))
_COMMON: Final[dict[str, tuple[Any, ...]]] = {
    "GetTypesPlatform": (),
    "GetVersion": (),
    "SetDebugLogging": (c_void_p, c_int, c_size_t, _strings),
    "Instantiate": (c_char_p, c_int, c_char_p, c_char_p, c_void_p, c_int, c_int),
    "FreeInstance": (c_void_p,),
    "SetupExperiment": (c_void_p, c_int, c_double, c_double, c_int, c_double),
    **dict.fromkeys(("EnterInitializationMode", "ExitInitializationMode", "Terminate", "Reset"), (c_void_p,)),
    **{f"{verb}{kind}": (c_void_p, _refs, c_size_t, values) for verb in ("Get", "Set") for kind, values in _VALUES},
    "GetFMUstate": (c_void_p, POINTER(_state)),
    "SetFMUstate": (c_void_p, _state),
    "FreeFMUstate": (c_void_p, POINTER(_state)),
    "SerializedFMUstateSize": (c_void_p, _state, POINTER(c_size_t)),
    "SerializeFMUstate": (c_void_p, _state, c_void_p, c_size_t),
    "DeSerializeFMUstate": (c_void_p, c_void_p, c_size_t, POINTER(_state)),
    "GetDirectionalDerivative": (c_void_p, _refs, c_size_t, _refs, c_size_t, _reals, _reals),
}
_CO_SIMULATION: Final[dict[str, tuple[Any, ...]]] = {
    "SetRealInputDerivatives": (c_void_p, _refs, c_size_t, _ints, _reals),
    "GetRealOutputDerivatives": (c_void_p, _refs, c_size_t, _ints, _reals),
    "DoStep": (c_void_p, c_double, c_double, c_int),
    "CancelStep": (c_void_p,),
    **{f"Get{kind}Status": (c_void_p, c_int, value) for kind, value in (("", _ints), *_VALUES)},
}
_EXCHANGE: Final[dict[str, tuple[Any, ...]]] = {
    **dict.fromkeys(("EnterEventMode", "EnterContinuousTimeMode"), (c_void_p,)),
    "NewDiscreteStates": (c_void_p, c_void_p),
    "CompletedIntegratorStep": (c_void_p, c_int, _ints, _ints),
    "SetTime": (c_void_p, c_double),
    "SetContinuousStates": (c_void_p, _reals, c_size_t),
    **dict.fromkeys(("GetContinuousStates", "GetDerivatives"), (c_void_p, _reals, c_size_t)),
    **dict.fromkeys(("GetEventIndicators", "GetNominalsOfContinuousStates"), (c_void_p, _reals, c_size_t)),
}

_RESULTS: Final = {"GetTypesPlatform": c_char_p, "GetVersion": c_char_p, "Instantiate": c_void_p, "FreeInstance": None}
_LOGGER = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
_BUFFERS: Final[dict[str, Any]] = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}


class _Callbacks(ctypes.Structure):
    _fields_ = tuple((name, c_void_p) for name in ("logger", "allocate", "free", "finished", "environment"))


def settings_now() -> dict[str, object]:
    """Return settings that a library must not change; the rounding mode only if the C library can tell."""
    try:
        rounding = int(ctypes.CDLL("libm.so.6").fegetround())
    except (OSError, AttributeError):
        rounding = None
    place = str(Path.cwd())
    return {
        "the working directory": place,
        "the locale": locale.setlocale(locale.LC_ALL),
        "the rounding mode": rounding,
    }


class MissingError(Exception):
    """The library does not export a function."""


class RefusedError(Exception):
    """A call failed that must succeed."""

    def __init__(self, function: str, status: str, message: str) -> None:
        super().__init__(function, status, message)
        self.function, self.status, self.message = function, status, message


@dataclass
class ProbedVariable:
    """Data of a ScalarVariable for the probes, as the check writes them."""

    name: str
    reference: int
    type: str
    causality: str
    variability: str
    initial: str | None
    start: Any
    low: float
    high: float
    nominal: float


class RawLibrary:
    """A loaded library with the data of its XML."""

    version = b"2.0"
    token = "guid"
    """What the library has to answer to GetVersion, and the name of its identity."""
    misuse = ""  # what is wrong with the calls that a probe makes on purpose

    def __init__(self, job: dict[str, Any], trace: mmap.mmap) -> None:
        self.job, self._trace = job, trace
        self.guid: str = job["guid"]
        self.start_time: float = job["start_time"]
        self.variables = [ProbedVariable(**row) for row in job["variables"]]
        self.by_type = _by_type(self.variables)
        self.messages: list[tuple[int, str, str]] = []
        self.categories: set[str] = set()
        self.settings = settings_now()
        self.mark("loading")
        self._handle = ctypes.CDLL(job["binary"])
        self.exchange: bool = job["exchange"]
        self._bind()
        libc = ctypes.cdll.msvcrt if sys.platform == "win32" else ctypes.CDLL(None)
        self._logger = _LOGGER(self._log)
        self.memory = [ctypes.cast(function, c_void_p).value for function in (libc.calloc, libc.free)]
        self._callbacks = _Callbacks(ctypes.cast(self._logger, c_void_p).value, *self.memory, None, None)

    def _bind(self) -> None:
        """Find the functions and set the types of their arguments."""
        signatures = _COMMON | (_EXCHANGE if self.exchange else _CO_SIMULATION)
        self.missing = [name for name in signatures if not hasattr(self._handle, f"fmi2{name}")]
        for name, arguments in signatures.items():
            if name not in self.missing:
                function = getattr(self._handle, f"fmi2{name}")
                function.argtypes, function.restype = arguments, _RESULTS.get(name, c_int)

    def named(self, name: str) -> str:
        """Return the name of a function or status, given without its prefix, in this version of FMI."""
        return f"fmi2{name}"

    def mark(self, function: str) -> None:
        """Store the name of the function being called."""
        self._trace[:TRACE_SIZE] = f"{function}{self.misuse}".encode()[:TRACE_SIZE].ljust(TRACE_SIZE)

    def _log(self, _environment: object, _name: bytes, status: int, category: bytes, message: bytes) -> None:
        names = (category or b"").decode(errors="replace"), (message or b"").decode(errors="replace")
        self.categories.add(names[0])
        self.messages = [*self.messages[-3:], (status, *names)]

    @property
    def kind(self) -> int:
        """The type of instances: fmi2ModelExchange or fmi2CoSimulation."""
        return 0 if self.exchange else 1

    def flag(self, name: str) -> bool:
        """Return a capability flag."""
        return bool(self.job["flags"].get(name))

    def continuous(self, causality: str) -> list[ProbedVariable]:
        """Return the continuous Real variables with a causality."""
        found = (v for v in self.variables if v.causality == causality)
        return [v for v in found if v.type == "Real" and v.variability == "continuous"]

    def call(self, function: str, *arguments: object) -> Any:
        """Call a function, given without its prefix, and return its result."""
        if function in self.missing:
            raise MissingError(function)
        self.mark(f"fmi2{function}")
        return getattr(self._handle, f"fmi2{function}")(*arguments)

    def instantiate(self, guid: str | None = None, name: str = "checked") -> int | None:
        """Return the address of a new instance, or None."""
        folder = Path(self.job["resources"]).as_uri()
        pointer: int | None = self.call(
            "Instantiate",
            name.encode(),
            self.kind,
            (self.guid if guid is None else guid).encode(),
            folder.encode(),
            ctypes.addressof(self._callbacks),
            0,
            1,
        )
        return pointer


class RawInstance:
    """One instance; all calls except calls of `status` must succeed."""

    def __init__(self, library: RawLibrary, name: str = "checked") -> None:
        self.library = library
        self.pointer = library.instantiate(name=name)
        if not self.pointer:
            raise RefusedError("Instantiate", "no instance", last_message(library))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.free()

    def free(self) -> None:
        """Free the instance; further calls have no effect."""
        pointer, self.pointer = self.pointer, None
        if pointer:
            self.library.call("FreeInstance", pointer)

    def status(self, function: str, *arguments: object) -> int:
        """Return the status of a call."""
        return int(self.library.call(function, self.pointer, *arguments))

    def must(self, function: str, *arguments: object) -> None:
        """Call a function and raise an error unless it returns fmi2OK or fmi2Warning."""
        self.library.messages.clear()
        status = self.status(function, *arguments)
        if status not in (OK, WARNING):
            name = self.library.named(STATUS[status]) if 0 <= status < len(STATUS) else str(status)
            raise RefusedError(function, name, last_message(self.library))

    def set_up(self) -> Self:
        """fmi2SetupExperiment."""
        self.must("SetupExperiment", 0, 0.0, self.library.start_time, 0, 0.0)
        return self

    def begin(self) -> Self:
        """Enter initialization mode."""
        self.set_up().must("EnterInitializationMode")
        return self

    def initialise(self) -> Self:
        """Complete the initialisation."""
        self.begin().must("ExitInitializationMode")
        return self

    def step_status(self, t: float, h: float) -> int:
        """Perform a communication step and return its status."""
        return self.status("DoStep", t, h, 1)

    def step(self, t: float, h: float) -> None:
        """Perform a communication step, which must succeed."""
        self.must("DoStep", t, h, 1)

    # ---- values

    def read_status(self, v: ProbedVariable) -> tuple[int, Any]:
        """Return status and value of one variable."""
        buffer = (_BUFFERS[v.type] * 1)()
        status = self.status(f"Get{v.type}", (c_uint * 1)(v.reference), 1, buffer)
        return status, (buffer[0] or b"").decode(errors="replace") if v.type == "String" else buffer[0]

    def write_status(self, v: ProbedVariable, value: Any) -> int:
        """Set one variable and return the status."""
        buffer = (_BUFFERS[v.type] * 1)(value.encode() if v.type == "String" else value)
        return self.status(f"Set{v.type}", (c_uint * 1)(v.reference), 1, buffer)

    def snapshot(self) -> dict[str, Any]:
        """Return all readable variables, with NaN as text so that it equals itself."""
        values: dict[str, Any] = {}
        for type, (names, numbers) in self.library.by_type.items():
            buffer = (_BUFFERS[type] * len(names))()
            if self.status(f"Get{type}", numbers, len(names), buffer) in (OK, WARNING):
                values |= zip(names, _plain(type, buffer), strict=True)
            else:
                values |= self._readable(type)
        return values

    def _readable(self, type: str) -> dict[str, Any]:
        """Return the readable variables of a type, one by one."""
        values = {}
        for v in self.library.variables:
            if v.type == type:
                status, value = self.read_status(v)
                if status in (OK, WARNING):
                    values[v.name] = "NaN" if value != value else value
        return values

    # ---- states

    @contextmanager
    def saved(self) -> Iterator[c_void_p]:
        """Yield the current state as a pointer, and free it at the end."""
        state = c_void_p()
        self.must("GetFMUstate", byref(state))
        yield state
        self.must("FreeFMUstate", byref(state))

    def serialized(self, state: c_void_p) -> bytes:
        """Return the bytes of a saved state."""
        size = c_size_t()
        self.must("SerializedFMUstateSize", state, byref(size))
        buffer = ctypes.create_string_buffer(size.value)
        self.must("SerializeFMUstate", state, buffer, size.value)
        return buffer.raw

    def restore(self, data: bytes) -> None:
        """Deserialise a state and set it."""
        state = c_void_p()
        self.must("DeSerializeFMUstate", data, len(data), byref(state))
        self.must("SetFMUstate", state)
        self.must("FreeFMUstate", byref(state))


def _by_type(variables: Sequence[ProbedVariable]) -> dict[str, tuple[list[str], Any]]:
    """Return names and value references of the variables of each type."""
    types = dict.fromkeys(v.type for v in variables)
    groups = {type: [v for v in variables if v.type == type] for type in types}
    return {type: ([v.name for v in group], references(group)) for type, group in groups.items()}


def _plain(type: str, buffer: Any) -> list[Any]:
    """Return the values in a buffer, with NaN as text."""
    if type == "String":
        return [(text or b"").decode(errors="replace") for text in buffer]
    return ["NaN" if value != value else value for value in buffer]


def last_message(library: RawLibrary) -> str:
    """Return the last log message of the FMU, as the end of a sentence."""
    return f"; it logged {library.messages[-1][2]!r}" if library.messages else ""


def references(variables: Sequence[ProbedVariable]) -> Any:
    """Return the value references of variables for a call."""
    return (c_uint * len(variables))(*(v.reference for v in variables))


MOST_ITERATIONS: Final = 100  # largest number of calls of fmi2NewDiscreteStates for one event
UNSET: Final = -7  # what the results of a call hold before it

_SUBSTEPS: Final = 4
_LARGEST: Final = 0.1  # largest change of a state in a substep over its nominal value: plausible, not accurate


class EventInfo(ctypes.Structure):
    """fmi2EventInfo."""

    _fields_ = (
        *((name, c_int) for name in ("iterate", "terminate", "nominals", "values", "scheduled")),
        ("next", c_double),
    )


def start(library: RawLibrary, name: str = "checked") -> RawInstance:
    """Return a new instance of the interface that is checked."""
    return RawExchange(library, name) if library.exchange else RawInstance(library, name)


class RawExchange(RawInstance):
    """One instance for model exchange; between steps it is in event mode."""

    def __init__(self, library: RawLibrary, name: str = "checked") -> None:
        super().__init__(library, name)
        self.info, self.settled = EventInfo(), True  # of the last event iteration, and whether it came to its end
        self.unset: set[str] = set()  # functions that did not set all of their flags

    def settle(self) -> None:
        """Iterate in event mode until the discrete states have settled."""
        for _ in range(MOST_ITERATIONS):
            info = self.info = EventInfo(UNSET, UNSET, UNSET, UNSET, UNSET, math.nan)
            self.must("NewDiscreteStates", byref(info))
            if UNSET in (info.iterate, info.terminate, info.nominals, info.values, info.scheduled):
                self.unset.add("NewDiscreteStates")
            self.settled = info.iterate in (0, UNSET)
            if self.settled:
                return

    def continuous(self) -> Self:
        """Initialise and enter continuous-time mode."""
        self.initialise()
        self.settle()
        self.must("EnterContinuousTimeMode")
        return self

    def values(self, function: str, n: int) -> list[float]:
        """Return the values of a function such as GetDerivatives."""
        if n == 0:
            return []
        buffer = (c_double * n)()
        self.must(function, buffer, n)
        return list(buffer)

    def states(self) -> list[float]:
        """Return the continuous states."""
        return self.values("GetContinuousStates", len(self.library.job["states"]))

    def derivatives(self) -> list[float]:
        """Return the derivatives of the states."""
        return self.values("GetDerivatives", len(self.library.job["states"]))

    def nominals(self) -> list[float]:
        """Return the nominal values of the states, with 1 for one that is not positive."""
        found = self.values("GetNominalsOfContinuousStates", len(self.library.job["states"]))
        return [value if 0.0 < value < math.inf else 1.0 for value in found]

    def indicators(self) -> list[float]:
        """Return the event indicators."""
        return self.values("GetEventIndicators", self.library.job["indicators"])

    def go_to(self, t: float, x: list[float]) -> None:
        """Set time and states."""
        self.must("SetTime", t)
        if x:
            self.must("SetContinuousStates", (c_double * len(x))(*x), len(x))

    def step_status(self, t: float, h: float) -> int:
        """Advance by Euler steps and events, and return a status."""
        try:
            self.step(t, h)
        except RefusedError:
            return ERROR
        return 0

    def step(self, t: float, h: float) -> None:
        """Advance by Euler steps and events, which must succeed."""
        self.settle()
        self.must("EnterContinuousTimeMode")
        x, nominals, above = self.states(), self.nominals(), self._above()
        for k in range(1, _SUBSTEPS + 1):
            now = t + h * k / _SUBSTEPS if k < _SUBSTEPS else t + h
            x = [
                value + max(-limit, min(limit, rate * h / _SUBSTEPS))
                for value, limit, rate in zip(x, (_LARGEST * n for n in nominals), self.derivatives(), strict=True)
            ]
            self.go_to(now, x)
            asked = self.complete() if self.library.job["completes"] else False
            due = self.info.scheduled == 1 and self.info.next <= now
            if k < _SUBSTEPS and (asked or due or self._above() != above):
                self.must("EnterEventMode")
                self.settle()
                self.must("EnterContinuousTimeMode")
                x, above = self.states(), self._above()
        self.must("EnterEventMode")
        self.settle()

    def complete(self) -> bool:
        """Report a completed solver step and return whether the FMU asks for an event."""
        enter, end = c_int(UNSET), c_int(UNSET)
        self.must("CompletedIntegratorStep", 1, byref(enter), byref(end))
        if UNSET in (enter.value, end.value):
            self.unset.add("CompletedIntegratorStep")
        return enter.value == 1

    def _above(self) -> list[bool]:
        return [value > 0.0 for value in self.indicators()]
