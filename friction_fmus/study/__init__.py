"""The study of a measured axis, from the record to the recommended compensator and the report."""

from .config import Compensation, ConfigError, Servo, StudyConfig, load_config, parse_config
from .result import StudyResult
from .study import StudyError, run_study

__all__ = [
    "Compensation",
    "ConfigError",
    "Servo",
    "StudyConfig",
    "StudyError",
    "StudyResult",
    "load_config",
    "parse_config",
    "run_study",
]
