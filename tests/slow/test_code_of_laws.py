"""C of all laws: by gcc as well, as C99 and C17, over long runs, and with the longest preview."""

from __future__ import annotations

import re
import shutil
import subprocess
from itertools import product
from pathlib import Path

import pytest
from codegen.test_export import COMPILERS, LAWS, compiled, without_target  # noqa: F401
from codegen.test_numbers import check_double, check_float
from codegen.test_unit_test import check_passes
from laws.conftest import GCC, Workshop, by_casadi_fixture, different_bits_fixture  # noqa: F401
from laws.test_emit import (  # noqa: F401
    test_every_law_has_casadis_bits,
    test_every_law_is_clean_c_in_float,
    test_every_law_keeps_casadis_bits_over_a_long_run,
    test_every_operation_has_casadis_bits,
    test_float_code_uses_float_only,
    test_random_decisions_have_casadis_bits,
)
from laws.test_law_blocks import test_the_blocks_sample_is_casadis, test_the_table_says_what_the_law_says  # noqa: F401
from laws.test_preview import check_long_preview
from shell.selection import EACH_FEATURE
from thorough import nightly, some

from friction_fmus.codegen import export_law


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Workshop:
    """The tests of tests/laws run here with gcc."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    return Workshop(GCC, tmp_path_factory.mktemp("gcc"))


@nightly
def test_the_longest_preview_is_the_inverse_filter(tmp_path: Path) -> None:
    check_long_preview(1024, tmp_path)


@pytest.mark.parametrize("name", some(LAWS, EACH_FEATURE[:1]))
def test_c99_and_c17_without_a_warning_and_the_example_runs(name: str, tmp_path: Path) -> None:
    for real in ("double", "float"):
        export_law(name, tmp_path, real=real)
        extra = ["-Wdouble-promotion"] if real == "float" else []
        outputs = set()
        pairs = [*product(COMPILERS, ("c99", "c17"))]
        for compiler, standard in some(pairs, [*zip(COMPILERS, ("c99", "c17"), strict=False)]):
            program = compiled(tmp_path, compiler, f"-std={standard}", *extra)
            outputs.add(subprocess.run([program], capture_output=True, text=True, check=True).stdout)
        assert len(outputs) == 1
        lines = outputs.pop().splitlines()
        assert len(lines) == 10
        assert "nan" not in "".join(lines)
        text = (tmp_path / "law.c").read_text(encoding="utf-8")
        assert not re.search(r"\b(malloc|calloc|free)\b|\bstatic (?!void )", text)
        if real == "float":
            assert not re.search(r"\bdouble\b|\b\d+\.\d+(e[-+]?\d+)?(?![\d.ef])", text)


@pytest.mark.parametrize("name", some(LAWS, EACH_FEATURE[2:3]))
def test_the_unit_test_passes(name: str, tmp_path: Path) -> None:
    check_passes(name, tmp_path, "-std=c17")


@pytest.mark.parametrize("name", some(LAWS, EACH_FEATURE[:1]))
def test_double_has_the_bits_of_the_fmu_and_of_casadi_over_a_long_run(name: str, tmp_path: Path) -> None:
    check_double(name, 100_000, tmp_path)


@pytest.mark.parametrize("name", some(LAWS, EACH_FEATURE[:1]))
def test_float_is_near_casadi_over_a_long_run(name: str, tmp_path: Path) -> None:
    check_float(name, 100_000, tmp_path)
