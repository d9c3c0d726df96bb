"""Composite FMUs that several tests use."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from shell.instance import Library, load

from friction_fmus import fmu
from harness import Experiment, FmuPart, System


@pytest.fixture(scope="session")
def compose(build_fmu: Callable[..., Path]) -> Callable[[str], Path]:
    """``compose(name)`` -> the composite FMU of ``examples/NAME.toml``."""
    return build_fmu


@pytest.fixture
def smooth(tmp_path: Path) -> Iterator[tuple[System, Library]]:
    """A mass on a spring with viscous friction under a constant force, at a step of 20 us, and its composite FMU."""
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu("Viscous"))]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
    start = {"mass.F_drive": 0.2, "mass.k": 2.0}
    with System(parts, wires, start, Experiment(stop=0.1, step=2e-5)) as system:
        system.to_fmu(tmp_path / "smooth.fmu")
        yield system, load(tmp_path / "smooth.fmu")
