"""Errors of records and identifications."""

from friction_fmus.errors import FrictionError


class IdentificationError(FrictionError):
    """Base class of the errors of this package."""


class RecordError(IdentificationError):
    """Record that cannot be read or used."""


class ExcitationError(IdentificationError):
    """Record without the motion that the parameters need."""


class FitError(IdentificationError):
    """Invalid setup of a fit, or simulation with an unusable result."""
