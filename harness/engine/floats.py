"""Descriptions of the bits of floats.h."""

from __future__ import annotations

import platform
from typing import Final

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
