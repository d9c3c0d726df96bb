"""Identification of an axis: inverse model by linear least squares, closed loop by output error."""

from .errors import ExcitationError, FitError, IdentificationError, RecordError
from .estimate import Estimate
from .excitation import examine, examine_pieces
from .findings import Finding, RecordWarning
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
from .mapping import DataMapping, load_mapping, read_mapping, read_windows
from .models import identifiable
from .output_error import Mapper, OutputErrorFit, Simulator, Target, Unknown, fit_output_error
from .presliding import PreslidingFit, identify_presliding
from .reading import Measurement, read_measurement, read_records
from .record import LINEAR, ROTARY, Array, AxisUnits, Record
from .result import Identification, Score
from .survey import Survey, Task, compare_models

__all__ = [
    "LINEAR",
    "ROTARY",
    "Array",
    "AxisUnits",
    "DataMapping",
    "Estimate",
    "ExcitationError",
    "Finding",
    "FitError",
    "HysteresisGrid",
    "Identification",
    "IdentificationError",
    "InverseModelFit",
    "InverseModelSettings",
    "Mapper",
    "Measurement",
    "Method",
    "Motion",
    "OutputErrorFit",
    "PreslidingFit",
    "Record",
    "RecordError",
    "RecordWarning",
    "Score",
    "Simulator",
    "Survey",
    "Target",
    "Task",
    "Unknown",
    "compare_models",
    "decimate",
    "examine",
    "examine_pieces",
    "filtered_motion",
    "fit_output_error",
    "identifiable",
    "identify",
    "identify_hysteresis",
    "identify_inverse_model",
    "identify_inverse_stribeck",
    "identify_presliding",
    "load_mapping",
    "read_mapping",
    "read_measurement",
    "read_records",
    "read_windows",
]
