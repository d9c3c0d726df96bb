"""FMUs in their own process, so that one that crashes or hangs ends its run and not the harness."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from typing import Final

from harness.errors import HarnessError, PartError
from harness.parts.fmu import FmuPart
from harness.parts.isolated.channel import CALL, GET, SET, STEP, Shared
from harness.parts.isolated.process import Process, ProcessError
from harness.parts.part import Calls, Native, StartValue, Values

_LOG = logging.getLogger("harness")

_FUNCTIONS: Final = {
    "enter_initialisation": "its initialisation",
    "exit_initialisation": "fmi2ExitInitializationMode",
    "save": "fmi2GetFMUstate",
    "restore": "fmi2SetFMUstate",
    "serialise": "fmi2SerializeFMUstate",
    "deserialise": "fmi2DeSerializeFMUstate",
    "terminate": "fmi2FreeInstance",
}
_EXCHANGES: Final = {SET: "fmi2SetXXX", STEP: "fmi2DoStep", GET: "fmi2GetXXX"}


class IsolatedPart(FmuPart):
    """An FMU in its own process, made by `FmuPart` with ``isolate=True``.

    Inputs, step and outputs of a communication step are transferred in one exchange. The native engine treats such a
    part like a Python part. The master newton passes no input derivatives to it.
    """

    _process: Process | None = None
    _shared: Shared
    _due = 0  # SET: the inputs have not been sent yet; GET: the outputs have not been fetched yet

    def enter_initialisation(
        self, start: float, stop: float, tolerance: float | None, values: Mapping[str, StartValue]
    ) -> None:
        """Start the process if necessary, and instantiate the FMU in it."""
        if self._process is None:
            try:
                self._process = Process(self.name, self.path, self.timeout)
            except ProcessError as error:
                raise PartError(self.name, "the start of its process", str(error)) from None
        self._process.last_message = ""
        self._due = 0
        self._call("enter_initialisation", start, stop, tolerance, dict(values))

    def bind(self, inputs: Sequence[str], outputs: Sequence[str], u: Values, y: Values) -> Calls:
        """Share the values with the process."""
        path = self._started_process().folder / "values"
        shared = self._shared = Shared(path, len(inputs), len(outputs))
        self._call("bind", list(inputs), list(outputs), path)
        path.unlink()
        self._due = GET

        def set_() -> None:
            shared.u[:] = u
            self._due = SET | GET

        def step(t: float, h: float) -> None:
            shared.head[1], shared.head[2] = t, h
            self._ask(self._due | STEP | GET, t)

        def get() -> None:
            if self._due:
                self._ask(self._due)
            y[:] = shared.y

        return Calls(set_, step, get)

    def native(self, inputs: Sequence[str], outputs: Sequence[str]) -> Native | None:
        """Return None: there are no addresses in another process."""
        return None

    def exit_initialisation(self) -> None:
        """Leave initialisation mode."""
        self._hand_over()
        self._call("exit_initialisation")
        self._due = GET

    def save(self, state: object | None = None) -> object:
        """Copy the state; it stays in the process."""
        self._hand_over()
        return self._call("save", state)

    def restore(self, state: object) -> None:
        """Return to a saved state."""
        self._hand_over()
        self._call("restore", state)
        self._due = GET

    def serialise(self) -> bytes:
        """Return the state from fmi2SerializeFMUstate."""
        self._hand_over()
        data = self._call("serialise")
        assert isinstance(data, bytes)
        return data

    def deserialise(self, data: bytes) -> None:
        """Return to a state from `serialise`."""
        self._hand_over()
        self._call("deserialise", data)
        self._due = GET

    def terminate(self) -> None:
        """Free the instance; the process stays for the next run."""
        if self._process is not None:
            try:
                self._call("terminate")
            except PartError as error:
                _LOG.warning("%s", error)  # the run is over and its result is valid

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.close()
            self._process = None

    def _started_process(self) -> Process:
        if self._process is None:
            raise HarnessError(f"part '{self.name}' is not running: call enter_initialisation first")
        return self._process

    def _hand_over(self) -> None:
        if self._due & SET:
            self._ask(SET)
            self._due = GET

    def _ask(self, kind: int, time: float | None = None) -> None:
        try:
            self._started_process().ask(kind)
        except ProcessError as error:
            self._process = None
            function = _EXCHANGES.get(int(self._shared.head[0]), "the exchange of values")
            raise PartError(self.name, function, str(error), time) from None
        self._due = 0

    def _call(self, method: str, *arguments: object) -> object:
        try:
            return self._started_process().ask(CALL, (method, *arguments))
        except ProcessError as error:
            self._process = None
            raise PartError(self.name, _FUNCTIONS.get(method, method), str(error)) from None
