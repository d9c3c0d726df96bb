"""Rules that no linter knows; `lint.sh` runs the linters."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from thorough import landing, nightly

ROOT = Path(__file__).parents[2]


def own_statements(function: ast.FunctionDef) -> Iterator[ast.AST]:
    """What stands in a function, but not in functions within it."""
    waiting: list[ast.AST] = [*function.body]
    while waiting:
        node = waiting.pop()
        yield node
        if not isinstance(node, (ast.FunctionDef, ast.Lambda, ast.ClassDef)):
            waiting += ast.iter_child_nodes(node)


@landing
def test_no_test_returns_early_and_counts_as_passed() -> None:
    """Give a test only the cases that it is for, by its parameters."""
    found = []
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                returns = [each.lineno for each in own_statements(node) if isinstance(each, ast.Return)]
                found += [f"{path.name}:{line} in {node.name}" for line in returns]
    assert found == []


@nightly
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
