"""The linters, so that one command tests everything."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from thorough import ONE_IN

ROOT = Path(__file__).parents[2]
C_FILES = sorted(
    str(path.relative_to(ROOT))
    for folder in ("fmu_src", "harness/engine", "harness/masters", "benchmarks")
    for path in (ROOT / folder).rglob("*.[ch]")
)


@pytest.mark.parametrize(
    "command",
    [
        ["ruff", "check", "."],
        ["ruff", "format", "--check", "."],
        ["mypy"],
        ["clang-format", "--dry-run", "--Werror", *C_FILES],
    ],
    ids=lambda command: " ".join(command[:2]),
)
def test_linter_finds_nothing(command: list[str]) -> None:
    result = subprocess.run(
        [str(Path(sys.executable).parent / command[0]), *command[1:]],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr


def own_statements(function: ast.FunctionDef) -> Iterator[ast.AST]:
    """What stands in a function, but not in functions within it."""
    waiting: list[ast.AST] = [*function.body]
    while waiting:
        node = waiting.pop()
        yield node
        if not isinstance(node, (ast.FunctionDef, ast.Lambda, ast.ClassDef)):
            waiting += ast.iter_child_nodes(node)


def test_no_test_returns_early_and_counts_as_passed() -> None:
    """Give a test only the cases that it is for, by its parameters."""
    found = []
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                returns = [each.lineno for each in own_statements(node) if isinstance(each, ast.Return)]
                found += [f"{path.name}:{line} in {node.name}" for line in returns]
    assert found == []


def test_mypy_knows_the_lazy_names(tmp_path: Path) -> None:
    program = (
        "from friction_fmus import build, harness\n"
        "from friction_fmus.harness import System\n"
        "import friction_fmus.harness\n"
        "a: int = System\n"
        "b: int = harness.Experiment\n"
        "c: int = build\n"
        "friction_fmus.harness.Sistem\n"
        "friction_fmus.bild\n"
    )
    (tmp_path / "program.py").write_text(program, encoding="utf-8")
    command = [str(Path(sys.executable).parent / "mypy"), str(tmp_path / "program.py")]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    errors = [line.partition("error: ")[2] for line in run.stdout.splitlines()[:-1]]
    assert len(errors) == 5, run.stdout
    for error, text in zip(errors, ("System", "Experiment", "out_dir", "Sistem", "bild"), strict=True):
        assert text in error


def test_tests_with_a_selection_of_repetitions_exist() -> None:
    for name in ONE_IN:
        file, _, test = name.partition("::")
        assert re.search(rf"\b{test}\b", (ROOT / "tests" / file).read_text(encoding="utf-8")), name
