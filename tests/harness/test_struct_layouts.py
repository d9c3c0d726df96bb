"""The structs of the engine have one layout in C and in Python, field by field."""

import ctypes
import re

import pytest

import harness.batch
import harness.engine.drive
import harness.run  # noqa: F401  # it imports every other mechanism of the engine
from harness.compiling import engine_library
from harness.masters import masters


class Shorter(ctypes.Structure):
    _fields_ = (("input", ctypes.c_int64),)


def swapped(struct: type[ctypes.Structure], first: int) -> type[ctypes.Structure]:
    """Return a structure of the same size in which a field and the next one are exchanged."""
    fields = [*struct._fields_]
    fields[first : first + 2] = reversed(fields[first : first + 2])
    return type("Swapped", (ctypes.Structure,), {"_fields_": tuple(fields)})


def check_layout(name: str, struct: type[ctypes.Structure]) -> None:
    """Compare another structure with the one in C."""
    engine_library._MIRRORS[name] = struct
    engine_library._check_layout(engine_library.library(), name)


@pytest.fixture(autouse=True)
def mirrors_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    masters()
    monkeypatch.setattr(engine_library, "_MIRRORS", dict(engine_library._MIRRORS))


def test_every_struct_that_crosses_is_compared() -> None:
    declared = re.findall(r"^MIRRORED\((\w+)\)", "\n".join(engine_library.sources().values()), re.M)
    assert sorted(engine_library._MIRRORS) == sorted(declared)


def test_two_fields_of_one_size_that_are_exchanged_are_found() -> None:
    engine_library.library()
    line = engine_library._MIRRORS["Line"]
    for name, struct in [*engine_library._MIRRORS.items()]:
        for first in range(len(struct._fields_) - 1):
            with pytest.raises(AssertionError, match=rf"{name} has .* in C and .* in Python"):
                check_layout(name, swapped(struct, first))
    with pytest.raises(AssertionError, match="Line has mean at byte 8 in C and end at byte 8 in Python"):
        check_layout("Line", swapped(line, 1))


def test_fields_that_are_exchanged_in_c_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    texts = engine_library.sources()
    code = texts["line.h"].replace("double mean, end;", "double end, mean;")
    assert code != texts["line.h"]
    exchanged = engine_library._layouts("\n".join({**texts, "line.h": code}.values()))
    assert 'fields_of_Line[] = "input end mean"' in exchanged


def test_a_struct_of_another_size_is_refused_when_the_library_is_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(engine_library._MIRRORS, "Line", Shorter)
    engine_library.library.cache_clear()
    try:
        with pytest.raises(AssertionError, match="Line has mean at byte 8 in C and size at byte 8 in Python"):
            engine_library.library()
    finally:
        engine_library.library.cache_clear()
