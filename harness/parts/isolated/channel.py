"""Channel between the harness and the process of an isolated FMU: messages over a socket, values in shared memory.

A message has a header with one byte for its kind and the length of its content. The harness sends CALL with a method
and its arguments (pickled), or a combination of SET, STEP and GET, which act on the shared values. The process answers
with LOG for each message of the FMU (JSON), then with DONE and nothing, a number (JSON) or bytes, or with FAILED and an
error (JSON). The harness never unpickles data from the process, because the FMU may have written them.
"""

import json
import mmap
import pickle
import socket
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from harness.errors import FmuError, HarnessError, PartError, StartValueError, UnknownNameError
from harness.parts.part import Values

SET: Final = 1
STEP: Final = 2
GET: Final = 4
CALL: Final = 8
DONE: Final = 16
FAILED: Final = 17
LOG: Final = 18
BYTES: Final = 19

_FROM_PROCESS: Final = (DONE, FAILED, LOG, BYTES)
_ERRORS: Final = {error.__name__: error for error in (FmuError, StartValueError, UnknownNameError, HarnessError)}
_HEAD: Final = struct.Struct("<BI")


class ChannelEnd:
    """One end of the channel."""

    def __init__(self, end: socket.socket) -> None:
        self.socket = end

    def ask(self, kind: int, content: object = None) -> None:
        """Send a message to the process; None sends no content."""
        self._send(kind, b"" if content is None else pickle.dumps(content))

    def answer(self, kind: int, content: object = None) -> None:
        """Send a message to the harness: None, bytes, or a JSON value."""
        if isinstance(content, bytes):
            self._send(BYTES, content)
        else:
            self._send(kind, b"" if content is None else json.dumps(content).encode())

    def asked(self) -> tuple[int, Any]:
        """Wait for a message from the harness and return its kind and content; errors as for `answered`."""
        kind, data = self._receive()
        return kind, pickle.loads(data) if data else None

    def answered(self) -> tuple[int, Any]:
        """Wait for a message from the process and return its kind and content."""
        kind, data = self._receive()
        if kind not in _FROM_PROCESS:
            raise ValueError(f"a message of kind {kind}")
        if kind == BYTES:
            return DONE, data
        return kind, json.loads(data) if data else None

    def _send(self, kind: int, data: bytes) -> None:
        self.socket.sendall(_HEAD.pack(kind, len(data)) + data)

    def _receive(self) -> tuple[int, bytes]:
        kind, length = _HEAD.unpack(self._exactly(_HEAD.size))
        return kind, self._exactly(length) if length else b""

    def _exactly(self, size: int) -> bytes:
        data = self.socket.recv(size)
        while len(data) < size:
            more = self.socket.recv(size - len(data))
            if not more:
                raise EOFError
            data += more
        return data


def as_plain(error: HarnessError) -> dict[str, Any]:
    """Return an error of the harness as a JSON value."""
    if isinstance(error, PartError):
        return {"part": [error.part, error.function, error.reason, error.time]}
    return {"error": type(error).__name__, "text": str(error)}


def as_error(plain: Mapping[str, Any]) -> HarnessError:
    """Return the error that `as_plain` encoded, or an error with the same text."""
    if "part" in plain:
        part, function, reason, time = plain["part"]
        return PartError(str(part), str(function), str(reason), None if time is None else float(time))
    return _ERRORS.get(plain["error"], HarnessError)(str(plain["text"]))


class Shared:
    """Values in memory shared by both processes."""

    def __init__(self, path: Path, inputs: int, outputs: int) -> None:
        size = 8 * (3 + inputs + outputs)
        with path.open("a+b") as file:
            file.truncate(size)
            memory = mmap.mmap(file.fileno(), size)
        # SET, STEP or GET, and t and h [s] of the step; for single values ten times as fast as an array
        self.head = memoryview(memory)[:24].cast("d")
        values: Values = np.frombuffer(memory, dtype=np.float64)[3:]
        self.u, self.y = values[:inputs], values[inputs:]
