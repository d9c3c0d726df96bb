"""One FMI 2.0 instance: its loaded library, its log, its saved states, and the status of every call."""

import ctypes
import logging
import math
import os
import threading
import weakref
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, TypeAlias

import fmpy
import fmpy.fmi2

from harness.compiling.platforms import missing_bytes
from harness.errors import ENDED, FmuError, PartError
from harness.parts.archive import Archive
from harness.parts.integrator import FUNCTIONS, address_of
from harness.storage.files import FULL, ScratchFolder
from harness.storage.zip_file import ZipError, open_zip, unpack_zip

_DISCARD, FATAL = 2, 4
_LAST_SUCCESSFUL_TIME: Final = 2
_TERMINATED: Final = 3  # of fmi2StatusKind

_STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
_LEVEL = (logging.DEBUG, logging.WARNING, logging.WARNING, logging.ERROR, logging.CRITICAL, logging.DEBUG)
_CATEGORIES = ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")

_COMMON = (
    *("SetReal", "SetInteger", "SetBoolean", "GetReal", "GetInteger", "GetBoolean"),
    *("GetFMUstate", "SetFMUstate", "FreeFMUstate"),
)

LOADING = threading.Lock()  # guards the working directory of all threads, which fmpy changes to load a library

DIRECT_VERSION: Final = 2  # of direct.h

_POINTER = ctypes.c_void_p
_REAL = ctypes.c_double
_INT = ctypes.c_int
_EXCHANGE: Any = ctypes.CFUNCTYPE(_INT, _POINTER, _POINTER, ctypes.c_size_t, _POINTER)
DO_STEP: Final = ctypes.CFUNCTYPE(_INT, _POINTER, _REAL, _REAL, _INT)  # fmi2DoStep, addresses as integers


class Library:
    """An unpacked FMU with its loaded shared library."""

    # Each part has its own copy, so that an FMU with static variables can be used in several parts.

    def __init__(self, archive: Archive, name: str) -> None:
        folder = ScratchFolder()
        self.folder = Path(folder.name)
        with LOADING:
            try:
                here: Path | None = Path.cwd()
            except FileNotFoundError:  # the file has been removed
                here = None
            try:
                with open_zip(archive.path) as members:
                    unpack_zip(members, Path(folder.name), ("sources/", "documentation/"))
                _refuse_truncated(Path(folder.name) / "binaries" / archive.platform)
                self._load(archive, name, folder.name)
            except BaseException as error:
                folder.cleanup()
                if not isinstance(error, Exception):
                    raise
                if isinstance(error, ZipError):
                    raise FmuError(f"cannot unpack {archive.path}: {error}") from error
                if isinstance(error, OSError) and error.errno in FULL:
                    reason = f"cannot unpack {archive.path} to {folder.name}: {error.strerror}"
                    raise FmuError(f"{reason}; make room there, or set TMPDIR to another folder") from error
                reason = " ".join(str(error).split())
                lacks = "cannot open shared object file" in reason
                remedy = "install the library that it names" if lacks else "export it again for this platform"
                raise FmuError(f"cannot load {archive.path}: {reason}; {remedy}") from error
            finally:
                if here is not None:
                    os.chdir(here)  # fmpy changes to the folder of the library and stays there when loading fails
        self.close = weakref.finalize(self, _unload, self.slave.dll._handle, folder)

    def _load(self, archive: Archive, name: str, folder: str) -> None:
        self.slave: Any = (fmpy.fmi2.FMU2Model if archive.exchange else fmpy.fmi2.FMU2Slave)(
            instanceName=name,
            guid=archive.description.guid,
            modelIdentifier=archive.interface.modelIdentifier,
            unzipDirectory=folder,
        )
        own = FUNCTIONS if archive.exchange else ("DoStep", "SetRealInputDerivatives")
        self.addresses = {name: address_of(self.slave.dll, f"fmi2{name}") for name in (*_COMMON, *own)}
        if not archive.exchange and (direct := _direct_calls(self.slave.dll)):
            self.addresses["blockDirect"] = direct


def _refuse_truncated(folder: Path) -> None:
    """Raise a ValueError for a truncated library: loading it would end the process."""
    for path in sorted(path for path in folder.iterdir() if path.is_file()):
        missing = missing_bytes(path)
        if missing:
            raise ValueError(f"its library {path.name} is truncated: {missing} bytes are missing at the end")


Exchanges: TypeAlias = dict[str, Callable[..., int]]


def exchanges(addresses: Mapping[str, int]) -> tuple[Exchanges, Exchanges]:
    """Return fmi2SetXXX and fmi2GetXXX by type; they take addresses as integers, twice as fast as converting arrays."""
    kinds = ("Real", "Integer", "Boolean")
    set_, get = ({kind: _EXCHANGE(addresses[f"{verb}{kind}"]) for kind in kinds} for verb in ("Set", "Get"))
    return set_, get


def _direct_calls(library: Any) -> int:
    """Return the address of the calls of ``direct.h``; 0 if the library has none of this version."""
    try:
        calls = library.blockDirect
    except AttributeError:
        return 0
    calls.restype, calls.argtypes = _POINTER, ()
    address = int(calls() or 0)
    return address if address and ctypes.c_int.from_address(address).value == DIRECT_VERSION else 0


def _unload(handle: int, folder: ScratchFolder) -> None:
    fmpy.freeLibrary(handle)
    folder.cleanup()


class State:
    """Handle of a saved state of an FMU."""

    def __init__(self) -> None:
        self.pointer = ctypes.c_void_p()
        self.time = math.nan  # of an FMU for model exchange [s], which does not tell it


class Instance:
    """One instance of an FMU for co-simulation, from instantiation to release."""

    def __init__(self, library: Library, archive: Archive, name: str) -> None:
        self._dll: Any = library.slave.dll
        self.name = name
        self.last_message = ""
        self.running = False
        self._released = False
        self._failed = False
        self._fatal = False
        self._log = logging.getLogger(f"harness.{name}")
        self.component = 0  # address of the instance
        self.inner: int | None = None  # address of the instance itself, if it is of FMI 3.0
        self.interpolates = False  # whether the inputs may change linearly during a step
        try:
            self._instantiate(library, archive)
        except Exception as error:
            reason = "it returned no instance and logged " + self._quoted_message()
            raise PartError(name, f"fmi{archive.description.fmiVersion[0]}Instantiate", reason) from error
        self.stepped = self.component  # what is passed to the following functions in its place
        self.functions: Mapping[str, int] = library.addresses  # by name without ``fmi2``
        if not archive.exchange:
            self.set_, self.get = exchanges(library.addresses)
            self.do_step: Callable[..., int] = DO_STEP(library.addresses["DoStep"])
            self.interpolates = self.interpolates or bool(archive.interface.canInterpolateInputs)
        declared = {category.name for category in archive.description.logCategories}
        self._categories = [category.encode() for category in _CATEGORIES if category in declared]
        self._choose_categories()

    def _instantiate(self, library: Library, _: Archive) -> None:
        """Make the instance, with logging on."""
        callbacks = fmpy.fmi2.fmi2CallbackFunctions()
        callbacks.logger, callbacks.componentEnvironment = _LOGGER, id(self)
        _INSTANCES[id(self)] = self
        callbacks.allocateMemory = fmpy.fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmpy.fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        _format_messages(callbacks)
        library.slave.instantiate(callbacks=callbacks, loggingOn=True)
        self.component = library.slave.component

    def begin(self, time: float, tolerance: float | None) -> None:
        """Leave initialisation mode."""
        self.call("ExitInitializationMode")
        self.running = True

    def save(self, state: State) -> None:
        """Copy the state of the FMU; memory that the handle refers to is reused."""
        self.call("GetFMUstate", ctypes.byref(state.pointer))

    def restore(self, state: State) -> None:
        """Return to a saved state."""
        self.call("SetFMUstate", state.pointer)

    def free(self, state: State) -> None:
        """Free a saved state."""
        self.call("FreeFMUstate", ctypes.byref(state.pointer))

    def serialised(self, state: State) -> bytes:
        """Return a saved state as bytes."""
        size = ctypes.c_size_t()
        self.call("SerializedFMUstateSize", state.pointer, ctypes.byref(size))
        data = ctypes.create_string_buffer(size.value)
        self.call("SerializeFMUstate", state.pointer, data, size)
        return data.raw

    def deserialise(self, state: State, data: bytes) -> None:
        """Make a saved state of bytes from `serialised`."""
        self.call("DeSerializeFMUstate", data, ctypes.c_size_t(len(data)), ctypes.byref(state.pointer))

    def function(self, name: str) -> Callable[..., Any]:
        """Return fmi2<name>."""
        return getattr(self._dll, f"fmi2{name}")  # type: ignore[no-any-return]

    def call(self, function: str, *arguments: object) -> None:
        """Call fmi2<function> with the instance as its first argument."""
        status: int = self.function(function)(self.component, *arguments)
        if status > 1:
            raise self.failure(f"fmi2{function}", status)

    def failure(self, function: str, status: int, time: float | None = None) -> PartError:
        """Return the error for a call whose status is worse than Warning, with the last log message as reason."""
        self._failed = True
        self._fatal = self._fatal or status == FATAL
        self.running = False
        if function == "fmi2DoStep" and status == _DISCARD and self._ended():
            error = PartError(self.name, function, ENDED, time)
            last = ctypes.c_double()
            if self._status("Real", _LAST_SUCCESSFUL_TIME, last):
                error.ended = last.value
            return error
        label = _STATUS[status] if 0 <= status < len(_STATUS) else f"the illegal status {status}"
        return PartError(self.name, function, f"it returned {label} and logged {self._quoted_message()}", time)

    def _ended(self) -> bool:
        """Return whether the FMU discarded the step because it wants to end the simulation (FMI 2.0, section 4.2)."""
        ended = ctypes.c_int()
        return self._status("Boolean", _TERMINATED, ended) and ended.value == 1

    def _status(self, kind: str, which: int, value: ctypes.c_int | ctypes.c_double) -> bool:
        """Ask for a status of the last step; return whether the FMU knows it."""
        answer = getattr(self._dll, f"fmi2Get{kind}Status", None)
        return (
            answer is not None
            and answer(ctypes.c_void_p(self.component), ctypes.c_int(which), ctypes.byref(value)) <= 1
        )

    def routes(
        self, inputs: Sequence[int], outputs: Sequence[int]
    ) -> tuple[Mapping[str, int], Sequence[int], Sequence[int]]:
        """Return the functions by which the engine exchanges these variables, and their references."""
        return self.functions, inputs, outputs

    def reset(self) -> bool:
        """Return the instance to its initial state with fmi2Reset."""
        if self._failed:
            return False
        self.last_message = ""
        try:
            if self.running:
                self.running = False
                self.call("Terminate")
            self.call("Reset")
            self._choose_categories()
        except PartError:
            return False
        return True

    def release(self) -> None:
        """Free the instance; further calls have no effect."""
        if self._released:
            return
        self._released = True
        if self._fatal:
            return  # after Fatal, FMI allows no further calls
        if self.running:
            self.function("Terminate")(self.component)
        self.function("FreeInstance")(self.component)

    def _choose_categories(self) -> None:
        names = self._categories
        if names:
            self.call("SetDebugLogging", 1, len(names), (ctypes.c_char_p * len(names))(*names))

    def _quoted_message(self) -> str:
        return f"'{self.last_message}'" if self.last_message else "nothing"

    def _logged(
        self, _: object, instance: bytes | None, status: int, category: bytes | None, message: bytes | None
    ) -> None:
        text = (message or b"").decode("utf-8", "replace")
        self.last_message = text
        known = status if 0 <= status < len(_LEVEL) else 3
        self._log.log(_LEVEL[known], "%s [%s]", text, (category or b"").decode("utf-8", "replace"))


_INSTANCES: Final[weakref.WeakValueDictionary[int, Instance]] = weakref.WeakValueDictionary()


def _log_of_instance(environment: int | None, *message: Any) -> None:
    """Pass a message to the instance that logs it."""
    if (instance := _INSTANCES.get(environment or 0)) is not None:
        instance._logged(environment, *message)


_LOGGER: Final = fmpy.fmi2.fmi2CallbackLoggerTYPE(_log_of_instance)
"""Logger of all instances: fmpy's formatter calls the one that it was given last, also of an instance that is gone."""


def _format_messages(callbacks: Any) -> None:
    """Insert fmpy's native formatter before the logger, as Python cannot read the printf arguments of a message."""
    # The formatter is not available on every platform; without it, messages keep their format specifiers.
    try:
        from fmpy.logging import addLoggerProxy
    except Exception:
        return
    addLoggerProxy(ctypes.byref(callbacks))
