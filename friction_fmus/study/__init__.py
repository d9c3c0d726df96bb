"""Study of a measured axis: identified friction models, co-simulated compensators, recommendation and report.

``study("my.csv", "out")`` is ``study.run_study("my.csv", "out")``.
"""

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

from harness.extras import lazy_names

if TYPE_CHECKING:
    from friction_fmus.axis.servo import Servo
    from friction_fmus.study.config import Compensation, ConfigError, StudyConfig, load_config, parse_config
    from friction_fmus.study.study import StudyError, run_study
    from friction_fmus.study.study_result import StudyResult
else:
    __getattr__, __dir__ = lazy_names(__name__)


class _Callable(ModuleType):
    def __call__(self, *arguments: Any, **options: Any) -> "StudyResult":
        return self.run_study(*arguments, **options)  # type: ignore[no-any-return]


sys.modules[__name__].__class__ = _Callable

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
