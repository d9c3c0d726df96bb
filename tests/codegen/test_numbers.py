"""The exported C, the FMU and casadi compute the same numbers."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from laws.draws import random_arguments
from shell.selection import EACH_FEATURE
from thorough import THOROUGH, some

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.law_runs import LawC, LawFmu, casadi_by_rows, rows_of, run_casadi
from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.codegen.emulation import samples
from friction_fmus.codegen.law_export import make_export
from friction_fmus.codegen.layout import STATES
from friction_fmus.lawkit.law import Kind, discover_laws

LAWS = [law.name for law in discover_laws(laws_folder())]
SAMPLES = 20_000 if THOROUGH else 3_000


def same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    return bool((np.ascontiguousarray(a).view(np.int64) == np.ascontiguousarray(b).view(np.int64)).all())


def same_numbers(a: np.ndarray, b: np.ndarray) -> bool:
    """All bits are equal but the signs of zeros: a + 0.0 makes 0.0 of -0.0 and changes no other bit.

    casadi's sum of both sides of a decision makes 0.0 of -0.0. The C does so only where it can change another number.
    """
    return same_bits(a + 0.0, b + 0.0)


def check_double(name: str, count: int, folder: Path) -> None:
    """Over a long run, each with its own states, the exported C has the FMU's bits and both have casadi's numbers."""
    export = make_export(name)
    given = samples(export, count, seed=2)
    rows = rows_of(export, given)
    expected = run_casadi(export.law, rows)
    assert np.isfinite(expected).all()
    assert np.ptp(expected[:, 0]) > 0.0
    found = LawC(export, folder / "c").run(rows, feeds_back=True)
    assert same_bits(LawFmu(export.law, folder).run(given)[0], found)
    assert same_numbers(found, expected)


@pytest.mark.parametrize("name", some(LAWS, EACH_FEATURE))
def test_double_has_casadis_numbers_for_any_parameters(name: str, tmp_path: Path) -> None:
    export = make_export(name)
    rows = random_arguments(export.law, SAMPLES, seed=5)
    expected, _ = casadi_by_rows(export.law, rows)
    assert same_numbers(LawC(export, tmp_path).run(rows, feeds_back=False), expected)


def check_float(name: str, count: int, folder: Path) -> None:
    """Every sample of a long run from states that float can hold: within 1e-5.

    Where a law decides, rounding may decide otherwise, or a difference of large numbers is lost: then the result must
    be one that the law has for arguments moved by the rounding of float.
    """
    export = make_export(name, real="float")
    law = export.law
    rows = rows_of(export, samples(export, count, seed=3)).astype(np.float32).astype(float)
    labels = [variable for variable in law.given for _ in variable.starts]
    states = [i for i, variable in enumerate(labels) if variable.kind in STATES]
    whole = run_casadi(law, rows)
    rows[1:, states] = whole[:-1, len(law.select(Kind.OUTPUT)) :].astype(np.float32)
    expected, _ = casadi_by_rows(law, rows)
    found = LawC(export, folder).run(rows, feeds_back=False)
    assert np.isfinite(found).all()

    allowed = 1e-5 * np.maximum(np.abs(expected), np.sqrt(np.mean(expected**2, axis=0)))
    (doubtful,) = np.nonzero((np.abs(found - expected) > allowed).any(axis=1))
    low, high = expected[doubtful].copy(), expected[doubtful].copy()
    random = np.random.default_rng(4)
    for _ in range(200 if len(doubtful) else 0):
        moved = rows[doubtful] * (1.0 + random.choice((-1.0, 0.0, 1.0), rows[doubtful].shape) * 2.0**-22)
        nearby, _ = casadi_by_rows(law, moved)
        low, high = np.minimum(low, nearby), np.maximum(high, nearby)
    assert (found[doubtful] >= low - allowed[doubtful]).all()
    assert (found[doubtful] <= high + allowed[doubtful]).all()
    assert len(doubtful) < 0.01 * count


@pytest.mark.parametrize("name", some(LAWS, EACH_FEATURE[1::2]))
def test_double_has_the_bits_of_the_fmu_and_of_casadi(name: str, tmp_path: Path) -> None:
    check_double(name, SAMPLES, tmp_path)


@pytest.mark.parametrize("name", some(LAWS, EACH_FEATURE[::2]))
def test_float_is_near_casadi(name: str, tmp_path: Path) -> None:
    check_float(name, SAMPLES, tmp_path)
