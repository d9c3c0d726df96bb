"""Every FMU in libcosim, alone and in a closed loop; its fixed-step algorithm is the master jacobi."""

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

pytest.importorskip("libcosimpy")


def test_every_fmu_simulates_its_default_experiment(fmus: Mapping[str, Path]) -> None:
    jobs = {name: alone_job(name, fmu) for name, fmu in fmus.items()}

    def judge(name: str, answer: Mapping[str, Any]) -> float:
        found = as_trajectories(jobs[name], answer["rows"])
        return deviation(found, default_experiment(fmus[name]), found)

    assert failures(jobs, in_worker("in_libcosim", jobs.values()), judge, 1e-8) == {}


def test_every_fmu_in_a_closed_loop_gives_the_trajectory_of_jacobi(loops: Mapping[str, Loop]) -> None:
    jobs = {name: loop_job(name, loop) for name, loop in loops.items()}

    def judge(name: str, answer: Mapping[str, Any]) -> float:
        found = as_trajectories(jobs[name], answer["rows"])
        return deviation(found, without_start(loops[name].jacobi), found)

    assert failures(jobs, in_worker("in_libcosim", jobs.values()), judge, 1e-8) == {}
