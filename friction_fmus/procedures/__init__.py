"""Procedures that run a system of FMUs repeatedly: iterative learning, identification from feedback, break-away."""

from friction_fmus.procedures.ilc import (
    PidLoop,
    PositionTables,
    Training,
    separate,
    train,
)
from friction_fmus.procedures.static_friction import (
    BreakAways,
    FrictionTable,
    break_away,
    find_break_aways,
    identify_from_feedback,
)

__all__ = [
    "BreakAways",
    "FrictionTable",
    "PidLoop",
    "PositionTables",
    "Training",
    "break_away",
    "find_break_aways",
    "identify_from_feedback",
    "separate",
    "train",
]
