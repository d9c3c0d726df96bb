"""The process of an isolated FMU, on the side of the harness."""

from __future__ import annotations

import logging
import os
import signal
import socket
import subprocess
import sys
import weakref
from pathlib import Path
from time import monotonic
from typing import Final

from harness.errors import HarnessError
from harness.parts.isolated.channel import FAILED, LOG, Line, as_error
from harness.storage.scratch import ScratchFolder

# Python may start slowly on a busy machine, which is not the fault of the FMU.
_START_TIME: Final = 60.0


class ProcessError(Exception):
    """The process has ended; the text says how, as the end of a sentence."""


class Process:
    """A Python process that serves one FMU, see `harness.parts.isolated.host.serve`.

    Attributes
    ----------
    folder : Path
        Temporary folder of both processes, removed at the end of this one.
    last_message : str
        The last log message of the FMU, quoted if the process dies.
    """

    def __init__(self, name: str, path: Path, timeout: float) -> None:
        """Start the process and wait until it listens."""
        if os.name != "posix":
            raise HarnessError(f"part '{name}' cannot be isolated on {sys.platform}: leave isolate out")
        folder = ScratchFolder("harness-")
        self.folder = Path(folder.name)
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
        self._process, self._line, self._timeout = process, Line(ours), timeout
        self.last_message = ""
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
