"""Connection to a dask cluster."""

from __future__ import annotations

from typing import Any

from friction_fmus.errors import FrictionError

PATIENCE = 10.0
"""Time limit for the answer of a scheduler [s]."""


def connect(address: str) -> Any:
    """Return a client of the dask cluster at this address.

    Raises
    ------
    FrictionError
        If dask is not installed, or no scheduler answers.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise FrictionError("--scheduler needs dask; install it with `pip install friction-fmus[dask]`") from error
    make: Any = Client
    try:
        return make(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise FrictionError(
            f"no dask scheduler answers at {address}: {error}; start `dask scheduler`, or correct the address"
        ) from error
