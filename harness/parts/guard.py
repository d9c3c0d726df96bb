"""Protection against side effects of FMUs: floating-point control, working directory, locale and exit().

An FMU in this process can do anything to it. The harness detects common faults: an FMU compiled with -ffast-math, one
that changes the working directory, one that calls exit(). It cannot protect against a crash, against threads that
outlive the run, or against malicious code.
"""

import atexit
import ctypes
import locale
import logging
import os
import platform
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

from harness.compiling.engine_library import library
from harness.errors import HarnessError
from harness.parts.fmi2 import LOADING
from harness.parts.fmu import FmuPart
from harness.parts.part import Part

_LOG = logging.getLogger("harness")

EXITED: Final = 2  # exit status of a program that an FMU has ended

_AT_EXIT = ctypes.CFUNCTYPE(None)
REMEDY: Final = "correct the FMU; the command check names the call"

_FLOATS: Final = (
    {
        "the rounding mode": 0x0C006000,
        "the treatment of denormal numbers": 0x8040,
        "the precision of the x87 unit": 0x03000000,
        "the trapping of invalid operations": 0x003F1F80,
    }
    if platform.machine().lower() in ("x86_64", "amd64", "i686", "x86")
    else {"the rounding mode": 0x00C00000, "the treatment of denormal numbers": 0x01080003}
)


def described_floats(changed: int) -> str:
    """Return a description of the changed bits of floats.h."""
    words = [name for name, bits in _FLOATS.items() if changed & bits]
    return " and ".join(words) or "the floating-point control"


class Guard:
    """Guard that watches the parts of a system while they are loaded, run and freed."""

    def __init__(self, parts: Sequence[Part]) -> None:
        self._parts = parts
        self.watched = {part.name: part for part in parts if isinstance(part, FmuPart)}
        self.acting: str | None = None
        self._before: _Surroundings | None = None

    def look(self, name: str | None = None) -> None:
        """Restore changed process settings and log a warning."""
        before = self._before
        if before is None or (name is not None and name not in self.watched):
            return
        changed = [*_changed_floats(before), *_changed_folder(before), *_changed_locale(before)]
        if changed:
            who = f"part '{name}'" if name else candidates(self.watched)
            _LOG.warning("%s changed %s of the whole process, now restored: %s", who, " and ".join(changed), REMEDY)

    @contextmanager
    def watching(self, name: str) -> Iterator[None]:
        """Name the part that is called in the block, for messages about this call."""
        self.acting = name
        try:
            yield
        finally:
            self.acting = None
            self.look(name)

    @contextmanager
    def running(self, *, look: bool = True) -> Iterator[None]:
        """Report an FMU that ends the program in the block, and restore all settings at the end of the block."""
        with _sole_use(self._parts):
            if not self.watched:
                yield
                return
            _listen()
            _hear_python()
            self._before = _surroundings() if look else None
            _running.append(self)
            try:
                yield
            finally:
                self.look()
                _running.remove(self)
                self._before = None


_running: list[Guard] = []
_USING: Final = threading.Lock()
_used: set[int] = set()


@contextmanager
def _sole_use(parts: Sequence[Part]) -> Iterator[None]:
    """Reserve parts for the block."""
    names = {id(part): part.name for part in parts}
    with _USING:
        if shared := names.keys() & _used:
            raise HarnessError(
                f"part '{names[min(shared)]}' is in use by another run: wait for its end, or give each thread a system "
                "of its own, such as pickle.loads(pickle.dumps(system))"
            )
        _used.update(names)
    try:
        yield
    finally:
        with _USING:
            _used.difference_update(names)


class _OwnSettings:
    """Working directory and locale that Python code of the program, not an FMU, has chosen last during the runs."""

    folder: str | None = None
    locale: str | None = None


@cache
def _hear_python() -> None:
    """Note each change of working directory or locale by Python code."""

    def hear(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "os.chdir":  # just before the change
            with suppress(OSError, TypeError, ValueError):
                folder = os.path.realpath(arguments[0])
                _OwnSettings.folder = folder if Path(folder).is_dir() else _OwnSettings.folder

    def set_locale(category: int, chosen: Any = None) -> str:
        found: str = low_level(category, chosen)
        if chosen is not None:
            _OwnSettings.locale = low_level(locale.LC_ALL)
        return found

    sys.addaudithook(hear)
    low_level = locale.setlocale.__globals__["_setlocale"]  # there is no event for it
    locale.setlocale.__globals__["_setlocale"] = set_locale


class _Surroundings(NamedTuple):
    """Settings of the process and of the thread."""

    floats: int
    folder: str | None
    locale: str


def _surroundings() -> _Surroundings:
    floats: int = library().engine_float_control()
    for guard in [*_running]:  # FMUs of other threads may have made changes, too
        if guard._before is not None:
            return guard._before._replace(floats=floats)
    with LOADING:
        _OwnSettings.folder = _OwnSettings.locale = None
        return _Surroundings(floats, _folder(), _locale())


def _changed_floats(before: _Surroundings) -> list[str]:
    now: int = library().engine_float_control()
    if now == before.floats:
        return []
    library().engine_set_float_control(before.floats)
    return [described_floats(now ^ before.floats)]


def _changed_folder(before: _Surroundings) -> list[str]:
    if not LOADING.acquire(blocking=False):
        return []  # fmpy has changed it while loading a library in another thread, and will restore it
    try:
        wanted = _OwnSettings.folder or before.folder
        if wanted is None or _folder() == wanted:
            return []
        os.chdir(wanted)
    except OSError:
        return []  # the folder has been removed
    finally:
        LOADING.release()
    return ["the working directory"]


def _changed_locale(before: _Surroundings) -> list[str]:
    wanted = _OwnSettings.locale or before.locale
    if _locale() == wanted:
        return []
    with suppress(locale.Error):
        locale.setlocale(locale.LC_ALL, wanted)
    return ["the locale"]


def candidates(names: Mapping[str, Any] | Sequence[str]) -> str:
    """Return the part that caused an event, or a list of those that may have caused it."""
    quoted = ", ".join(f"'{name}'" for name in names)
    return f"part {quoted}" if len(names) == 1 else f"one of the parts {quoted}"


def _folder() -> str | None:
    try:
        return os.getcwd()  # noqa: PTH109 (a Path would cost more than everything else)
    except OSError:
        return None


def _locale() -> str:
    return locale.setlocale(locale.LC_ALL)


@cache
def _listen() -> Any:
    """Register a callback for C's exit(); Python calls its own atexit functions before this one."""
    function = _AT_EXIT(_at_exit)
    library().engine_at_exit(function)
    atexit.register(library().engine_at_exit, None)
    return function


def _at_exit() -> None:
    """End the program with a message and an exit status that report the lost run."""
    if not _running:
        return
    watched = {name: part for guard in _running for name, part in guard.watched.items()}
    name = _caller(watched) or next((guard.acting for guard in _running if guard.acting), None)
    who = f"part '{name}'" if name else candidates(watched)
    with suppress(Exception):
        sys.stdout.flush()
    text = f"{who} called exit(), which ends the whole program; the run is lost: {REMEDY}\n"
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
    """Return the part whose library called this function; None if the C library cannot tell."""
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
