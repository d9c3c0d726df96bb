"""The compiled engine and the structs that it shares with Python."""

import ctypes
import re
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from harness.compiling.platforms import NATIVE, missing_bytes, native_library
from harness.compiling.toolchain import source_folder

_POINTER, _INT = ctypes.c_void_p, ctypes.c_int64
_NUMBERS = ctypes.POINTER(ctypes.c_double)
RESIDUAL: Final = ctypes.CFUNCTYPE(ctypes.c_bool, _POINTER, _NUMBERS, _NUMBERS)  # of fixed_point.h

_MIRRORS: Final[dict[str, type[ctypes.Structure]]] = {}


@cache
def library() -> ctypes.CDLL:
    """Return the compiled engine, from the wheel or else built from the sources and cached."""
    folder = Path(__file__).parents[1] / "engine"
    shipped = folder / "binaries" / NATIVE.folder / f"engine{NATIVE.suffix}"
    whole = shipped.is_file() and missing_bytes(shipped) == 0
    engine = ctypes.CDLL(str(shipped if whole else native_library(sources(), "engine", headers=False)))
    engine.engine_run.restype = _INT
    engine.engine_run.argtypes = (_POINTER, _INT, _INT)
    engine.engine_drive.restype = _INT
    engine.engine_batch.restype = _INT
    engine.engine_batch.argtypes = (_POINTER, _POINTER, _INT, _INT)
    engine.engine_inert.restype = _POINTER
    engine.engine_takes_turns.restype = ctypes.c_bool
    engine.engine_float_control.restype = ctypes.c_uint32
    engine.engine_set_float_control.argtypes = (ctypes.c_uint32,)
    engine.engine_drive.argtypes = (_POINTER, _INT)
    engine.newton_begin.restype = None
    engine.newton_begin.argtypes = (_POINTER, _POINTER)
    engine.find_fixed_point.restype = ctypes.c_bool
    engine.find_fixed_point.argtypes = (RESIDUAL, _POINTER, _POINTER, _INT, _POINTER, _POINTER)
    engine.fixed_point_work.restype = _INT
    engine.fixed_point_work.argtypes = (_INT,)
    for name in _MIRRORS:
        _check_layout(engine, name)
    return engine


def _check_layout(engine: ctypes.CDLL, name: str) -> None:
    struct, fields = _MIRRORS[name], ctypes.addressof(ctypes.c_char.in_dll(engine, f"fields_of_{name}"))
    names = ctypes.string_at(fields).decode().split()
    offsets = (_INT * (len(names) + 1)).in_dll(engine, f"offsets_of_{name}")
    compiled = [*zip(names, offsets, strict=False), ("size", offsets[-1])]
    own_names = [field[0] for field in struct._fields_]
    mirror = [*((own, getattr(struct, own).offset) for own in own_names), ("size", ctypes.sizeof(struct))]
    for (field, offset), (own, expected) in zip(compiled, mirror, strict=False):
        assert (field, offset) == (own, expected), (
            f"{name} has {field} at byte {offset} in C and {own} at byte {expected} in Python"
        )


def sources() -> dict[str, str]:
    """Return the text of each of the engine's C files."""
    folder = Path(__file__).parents[1] / "engine"
    masters = sorted((folder.parent / "masters").glob("*.h"))
    files = (*folder.glob("*.h"), *folder.glob("*.c"), *masters, source_folder() / "direct.h")
    texts = {path.name: path.read_text(encoding="utf-8") for path in sorted(files)}
    generated = {"masters.h": "".join(f'#include "{path.name}"\n' for path in masters)}
    return texts | generated | {"mirrors.h": _layouts("\n".join(texts.values()))}


def _layouts(code: str) -> str:
    """Return C with the names and the offsets of the fields of each struct that is marked by MIRRORED."""
    lines, bodies = [], _bodies(code)
    for name in re.findall(r"^MIRRORED\((\w+)\)", code, re.M):
        fields = [field for field, _ in _fields(bodies[name])]
        offsets = ", ".join(f"offsetof({name}, {field})" for field in fields)
        lines += [f"EXPORT extern const char fields_of_{name}[];", f"EXPORT extern const int64_t offsets_of_{name}[];"]
        lines += [f'const char fields_of_{name}[] = "{" ".join(fields)}";']
        lines += [f"const int64_t offsets_of_{name}[] = {{{offsets}, sizeof({name})}};"]
    return "\n".join(lines) + "\n"


_LENGTHS: Final = {"TYPES": 3, "TYPES + 1": 4, "TYPES_3": 11}  # of arrays in structs, which the check covers


def _bodies(code: str) -> dict[str, str]:
    """Return the declarations in each struct by the name of its type."""
    code = re.sub(r"/\*.*?\*/", "", code, flags=re.DOTALL)
    tags = dict(re.findall(r"typedef struct (\w+) (\w+);", code))
    found = re.findall(r"struct (\w*) ?{([^{}]*)} ?(\w*);", code)
    return {name or tags.get(tag, tag): body for tag, body, name in found}


def _fields(body: str) -> list[tuple[str, Any]]:
    """Return the fields of a struct with their types in ctypes; each pointer is an address."""
    found: list[tuple[str, Any]] = []
    declarator = re.compile(r"\(\*(\w+)\).*|(\*?)(\w+)(?:\[([^]]*)\])?(?:,\s*|$)", re.DOTALL)
    for declaration in body.split(";")[:-1]:
        kind, declared = re.findall(r"^\s*(?:const |unsigned )*(\w+) (.*)", declaration, re.DOTALL)[0]
        for function, pointer, field, length in declarator.findall(declared):
            own = _MIRRORS.get(kind) or getattr(ctypes, f"c_{kind.removesuffix('_t')}", None)
            plain: Any = _POINTER if function or pointer else own
            found.append((function or field, plain * _LENGTHS[length] if length else plain))
    return found


@cache
def _structs() -> dict[str, str]:
    folder = Path(__file__).parents[1]
    paths = (*folder.glob("engine/*.h"), *folder.glob("masters/*.h"), source_folder() / "direct.h")
    return _bodies("\n".join(path.read_text(encoding="utf-8") for path in paths))


def mirror(name: str) -> type[ctypes.Structure]:
    """Return a ctypes structure with the fields of a C struct; their offsets are checked when the library is loaded."""
    struct = _MIRRORS[name] = type(name, (ctypes.Structure,), {"_fields_": _fields(_structs()[name])})
    if library.cache_info().currsize:
        _check_layout(library(), name)
    return struct


def bytes_of(struct: ctypes.Array[Any] | ctypes.Structure) -> NDArray[np.uint8]:
    """Return a view of the bytes of a struct or of an array of structs."""
    size = ctypes.sizeof(struct)
    return np.ctypeslib.as_array((ctypes.c_uint8 * size).from_buffer(struct)) if size else np.zeros(0, np.uint8)
