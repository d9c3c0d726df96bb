"""Every FMU in ecos, alone and in a closed loop; it couples as the master jacobi does.

It reads outputs when it is asked, after the inputs have changed: what feeds through is newer there than in the
trajectories of the harness, so that the other outputs, the states, are compared. All outputs act on them.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from interop.importers import (
    alone_job,
    as_trajectories,
    default_experiment,
    deviation,
    failures,
    in_worker,
    loop_job,
    without_start,
)
from interop.loops import Loop

try:
    import ecospy  # noqa: F401
except (ImportError, OSError) as error:  # its library needs Debian's libtbb12
    pytest.skip(f"ecospy cannot be loaded: {error}", allow_module_level=True)


def test_every_fmu_simulates_its_default_experiment(fmus: Mapping[str, Path]) -> None:
    jobs = {name: alone_job(name, fmu) for name, fmu in fmus.items()}

    def judge(name: str, answer: Mapping[str, Any]) -> float:
        found = as_trajectories(jobs[name], answer["rows"])
        return deviation(found, default_experiment(fmus[name]), found)

    assert failures(jobs, in_worker("in_ecos", jobs.values()), judge, 1e-8) == {}


def test_every_fmu_in_a_closed_loop_gives_the_trajectory_of_jacobi(loops: Mapping[str, Loop]) -> None:
    jobs = {name: loop_job(name, loop) for name, loop in loops.items()}

    def judge(name: str, answer: Mapping[str, Any]) -> float:
        found = as_trajectories(jobs[name], answer["rows"])
        return deviation(found, without_start(loops[name].jacobi), loops[name].states())

    assert failures(jobs, in_worker("in_ecos", jobs.values()), judge, 1e-8) == {}
