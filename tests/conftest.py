"""What all tests share: FMUs built once."""

from __future__ import annotations

import os

# more threads than processors only wait for each other; numpy reads this when it is imported
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import pytest
from fmpy import read_model_description
from shell.selection import built
from thorough import THOROUGH, left_out

from friction_fmus import build, fmu

# the longest first, so that no worker waits for another one at the end; the wheel when the platforms are compiled
LONG = (
    *("test_documents.py", "test_demo_study.py", "test_composite_runs.py", "test_quality.py", "test_exchange_runs.py"),
    *("test_emps_study.py", "test_identify_command.py", "test_sweeps.py", "test_numbers.py", "test_emit.py"),
    *("test_platforms.py", "test_built_site.py", "test_native_checks.py", "test_target.py", "test_code_of_laws.py"),
    *("test_composite_platforms.py", "test_fmu_toolbox.py", "test_report_in_a_browser.py", "test_examples.py"),
    *("test_recommended_files.py", "test_random_calls.py", "test_mutants.py", "test_source_code.py", "test_misra.py"),
    *("test_exchange_motions.py", "test_performance.py", "test_kernels.py", "test_wheel.py", "test_intervals.py"),
)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """The order of `LONG`, then all others; a worker takes a file at a time. What is for the night is left out."""
    if not THOROUGH and (out := left_out(items)):
        config.hook.pytest_deselected(items=[*out])
        items[:] = [item for item in items if item not in out]
    items.sort(key=lambda item: LONG.index(item.path.name) if item.path.name in LONG else len(LONG))


@cache
def own_start_values(name: str) -> Mapping[str, str]:
    """Start values of a block as its FMU states them."""
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
        key = (name, *sorted(changed.items()))
        if key not in made:
            folder = tmp_path_factory.mktemp("fmus")
            made[key] = build(name, folder, changed) if changed else built(name, folder)
        return made[key]

    return make
