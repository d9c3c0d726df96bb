"""Every FMU whose ports are all Real in CoFmuPy, alone and in a closed loop; it couples as gauss-seidel does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from install_cofmupy import PYTHON
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
from interop.loops import REAL_PARTS, Loop, all_loops, ports, start_value, variables

needs_cofmupy = pytest.mark.skipif(
    not PYTHON.exists(), reason="CoFmuPy is not installed: run tests/slow/importers/install_cofmupy.py"
)


@pytest.fixture(scope="session")
def real_fmus(build_fmu: Callable[..., Path], fmus: Mapping[str, Path]) -> Mapping[str, Path]:
    """Its setters and getters are those of Reals, whatever the variable."""
    return {
        name: fmu
        for name, fmu in fmus.items()
        if all(variables(fmu)[port].type == "Real" for port in ports(fmu, "input") + ports(fmu, "output"))
    }


def test_models_plants_and_signals_are_all_real(fmus: Mapping[str, Path], real_fmus: Mapping[str, Path]) -> None:
    """Laws and controllers have the Boolean ports enable, reset and fault."""
    others = set(fmus) - set(real_fmus)
    assert all("fault" in ports(fmus[name], "output") for name in others)


@needs_cofmupy
def test_every_real_fmu_simulates_its_default_experiment(real_fmus: Mapping[str, Path]) -> None:
    def job(name: str, fmu: Path) -> dict[str, Any]:
        inputs = {f"block.{port}": start_value(variables(fmu)[port]) for port in ports(fmu, "input")}
        return alone_job(name, fmu, method="gauss_seidel", start=inputs)  # else all inputs are 0

    jobs = {name: job(name, fmu) for name, fmu in real_fmus.items()}

    def judge(name: str, answer: Mapping[str, Any]) -> float:
        found = as_trajectories(jobs[name], answer["rows"])
        return deviation(found, default_experiment(real_fmus[name]), found)

    assert failures(jobs, in_worker("in_cofmupy", jobs.values(), str(PYTHON)), judge, 1e-8) == {}


@needs_cofmupy
def test_every_real_fmu_in_a_closed_loop_gives_the_trajectory_of_gauss_seidel(
    build_fmu: Callable[..., Path], real_fmus: Mapping[str, Path]
) -> None:
    loops = {name: loop.real() for name, loop in all_loops(build_fmu, real_fmus, REAL_PARTS).items()}

    def job(name: str, loop: Loop) -> dict[str, Any]:
        return loop_job(name, loop, method="gauss_seidel", start=loop.start | loop.first_inputs())

    jobs = {name: job(name, loop) for name, loop in loops.items()}

    def judge(name: str, answer: Mapping[str, Any]) -> float:
        found = as_trajectories(jobs[name], answer["rows"])
        expected = without_start(loops[name].own("gauss-seidel", answer["order"]))
        return deviation(found, expected, loops[name].states())

    assert failures(jobs, in_worker("in_cofmupy", jobs.values(), str(PYTHON)), judge, 1e-6) == {}
