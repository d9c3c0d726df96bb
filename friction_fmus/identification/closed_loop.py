"""Output error on the whole co-simulated axis."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from friction_fmus.data import MeasuredAxis

from .errors import FitError
from .record import Record
from .result import Identification
from .setup import Wishes


def identify_closed_loop(
    model: str | Path,
    axis: MeasuredAxis,
    wishes: Wishes,
    validation: Record | Sequence[Record] | None,
    begin: float,
) -> Identification:
    """Fit mass, offset and friction so that the co-simulated servo moves as the measured one did."""
    raise FitError("An axis with its servo is not identified yet; give its record.")
