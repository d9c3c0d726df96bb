"""The study of a measured axis, from the record to the report."""

from .emps import StudyError, StudySettings, run_study
from .metrics import Agreement, agreement, rms, tracking_rms_um
from .summary import Compensation, Identified, Summary, Tracking, summary_table

__all__ = [
    "Agreement",
    "Compensation",
    "Identified",
    "StudyError",
    "StudySettings",
    "Summary",
    "Tracking",
    "agreement",
    "rms",
    "run_study",
    "summary_table",
    "tracking_rms_um",
]
