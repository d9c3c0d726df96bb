"""What an FMU can change for the whole process, put back: floating-point control, working directory, locale, exit.

An FMU in this process can do anything to it. The harness looks for the accidents that happen: an FMU compiled with
-ffast-math, one that changes to its own folder, one that calls exit(). It cannot guard against a crash, against threads
that outlive the run, or against malice.
"""

from __future__ import annotations

import atexit
import ctypes
import locale
import logging
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

from harness.engine.floats import described_floats
from harness.engine.native import library
from harness.parts.fmi2 import LOADING
from harness.parts.fmu import FmuPart
from harness.parts.part import Part

_LOG = logging.getLogger("harness")

EXITED: Final = 2
"""Status of a program that an FMU has ended."""

_AT_EXIT = ctypes.CFUNCTYPE(None)
_ISOLATE: Final = "run it in a process of its own (isolate = true)"


class Guard:
    """Watches the parts of a system while they are loaded, run and freed.

    Parameters
    ----------
    parts : iterable of Part
        Those that are FMUs in this process are watched.
    """

    def __init__(self, parts: Sequence[Part]) -> None:
        """Find them."""
        self.watched = {part.name: part for part in parts if isinstance(part, FmuPart) and not part.isolate}
        self.acting: str | None = None
        self._before: _Surroundings | None = None

    def look(self, name: str | None = None) -> None:
        """Put back what has been changed since, and say so.

        Parameters
        ----------
        name : str or None
            The part that has done it; None: it may have been any of them.
        """
        before = self._before
        if before is None or (name is not None and name not in self.watched):
            return
        changed = [*_changed_floats(before), *_changed_folder(before), *_changed_locale(before)]
        if changed:
            who = f"part '{name}'" if name else candidates(self.watched)
            _LOG.warning("%s changed %s of the whole process, now put back: %s", who, " and ".join(changed), _ISOLATE)

    @contextmanager
    def watching(self, name: str) -> Iterator[None]:
        """Name the part that is called in the block, if something happens in it."""
        self.acting = name
        try:
            yield
        finally:
            self.acting = None
            self.look(name)

    @contextmanager
    def running(self, *, look: bool = True) -> Iterator[None]:
        """Say who did it if an FMU ends the program in the block, and put everything back at its end.

        Parameters
        ----------
        look : bool
            Whether to put things back; it takes some 10 us.
        """
        if not self.watched:
            yield
            return
        _listen()
        self._before = _surroundings() if look else None
        _running.append(self)
        try:
            yield
        finally:
            self.look()
            _running.remove(self)
            self._before = None


_running: list[Guard] = []


class _Surroundings(NamedTuple):
    """What belongs to the whole process, or to the thread."""

    floats: int
    folder: str | None
    locale: str


def _surroundings() -> _Surroundings:
    floats: int = library().engine_float_control()
    for guard in [*_running]:  # of other threads, whose FMUs may have changed something by now
        if guard._before is not None:
            return guard._before._replace(floats=floats)
    with LOADING:
        return _Surroundings(floats, _folder(), _locale())


def _changed_floats(before: _Surroundings) -> list[str]:
    now: int = library().engine_float_control()
    if now == before.floats:
        return []
    library().engine_set_float_control(before.floats)
    return [described_floats(now ^ before.floats)]


def _changed_folder(before: _Surroundings) -> list[str]:
    if not LOADING.acquire(blocking=False):
        return []  # fmpy has changed it while it loads a library in another thread, and will change it back
    try:
        if before.folder is None or _folder() == before.folder:
            return []
        os.chdir(before.folder)
    except OSError:
        return []  # somebody has removed it
    finally:
        LOADING.release()
    return ["the working directory"]


def _changed_locale(before: _Surroundings) -> list[str]:
    if _locale() == before.locale:
        return []
    with suppress(locale.Error):
        locale.setlocale(locale.LC_ALL, before.locale)
    return ["the locale"]


def candidates(names: Mapping[str, Any] | Sequence[str]) -> str:
    """Return the one that must have been it, or all that may have been."""
    quoted = ", ".join(f"'{name}'" for name in names)
    return f"part {quoted}" if len(names) == 1 else f"one of the parts {quoted}"


def _folder() -> str | None:
    try:
        return os.getcwd()  # noqa: PTH109 (a Path costs more than all the rest)
    except OSError:
        return None


def _locale() -> str:
    return locale.setlocale(locale.LC_ALL)


@cache
def _listen() -> Any:
    """Be called when C's exit() is, but not at the end of Python, which comes to its own atexit first."""
    function = _AT_EXIT(_at_exit)
    library().engine_at_exit(function)
    atexit.register(library().engine_at_exit, None)
    return function


def _at_exit() -> None:
    """End the program with a sentence and a status that say that its run is lost."""
    if not _running:
        return
    watched = {name: part for guard in _running for name, part in guard.watched.items()}
    name = _caller(watched) or next((guard.acting for guard in _running if guard.acting), None)
    who = f"part '{name}'" if name else candidates(watched)
    with suppress(Exception):
        sys.stdout.flush()
    text = f"{who} called exit(), which ends the whole program, and its run is lost: {_ISOLATE}\n"
    os.write(2, text.encode())
    os._exit(EXITED)


class _Symbol(ctypes.Structure):
    """``Dl_info`` of dlfcn.h."""

    _fields_ = (
        ("file", ctypes.c_char_p),
        ("base", ctypes.c_void_p),
        ("name", ctypes.c_char_p),
        ("address", ctypes.c_void_p),
    )


def _caller(parts: Mapping[str, FmuPart]) -> str | None:
    """The part from whose library this function was reached; None where the C library cannot tell."""
    folders = {part.folder: name for name, part in parts.items() if part.folder is not None}
    for file in _files_on_the_stack():
        name = next((name for folder, name in folders.items() if file.is_relative_to(folder)), None)
        if name is not None:
            return name
    return None


def _files_on_the_stack() -> list[Path]:
    addresses, files = (ctypes.c_void_p * 256)(), []
    try:
        system = ctypes.CDLL(None)
        count = system.backtrace(addresses, len(addresses))
        for address in addresses[:count]:
            symbol = _Symbol()
            if system.dladdr(ctypes.c_void_p(address), ctypes.byref(symbol)) and symbol.file:
                files.append(Path(os.fsdecode(symbol.file)))
    except (AttributeError, OSError, TypeError):  # no backtrace() in this C library
        return []
    return files
