"""Identification of an axis: inverse model by linear least squares, closed loop by output error."""

from .errors import ExcitationError, FitError, IdentificationError, RecordError
from .estimate import Estimate
from .grid import HysteresisGrid, identify_hysteresis
from .identifying import Method, identify
from .idim import (
    InverseModelFit,
    InverseModelSettings,
    Motion,
    decimate,
    filtered_motion,
    identify_inverse_model,
    identify_inverse_stribeck,
)
from .models import identifiable
from .output_error import Mapper, OutputErrorFit, Simulator, Target, Unknown, fit_output_error
from .record import LINEAR, ROTARY, Array, AxisUnits, Record
from .result import Identification, Score

__all__ = [
    "LINEAR",
    "ROTARY",
    "Array",
    "AxisUnits",
    "Estimate",
    "ExcitationError",
    "FitError",
    "HysteresisGrid",
    "Identification",
    "IdentificationError",
    "InverseModelFit",
    "InverseModelSettings",
    "Mapper",
    "Method",
    "Motion",
    "OutputErrorFit",
    "Record",
    "RecordError",
    "Score",
    "Simulator",
    "Target",
    "Unknown",
    "decimate",
    "filtered_motion",
    "fit_output_error",
    "identifiable",
    "identify",
    "identify_hysteresis",
    "identify_inverse_model",
    "identify_inverse_stribeck",
]
