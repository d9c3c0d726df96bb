"""Inverse model of a law without states: the law is evaluated along the measured motion."""

from friction_fmus.identification.fit.block_fit import fit_scalars as fit

__all__ = ["fit"]
