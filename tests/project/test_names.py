"""A name of a file or of a class means one thing."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[2]
FILES = sorted(path for package in ("friction_fmus", "harness") for path in (ROOT / package).rglob("*.*"))

FILE_NAMES = {
    "errors.py": "the exceptions of each package",
    "fmi2.py": "an FMI 2.0 FMU as a part, and as an export target, which has this name in commands",
    "output_error.py": "the method of identification of this name, and the fit that it calls",
    "run.py": "the command of this name, and what it calls",
    "study.py": "the command of this name, and what it calls",
}
"""File names that occur more than once, with the reason."""

CLASS_NAMES: dict[str, str] = {}
"""Names of classes that occur more than once, with the reason."""


def repeated(places: Iterable[tuple[str, Path]]) -> dict[str, list[str]]:
    """Return the names that stand in more than one place."""
    found: dict[str, list[str]] = {}
    for name, path in places:
        found.setdefault(name, []).append(path.relative_to(ROOT).as_posix())
    return {name: paths for name, paths in found.items() if len(paths) > 1}


def test_no_file_name_means_two_things() -> None:
    names = ((path.name, path) for path in FILES if path.suffix in (".py", ".h", ".c", ".js", ".css", ".html"))
    found = repeated((name, path) for name, path in names if name != "__init__.py")
    assert found.keys() == FILE_NAMES.keys(), found


def test_no_class_name_means_two_things() -> None:
    sources = [path for path in FILES if path.suffix == ".py"]
    statements = ((path, node) for path in sources for node in ast.parse(path.read_text(encoding="utf-8")).body)
    found = repeated((node.name, path) for path, node in statements if isinstance(node, ast.ClassDef))
    assert found.keys() == CLASS_NAMES.keys(), found
