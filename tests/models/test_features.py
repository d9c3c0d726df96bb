"""What the table of docs/models.md says of a model is what the model does."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from shell.instance import Instance, load

from friction_fmus.blocks.catalogue import Block, catalogue

CONTACTS = [b for b in catalogue().values() if b.kind == "friction" and "mass inside" not in b.features]
LEGS = (2.1e-5, -3.17e-5, 1.23e-5, -0.53e-5, 2.07e-4)
"""[m] a path with inner loops, from presliding into sliding"""


@pytest.mark.parametrize("block", [b for b in catalogue().values() if b.kind == "friction"], ids=lambda b: b.name)
def test_says_where_its_equations_were_taken_from(block: Block) -> None:
    assert re.match("equations? |(not )?checked against |in the form of ", block.status)
    assert "from memory" not in block.notes


def forces_along_the_path(fmu: Path, speed: float) -> np.ndarray:
    """F [N] at ten places on each leg, which is gone at a constant speed [m/s]."""
    found = []
    with Instance(load(fmu)) as run:
        run.initialise()
        t = 0.0
        for leg in LEGS:
            run.set({"v": np.sign(leg) * speed})
            h = abs(leg) / speed / 10.0
            for _ in range(10):
                run.step(t, h)
                t += h
                found.append(run.get1("F"))
    return np.array(found)


@pytest.mark.parametrize("block", CONTACTS, ids=lambda block: block.name)
def test_rate_dependent_says_whether_the_speed_on_a_path_matters(block: Block, build_fmu: Callable[..., Path]) -> None:
    fmu = build_fmu(block.name)
    slow, fast = forces_along_the_path(fmu, 2e-3), forces_along_the_path(fmu, 6e-3)
    difference = np.abs(fast - slow).max() / np.abs(slow).max()
    assert difference > 1e-3 if "rate dependent" in block.features else difference < 1e-9
