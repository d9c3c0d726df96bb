"""Procedures that run a system of FMUs repeatedly: iterative learning, identification from feedback, break-away."""

from friction_fmus.procedures.ilc import (
    PidLoop,
    PositionTables,
    Training,
    inverse_process_sensitivity,
    learning_step,
    separate,
    train,
    zero_phase,
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
    "inverse_process_sensitivity",
    "learning_step",
    "separate",
    "train",
    "zero_phase",
]
