"""Grid of the table of `FrictionResidual`, for the law and for its identification."""

from __future__ import annotations

from typing import Final

SPEEDS: Final = (0.03, 0.1, 0.3, 0.6, 1.0)  # speeds over the largest one
POSITIONS: Final = 8  # number of equally spaced positions
