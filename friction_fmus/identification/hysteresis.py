"""Blocks with elastic, perfectly plastic elements: least squares on a grid of break-away distances."""

from __future__ import annotations

from collections.abc import Sequence

from harness import Drive

from .errors import FitError
from .models import ContactModel, Traits
from .pieces import Piece
from .record import AxisUnits
from .setup import Setup, Wishes


def hysteresis_start(
    model: ContactModel,
    drive: Drive,
    pieces: Sequence[Piece],
    traits: Traits,
    wishes: Wishes,
    units: AxisUnits,
    Fn0: float | None,
) -> Setup:
    """The unknowns of a block with elements."""
    raise FitError(f"{model.name} is not identified yet; choose another model.")
