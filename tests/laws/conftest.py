"""Compiles what the emitter writes and runs it through ctypes."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable, Sequence
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from casadi import Function

from friction_fmus.blocks.catalogue import source_folder
from friction_fmus.lawkit.emit.c_text import DOUBLE, Kernel, Real, kernel
from harness.compiling.toolchain import compiler, header_folder

FLAGS = (
    *("-std=c99", "-O2", "-fno-math-errno", "-ffp-contract=off", "-fPIC", "-fvisibility=hidden", "-shared"),
    *("-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror", "-DFMI2_OVERRIDE_FUNCTION_PREFIX"),
)
GCC = ("gcc",)

Evaluate = Callable[[np.ndarray], np.ndarray]


class Workshop:
    """One compiler and a folder to work in."""

    def __init__(self, compiler: Sequence[str], folder: Path) -> None:
        self._compiler = compiler
        self._folder = folder
        self._numbers = count()
        self._made: dict[tuple[str, ...], Path] = {}

    def library(self, text: str, *flags: str) -> Path:
        """The library of a source; the same one for the same text and flags."""
        if (text, *flags) not in self._made:
            self._made[text, *flags] = self._compiled(text, *flags)
        return self._made[text, *flags]

    def _compiled(self, text: str, *flags: str) -> Path:
        source = self._folder / f"source{next(self._numbers)}.c"
        source.write_text(text, encoding="utf-8")
        target = source.with_suffix(".so")
        folders = [f"-I{folder}" for folder in (source_folder(), source_folder() / "numerics", header_folder())]
        command = [*self._compiler, *FLAGS, *flags, *folders, str(source), "-o", str(target), "-lm"]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        assert run.returncode == 0, run.stderr
        return target

    def evaluator(self, function: Function, real: Real = DOUBLE, *flags: str, in_place: bool = False) -> Evaluate:
        """Rows of arguments -> rows of results, by compiled C, in which results may overwrite arguments."""
        n, m = function.n_in(), function.n_out()
        reads, writes = [f"given[{i}]" for i in range(n)], [f"result[{i}]" for i in range(m)]
        if in_place:
            reads = [f"result[{m - 1 - i}]" for i in range(n)]
        written = kernel(function, reads, writes, real=real)
        text = "\n".join(
            [
                "#include <math.h>",
                "#include <stdbool.h>",
                "#include <stdint.h>",
                f"void sample(const {real.name} *given, {real.name} *result);",
                f"void sample(const {real.name} *given, {real.name} *result)",
                "{",
                *([f"    {place} = given[{i}];" for i, place in enumerate(reads)] if in_place else []),
                *written.lines,
                "}",
                '__attribute__((visibility("default")))',
                f"void run(int n, const {real.name} *given, {real.name} *result);",
                f"void run(int n, const {real.name} *given, {real.name} *result)",
                "{",
                f"for (int i = 0; i < n; i++) sample(given + {n} * i, result + {m} * i);",
                "}",
                "",
            ]
        )
        run = ctypes.CDLL(str(self.library(text, *flags))).run
        kind = np.float64 if real is DOUBLE else np.float32
        pointer = np.ctypeslib.ndpointer(kind, 2, flags="C_CONTIGUOUS")
        run.argtypes = (ctypes.c_int, pointer, pointer)
        run.restype = None

        def evaluate(rows: np.ndarray) -> np.ndarray:
            results = np.full((len(rows), m), np.nan, kind)
            run(len(rows), np.ascontiguousarray(rows, kind), results)
            return results

        return evaluate

    def in_struct(self, found: Kernel, members: str, reads: Sequence[str], writes: Sequence[str]) -> Evaluate:
        """Rows of arguments -> rows of results, by statements on a struct `v` of arguments and results."""
        n, m = len(reads), len(writes)
        text = "\n".join(
            [
                "#include <math.h>",
                "#include <stdbool.h>",
                "#include <stdint.h>",
                f"typedef struct {{ {members} }} Values;",
                "static void sample(Values *v)",
                "{",
                *found.lines,
                "}",
                '__attribute__((visibility("default")))',
                "void run(int n, const double *given, double *result);",
                "void run(int n, const double *given, double *result)",
                "{",
                "Values w, *v = &w;",
                "for (int k = 0; k < n; k++) {",
                *(f"{place} = given[{n} * k + {i}];" for i, place in enumerate(reads)),
                "sample(v);",
                *(f"result[{m} * k + {i}] = v->{place};" for i, place in enumerate(writes)),
                "}",
                "}",
                "",
            ]
        )
        run = ctypes.CDLL(str(self.library(text))).run
        pointer = np.ctypeslib.ndpointer(np.float64, 2, flags="C_CONTIGUOUS")
        run.argtypes = (ctypes.c_int, pointer, pointer)
        run.restype = None

        def evaluate(rows: np.ndarray) -> np.ndarray:
            results = np.full((len(rows), m), np.nan)
            run(len(rows), np.ascontiguousarray(rows), results)
            return results

        return evaluate


@pytest.fixture(scope="session")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Workshop:
    return Workshop(compiler(), tmp_path_factory.mktemp("zig"))


def by_casadi(function: Function, rows: np.ndarray) -> np.ndarray:
    """Rows of arguments -> rows of results, by casadi."""
    buffer, evaluate = function.buffer()
    given = np.zeros(function.n_in())
    result = np.zeros(function.n_out())
    for i in range(function.n_in()):
        buffer.set_arg(i, memoryview(given[i : i + 1]))
    for i in range(function.n_out()):
        buffer.set_res(i, memoryview(result[i : i + 1]))
    results = np.empty((len(rows), function.n_out()))
    for row, target in zip(rows, results, strict=True):
        given[:] = row
        evaluate()
        target[:] = result
    return results


@pytest.fixture(scope="session", name="by_casadi")
def by_casadi_fixture() -> Callable[[Function, np.ndarray], np.ndarray]:
    return by_casadi


def different_bits(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Where two arrays differ in any bit, every NaN being equal, and -0.0 equal to 0.0.

    casadi's sum of both sides of a decision makes 0.0 of -0.0; generated C need not, unless a division or another
    operation would make another number of it, see `signed_zeros`. `a + 0.0` makes 0.0 of -0.0 and changes no other bit.
    """
    return ((a + 0.0).view(np.int64) != (b + 0.0).view(np.int64)) & ~(np.isnan(a) & np.isnan(b))


@pytest.fixture(scope="session", name="different_bits")
def different_bits_fixture() -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    return different_bits
