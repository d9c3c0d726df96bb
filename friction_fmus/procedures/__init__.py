"""Procedures that run a system of FMUs repeatedly: iterative learning, and identification from feedback."""

from friction_fmus.procedures.feedback_error import FrictionTable, identify_from_feedback
from friction_fmus.procedures.ilc import Loop, Training, inverse_process_sensitivity, learning_step, train, zero_phase
from friction_fmus.procedures.ilc_identification import PositionTables, separate

__all__ = [
    "FrictionTable",
    "Loop",
    "PositionTables",
    "Training",
    "identify_from_feedback",
    "inverse_process_sensitivity",
    "learning_step",
    "separate",
    "train",
    "zero_phase",
]
