"""No module imports itself by way of others, neither at its top nor inside a function; folders import downwards."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib.util import resolve_name
from pathlib import Path

ROOT = Path(__file__).parents[2]


@cache
def modules() -> dict[str, tuple[Path, list[ast.stmt]]]:
    """Names, files and statements of all modules."""
    found = {}
    for package in ("friction_fmus", "harness"):
        for file in (ROOT / package).rglob("*.py"):
            parts = file.relative_to(ROOT).with_suffix("").parts
            statements = ast.parse(file.read_text(encoding="utf-8")).body
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file, statements
    return found


def imports(nodes: list[ast.stmt], package: str, *, late: bool = True) -> Iterator[tuple[str, str]]:
    """Modules that are imported when this code runs, each with a name that is taken from it, or an empty one.

    Without `late`, only what is imported with the module counts, and not what its functions import when called.
    """
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from ((name.name, "") for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = resolve_name("." * node.level + (node.module or ""), package)
            yield from ((module, name.name) for name in node.names)
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            yield from imports(node.orelse, package, late=late)
        elif late or not isinstance(node, ast.FunctionDef | ast.ClassDef):
            inner = [part for part in ast.iter_child_nodes(node) if isinstance(part, ast.stmt | ast.excepthandler)]
            yield from imports(inner, package, late=late)  # type: ignore[arg-type]


def test_there_is_no_cycle() -> None:
    files = modules()
    graph: dict[str, set[str]] = {name: set() for name in files}
    for name, (file, statements) in files.items():
        package = name if file.stem == "__init__" else name.rpartition(".")[0]
        for module, taken in imports(statements, package):
            source = f"{module}.{taken}" if f"{module}.{taken}" in files else module
            while source and not f"{name}.".startswith(f"{source}."):  # the packages around it are imported, too
                if source in files:
                    graph[name].add(source)
                source = source.rpartition(".")[0]
    assert sum(map(len, graph.values())) > 500
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        raise AssertionError(" <- ".join(error.args[1])) from error


def folder(name: str) -> str:
    """The folder of a module; a module beside the folders of a package is its own."""
    return ".".join(name.split(".")[:2])


@cache
def folder_imports() -> dict[str, set[str]]:
    """What the modules of each folder import when they are imported, from other folders."""
    files = modules()
    graph: dict[str, set[str]] = {}
    for name, (file, statements) in files.items():
        package = name if file.stem == "__init__" else name.rpartition(".")[0]
        for module, taken in imports(statements, package, late=False):
            source = f"{module}.{taken}" if f"{module}.{taken}" in files else module
            if source in files and folder(source) != folder(name):
                graph.setdefault(folder(name), set()).add(folder(source))
    assert sum(map(len, graph.values())) > 100
    return graph


def test_folders_import_downwards() -> None:
    """Only functions that users call, such as `System.to_fmu`, import from folders above their own."""
    try:
        TopologicalSorter(folder_imports()).prepare()
    except CycleError as error:
        raise AssertionError(" <- ".join(error.args[1])) from error


def test_the_architecture_shows_the_layers() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    (drawing,) = re.findall(r"^friction_fmus +harness\n.*?(?=^```)", page, re.M | re.S)
    columns = {"friction_fmus": 0, "harness": drawing.index("harness")}
    lines = {
        f"{'harness' if found.start() >= columns['harness'] else 'friction_fmus'}.{found[1]}": number
        for number, line in enumerate(drawing.splitlines()[2:])
        for found in re.finditer(r"(\w+)(?:/|\.py)", line)
    }
    folders = {
        f"{package}.{path.parent.name}" for package in columns for path in (ROOT / package).glob("*/__init__.py")
    }
    assert folders | {"friction_fmus.laws"} == {name for name in lines if (ROOT / name.replace(".", "/")).is_dir()}
    for upper, below in folder_imports().items():
        for lower in below:
            if upper in lines and "." in lower:
                assert lower in lines, f"{upper} imports {lower}, which the drawing does not show"
                assert columns[lower.split(".")[0]] >= columns[upper.split(".")[0]], f"{upper} imports {lower}"
                across = lower.split(".")[0] != upper.split(".")[0]
                assert across or lines[lower] > lines[upper], f"{upper} imports {lower}, which is not below it"


NAMED = {
    "harness/compiling/toolchain.py": 4,  # the C files of FMUs, in a checkout and in a wheel; the folder of the cache
    "harness/extras.py": 3,  # what to install
    "harness/ssp/annotations.py": 1,  # annotations in files that users have
    "harness/ssp/package.py": 1,  # their name space
    "harness/system/system.py": 2,  # `System.to_fmu` imports the export when called
}
"""Lines of the harness with the name of the project."""


def test_the_harness_does_not_know_the_project() -> None:
    found = {}
    for file in (ROOT / "harness").rglob("*.[pchj]*"):
        if file.suffix in (".py", ".c", ".h", ".js"):
            lines = re.findall(r".*friction[-_]fmus.*", file.read_text(encoding="utf-8"), re.IGNORECASE)
            found |= {file.relative_to(ROOT).as_posix(): len(lines)} if lines else {}
    assert found == NAMED
