"""The identity of a part: what determines its results, so that no other part continues a run or a sweep with it."""

from __future__ import annotations

import hashlib
from functools import partial
from types import CodeType, FunctionType, MethodType
from typing import Final

import numpy as np

from harness.errors import FmuError
from harness.parts.callable_part import CallablePart
from harness.parts.fmu import FmuPart
from harness.parts.part import Part
from harness.parts.series import SeriesPart
from harness.storage.files import reason

_DEEPEST: Final = 20


def part_identity(part: Part) -> list[str]:
    """Return kind, content and sample time of a part; equal parts have the same, wherever their files are."""
    if isinstance(part, FmuPart):  # an isolated FMU is the same FMU
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
