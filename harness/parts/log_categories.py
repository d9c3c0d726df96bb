"""Log categories of the FMUs that this library writes."""

from __future__ import annotations

from typing import Final

LOG_CATEGORIES: Final = {
    "logStatusWarning": "warnings that do not stop the simulation",
    "logStatusDiscard": "rejected values and steps",
    "logStatusError": "calls that are not allowed",
    "logEvents": "events inside the model",
    "logAll": "all messages",
}
"""Log categories, as in fmi2_modes.h."""
