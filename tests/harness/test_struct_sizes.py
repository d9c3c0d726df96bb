"""The structs of the engine have one layout in C and in Python."""

import ctypes
import re

import pytest

import harness.engine.drive
import harness.run  # noqa: F401  # it imports every other mechanism of the engine
from harness.compiling import library
from harness.masters import masters


class Shorter(ctypes.Structure):
    _fields_ = (("input", ctypes.c_int64),)


@pytest.fixture(autouse=True)
def mirrors_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library, "_MIRRORS", dict(library._MIRRORS))


def test_every_struct_that_crosses_is_compared() -> None:
    masters()
    declared = re.findall(r"^MIRRORED\((\w+)\)", "\n".join(library.sources().values()), re.M)
    assert sorted(library._MIRRORS) == sorted(declared)


def test_a_struct_declared_after_the_library_was_loaded_is_compared_at_once() -> None:
    library.library()
    with pytest.raises(AssertionError, match="Line has 24 bytes in C and 8 in Python"):
        library.mirrors("Line")(Shorter)


def test_a_struct_of_another_size_is_refused_when_the_library_is_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(library._MIRRORS, "Line", Shorter)
    library.library.cache_clear()
    try:
        with pytest.raises(AssertionError, match="Line has 24 bytes in C and 8 in Python"):
            library.library()
    finally:
        library.library.cache_clear()
