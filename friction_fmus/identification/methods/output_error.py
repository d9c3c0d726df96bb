"""Output error: the block simulated along the measured motion from an initial state that is identified as well."""

from friction_fmus.identification.fit.fitting import fit_scalars as fit

__all__ = ["fit"]
