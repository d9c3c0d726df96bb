"""The time stamp of reproducible files."""

import os
from datetime import UTC, datetime

from harness.errors import BuildError


def stamped() -> str | None:
    """Return the time of ``SOURCE_DATE_EPOCH`` in the format of FMI; None if it is not set."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    if not epoch:
        return None
    try:
        if int(epoch) < 0:
            raise ValueError(epoch)
        return datetime.fromtimestamp(int(epoch), UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    except (ValueError, OverflowError, OSError) as error:
        raise BuildError(
            f"SOURCE_DATE_EPOCH is {epoch!r}: set it to a number of seconds since 1970, or remove it"
        ) from error
