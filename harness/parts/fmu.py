"""Parts that are FMUs."""

from __future__ import annotations

import ctypes
import math
import struct
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from harness.errors import HarnessError, PartError, StartValueError, not_whole
from harness.extras import MODELS
from harness.parts.archive import Archive, open_archive
from harness.parts.flat_description import stated_sizes
from harness.parts.fmi2 import DO_STEP, Instance, Library, State, exchanges
from harness.parts.fmi3 import Instance3, Library3
from harness.parts.integrator import TOLERANCE, Integrator
from harness.parts.part import Calls, Native, Part, Port, StartValue, Values
from harness.values import shown

_TIME = struct.Struct("<d")


class ExchangeInstance(Instance):
    """One instance of an FMU for model exchange, which steps like one for co-simulation."""

    def __init__(self, library: Library, archive: Archive, name: str) -> None:
        super().__init__(library, archive, name)
        description = archive.description
        needed = {"CompletedIntegratorStep": archive.interface.needsCompletedIntegratorStep}
        try:
            self._integrator = Integrator(
                self.component,
                {name: address * needed.get(name, True) for name, address in library.addresses.items()},
                tuple(_state_name(unknown.variable) for unknown in description.derivatives),
                int(description.numberOfEventIndicators or 0),
                sum(
                    variable.type == "Real" and variable.causality == "input" for variable in archive.variables.values()
                ),
            )
        except BaseException:
            self.release()
            raise
        self.stepped = ctypes.addressof(self._integrator.data)
        self.functions = self._integrator.functions
        self.do_step = DO_STEP(self.functions["DoStep"])
        self.set_, self.get = exchanges(self.functions)
        self.interpolates = True

    def begin(self, time: float, tolerance: float | None) -> None:
        """Leave initialisation mode and let the discrete states settle."""
        super().begin(time, tolerance)
        status = self._integrator.begin(time, tolerance)
        if status > 1:
            raise self.failure("fmi2DoStep", status)

    def event(self, time: float) -> None:
        """Take the event at this time, as the next step does."""
        status = self._integrator.event(time)
        if status > 1:
            raise self.failure("fmi2DoStep", status, time)

    def reset(self) -> bool:
        """Return the instance to its initial state; it is in no mode of a run then."""
        self._integrator.data.continuous = 0
        return super().reset()

    def save(self, state: State) -> None:
        """Copy the state and the time."""
        state.time = float(self._integrator.data.time)
        self._enter_events()
        super().save(state)

    def restore(self, state: State) -> None:
        """Return to a saved state and its time."""
        self._enter_events()
        super().restore(state)
        self._integrator.data.time = state.time

    def serialised(self, state: State) -> bytes:
        """Return a saved state as bytes, beginning with the time."""
        return _TIME.pack(state.time) + super().serialised(state)

    def deserialise(self, state: State, data: bytes) -> None:
        """Make a saved state of bytes from `serialised`."""
        if len(data) < _TIME.size:
            raise PartError(self.name, "deserialise", f"the state has {len(data)} bytes and belongs to another part")
        (state.time,) = _TIME.unpack(data[: _TIME.size])
        super().deserialise(state, data[_TIME.size :])

    def _enter_events(self) -> None:
        status = self._integrator.enter_events()
        if status > 1:
            raise self.failure("fmi2DoStep", status)

    def failure(self, function: str, status: int, time: float | None = None) -> PartError:
        """Return the error for a failed call; for a step, with the cause and its time."""
        if function != "fmi2DoStep":
            return super().failure(function, status, time)
        cause = self._integrator.failure()
        error = super().failure(cause.function, cause.status, cause.time)
        return PartError(self.name, cause.function, cause.reason, cause.time) if cause.reason else error

    def release(self) -> None:
        """Free the solver and the instance; further calls have no effect."""
        super().release()
        if hasattr(self, "_integrator"):
            self._integrator.close()


def _state_name(derivative: object) -> str:
    """Return the name of the state that has this derivative."""
    state = getattr(derivative, "derivative", None)
    return str(getattr(state, "name", None) or getattr(derivative, "name", derivative))


