"""Checkpoints: files with the state of a run, from which another process continues it bit for bit."""

import hashlib
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import CodeType, FunctionType, MethodType
from typing import Any, Final, TypeAlias

import numpy as np

from harness.errors import ExperimentError, FmuError
from harness.parts.callable_part import CallablePart
from harness.parts.fmu import FmuPart
from harness.parts.part import Part
from harness.parts.series import SeriesPart
from harness.storage.files import atomic_path, reason, require_regular
from harness.system.assembly import Assembly
from harness.system.experiment import SCALARS, Experiment
from harness.system.plan import Plan
from harness.values import shown

_DEEPEST: Final = 20


def part_identity(part: Part) -> list[str]:
    """Return kind, content and sample time of a part; equal parts have the same, wherever their files are."""
    if isinstance(part, FmuPart):
        try:
            content = digest(part.path.read_bytes())
        except OSError as error:
            raise FmuError(f"cannot read the FMU {part.path}: {reason(error)}; restore the file") from error
        return [FmuPart.__qualname__, content, str(part.every)]
    kind = type(part).__qualname__
    ports = [repr(port) for port in (*part.inputs, *part.outputs)]
    if isinstance(part, SeriesPart):
        return [kind, digest(part.content()), part.interpolation, part.beyond, *ports]
    if isinstance(part, CallablePart):
        ports += [str(part.initial_state.tolist()), function_identity((part.function, part.advance))]
    reads = sorted((output, sorted(inputs)) for output, inputs in part.dependencies.items())
    return [kind, part.identity, *ports, str(reads), str(part.every), str(part.sampled)]


def function_identity(function: object) -> str:
    """Return a hash of name, code and bound values of a function; the functions that it calls do not count."""
    return digest(_text(function, 0).encode())


def digest(content: bytes) -> str:
    """Return a hash of 16 characters."""
    return hashlib.sha256(content).hexdigest()[:16]


def _text(thing: object, depth: int) -> str:
    """Return a text that is the same in all processes; of what may be a log, such as a list, only the type."""
    parts: list[object] = []
    if isinstance(thing, (tuple, frozenset)):
        parts = [*thing]
    elif isinstance(thing, CodeType):
        parts = [thing.co_code.hex(), thing.co_names, thing.co_consts]
    elif isinstance(thing, partial):
        parts = [thing.func, thing.args, *sorted(thing.keywords.items())]
    elif isinstance(thing, MethodType):
        parts = [thing.__func__, *_object(thing.__self__)]
    elif isinstance(thing, FunctionType):
        cells = [cell.cell_contents for cell in thing.__closure__ or ()]
        named = sorted((thing.__kwdefaults__ or {}).items())
        parts = [thing.__module__, thing.__qualname__, thing.__code__, thing.__defaults__, *named, *cells]
    elif isinstance(thing, np.ndarray):
        parts = [str(thing.dtype), thing.shape, thing.tobytes().hex()]
    elif isinstance(thing, type):
        parts = [thing.__module__, thing.__qualname__]
    elif thing is None or isinstance(thing, (bool, int, float, complex, str, bytes, np.generic)):
        return repr(thing)
    else:
        parts = [type(thing).__call__, *_object(thing)] if callable(thing) else [type(thing).__qualname__]
    texts = [_text(part, depth + 1) for part in parts] if depth < _DEEPEST else []
    return f"{type(thing).__name__}({', '.join(sorted(texts) if isinstance(thing, frozenset) else texts)})"


def _object(thing: object) -> list[object]:
    """Return the class of the object of a method, and its attributes."""
    return [type(thing).__module__, type(thing).__qualname__, *sorted(getattr(thing, "__dict__", {}).items())]


_FORMAT: Final = 3
_HEADER: Final = "checkpoint.json"
_HASH: Final = "sha256"
_LARGEST: Final = 1 << 30  # largest unpacked size of a checkpoint [bytes]
_REMEDY: Final = "give a checkpoint that a run has written"

Arrays: TypeAlias = Mapping[str, np.ndarray[Any, Any]]


