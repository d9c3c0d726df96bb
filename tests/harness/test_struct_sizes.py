"""The structs of the engine have one layout in C and in Python."""

import ctypes
import re
from pathlib import Path

import pytest

import harness.engine.drive
import harness.run  # noqa: F401  # it imports every other mechanism of the engine
from harness.engine import native

SOURCE = Path(native.__file__).with_name("engine.c").read_text(encoding="utf-8")


def test_every_struct_that_crosses_is_compared() -> None:
    assert sorted(native._MIRRORS) == sorted(re.findall(r"\{\"\w+\", sizeof\((\w+)\)\}", SOURCE))


def test_a_struct_of_another_size_is_refused_when_the_library_is_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    class Shorter(ctypes.Structure):
        _fields_ = (("input", ctypes.c_int64),)

    monkeypatch.setitem(native._MIRRORS, "Line", Shorter)
    native.library.cache_clear()
    try:
        with pytest.raises(AssertionError, match="Line has 24 bytes in C and 8 in Python"):
            native.library()
    finally:
        native.library.cache_clear()
