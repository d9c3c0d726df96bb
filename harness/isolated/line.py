"""The line between the harness and the process of an isolated FMU: messages over a socket, values in shared memory.

A message has a head of one byte and the length of what follows, a pickled object or nothing. The harness sends CALL
with a method and its arguments, or which of SET, STEP and GET are to be done on the shared values; the process answers
DONE with the result or FAILED with an exception, before that LOG for every message of the FMU.
"""

from __future__ import annotations

import mmap
import pickle
import socket
import struct
from pathlib import Path
from typing import Any, Final

import numpy as np

from harness.part import Values

SET: Final = 1
STEP: Final = 2
GET: Final = 4
CALL: Final = 8
DONE: Final = 16
FAILED: Final = 17
LOG: Final = 18

_HEAD: Final = struct.Struct("<BI")


class Line:
    """One end of the line.

    Parameters
    ----------
    end : socket.socket
        Connected to the other end.
    """

    def __init__(self, end: socket.socket) -> None:
        """Take the socket over."""
        self.socket = end

    def send(self, kind: int, content: object = None) -> None:
        """Send a message; a content of None is not sent."""
        data = b"" if content is None else pickle.dumps(content)
        self.socket.sendall(_HEAD.pack(kind, len(data)) + data)

    def receive(self) -> tuple[int, Any]:
        """Wait for a message: its kind and content.

        Raises
        ------
        EOFError
            If the other end is closed.
        TimeoutError
            If nothing comes in the time that the socket waits.
        """
        kind, length = _HEAD.unpack(self._exactly(_HEAD.size))
        return kind, pickle.loads(self._exactly(length)) if length else None

    def _exactly(self, size: int) -> bytes:
        data = self.socket.recv(size)
        while len(data) < size:
            more = self.socket.recv(size - len(data))
            if not more:
                raise EOFError
            data += more
        return data


class Shared:
    """Values that both processes see.

    Parameters
    ----------
    path : Path
        The file that is mapped.
    inputs, outputs : int
        How many values there are.

    Attributes
    ----------
    head : memoryview of 3 doubles
        What is being done (SET, STEP or GET), and t and h [s] of the step.
    u, y : float64 array, shapes (inputs,) and (outputs,)
        The values.
    """

    def __init__(self, path: Path, inputs: int, outputs: int) -> None:
        """Map the file; make it if it is not there."""
        size = 8 * (3 + inputs + outputs)
        with path.open("a+b") as file:
            file.truncate(size)
            memory = mmap.mmap(file.fileno(), size)
        self.head = memoryview(memory)[:24].cast("d")  # ten times as fast for single values as an array
        values: Values = np.frombuffer(memory, dtype=np.float64)[3:]
        self.u, self.y = values[:inputs], values[inputs:]
