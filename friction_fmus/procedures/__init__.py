"""Procedures that run a system of FMUs again and again."""

from friction_fmus.procedures.ilc import Loop, Training, inverse_process_sensitivity, learning_step, train, zero_phase

__all__ = ["Loop", "Training", "inverse_process_sensitivity", "learning_step", "train", "zero_phase"]
