"""Checks of FMI 3.0 FMUs: variables, structure; the binary runs in the probes of FMI 2.0 and in its own."""

from friction_fmus.check.fmi3 import structure, variables
from friction_fmus.check.fmi3.description import Model3

__all__ = ["Model3", "structure", "variables"]
