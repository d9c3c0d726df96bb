"""Fixtures of other folders."""

from __future__ import annotations

from check.conftest import library as faulty  # noqa: F401
from every_block.conftest import library  # noqa: F401
