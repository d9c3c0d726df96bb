"""Calls of FMI 2.0 and 3.0 through ctypes. Nothing of the harness or of fmpy is used, so that no fault is shared."""

from __future__ import annotations

import ctypes
import math
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from ctypes import CFUNCTYPE, byref, c_bool, c_char, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from lxml import etree

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
TIME_LAST_SUCCESSFUL, TERMINATED = 2, 3  # kinds of status of FMI 2.0
KINDS = {"cs": "CoSimulation", "me": "ModelExchange"}

_C = {  # of FMI 3.0; those of FMI 2.0 below
    "Float64": c_double,
    "Float32": ctypes.c_float,
    **{
        f"{sign}Int{bits}": getattr(ctypes, f"c_{sign.lower()}int{bits}")
        for sign in ("", "U")
        for bits in (8, 16, 32, 64)
    },
    "Enumeration": ctypes.c_int64,
    "Boolean": c_bool,
    "Clock": c_bool,
    "String": c_char_p,
}
_C2 = {"Real": c_double, "Integer": c_int, "Enumeration": c_int, "Boolean": c_int, "String": c_char_p}
_FLOATS = ("Real", "Float64", "Float32")
_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")

Value = Any


class RefusedError(Exception):
    """A call that had to succeed returned another status."""

    def __init__(self, function: str, status: int, log: Sequence[str] = ()) -> None:
        """Keep the status."""
        name = STATUS[status] if 0 <= status < len(STATUS) else str(status)
        super().__init__(f"{function} returned {name}; {' | '.join(log[-3:])}")
        self.status = status


@dataclass(frozen=True)
class Variable:
    """A variable of a description."""

    name: str
    reference: int
    type: str  # Real, Integer, ... or Float64, Int32, ...
    causality: str
    variability: str
    start: tuple[str, ...]
    sizes: tuple[int | str, ...]  # of its dimensions: numbers, or value references of structural parameters as text
    element: etree._Element

    @property
    def is_float(self) -> bool:
        """Whether it is a floating-point number."""
        return self.type in _FLOATS


class RawFmu:
    """An unpacked FMU with its library and its description."""

    def __init__(self, path: Path, folder: Path) -> None:
        """Unpack and load it."""
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
        self.folder = folder
        self.root = etree.parse(folder / "modelDescription.xml").getroot()
        self.version = int(self.root.get("fmiVersion", "2")[0])
        self.token = self.root.get("guid" if self.version == 2 else "instantiationToken", "")
        self.variables = {v.name: v for v in (self._two() if self.version == 2 else self._three())}
        self.by_reference = {v.reference: v for v in self.variables.values()}

    def interface(self, kind: str) -> etree._Element | None:
        """The element of "cs" or "me"."""
        return self.root.find(KINDS[kind])

    def flag(self, kind: str, name: str) -> str:
        """An attribute of the interface, empty if it is absent."""
        element = self.interface(kind)
        return "" if element is None else element.get(name, "")

    def library(self, kind: str) -> ctypes.CDLL:
        """The library of an interface."""
        platform = "linux64" if self.version == 2 else "x86_64-linux"
        return ctypes.CDLL(str(self.folder / "binaries" / platform / f"{self.flag(kind, 'modelIdentifier')}.so"))

    def _two(self) -> Iterable[Variable]:
        for element in self.root.iterfind("ModelVariables/ScalarVariable"):
            typed = next(child for child in element if child.tag in _C2)
            yield Variable(
                element.get("name", ""),
                int(element.get("valueReference", "0")),
                str(typed.tag),
                element.get("causality", "local"),
                element.get("variability", "continuous"),
                (typed.get("start", ""),) if typed.get("start") is not None else (),
                (),
                element,
            )

    def _three(self) -> Iterable[Variable]:
        for element in self.root.iterfind("ModelVariables/*"):
            default = "continuous" if element.tag in _FLOATS else "discrete"
            starts = tuple(each.get("value", "") for each in element.iterfind("Start"))
            yield Variable(
                element.get("name", ""),
                int(element.get("valueReference", "0")),
                str(element.tag),
                element.get("causality", "local"),
                element.get("variability", default),
                starts or tuple(element.get("start", "").split()),
                tuple(
                    int(each.get("start", "0")) if each.get("start") else each.get("valueReference", "")
                    for each in element.iterfind("Dimension")
                ),
                element,
            )

    @cached_property
    def types(self) -> Mapping[str, etree._Element]:
        """The declared types by name."""
        if self.version == 2:
            found = self.root.iterfind("TypeDefinitions/SimpleType")
            return {element.get("name", ""): element[0] for element in found}
        return {element.get("name", ""): element for element in self.root.iterfind("TypeDefinitions/*")}

    def attribute(self, name: str, attribute: str) -> str | None:
        """An attribute of a variable, or else of its declared type."""
        variable = self.variables[name]
        element = variable.element
        if self.version == 2:
            element = next(child for child in element if child.tag in _C2)
        own = element.get(attribute)
        declared = self.types.get(element.get("declaredType", ""))
        return own if own is not None or declared is None else declared.get(attribute)

    def items(self, name: str) -> Mapping[str, int]:
        """The items of the enumeration of a variable."""
        variable = self.variables[name]
        element = variable.element if self.version == 3 else variable.element.find("Enumeration")
        assert element is not None
        declared = self.types[element.get("declaredType", "")]
        return {item.get("name", ""): int(item.get("value", "0")) for item in declared.iterfind("Item")}

    def base(self, unit: str) -> tuple[tuple[int, ...], float, float]:
        """Exponents, factor and offset of a unit."""
        for element in self.root.iterfind("UnitDefinitions/Unit"):
            base = element.find("BaseUnit")
            if element.get("name") == unit and base is not None:
                exponents = tuple(int(base.get(symbol, "0")) for symbol in _UNITS)
                return exponents, float(base.get("factor", "1")), float(base.get("offset", "0"))
        return (0,) * 8, 1.0, 0.0

    @cached_property
    def derivatives(self) -> list[Variable]:
        """The derivatives of the continuous states, in the order of the states."""
        if self.version == 2:
            every = list(self.variables.values())
            found = self.root.iterfind("ModelStructure/Derivatives/Unknown")
            return [every[int(element.get("index", "1")) - 1] for element in found]
        found = self.root.iterfind("ModelStructure/ContinuousStateDerivative")
        return [self.by_reference[int(element.get("valueReference", "0"))] for element in found]

    @cached_property
    def indicators(self) -> int:
        """Number of event indicators."""
        if self.version == 2:
            return int(self.root.get("numberOfEventIndicators", "0"))
        return len(self.root.findall("ModelStructure/EventIndicator"))


