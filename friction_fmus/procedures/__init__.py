"""Procedures that run a system of FMUs again and again."""

from friction_fmus.procedures.ilc import Loop, Training, inverse_process_sensitivity, learning_step, train, zero_phase
from friction_fmus.procedures.ilc_identification import PositionTables, separate

__all__ = [
    "Loop",
    "PositionTables",
    "Training",
    "inverse_process_sensitivity",
    "learning_step",
    "separate",
    "train",
    "zero_phase",
]
