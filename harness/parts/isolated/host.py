"""The code that runs in the process of an isolated FMU."""

import logging
import os
import socket
import threading
from collections.abc import Sequence
from pathlib import Path

from harness.errors import HarnessError, PartError
from harness.parts.fmu import FmuPart
from harness.parts.isolated.channel import CALL, DONE, FAILED, GET, LOG, SET, STEP, ChannelEnd, Shared, as_plain
from harness.parts.part import Calls


def serve(descriptor: int, name: str, path: str) -> None:
    """Serve requests for an FMU until the other end of the channel is closed."""
    threading.Thread(target=_end_with_the_harness, daemon=True).start()
    line = ChannelEnd(socket.socket(fileno=descriptor))
    logger = logging.getLogger("harness")
    logger.setLevel(logging.DEBUG)
    logger.propagate = False
    logger.addHandler(_Forward(line))
    host = _Host(FmuPart(name, path))
    line.answer(DONE)
    while True:
        try:
            kind, content = line.asked()
        except (EOFError, ConnectionError):
            break
        try:
            result = None
            if kind == CALL:
                result = host.call(*content)
            else:
                host.exchange(kind)
            line.answer(DONE, result)
        except HarnessError as error:
            line.answer(FAILED, as_plain(error))
        except Exception as error:
            function = content[0] if kind == CALL else "exchange"
            line.answer(FAILED, as_plain(PartError(name, function, f"{type(error).__name__}: {error}")))
    host.part.close()


class _Host:
    """The FMU with its prepared calls, shared values and saved states."""

    def __init__(self, part: FmuPart) -> None:
        self.part = part
        self._states: list[object] = []

    def call(self, method: str, *arguments: object) -> object:
        """Call a method of this class, or else of the part."""
        result: object = getattr(self if method in _OWN else self.part, method)(*arguments)
        return result

    def exchange(self, kind: int) -> None:
        """Set, step and get, as requested."""
        if kind & SET:
            self._head[0] = SET
            self._calls.set()
        if kind & STEP:
            self._head[0] = STEP
            self._calls.step(self._head[1], self._head[2])
        if kind & GET:
            self._head[0] = GET
            self._calls.get()

    def bind(self, inputs: Sequence[str], outputs: Sequence[str], path: Path) -> None:
        """Connect the FMU to shared values."""
        shared = Shared(path, len(inputs), len(outputs))
        self._head = shared.head
        self._calls: Calls = self.part.bind(inputs, outputs, shared.u, shared.y)

    def save(self, number: int | None) -> int:
        """Save a state, under the number of an earlier one or a new number, and return the number."""
        if number is None:
            number = len(self._states)
            self._states.append(None)
        self._states[number] = self.part.save(self._states[number])
        return number

    def restore(self, number: int) -> None:
        """Return to the state with this number."""
        self.part.restore(self._states[number])


_OWN = ("bind", "save", "restore")


class _Forward(logging.Handler):
    """Log handler that sends messages to the harness."""

    def __init__(self, line: ChannelEnd) -> None:
        super().__init__()
        self._line = line

    def emit(self, record: logging.LogRecord) -> None:
        """Send one message."""
        self._line.answer(LOG, (record.name, record.levelno, record.getMessage()))


def _end_with_the_harness() -> None:
    """End this process when the harness ends, even in an endless loop: stdin is a pipe from the harness."""
    while os.read(0, 1):
        pass
    os._exit(1)