class _Callbacks2(ctypes.Structure):
    _fields_ = tuple((name, c_void_p) for name in ("logger", "allocate", "free", "finished", "environment"))


class _EventInfo2(ctypes.Structure):
    _fields_ = (
        *((name, c_int) for name in ("again", "terminate", "nominals", "changed", "defined")),
        ("next", c_double),
    )


_LOG2 = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
_LOG3 = CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)


@dataclass
class Step:
    """What a call of DoStep said."""

    status: int
    time: float  # the time that was reached
    early: bool = False
    event: bool = False
    terminate: bool = False


@dataclass
class Update:
    """What an update of the discrete states said."""

    again: bool
    terminate: bool
    changed: bool  # the continuous states
    next: float  # the next time event, infinite if there is none


def _references(variables: Sequence[Variable]) -> Any:
    return (c_uint * len(variables))(*(v.reference for v in variables))


class RawInstance:
    """An instance with the functions of both versions under one name; no call is made that is not asked for."""

    def __init__(
        self, fmu: RawFmu, kind: str, name: str = "instance", *, logging: bool = True, events: bool = False
    ) -> None:
        """Instantiate it; `events` asks for the event mode and early return of a co-simulation in FMI 3.0."""
        self.fmu, self.kind, self.events, self.log = fmu, kind, events, list[str]()
        self.version = fmu.version
        self._library = fmu.library(kind)
        self._prefix = f"fmi{self.version}"
        self.sizes: dict[str, int] = {}
        resources = fmu.folder / "resources"
        if self.version == 2:
            self._logger: Any = _LOG2(self._log2)
            self._callbacks = _Callbacks2(ctypes.cast(self._logger, c_void_p))
            self._callbacks.allocate = ctypes.cast(_LIBC.calloc, c_void_p)
            self._callbacks.free = ctypes.cast(_LIBC.free, c_void_p)
            create = self._library.fmi2Instantiate
            create.restype = c_void_p
            self.pointer = create(
                name.encode(),
                c_int(1 if kind == "cs" else 0),
                fmu.token.encode(),
                resources.as_uri().encode(),
                byref(self._callbacks),
                c_int(0),
                c_int(logging),
            )
        else:
            self._logger = _LOG3(self._log3)
            create = getattr(self._library, f"fmi3Instantiate{KINDS[kind]}")
            create.restype = c_void_p
            head = (name.encode(), fmu.token.encode(), f"{resources}/".encode(), c_bool(False), c_bool(logging))
            middle = (c_bool(events), c_bool(events), None, c_size_t(0)) if kind == "cs" else ()
            tail = (None, self._logger, None) if kind == "cs" else (None, self._logger)
            self.pointer = create(*head, *middle, *tail)
        if not self.pointer:
            raise RefusedError("Instantiate", ERROR, self.log)
        self._handle = c_void_p(self.pointer)

    def _log2(self, _environment: object, _name: bytes, _status: int, category: bytes, message: bytes) -> None:
        self.log.append(f"{(category or b'').decode()}: {(message or b'').decode()}")

    def _log3(self, _environment: object, _status: int, category: bytes, message: bytes) -> None:
        self.log.append(f"{(category or b'').decode()}: {(message or b'').decode()}")

    def function(self, name: str) -> Callable[..., int]:
        """A function without its prefix."""
        found: Callable[..., int] = getattr(self._library, f"{self._prefix}{name}")
        return found

    def call(self, name: str, *arguments: Any) -> int:
        """The status of a call."""
        return int(self.function(name)(self._handle, *arguments))

    def must(self, name: str, *arguments: Any) -> None:
        """Call and insist on OK or a warning."""
        status = self.call(name, *arguments)
        if status > WARNING:
            raise RefusedError(name, status, self.log)

    # ---- life

    def enter_initialization(self, start: float, stop: float | None = None, tolerance: float | None = None) -> None:
        """Set up the experiment and enter initialization mode."""
        has, tolerance_ = tolerance is not None, c_double(tolerance or 0.0)
        ends, stop_ = stop is not None, c_double(stop or 0.0)
        if self.version == 2:
            self.must("SetupExperiment", c_int(has), tolerance_, c_double(start), c_int(ends), stop_)
            self.must("EnterInitializationMode")
        else:
            self.must("EnterInitializationMode", c_bool(has), tolerance_, c_double(start), c_bool(ends), stop_)

    def free(self) -> None:
        """Free the instance."""
        if self.pointer:
            self.function("FreeInstance").restype = None  # type: ignore[attr-defined]
            self.function("FreeInstance")(self._handle)
            self.pointer = None

    # ---- values

    def size(self, variable: Variable) -> int:
        """Number of elements, with the sizes of now."""
        sizes = [
            each if isinstance(each, int) else int(self.get([self.fmu.by_reference[int(each)].name])[0])
            for each in variable.sizes
        ]
        return math.prod(sizes)

    def _ctype(self, type: str) -> Any:
        return (_C2 if self.version == 2 else _C)[type]

    def _getter(self, type: str) -> str:
        if type == "Enumeration":
            return "Integer" if self.version == 2 else "Int64"
        return type

    def _encoded(self, variable: Variable, value: Value) -> Any:
        if variable.type == "String":
            return str(value).encode()
        if variable.type == "Enumeration" and isinstance(value, str):
            return self.fmu.items(variable.name)[value]
        return float(value) if variable.is_float else bool(value) if variable.type == "Boolean" else int(value)

    def set(self, values: Mapping[str, Value]) -> int:
        """Set variables, one call for each type; the highest status, after which nothing more is set."""
        groups: dict[str, list[tuple[Variable, list[Any]]]] = {}
        for name, value in values.items():
            variable = self.fmu.variables[name]
            elements = list(_flat(value)) if isinstance(value, (list, tuple)) else [value]
            groups.setdefault(variable.type, []).append((variable, [self._encoded(variable, x) for x in elements]))
        worst = OK
        for type, group in groups.items():
            worst = max(worst, self.set_raw(type, [v for v, _ in group], [x for _, xs in group for x in xs]))
            if worst > WARNING:
                break
        return worst

    def set_raw(self, type: str, variables: Sequence[Variable], values: Sequence[Any]) -> int:
        """One call of a setter."""
        array = (self._ctype(type) * len(values))(*values)
        references, n = _references(variables), c_size_t(len(variables))
        more = () if self.version == 2 or type == "Clock" else (c_size_t(len(values)),)
        return self.call(f"Set{self._getter(type)}", references, n, array, *more)

    def get(self, names: Sequence[str]) -> list[Value]:
        """Values of variables of any type, arrays as flat lists."""
        found: dict[str, Value] = {}
        for type in dict.fromkeys(self.fmu.variables[name].type for name in names):
            chosen = [self.fmu.variables[name] for name in names if self.fmu.variables[name].type == type]
            sizes = [self.size(v) if v.sizes else 1 for v in chosen]
            array = (self._ctype(type) * sum(sizes))()
            references, n = _references(chosen), c_size_t(len(chosen))
            more = () if self.version == 2 or type == "Clock" else (c_size_t(sum(sizes)),)
            self.must(f"Get{self._getter(type)}", references, n, array, *more)
            at = 0
            for variable, size in zip(chosen, sizes, strict=True):
                values = [_decoded(variable.type, array[at + k]) for k in range(size)]
                found[variable.name] = values if variable.sizes else values[0]
                at += size
        return [found[name] for name in names]

    def reader(self, names: Sequence[str]) -> Callable[[], list[Value]]:
        """`get` of these names; fast if all are floats without dimensions."""
        chosen = [self.fmu.variables[name] for name in names]
        if {v.type for v in chosen} - {"Real", "Float64"} or any(v.sizes for v in chosen) or not chosen:
            return lambda: self.get(names)
        array, references, n = (c_double * len(chosen))(), _references(chosen), c_size_t(len(chosen))
        function, handle = self.function(f"Get{chosen[0].type}"), self._handle
        more = () if self.version == 2 else (n,)

        def read() -> list[Value]:
            status = function(handle, references, n, array, *more)
            if status > WARNING:
                raise RefusedError("Get", status, self.log)
            return list(array)

        return read

    def writer(self, names: Sequence[str]) -> Callable[[Sequence[float]], int]:
        """The setter of floats of these names."""
        chosen = [self.fmu.variables[name] for name in names]
        if not chosen:
            return lambda _values: OK
        kind = self._ctype(chosen[0].type)
        array, references, n = (kind * len(chosen))(), _references(chosen), c_size_t(len(chosen))
        function, handle = self.function(f"Set{chosen[0].type}"), self._handle
        more = () if self.version == 2 else (n,)

        def write(values: Sequence[float]) -> int:
            array[:] = values
            return function(handle, references, n, array, *more)

        return write

    def slopes(self, names: Sequence[str], values: Sequence[float]) -> int:
        """The first derivatives of inputs in FMI 2.0."""
        chosen = [self.fmu.variables[name] for name in names]
        orders = (c_int * len(chosen))(*[1] * len(chosen))
        array = (c_double * len(chosen))(*values)
        return self.call("SetRealInputDerivatives", _references(chosen), c_size_t(len(chosen)), orders, array)

    def output_slopes(self, names: Sequence[str]) -> list[float]:
        """The first derivatives of outputs."""
        chosen = [self.fmu.variables[name] for name in names]
        n, array = c_size_t(len(chosen)), (c_double * len(chosen))()
        orders = (c_int * len(chosen))(*[1] * len(chosen))
        if self.version == 2:
            self.must("GetRealOutputDerivatives", _references(chosen), n, orders, array)
        else:
            self.must("GetOutputDerivatives", _references(chosen), n, orders, array, n)
        return list(array)

    # ---- derivatives

    def directional(self, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]) -> list[float]:
        """Directional derivatives."""
        return self._derivatives("Directional", unknowns, knowns, seed, len(unknowns))

    def adjoint(self, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]) -> list[float]:
        """Adjoint derivatives (FMI 3.0)."""
        return self._derivatives("Adjoint", unknowns, knowns, seed, len(knowns))

    def _derivatives(
        self, which: str, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float], count: int
    ) -> list[float]:
        result, given = (c_double * count)(), (c_double * len(seed))(*seed)
        z, v = ([self.fmu.variables[name] for name in names] for names in (unknowns, knowns))
        places = (_references(z), c_size_t(len(z)), _references(v), c_size_t(len(v)))
        more = (given, result) if self.version == 2 else (given, c_size_t(len(seed)), result, c_size_t(count))
        self.must(f"Get{which}Derivative", *places, *more)
        return list(result)

    # ---- saved states

    def save(self) -> c_void_p:
        """A saved state."""
        state = c_void_p()
        self.must("GetFMUstate" if self.version == 2 else "GetFMUState", byref(state))
        return state

    def restore(self, state: c_void_p) -> None:
        """Restore a saved state."""
        self.must("SetFMUstate" if self.version == 2 else "SetFMUState", state)

    def free_state(self, state: c_void_p) -> None:
        """Free a saved state."""
        self.must("FreeFMUstate" if self.version == 2 else "FreeFMUState", byref(state))

    def serialise(self, state: c_void_p) -> bytes:
        """The bytes of a saved state."""
        size = c_size_t()
        two = self.version == 2
        self.must("SerializedFMUstateSize" if two else "SerializedFMUStateSize", state, byref(size))
        buffer = (c_char * size.value)()
        self.must("SerializeFMUstate" if two else "SerializeFMUState", state, buffer, size)
        return bytes(buffer)

    def deserialise(self, data: bytes) -> c_void_p:
        """The saved state of these bytes."""
        state = c_void_p()
        name = "DeSerializeFMUstate" if self.version == 2 else "DeserializeFMUState"
        self.must(name, data, c_size_t(len(data)), byref(state))
        return state

    # ---- co-simulation

    def step(self, t: float, h: float, *, keep: bool = False) -> Step:
        """One communication step; `keep` says that an earlier state may be restored."""
        if self.version == 3:
            event, terminate, early, last = c_bool(), c_bool(), c_bool(), c_double(t)
            arguments = (c_double(t), c_double(h), c_bool(not keep))
            status = self.call("DoStep", *arguments, byref(event), byref(terminate), byref(early), byref(last))
            reached = last.value if early.value or status == DISCARD else t + h
            return Step(status, reached, early.value, event.value, terminate.value)
        status = self.call("DoStep", c_double(t), c_double(h), c_int(not keep))
        if status != DISCARD:
            return Step(status, t + h)
        last, terminated = c_double(t), c_int()
        self.must("GetRealStatus", c_int(TIME_LAST_SUCCESSFUL), byref(last))
        self.call("GetBooleanStatus", c_int(TERMINATED), byref(terminated))
        return Step(status, last.value, terminate=bool(terminated.value))

    def stepper(self) -> Callable[[float, float], Step]:
        """`step`, fast in FMI 2.0."""
        if self.version == 3:
            return self.step
        function, handle, slow = self.function("DoStep"), self._handle, self.step
        function.argtypes = (c_void_p, c_double, c_double, c_int)  # type: ignore[attr-defined]
        done = Step(OK, 0.0)

        def step(t: float, h: float) -> Step:
            status = function(handle, t, h, 1)
            if status == DISCARD:
                last, terminated = c_double(t), c_int()
                self.must("GetRealStatus", c_int(TIME_LAST_SUCCESSFUL), byref(last))
                self.call("GetBooleanStatus", c_int(TERMINATED), byref(terminated))
                return Step(status, last.value, terminate=bool(terminated.value))
            done.status, done.time = status, t + h
            return done

        return step if slow is not None else slow

    # ---- model exchange and event mode

    def update(self) -> Update:
        """One iteration of an event."""
        if self.version == 2:
            info = _EventInfo2()
            self.must("NewDiscreteStates", byref(info))
            following = info.next if info.defined else math.inf
            return Update(bool(info.again), bool(info.terminate), bool(info.changed), following)
        again, terminate, nominals, changed, defined, at = *(c_bool() for _ in range(5)), c_double()
        self.must("UpdateDiscreteStates", *(byref(each) for each in (again, terminate, nominals, changed, defined, at)))
        return Update(again.value, terminate.value, changed.value, at.value if defined.value else math.inf)

    def completed(self) -> tuple[bool, bool]:
        """Whether a completed step of the integrator needs an event, and ends the simulation."""
        kind = c_int if self.version == 2 else c_bool
        event, terminate = kind(), kind()
        self.must("CompletedIntegratorStep", kind(True), byref(event), byref(terminate))
        return bool(event.value), bool(terminate.value)

    def vector(self, function: str, n: int) -> Callable[[], list[float]]:
        """The reader of a vector such as GetDerivatives."""
        array, size, handle, call = (c_double * n)(), c_size_t(n), self._handle, self.function(function)

        def read() -> list[float]:
            status = call(handle, array, size)
            if status > WARNING:
                raise RefusedError(function, status, self.log)
            return list(array)

        return read

    def set_time(self, t: float) -> None:
        """The time of model exchange."""
        self.must("SetTime", c_double(t))

    def set_states(self, x: Sequence[float]) -> None:
        """The continuous states."""
        self.must("SetContinuousStates", (c_double * len(x))(*x), c_size_t(len(x)))

    def interval(self, clock: str) -> float:
        """The interval of a clock (FMI 3.0) [s]."""
        variable = self.fmu.variables[clock]
        value, qualifier = c_double(), c_int()
        self.must("GetIntervalDecimal", _references([variable]), c_size_t(1), byref(value), byref(qualifier))
        return value.value


_LIBC = ctypes.CDLL(None)


def _decoded(type: str, value: Any) -> Value:
    if type == "String":
        return (value or b"").decode()
    return bool(value) if type == "Boolean" else value


def _flat(value: Any) -> Iterable[Any]:
    for each in value:
        if isinstance(each, (list, tuple)):
            yield from _flat(each)
        else:
            yield each
