"""Connection to a dask cluster."""

from __future__ import annotations

from typing import Any

from friction_fmus.errors import FrictionError
from harness.extras import require

PATIENCE = 10.0
"""Time limit for the answer of a scheduler [s]."""


def connect(address: str) -> Any:
    """Return a client of the dask cluster at this address."""
    require("distributed")
    from distributed import Client

    make: Any = Client
    try:
        return make(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise FrictionError(
            f"no dask scheduler answers at {address}: {error}; start `dask scheduler`, or correct the address"
        ) from error
