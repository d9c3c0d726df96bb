"""Fixtures of other folders, and Chromium."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from browser import chromium
from check.conftest import library as faulty  # noqa: F401
from every_block.conftest import library  # noqa: F401
from playwright.sync_api import Browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser
