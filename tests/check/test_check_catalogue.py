"""Every FMU that the project builds: the schema, fmpy and `check`, which runs it, have nothing to say."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from fmpy.validation import validate_fmu
from shell.selection import SHELL_BLOCKS
from thorough import nightly, some

from friction_fmus import build, catalogue
from friction_fmus.check import check
from harness.units import parse_unit


@pytest.mark.parametrize("name", some(tuple(catalogue()), SHELL_BLOCKS[2:6:3]))
def test_nothing_is_found_in_a_block(build_fmu: Callable[..., Path], name: str) -> None:
    fmu = build_fmu(name)
    assert validate_fmu(str(fmu)) == []
    assert check(fmu) == []


@nightly
@pytest.mark.parametrize("name", some(["LuGre", "Mass", "GMS"], ["Mass"]))
def test_nothing_is_found_in_a_rotational_twin(tmp_path: Path, name: str) -> None:
    fmu = build(name, tmp_path, domain="rotational")
    assert validate_fmu(str(fmu)) == []
    assert check(fmu) == []


@nightly
def test_every_unit_is_understood_by_the_checker(build_fmu: Callable[..., Path]) -> None:
    """Otherwise its exponents would not be compared with its name."""
    import fmpy

    units = {
        unit.name for name in catalogue() for unit in fmpy.read_model_description(str(build_fmu(name))).unitDefinitions
    }
    assert {name for name in units if parse_unit(name) is None} == set()
