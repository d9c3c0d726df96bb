"""Inverse model of a law without states: the law is evaluated along the measured motion."""

from friction_fmus.identification.fit.fitting import fit_scalars as fit

__all__ = ["fit"]
