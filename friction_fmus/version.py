"""Version and release time of the distribution."""

from harness.storage.files import stamped

VERSION = "0.1.0"
RELEASED = "2026-11-20T00:00:00Z"


def build_time() -> str:
    """Return the time stamp of reproducible builds: ``SOURCE_DATE_EPOCH`` if set, otherwise the release time."""
    return stamped() or RELEASED
