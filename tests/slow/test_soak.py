"""The long run, a short one of it."""

from __future__ import annotations

from pathlib import Path

import pytest
from thorough import nightly

if not Path("/proc/self/statm").is_file():
    pytest.skip("the memory of a process is read from /proc", allow_module_level=True)

from soak import instances, steps

pytestmark = nightly


def test_a_million_steps_take_no_memory_and_lose_no_time() -> None:
    assert steps(1_000_000).startswith("1000000 steps: ")


def test_thousands_of_instances_take_no_memory() -> None:
    assert instances(3_000).startswith("3000 instances: ")