@dataclass(frozen=True)
class Checkpoint:
    """State of a run, read from a file."""

    path: Path  # the file
    tick: int  # number of completed communication steps
    signals: Mapping[str, float]  # values by "part.port"
    states: Mapping[str, bytes]  # state of each part
    memory: Mapping[str, tuple[str, tuple[int, ...], bytes]]  # arrays of the master: type, shape, content

    def restore(self, plan: Plan, memory: Arrays) -> None:
        """Restore started parts, their values and the internal arrays of the master to this state."""
        saved = {name: self._array(name, array) for name, array in memory.items()}
        for part in plan.parts:
            part.deserialise(self.states[part.name])
        for call in plan.calls:
            call.get()
        for name, value in self.signals.items():
            if name in plan.columns:
                plan.signals[plan.columns[name]] = value
        for name, array in memory.items():
            array[...] = saved[name]

    def _array(self, name: str, like: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """Return a saved array after checking that its type and shape match this run."""
        kind, shape, content = self.memory.get(name, ("", (), b""))
        if (kind, shape, len(content)) != (like.dtype.str, like.shape, like.nbytes):
            raise ExperimentError(
                f"{self.path} has another {name} than this run: continue with the manipulators and options of the "
                "first run"
            )
        return np.frombuffer(content, like.dtype).reshape(like.shape)


def write_checkpoint(path: Path, system: Assembly, experiment: Experiment, plan: Plan, memory: Arrays) -> None:
    """Write the state at the end of a run; an existing file is replaced only when the new one is complete."""
    header = {
        "format": _FORMAT,
        "tick": plan.ticks,
        "system": identity(system, experiment),
        "signals": {name: float(plan.signals[index]).hex() for name, index in plan.columns.items()},
        "memory": {name: [array.dtype.str, list(array.shape)] for name, array in memory.items()},
    }
    members = {_HEADER: json.dumps(header, indent=1).encode()}
    members |= {f"parts/{part.name}": part.serialise() for part in plan.parts}
    members |= {f"memory/{name}": array.tobytes() for name, array in memory.items()}
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in (*members.items(), (_HASH, _hash(members))):
            archive.writestr(name, content)


def read_checkpoint(path: Path, system: Assembly, experiment: Experiment) -> Checkpoint:
    """Read the state of a run."""
    try:
        require_regular(path)
        members = _members(path)
    except OSError as error:
        raise ExperimentError(f"cannot read the checkpoint {path}: {error.strerror}; {_REMEDY}") from error
    except Exception as error:  # zipfile and zlib raise many kinds for a damaged file
        raise ExperimentError(f"cannot read the checkpoint {path}: {reason(error)}; {_REMEDY}") from error
    header = _header(path, members)
    _compare(path, header["system"], identity(system, experiment))
    tick, signals, memory = header["tick"], header["signals"], header["memory"]
    if type(tick) is not int or tick < 0:
        raise _malformed(path, f"the invalid step count {shown(tick)}")
    if tick > experiment.ticks:
        reached = experiment.start + tick * experiment.step
        raise ExperimentError(f"{path} is the state at {reached:.12g} s: give a later stop than {experiment.stop:.12g}")
    try:
        return Checkpoint(
            path,
            tick,
            {name: float.fromhex(value) for name, value in signals.items()},
            {name: members[f"parts/{name}"] for name in system.parts},
            {name: (kind, tuple(shape), members[f"memory/{name}"]) for name, (kind, shape) in memory.items()},
        )
    except (AttributeError, KeyError, OverflowError, TypeError, ValueError) as error:
        raise _malformed(path, f"an incomplete state ({error})") from error


def _members(path: Path) -> dict[str, bytes]:
    """Return the members of the file after checking their hash."""
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
        if sum(entry.file_size for entry in entries) > _LARGEST:
            raise ValueError(f"it unpacks to more than {_LARGEST} bytes")
        if _HEADER not in archive.namelist():
            raise ValueError(f"it has no {_HEADER}")
        members = {entry.filename: archive.read(entry) for entry in entries}
    found = members.pop(_HASH, None)
    if found != _hash(members):
        raise ValueError("it is damaged or was written by an earlier version" if found is None else "it is damaged")
    return members


def _hash(members: Mapping[str, bytes]) -> bytes:
    """Return the hash of the names and contents of the members."""
    digest = hashlib.sha256()
    for name, content in members.items():
        digest.update(f"{len(name)} {len(content)} {name}".encode() + content)
    return digest.hexdigest().encode()


def _header(path: Path, members: Mapping[str, bytes]) -> dict[str, Any]:
    """Return the header after checking that it is a table with all its entries."""
    try:
        header = json.loads(members[_HEADER])
    except (ValueError, RecursionError) as error:
        raise _malformed(path, f"a {_HEADER} that is not JSON") from error
    if not isinstance(header, dict) or header.get("format") != _FORMAT:
        raise _malformed(path, f"a format other than {_FORMAT}")
    if "tick" not in header or any(not isinstance(header.get(key), dict) for key in ("system", "signals", "memory")):
        raise _malformed(path, "an incomplete header")
    return header


def _compare(path: Path, found: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    """Raise an ExperimentError at the first entry in which two systems differ."""
    for key, value in wanted.items():
        if found.get(key) != value:
            raise ExperimentError(
                f"{path} belongs to a run with other {key}: {shown(found.get(key))} instead of {shown(value)}"
            )


def _malformed(path: Path, what: str) -> ExperimentError:
    return ExperimentError(f"cannot read the checkpoint {path}: it has {what}; {_REMEDY}")


def identity(system: Assembly, experiment: Experiment) -> dict[str, Any]:
    """Return what must agree between two runs for a state to be valid in both."""
    wires = [(str(wire), wire.gain, wire.offset, wire.delay, wire.initial) for wire in system.wires]
    return {
        "parts": {name: " ".join(part_identity(part)) for name, part in system.parts.items()},
        "wires": [
            f"{text} * {gain!r} + {offset!r}, delay {delay}" + ("" if initial is None else f" from {initial!r}")
            for text, gain, offset, delay, initial in wires
        ],
        "start values": {name: repr(value) for name, value in sorted(system.start.items())},
        **{name: getattr(experiment, name) for name in SCALARS if name not in ("stop", "decimate")},  # decide on values
        "order": list(experiment.order),
        "manipulators": [repr(each) for each in experiment.manipulators],
    }
