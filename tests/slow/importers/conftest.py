"""The FMUs of the catalogue, and the loops that they take part in."""

from __future__ import annotations

from interop.conftest import _temporary, fmus, loops  # noqa: F401
