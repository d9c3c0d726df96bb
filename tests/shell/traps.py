"""Floating-point exceptions that a host program may have enabled as traps."""

from __future__ import annotations

import ctypes
import platform
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

_BITS = {"x86_64": (1, 4, 8), "aarch64": (1, 2, 4)}
_NAMES = ("an invalid operation", "a division by zero", "an overflow")


@contextmanager
def no_traps(what: object = "") -> Iterator[None]:
    """Insist that no operation inside would trap."""
    bits = _BITS.get(platform.machine())
    if bits is None or platform.system() != "Linux":
        pytest.skip("the flags of this machine are not known")
    libm = ctypes.CDLL("libm.so.6")
    libm.feclearexcept(sum(bits))
    yield
    raised = libm.fetestexcept(sum(bits))
    assert not raised, (*(name for name, bit in zip(_NAMES, bits, strict=True) if raised & bit), what)
