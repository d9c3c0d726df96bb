"""Parameters of compensators, computed."""

from friction_fmus.design.kalman import kalman_friction_gains

__all__ = ["kalman_friction_gains"]
