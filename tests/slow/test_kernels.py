"""Decisions that hang on linear algebra, with the kernels of OpenBLAS for three generations of processors."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from thorough import nightly
from threadpoolctl import threadpool_info

ROOT = Path(__file__).parents[2]
TESTS = (
    "tests/conditions/test_borders.py",
    "tests/conditions/test_conditions.py",
    "tests/conditions/test_chain.py",
    "tests/identification/test_ties.py",
    "tests/study/test_inverse_model.py",
    "tests/study/test_output_error.py",
)
# a kernel that the processor has no instructions for ends the process
NEEDS = {"Prescott": "pni", "Haswell": "avx2", "SkylakeX": "avx512dq"}
CPU = Path("/proc/cpuinfo")


def runnable() -> list[str]:
    """The kernels that this processor can run, if numpy has OpenBLAS at all."""
    if not CPU.is_file() or not any(found["internal_api"] == "openblas" for found in threadpool_info()):
        return []
    flags = next((line.split() for line in CPU.read_text().splitlines() if line.startswith("flags")), [])
    return [kernel for kernel, flag in NEEDS.items() if flag in flags]


def python(kernel: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A process with that kernel."""
    environment = os.environ | {"OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )


@nightly
@pytest.mark.skipif(not runnable(), reason="OpenBLAS on an x86-64 processor under Linux has kernels to choose from")
@pytest.mark.parametrize("kernel", NEEDS)
def test_decisions_are_the_same_with_every_kernel(kernel: str) -> None:
    if kernel not in runnable():
        pytest.skip(f"this processor has no instructions for the kernel {kernel}")
    run = python(kernel, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *TESTS)
    assert run.returncode == 0, run.stdout[-3000:]


@pytest.mark.skipif(not runnable(), reason="OpenBLAS on an x86-64 processor under Linux has kernels to choose from")
def test_the_kernels_are_not_one_and_the_same() -> None:
    text = "import numpy, threadpoolctl as t; print(*{i['architecture'] for i in t.threadpool_info()})"
    used = {python(kernel, "-c", text).stdout for kernel in runnable()}
    assert len(used) == len(runnable())
