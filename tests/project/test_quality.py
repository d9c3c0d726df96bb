"""The linters, so that one command tests everything."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
C_FILES = sorted(
    str(path.relative_to(ROOT))
    for folder in ("fmu_src", "harness/engine", "benchmarks")
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


def test_no_file_is_longer_than_its_idea() -> None:
    paths = [
        *(ROOT / "fmu_src").rglob("*.[ch]"),
        *(ROOT / "friction_fmus").rglob("*.py"),
        *(ROOT / "harness").rglob("*.py"),
    ]
    long = {path.name: len(path.read_text(encoding="utf-8").splitlines()) for path in paths}
    assert {name: lines for name, lines in long.items() if lines > 400} == {}
