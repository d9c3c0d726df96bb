"""What all tests share: FMUs built once."""

from __future__ import annotations

import gc
import os
import sys

# more threads than processors only wait for each other; numpy reads this when it is imported
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path

import pytest
from fmpy import read_model_description
from quick import builds_of, options, quick_builds
from shell.selection import ONE_OF_EACH, built
from thorough import LANDING, THOROUGH

from friction_fmus import catalogue, fmu

gc.disable()  # until all is imported and collected, which makes no garbage, but many objects to look through

# a process that compiles all modules again takes twice as long to start; tests start many
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what is for another run, and begin with what takes longest in one file."""
    if not THOROUGH:
        left_out = {item for item in items if is_for_the_night(item) or is_for_another_run(item)}
        config.hook.pytest_deselected(items=[item for item in items if item in left_out])
        items[:] = [item for item in items if item not in left_out]
    items.sort(key=lambda item: "wasm" not in item.path.parts)  # the first module compiles the C library


def is_for_the_night(item: pytest.Item) -> bool:
    """Whether a test, or the block that it runs on, is left out before a landing."""
    if item.get_closest_marker("nightly"):
        return True
    if not hasattr(item, "callspec") or not item.get_closest_marker("one_of_each"):
        return False
    block = item.callspec.params.get("library")
    return block not in ONE_OF_EACH and block in catalogue()


def is_for_another_run(item: pytest.Item) -> bool:
    """Whether a test is left out with README's command, or in the second run of a landing."""
    second = item.get_closest_marker("landing") is not None
    return not second and "slow" not in item.path.parts if LANDING else second


def pytest_collection_finish() -> None:
    """Leave what was imported and collected out of every later search for garbage."""
    gc.collect()
    gc.freeze()
    gc.enable()


def pytest_unconfigure() -> None:
    """Let extension modules free at the end what they would report as leaked."""
    gc.unfreeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Build what a test needs quickly, see quick.py."""
    with quick_builds(item.path.relative_to(Path(__file__).parent)):
        return (yield)


@cache
def own_start_values(name: str) -> Mapping[str, str]:
    """Start values of a block as its FMU states them."""
    with builds_of(name):
        variables = read_model_description(str(fmu(name))).modelVariables
    return {v.name: v.start for v in variables if v.type == "Real" and v.start is not None}


@pytest.fixture(scope="session")
def build_fmu(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """``build_fmu(name, **start_values)`` -> path of the FMU, each with other start values in a folder of its own.

    The name is that of a block, or of a composite without start values. Start values that the block has anyway make no
    other FMU.
    """
    made: dict[tuple[object, ...], Path] = {}

    def make(name: str, **start: float) -> Path:
        own = own_start_values(name) if start else {}
        changed = {key: value for key, value in start.items() if key not in own or float(own[key]) != value}
        key = (options(), name, *sorted(changed.items()))
        if key not in made:
            folder = tmp_path_factory.mktemp("fmus")
            made[key] = built(name, folder, changed)
        return made[key]

    return make
