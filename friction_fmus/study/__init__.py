"""Study of a measured axis: identified friction models, co-simulated compensators, recommendation and report."""

from typing import TYPE_CHECKING

from harness.extras import lazy_names

if TYPE_CHECKING:
    from friction_fmus.axis.servo import Servo
    from friction_fmus.study.config import Compensation, ConfigError, StudyConfig, load_config, parse_config
    from friction_fmus.study.study import StudyError, run_study
    from friction_fmus.study.study_result import StudyResult
else:
    __getattr__, __dir__ = lazy_names(__name__)

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
