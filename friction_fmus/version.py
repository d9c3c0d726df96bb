"""Version and release time of the distribution."""

import os
from datetime import UTC, datetime

VERSION = "0.1.0"
RELEASED = "2026-11-20T00:00:00Z"


def build_time() -> str:
    """Return the time stamp of reproducible builds: ``SOURCE_DATE_EPOCH`` if set, otherwise the release time."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    return datetime.fromtimestamp(int(epoch), UTC).strftime("%Y-%m-%dT%H:%M:%SZ") if epoch else RELEASED
