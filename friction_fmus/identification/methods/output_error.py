"""Output error: the block is simulated along the measured motion; its initial state is also identified."""

from friction_fmus.identification.fit.block_fit import fit_scalars as fit

__all__ = ["fit"]