class FmuPart(Part):
    """A part that is an FMI 2.0 FMU, or an FMI 3.0 FMU for co-simulation.

    The file is checked immediately. It is unpacked to a temporary folder at the start of its first run. An FMU that
    offers model exchange only is integrated by the harness, see `harness.parts.integrator`.

    Parameters
    ----------
    name : str
        Name within the system.
    path : path-like
        The .fmu file, or the name of a model such as ``"LuGre"`` if a package with models is imported.
    every : int
        Sample time in communication steps.
    model : str or None
        Model name by which the file was found; a system file then contains this name instead of the path.

    Attributes
    ----------
    keep : object
        An object that lives as long as the part, such as the temporary folder that contains the file.
    reuse : bool
        Whether the next run resets the instance with fmi2Reset instead of making a new one. The default is False.

    Raises
    ------
    FmuError
        If the file cannot be used, see `open_archive`.
    """

    def __init__(
        self,
        name: str,
        path: str | Path,
        *,
        every: int = 1,
        model: str | None = None,
    ) -> None:
        self.name = name
        self.keep: object = None
        self.path, self.model = Path(path), model
        if MODELS and model is None and isinstance(path, str) and path.isidentifier() and not self.path.is_file():
            self.path, self.model = MODELS[0](path), path
        self.every = every
        self.reuse = False
        self._sizes: dict[str, int] = {}
        self._describe(open_archive(self.path))
        self._library: Library | None = None
        self.instance: Instance | None = None
        self._idle: Instance | None = None
        self._start = 0.0
        self._tolerance: float | None = None
        self._states: list[State] = []

    def _describe(self, archive: Archive) -> None:
        """Store what the description says."""
        self.archive, ports, variables = archive, archive.ports, archive.variables
        self.others = {} if archive.flat is None else archive.flat.others
        numeric = [name for name in ports if ports[name].type != "String"]
        self.inputs = tuple(ports[name] for name in numeric if variables[name].causality == "input")
        self.outputs = tuple(ports[name] for name in numeric if variables[name].causality == "output")
        self.parameters = tuple(
            port
            for name, port in ports.items()  # a String input is set once, like a parameter
            if _is_parameter(variables[name]) or (variables[name].causality == "input" and port.type == "String")
        )
        self.observables = tuple(
            ports[name] for name in numeric if variables[name].causality not in ("input", "output")
        )
        self.dependencies, self.undeclared = archive.feedthrough()
        self.integrals = archive.integrals()
        self.strict = "strict" in archive.traits
        self.saves = bool(self.archive.interface.canGetAndSetFMUstate)
        self.events = archive.exchange or bool(archive.flat is not None and archive.flat.clocks)
        self.identity = str(self.archive.description.guid)
        self.follows = archive.exchange
        self.sampled = bool(self.outputs) and all(port.held for port in self.outputs)

    def inner_tolerance(self, given: float | None) -> float:
        """Return the tolerance of the run, or that of the default experiment, for a third-party FMU."""
        stated = float(getattr(self.archive.description.defaultExperiment, "tolerance", None) or 0.0)
        return 0.0 if self.strict else given or (TOLERANCE if self.archive.exchange else stated)

    def resize(self, start: Mapping[str, StartValue]) -> None:
        """Give arrays of an FMI 3.0 FMU the sizes that these values of structural parameters state."""
        sizes = stated_sizes(self.archive.flat, self.name, start)
        if sizes == self._sizes:
            return
        self._describe(open_archive(self.path, sizes))
        self._sizes = sizes
        if self._idle is not None:  # its arrays have other sizes
            self._idle.release()
            self._idle = None

    def enter_initialisation(
        self, start: float, stop: float, tolerance: float | None, values: Mapping[str, StartValue]
    ) -> None:
        """Instantiate or reset the FMU, set its start values and enter initialisation mode."""
        self.terminate()
        self.resize(values)
        three = self.archive.flat is not None
        if self._library is None:
            self._library = (Library3 if three else Library)(self.archive, self.name)
        kind = ExchangeInstance if self.archive.exchange else Instance3 if three else Instance
        instance = self.instance = self._idle or kind(self._library, self.archive, self.name)
        self._idle = None
        self._start, self._tolerance = start, tolerance
        sizes = self.archive.flat.structural if self.archive.flat is not None else {}
        if isinstance(instance, Instance3):
            instance.preload(values)
        for name in sorted(values, key=lambda name: name not in sizes):  # sizes of arrays before their values
            self._set_start(instance, self.archive.ports[name], values[name])
        known = math.isfinite(stop)
        instance.call("SetupExperiment", tolerance is not None, tolerance or 0.0, start, known, stop if known else 0.0)
        instance.call("EnterInitializationMode")

    def bind(self, inputs: Sequence[str], outputs: Sequence[str], u: Values, y: Values) -> Calls:
        """Prepare the FMI calls; Reals are copied directly between the FMU and the signal vector."""
        instance = self._started()
        setters = [self._exchange(instance.set_, "Set", *block) for block in self._blocks(inputs, u)]
        getters = [self._exchange(instance.get, "Get", *block) for block in self._blocks(outputs, y)]
        do_step, component = instance.do_step, instance.stepped

        def step(t: float, h: float) -> None:
            # the last argument, noSetFMUStatePriorToCurrentPoint, is true in all common importers
            status = do_step(component, t, h, 1)
            if status > 1:
                raise instance.failure("fmi2DoStep", status, t)

        return Calls(_sequence(setters), step, _sequence(getters), instance)

    def native(self, inputs: Sequence[str], outputs: Sequence[str]) -> Native | None:
        """Return the addresses of the instance and of the functions of its library."""
        instance, variables = self._started(), self.archive.variables
        functions, set_, get = instance.routes(
            *([variables[name].valueReference for name in names] for names in (inputs, outputs))
        )
        return Native(
            instance.stepped,
            instance.inner,
            functions,
            set_,
            get,
            instance.interpolates and "SetRealInputDerivatives" in functions,
            self.saves,
            instance.failure,
        )

    def exit_initialisation(self) -> None:
        """Leave initialisation mode."""
        self._started().begin(self._start, self._tolerance)

    def save(self, state: object | None = None) -> object:
        """Copy the state of the FMU with fmi2GetFMUstate."""
        if not self.saves:
            raise PartError(self.name, "fmi2GetFMUstate", "this FMU declares that it cannot save its state")
        if not isinstance(state, State):
            state = State()
            self._states.append(state)
        self._started().save(state)
        return state

    def restore(self, state: object) -> None:
        """Return to a saved state with fmi2SetFMUstate."""
        assert isinstance(state, State)
        if state not in self._states:
            raise PartError(self.name, "fmi2SetFMUstate", "this state belongs to another run; save it again")
        self._started().restore(state)

    def event(self, time: float) -> None:
        """Take the event at this time, as the next step does."""
        instance = self._started()
        assert isinstance(instance, (ExchangeInstance, Instance3))
        instance.event(time)

    def serialise(self) -> bytes:
        """Return the state from fmi2SerializeFMUstate."""
        if not self.archive.interface.canSerializeFMUstate:
            raise PartError(self.name, "fmi2SerializeFMUstate", "this FMU declares that it cannot serialise its state")
        state = self.save()
        assert isinstance(state, State)
        data = self._started().serialised(state)
        self._free(state)
        return data

    def deserialise(self, data: bytes) -> None:
        """Return to a state from `serialise`."""
        state = State()
        self._states.append(state)
        self._started().deserialise(state, data)
        self.restore(state)
        self._free(state)

    def _free(self, state: State) -> None:
        self._started().free(state)
        self._states.remove(state)

    def terminate(self) -> None:
        """Free the saved states and, unless the next run reuses it, the instance."""
        if self.instance is not None:
            for state in self._states:
                self.instance.function("FreeFMUstate")(self.instance.component, ctypes.byref(state.pointer))
            if self.reuse and self.instance.reset():
                self._idle = self.instance
            else:
                self.instance.release()
        elif self._idle is not None and not self.reuse:
            self._idle.release()
            self._idle = None
        self._states.clear()
        self.instance = None

    def close(self) -> None:
        """Free the instance, unload the library and remove the temporary folder."""
        self.reuse, reuse = False, self.reuse
        self.terminate()
        self.reuse = reuse
        if self._library is not None:
            self._library.close()
            self._library = None

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the arguments: a copy in another process is made from the same file."""
        make = partial(FmuPart, every=self.every, model=self.model)
        return make, (self.name, self.path.absolute())

    @property
    def folder(self) -> Path | None:
        """Folder to which the FMU is unpacked; None before the first run."""
        return None if self._library is None else self._library.folder

    def _started(self) -> Instance:
        if self.instance is None:
            raise HarnessError(f"part '{self.name}' is not running: call enter_initialisation first")
        return self.instance

    def _set_start(self, instance: Instance, port: Port, value: StartValue) -> None:
        """Set one start value in a separate call, so that the message can name a rejected value."""
        reference = (ctypes.c_uint * 1)(self.archive.variables[port.name].valueReference)
        try:
            buffer: Any
            if port.type == "String":
                buffer = (ctypes.c_char_p * 1)(_text(value))
            elif port.type == "Real":
                buffer = (ctypes.c_double * 1)(float(value))
            else:
                buffer = (ctypes.c_int * 1)(_whole(value))
                if port.items and value != port.start and value not in {number for _, number in port.items}:
                    known = ", ".join(f"{number} ({item})" for item, number in port.items[:10])
                    raise StartValueError(f"start value {value} of {self.name}.{port.name} is no item: give {known}")
        except (TypeError, ValueError, OverflowError) as error:
            raise StartValueError(
                f"start value {shown(value)} of {self.name}.{port.name} is not of type {port.type}: give a value of "
                "this type"
            ) from error
        try:
            instance.last_message = ""
            instance.call(f"Set{port.type}", reference, 1, buffer)
        except PartError as error:
            raise StartValueError(
                f"{self.name} rejected the start value {shown(value)} of {port.name}: {error.reason}; "
                "give a value in the range that its model description states"
            ) from error

    def _blocks(self, names: Sequence[str], values: Values) -> list[tuple[str, list[int], Values]]:
        """Split names and values by type: (type, value references, view of the values)."""
        blocks: list[tuple[str, list[int], Values]] = []
        for index, name in enumerate(names):
            kind = self.archive.ports[name].type
            first = index - len(blocks[-1][1]) if blocks and blocks[-1][0] == kind else index
            references = [self.archive.variables[other].valueReference for other in names[first : index + 1]]
            blocks = [*(blocks[:-1] if first < index else blocks), (kind, references, values[first : index + 1])]
        return blocks

    def _exchange(
        self, functions: Mapping[str, Callable[..., int]], verb: str, kind: str, references: list[int], values: Values
    ) -> Callable[[], None]:
        """Return one prepared call of fmi2SetXXX or fmi2GetXXX."""
        instance = self._started()
        function, component, count = functions[kind], instance.stepped, len(references)
        vrs = (ctypes.c_uint * count)(*references)
        numbers: Any = (ctypes.c_double if kind == "Real" else ctypes.c_int) * count
        buffer = numbers.from_buffer(values) if kind == "Real" else numbers()
        vrs_address, buffer_address = ctypes.addressof(vrs), ctypes.addressof(buffer)

        def exchange() -> None:
            status = function(component, vrs_address, count, buffer_address)
            if status > 1:
                raise instance.failure(f"fmi2{verb}{kind}", status)

        def set_whole() -> None:
            try:
                for index in range(count):
                    buffer[index] = _whole(values[index]) if kind == "Integer" else int(values[index] != 0)
            except (ValueError, OverflowError) as error:
                raise not_whole(self.name) from error
            exchange()

        def get_whole() -> None:
            exchange()
            for index in range(count):
                values[index] = buffer[index]

        # the addresses are plain integers, so the arrays must live as long as the function that uses them
        exchange.arrays = (vrs, buffer, values)  # type: ignore[attr-defined]
        if kind == "Real":
            return exchange
        return set_whole if verb == "Set" else get_whole


def _whole(value: StartValue) -> int:
    """Return an Integer or Boolean value as an int; raise an error if it is not one or has more than 32 bits."""
    if isinstance(value, str) or value != int(value) or not -(1 << 31) <= value < 1 << 31:
        raise ValueError(value)
    return int(value)


def _text(value: StartValue) -> bytes:
    """Return a text as C bytes; raise an error if it is not a text or contains a NUL."""
    if not isinstance(value, str) or "\0" in value:
        raise ValueError(value)
    return value.encode()


def _sequence(calls: list[Callable[[], None]]) -> Callable[[], None]:
    """Return a function that performs several calls."""
    if len(calls) == 1:
        return calls[0]

    def call_all() -> None:
        for call in calls:
            call()

    return call_all


def _is_parameter(variable: Any) -> bool:
    """Return whether a start value may be set before initialisation (FMI 2.0, 2.2.7); inputs are excluded."""
    return variable.causality not in {"input", "independent"} and (
        variable.variability != "constant" and variable.initial in {"exact", "approx"}
    )
