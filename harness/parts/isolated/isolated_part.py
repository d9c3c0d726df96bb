"""FMUs in their own process, so that one that crashes or hangs ends its run and not the harness."""

import logging
import os
import signal
import socket
import subprocess
import sys
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import monotonic
from typing import Final

from harness.errors import HarnessError, PartError
from harness.parts.fmu import FmuPart
from harness.parts.isolated.channel import CALL, FAILED, GET, LOG, SET, STEP, ChannelEnd, Shared, as_error
from harness.parts.part import Calls, Native, StartValue, Values
from harness.storage.files import ScratchFolder

# Python may start slowly on a busy machine, which is not the fault of the FMU.
_START_TIME: Final = 60.0


class ProcessError(Exception):
    """The process has ended; the text says how, as the end of a sentence."""


class Process:
    """A Python process that serves one FMU, see `harness.parts.isolated.host.serve`."""

    def __init__(self, name: str, path: Path, timeout: float) -> None:
        if os.name != "posix":
            raise HarnessError(f"part '{name}' cannot be isolated on {sys.platform}: leave isolate out")
        folder = ScratchFolder()
        self.folder = Path(folder.name)  # temporary folder of both processes
        ours, theirs = socket.socketpair()
        arguments = (theirs.fileno(), name, str(path.absolute()))
        # not multiprocessing, whose new processes run the user's script again
        program = (
            f"import sys; sys.path[:] = {sys.path!r}; "
            f"from harness.parts.isolated.host import serve; serve(*{arguments!r})"
        )
        with theirs:
            process = subprocess.Popen(
                [sys.executable, "-c", program],
                stdin=subprocess.PIPE,
                pass_fds=[theirs.fileno()],
                env=os.environ | {"TMPDIR": folder.name},
                process_group=0,  # Ctrl-C goes to the harness only
            )
        self.close = weakref.finalize(self, _end, process, ours, folder, timeout)
        self._process, self._line, self._timeout = process, ChannelEnd(ours), timeout
        self.last_message = ""  # of the FMU, quoted if the process dies
        ours.settimeout(_START_TIME)
        self._answer(_START_TIME)
        ours.settimeout(timeout)

    def ask(self, kind: int, content: object = None) -> object:
        """Send a request and return the answer, see `harness.parts.isolated.channel`."""
        try:
            self._line.ask(kind, content)
        except OSError:
            raise ProcessError(self._how_it_ended()) from None
        return self._answer(self._timeout)

    def _answer(self, timeout: float) -> object:
        deadline = 0.0
        try:
            kind, content = self._line.answered()
            while kind == LOG:
                self._log(*map(str, content))
                deadline = deadline or monotonic() + timeout
                if monotonic() > deadline:
                    raise TimeoutError
                kind, content = self._line.answered()
            failure = as_error(content) if kind == FAILED else None
        except TimeoutError:
            self._kill()
            raise ProcessError(
                f"its process did not answer within {timeout:g} s and was killed{self._said()}"
            ) from None
        except (EOFError, OSError):
            raise ProcessError(self._how_it_ended()) from None
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            self._kill()
            raise ProcessError(f"its process sent an invalid answer and was killed{self._said()}") from None
        except BaseException:
            self._kill()  # interrupted in the middle of a message
            raise
        if failure is not None:
            raise failure
        return content

    def _log(self, logger: str, level: str, text: str) -> None:
        self.last_message = text
        logging.getLogger(logger).log(int(level), "%s", text)

    def _said(self) -> str:
        return f"; it last logged '{self.last_message}'" if self.last_message else ""

    def _kill(self) -> None:
        self._process.kill()
        self.close()

    def _how_it_ended(self) -> str:
        """Return the signal or exit status of a process that closed the channel."""
        try:
            status = self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._kill()
            return f"its process closed the connection{self._said()}"
        self.close()
        if status >= 0:
            return f"its process ended with exit status {status}{self._said()}"
        known = {member.value: member.name for member in signal.Signals}
        text = f"{known.get(-status, f'signal {-status}')} ({signal.strsignal(-status)})"
        return f"its process died of {text}{self._said()}"


def _end(process: subprocess.Popen[bytes], line: socket.socket, folder: ScratchFolder, timeout: float) -> None:
    """Close the channel, give the process time to free the FMU, and remove its temporary files."""
    line.close()
    try:
        process.wait(timeout)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    assert process.stdin is not None
    process.stdin.close()
    folder.cleanup()


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
    """An FMU in its own process, made by `FmuPart` with ``isolate=True``."""

    # Inputs, step and outputs of a communication step are transferred in one exchange. The native engine treats such a
    # part like a Python part. The master newton passes no input derivatives to it.

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
        self._change("exit_initialisation")

    def _change(self, function: str, *arguments: object) -> None:
        """Call a function after which the outputs have other values."""
        self._hand_over()
        self._call(function, *arguments)
        self._due = GET

    def save(self, state: object | None = None) -> object:
        """Copy the state; it stays in the process."""
        self._hand_over()
        return self._call("save", state)

    def restore(self, state: object) -> None:
        """Return to a saved state."""
        self._change("restore", state)

    def event(self, time: float) -> None:
        """Take the event at this time, as the next step does."""
        self._change("event", time)

    def serialise(self) -> bytes:
        """Return the state from fmi2SerializeFMUstate."""
        self._hand_over()
        data = self._call("serialise")
        assert isinstance(data, bytes)
        return data

    def deserialise(self, data: bytes) -> None:
        """Return to a state from `serialise`."""
        self._change("deserialise", data)

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
