"""Identification of friction models from measured data: inverse model, output error, hysteresis, free run."""

from typing import TYPE_CHECKING

from harness.extras import lazy_names

if TYPE_CHECKING:
    from friction_fmus.blocks.axis_units import LINEAR, ROTARY, AxisUnits
    from friction_fmus.errors import ExcitationError, FitError, IdentificationError, RecordError
    from friction_fmus.identification.data.excitation import examine
    from friction_fmus.identification.data.mapping import DataMapping
    from friction_fmus.identification.data.reading import Measurement, read_measurement, read_records
    from friction_fmus.identification.data.record import Array, Record, RecordFinding, RecordWarning
    from friction_fmus.identification.fit.contact_model import identifiable
    from friction_fmus.identification.fit.estimate import Estimate
    from friction_fmus.identification.fit.idim import PUBLISHED_SETTINGS, InverseModelSettings
    from friction_fmus.identification.fit.scores import Score
    from friction_fmus.identification.identification_result import Identification
    from friction_fmus.identification.identifying import identify
    from friction_fmus.identification.joint import Joint, JointIdentification, JointRecord, identify_joint
    from friction_fmus.identification.model_comparison import IdentificationTask, ModelComparison, compare_models
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "LINEAR",
    "PUBLISHED_SETTINGS",
    "ROTARY",
    "Array",
    "AxisUnits",
    "DataMapping",
    "Estimate",
    "ExcitationError",
    "FitError",
    "Identification",
    "IdentificationError",
    "IdentificationTask",
    "InverseModelSettings",
    "Joint",
    "JointIdentification",
    "JointRecord",
    "Measurement",
    "ModelComparison",
    "Record",
    "RecordError",
    "RecordFinding",
    "RecordWarning",
    "Score",
    "compare_models",
    "examine",
    "identifiable",
    "identify",
    "identify_joint",
    "read_measurement",
    "read_records",
]
