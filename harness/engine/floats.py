"""The bits of floats.h in words."""

from __future__ import annotations

import platform
from typing import Final

_FLOATS: Final = (
    {
        "the rounding mode": 0x0C006000,
        "the treatment of tiny numbers as zero": 0x8040,
        "the precision of the x87 unit": 0x03000000,
        "the trapping of invalid operations": 0x003F1F80,
    }
    if platform.machine().lower() in ("x86_64", "amd64", "i686", "x86")
    else {"the rounding mode": 0x00C00000, "the treatment of tiny numbers as zero": 0x01080003}
)


def described_floats(changed: int) -> str:
    """Return in words which bits of floats.h have changed."""
    words = [name for name, bits in _FLOATS.items() if changed & bits]
    return " and ".join(words) or "the control of floating-point numbers"
