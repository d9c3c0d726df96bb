"""What can be wrong with a record or with an identification."""

from friction_fmus.errors import FrictionError


class IdentificationError(FrictionError):
    """Base class of the errors of this package."""


class RecordError(IdentificationError):
    """A record of an axis cannot be read or is not usable."""


class ExcitationError(IdentificationError):
    """The record does not contain the motion that the parameters need."""


class FitError(IdentificationError):
    """A fit was set up wrongly or its simulation returned something unusable."""
